"""Videos beside bags: how fast they are read, what their sound tells, how far off their starts may be, and whether the
labels are those of bags.

usage: python -m benchmarks.videos [speed | sound | flash | clocks | beyond | labels | real] [N] [FILE.jsonl]

All but real if none is named. N: of captures, 4. FILE.jsonl keeps the results of `clocks`: captures that are in it are
not made again.


speed   pictures of 1280 x 720 read in order beside PyAV alone, and 12 of them anywhere
sound   two microphones in one scene of steps: how often the lag is told, how far off it is; and of two scenes
flash   two cameras that see flashes, among people, lamps and flicker: the same
clocks  captures of benchmarks/steps.py whose cameras began up to 1.7 s early or late, the start known to 1 s (1 sigma),
        and the same pictures with exact stamps
beyond  the same with one camera that began further off than was said: clocks that are right, unknown or wrong
labels  the workflow on small captures from bags and from their videos (constant and variable rate; PTS alone, with one
        that began 1.7 s late, stamps in a file; one camera turned, one in Matroska, all with sound): labels, picture by
        picture
real    the same of ../shared/data/real_outdoor: figures of the unseen camera
"""

import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter
from itertools import product
from pathlib import Path

import numpy as np

from benchmarks import steps
from dior.clocks.axis import start_ns
from dior.errors import DiorError
from dior.ingest import bags, frames, video_audio, video_flash
from dior.ingest.video_audio import Heard
from dior.ingest.video_frames import Recorded
from dior.simulate import settings as levels
from dior.tables import tables
from tests.ingest import test_video_audio, test_video_flash, videofiles

ROOT = Path(__file__).resolve().parents[1]
COUNT, SIZE = 300, (720, 1280)
# as much, evenly spread, is a standard deviation of a second
APART_S, START_SIGMA_S = 1.7, 1.0
STARTS = {
    "second": (f"starts known to {START_SIGMA_S:g} s (1 sigma)", START_SIGMA_S, None),
    "exact": ("the same pictures with exact stamps, as a check: what is left is no fault of the starts", 0.0, {}),
}
# how well the starts are said to be known (1 sigma; 0: as of bags, whose clocks are searched up to 2 s) and how far off
# one is, s
BEYOND = ((0.0, 2.3), (0.0, -3.0), (0.0, 4.9), (1.0, 4.9), (1.0, -4.9))
WITHIN_MS = 5.0  # what the project asks for
SMALL = {"subjects": 1, "sequences": 1, "duration_s": 4}
FAR_S = 0.05
LATE = {"outdoor_01": {"cam02": 1.7}}
GONE = {sequence: {camera: round(30 * s) for camera, s in late.items()} for sequence, late in LATE.items()}
# rate of the pictures, errors of the stamps that make it so, and by what the videos of each are told: in words, what of
# their beginnings is left out, in s and pictures, and whether they have files with stamps
LABELLED = (
    ("constant", {}, (
        ("PTS alone", None, None, False), ("PTS alone, cam02 1.7 s late outdoors", LATE, GONE, False),
        ("sidecar", None, None, True),
    )),
    ("variable", {"jitter_ms": 2.0, "dropped": 0.05}, (
        ("PTS alone", None, None, False), ("sidecar", None, None, True),
    )),
)  # fmt: skip


def speed():
    """Print what reading takes."""
    import av

    noise = np.random.default_rng(0).integers(0, 255, (*SIZE, 3), np.uint8)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        path = folder / "film.mp4"
        videofiles.write(path, [np.roll(noise, 5 * i, axis=1) for i in range(COUNT)], key_every=60)

        def alone():
            with av.open(str(path)) as container:
                container.streams.video[0].thread_type = "AUTO"
                return sum(frame.to_ndarray(format="bgr24")[0, 0, 0] >= 0 for frame in container.decode(video=0))

        def index():
            frames.run(
                sequence="w", bags=[], data_root=folder, topics={"cam01": "video0"}, out=folder / "f.parquet",
                recorded=Recorded({"cam01": path}),
            )  # fmt: skip

        index()
        table = tables.read(folder / "f.parquet", "frames")
        some = tables.rows(table, np.sort(np.random.default_rng(1).choice(COUNT, 12, replace=False)))
        ways = {
            "PyAV alone, in order": alone,
            "read_pictures, in order": lambda: sum(1 for _ in bags.read_pictures(table, folder)),
            "index": index,
            "read_pictures, 12 anywhere": lambda: sum(1 for _ in bags.read_pictures(some, folder)),
        }
        taken = {what: min(_seconds(how) for _ in range(5)) for what, how in ways.items()}
    print(f"{COUNT} pictures of {SIZE[1]} x {SIZE[0]}, H.264, a key frame every 60; best of 5")
    for what, seconds in taken.items():
        print(f"  {what:<30}{seconds:>8.2f} s{1e3 * seconds / COUNT:>9.2f} ms per picture of the file")
    first, second = list(taken.values())[:2]
    print(f"  in order, beside PyAV alone: {second / first:.2f} [at most 1.30]")


def _seconds(how):
    began = time.perf_counter()
    how()
    return time.perf_counter() - began


def sound(count):
    """Print how often, and how well, a lag is told."""
    print(f"lags by sound, {count} scenes each; of two other scenes none may be told")
    print(f"  {'seconds':>8}{'noise':>7}{'told':>7}{'worst, ms':>11}{'of two scenes':>15}")
    for seconds in (6, 12, 40):
        for noise in (0.3, 1.0):
            told, others = [], 0
            for seed in range(count):
                scene, late_s = test_video_audio.steps(seed, seconds + 6), 3 * np.random.default_rng(seed).random()
                one, other, foreign = (
                    Heard(video_audio.onsets(test_video_audio.recorded(heard, start, seconds, way, noise=noise)), 0.0)
                    for heard, start, way in (
                        (scene, 1.0, 2 * seed), (scene, 1.0 + late_s, 2 * seed + 1),
                        (test_video_audio.steps(1000 + seed, seconds + 6), 1.0, 2 * seed + 1),
                    )
                )  # fmt: skip
                found = video_audio.lag(one, other, 0.0, 15.0)
                told += [] if found is None else [abs(found - late_s)]
                others += video_audio.lag(one, foreign, 0.0, 15.0) is not None
            worst = f"{1e3 * max(told):.1f}" if told else "-"
            print(f"  {seconds:>8}{noise:>7}{len(told) / count:>7.0%}{worst:>11}{others:>15}")


def flash(count):
    """Print how often, and how well, a lag is told by flashes, among what else changes the light."""
    curve, changed = test_video_flash.curve, test_video_flash.changed
    print(f"lags by flashes, {count} scenes each, 30 Hz; one of each of two scenes counts as the same")
    print(f"  {'beside':<16}{'flashes':>8}{'told':>7}{'worst, ms':>11}{'with none':>11}{'of two scenes':>15}")
    for beside in ({}, {"person": 30}, {"exposure": 60}, {"lamp": 50}, {"flicker": 5}):
        for flashes in (1, 3):
            told, none, others = [], 0, 0
            for seed in range(count):
                draw = np.random.default_rng(seed)
                at_s, late_s = np.sort(draw.uniform(3, 7, flashes)), draw.uniform(-2, 2)
                one, other, foreign, dark = (
                    video_flash.flashes(changed(light, **beside), pts_ns)
                    for light, pts_ns in (
                        curve(at_s, seed=seed), curve(at_s - late_s, seed=count + seed, phase_s=draw.uniform(0, 0.033)),
                        curve(draw.uniform(3, 7, flashes), seed=count + seed), curve(seed=count + seed),
                    )
                )  # fmt: skip
                none += dark is not None
                found = video_flash.lag(one, other, 0.0, 3.0) if one and other else None
                told += [] if found is None else [abs(found - late_s)]
                others += bool(one and foreign) and video_flash.lag(one, foreign, 0.0, 3.0) is not None
            worst = f"{1e3 * max(told):.0f}" if told else "-"
            named = "".join(beside) or "nothing"
            print(f"  {named:<16}{flashes:>8}{len(told) / count:>7.0%}{worst:>11}{none:>11}{others:>15}")


def clocks(count, kept=None):
    """Print the errors of clocks whose starts are known to a second, and of the same pictures with exact stamps.

    `kept`: file to which the results of each capture are added; captures that it has are not made again.
    """
    rows = [json.loads(line) for line in kept.read_text().splitlines()] if kept and kept.is_file() else []
    there = {(row["preset"], row["seed"], row["starts"]) for row in rows}
    for seed in range(count):
        for preset, starts in product(("ideal", "real"), STARTS):
            if (preset, seed, starts) not in there:
                rows += [
                    {"preset": preset, "seed": seed, "starts": starts, **row}
                    for row in clocks_of(*STARTS[starts][1:], preset=preset, seed=seed)
                ]
                if kept:
                    kept.write_text("".join(json.dumps(row) + "\n" for row in rows))
    for starts, (what, *_) in STARTS.items():
        print(f"clocks of cameras {APART_S:g} s early or late at most, {count} captures of a preset; {what}")
        for preset, role in product(("ideal", "real"), ("close", "long_range")):
            _print_clocks(
                f"{preset}, {role}",
                [
                    row
                    for row in rows
                    if (row["preset"], row["role"], row["starts"]) == (preset, role, starts) and row["seed"] < count
                ],
            )


def _print_clocks(what, rows):
    """Print how far off clocks are, and name those that are far off."""
    told = [row for row in rows if row["told"]]
    off, held = np.abs([row["off_ms"] for row in told]), [row["held"] for row in told]
    print(
        f"  {what:<18}{len(told):>4} told, {len(rows) - len(told)} not; median {np.median(off):.2f} ms, worst "
        f"{off.max():.2f} ms; {np.mean(off <= WITHIN_MS):.0%} within {WITHIN_MS:g} ms; {np.mean(held):.0%} in their "
        "95 % intervals"
    )
    for row in told:
        if abs(row["off_ms"]) > 1e3 * FAR_S:
            print(f"    seed {row['seed']}: {row['camera']} {row['off_ms']:+.0f} ms")


def clocks_of(start_sigma_s, offsets_s, **settings):
    """Yield what is found of each clock of an outdoor capture; arguments as of `steps.labelled`."""
    with tempfile.TemporaryDirectory() as folder:
        capture = steps.labelled(
            folder, subjects=1, sequences=1, environments=["outdoor"], clocks={"apart_s": APART_S},
            start_sigma_s=start_sigma_s, offsets_s=offsets_s, **settings,
        )  # fmt: skip
        for walk in levels.sequences(capture.settings):
            pictures = tables.read(capture.made("frames", walk.name), "frames")
            # the clocks of the scene count from the first stamp, and so do those that are found
            t0_s = (start_ns(pictures) - min(v.clock.stamp_ns[0] for v in capture.views[walk.name].values())) / 1e9
            for name, seen in capture.views[walk.name].items():
                path = capture.made("follow", f"{walk.name}.{name}")
                path = path if path.is_file() else capture.made("clocks", walk.name)
                row = tables.rows(tables.of_camera(tables.read(path, "offsets"), name), slice(0, 1))
                row = {key: values[0] for key, values in row.items()}
                if row["source"] == "reference":
                    continue
                clock = seen.clock
                offset_s = clock.offset_s if offsets_s is None else offsets_s.get(name, 0.0)
                # a drift counts from the clock's own t0
                at_s = row["middle_s"] + t0_s + offset_s - clock.offset_s
                true = offset_s + 1e-6 * clock.drift_ppm * at_s
                yield {
                    "camera": name, "role": seen.camera.role, "told": row["source"] == "estimated",
                    "off_ms": 1e3 * float(row["late_s"] - true), "sigma_ms": 1e3 * float(row["late_sigma_s"]),
                    "held": bool(row["late_low"] <= true <= row["late_high"]),
                }  # fmt: skip


def beyond(count):
    """Print what becomes of a camera that began further off than was said: what must not be is a wrong clock."""
    print(f"a camera that began further off than was said, {count} captures of a preset")
    for preset, camera in product(("ideal", "real"), ("cam02", "cam04")):
        for start_sigma_s, late_s in BEYOND:
            outcomes, said = Counter(), []
            for seed in range(count):
                try:
                    rows = list(clocks_of(start_sigma_s, {camera: late_s}, preset=preset, seed=seed))
                except DiorError as error:
                    outcomes["refused"] += 1
                    said.append(f"seed {seed}: {str(error).partition('. ')[0]}")
                    continue
                wrong = [row for row in rows if row["told"] and abs(row["off_ms"]) > 1e3 * FAR_S]
                own = next(row for row in rows if row["camera"] == camera)
                outcomes["wrong" if wrong else "right" if own["told"] else "unknown"] += 1
                said += [f"seed {seed}: {row['camera']} {row['off_ms']:+.0f} ms" for row in wrong]
            found = ", ".join(f"{number} {what}" for what, number in sorted(outcomes.items()))
            print(f"  {preset}, {camera} {late_s:+.1f} s, said good to {start_sigma_s:g} s: {found}")
            print("".join(f"    {text}\n" for text in said), end="", flush=True)


def on_videos(source, target, data_root, late=None, sound_of=None, turned=(), matroska=(), sidecars=False):
    """A project `target` like `source`, whose recordings are in `data_root`, on videos of its pictures.

    `late`: by sequence and camera, s of the beginning that are left out; `sound_of` as of `videofiles.from_bags`;
    `turned`, `matroska`: cameras whose videos are to be turned, and of that container under the same name.
    """
    shutil.copytree(source / "config", target / "config")
    data, config = target / "data", target / "config/config.yaml"
    data.mkdir()
    # the section `simulate:` and what is indented below it
    text = re.sub(r"(?m)^simulate:\n(?:[ #].*\n|\n)*", "", config.read_text())
    config.write_text(re.sub(r"(?m)^data_root: .*$", "data_root: data", text))
    header, *rows = [line.split("\t") for line in (target / "config/sequences.tsv").read_text().splitlines()]
    lines = ["\t".join([*header, "videos", "stamps"])]
    for cells in rows:
        row = dict(zip(header, cells, strict=True))
        name, there = row["sequence"], [data_root / bag for bag in row["bags"].split(";")]
        gone = videofiles.from_bags(there, data / name, late_s=(late or {}).get(name), sound_of=sound_of,
                                    turned=turned, matroska=matroska)  # fmt: skip
        (data / name / "lenses.toml").write_text(videofiles.lens_toml(there))
        for camera, (_, count) in gone.items():
            _without_first(data_root / row["detections"].format(camera=camera), data, data_root, count)
        if row["mocap"]:
            shutil.copy(data_root / row["mocap"], data / row["mocap"])
        row |= {"bags": "", "truth": ""}
        stamps = f"{name}/{{camera}}.csv" if sidecars else ""
        lines.append("\t".join([*row.values(), f"{name}/{{camera}}.mp4", stamps]))
        for path in (target / f"config/sessions/{row['session']}").glob("cam??.yaml"):
            lens = f"{{file: {name}/lenses.toml, name: {path.stem}}}"
            without = re.sub(r"(?m)^topic: .*\n", "", path.read_text())
            path.write_text(without.replace("intrinsics: camera_info", f"intrinsics: {lens}"))
    (target / "config/sequences.tsv").write_text("\n".join(lines) + "\n")


def _without_first(path, data, data_root, count):
    """Copy a camera's ML Kit lines but the first `count`, the frames numbered anew."""
    if not path.is_file():
        return
    rows = [json.loads(line) for line in path.read_text().splitlines()][count:]
    target = data / path.relative_to(data_root)
    target.parent.mkdir(exist_ok=True)
    target.write_text("".join(json.dumps(row | {"frame": i}) + "\n" for i, row in enumerate(rows)))


def simulated(folder, settings):
    """Write a project folder of a capture that is simulated."""
    words = ["simulate", "--write-config", folder / "config", "--settings", json.dumps(settings)]
    subprocess.run([sys.executable, "-m", "dior", *words], cwd=ROOT, check=True)


def run(project, *targets):
    """Run the workflow in a project folder."""
    command = [sys.executable, "-m", "snakemake", "-j2", "--quiet", "all", "--directory", project, *targets]
    subprocess.run(command, cwd=ROOT, check=True, env=os.environ | {"PYTHONPATH": str(ROOT)})


def apart(one, other, gone=None):
    """Yield (sequence, camera, px by which the labels of two projects are apart, how many only `one` has), picture by
    picture. `gone`: pictures that `other` lacks at the beginning, by sequence and camera."""
    for path in sorted((one / "results/reproject").glob("*.parquet")):
        sequence, camera = path.stem.split(".")
        a, b = (tables.read(each / "results/reproject" / path.name, "labels_2d") for each in (one, other))
        shift = (gone or {}).get(sequence, {}).get(camera, 0)
        at = {key: i for i, key in enumerate(zip(a["frame"].tolist(), a["joint"], strict=True))}
        pairs = [
            (at[frame + shift, joint], j)
            for j, (frame, joint) in enumerate(zip(b["frame"].tolist(), b["joint"], strict=True))
            if (frame + shift, joint) in at
        ]
        i, j = np.array(pairs).T
        off = np.hypot(a["u"][i] - b["u"][j], a["v"][i] - b["v"][j])
        lost = np.isfinite(a["u"][i]) & ~np.isfinite(b["u"][j])
        yield sequence, camera, off, int(lost.sum())


def compared(one, other, gone=None):
    """Print the same."""
    for sequence, camera, off, lost in apart(one, other, gone):
        print(
            f"  {sequence}.{camera}{np.isfinite(off).sum():>8} labels{np.nanmean(off):>9.4f} px mean"
            f"{np.nanmax(off):>9.4f} worst; {lost} only from bags"
        )


def scene_of(seconds):
    """A function for the sound that each camera of a walk has of one scene, as of `videofiles.from_bags`."""
    rate, began = 16000, []
    scene = test_video_audio.steps(1, seconds + 20, rate)

    def sound_of(camera, first_ns, length_s):
        if began and abs(first_ns - began[0]) > 60 * 10**9:
            # the next walk
            began.clear()
        began.append(first_ns)
        start = 5 + (first_ns - began[0]) / 1e9
        heard = test_video_audio.recorded(scene, start, length_s + 0.1, len(began), rate)
        return (0.1 * heard).astype(np.float32), rate

    return sound_of


def labels():
    """Run a small capture from bags and from videos, and compare the labels."""
    for rate, clocks, ways in LABELLED:
        with tempfile.TemporaryDirectory() as name:
            bag = Path(name) / "bags"
            simulated(bag, SMALL | {"clocks": clocks})
            run(bag)
            for i, (what, late, gone, sidecars) in enumerate(ways):
                film = Path(name) / f"videos{i}"
                film.mkdir()
                data, sound = bag / "results/simulate", scene_of(SMALL["duration_s"])
                on_videos(bag, film, data, late, sound, ["cam03"], ["cam01"], sidecars)
                run(film)
                print(f"labels from videos ({rate} rate; {what}; cam01 Matroska, cam03 turned) beside bags")
                compared(bag, film, gone)


def real():
    """Run the real session from its bags and from videos with stamps, and compare labels."""
    source, data = ROOT / "tests/projects/real_outdoor", ROOT.parent / "shared/data/real_outdoor"
    with tempfile.TemporaryDirectory() as name:
        bag, film = Path(name) / "bags", Path(name) / "videos"
        shutil.copytree(source / "config", bag / "config")
        config = bag / "config/config.yaml"
        config.write_text(re.sub(r"(?m)^data_root: .*$", f"data_root: {data}", config.read_text()))
        film.mkdir()
        on_videos(bag, film, data, sidecars=True)
        (film / "data/reference").symlink_to(data / "reference")
        for project in (bag, film):
            run(project)
        print("labels of real_outdoor from videos beside bags")
        compared(bag, film)


def main():
    words = [word for word in sys.argv[1:] if not word.isdigit()]
    kept = next((Path(word) for word in words if word.endswith(".jsonl")), None)
    words = [word for word in words if not word.endswith(".jsonl")] or [
        "speed",
        "sound",
        "flash",
        "clocks",
        "beyond",
        "labels",
    ]
    count = int(next((word for word in sys.argv[1:] if word.isdigit()), 4))
    ways = {
        "speed": speed, "sound": lambda: sound(count), "flash": lambda: flash(count),
        "clocks": lambda: clocks(count, kept), "beyond": lambda: beyond(count), "labels": labels, "real": real,
    }  # fmt: skip
    for word in words:
        ways[word]()


if __name__ == "__main__":
    main()
