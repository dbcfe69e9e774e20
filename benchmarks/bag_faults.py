"""Recordings with a fault in their stamps, lenses or spans: is it named, and does nothing else cry?

usage: python -m benchmarks.bag_faults [SEEDS] [stamps] [lenses] [recorders]      (20 seeds, all parts)

stamps    two cameras in one bag or two, 10 s at 15 to 60 Hz, with the clocks of each level of the simulation; the
          header clock of one of them is off for a while or set for good; by the steps `frames` and `audit`
lenses    rectified pictures, regions of interest and binning, as CameraInfo says them and as the pictures are; by the
          step `intrinsics`
recorders two or three computers with one or two cameras each, recorded one after the other; by the step `frames`

Bags are written, of pictures of a few pixels. `named`: the cause is in the sentence of an error or a warning, with the
pictures, sizes or cameras that it is in, and what is restored holds within four sigma; `refused`: of a disturbed clock,
an error that has the cause in its sentence; `otherwise`: another sentence, or what is named is restored wrongly;
`untold`: nothing is said. Beside it stands what is true at `real`: that messages are there twice, and that pictures are
lost, of a camera that lost more than `dior.tables.words` takes for few.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import re
import sys
import tempfile
from collections import Counter
from pathlib import Path

import numpy as np

from dior.calibrate import intrinsics
from dior.errors import DiorError
from dior.geometry import camera_tables
from dior.ingest import audit, frames
from dior.simulate import clocks, simulate
from dior.simulate import settings as levels
from dior.tables import tables
from dior.tables.words import MOST_LOST
from tests.ingest import bagfiles

SECONDS, RATES = 10.0, (15.0, 25.0, 30.0, 60.0)
TOPIC = "/{}/image_raw/compressed"


def pictures(topic, header_ns, receive_ns):
    """Messages of small pictures, no two with the same bytes."""
    for i, (stamp, received) in enumerate(zip(header_ns.tolist(), receive_ns.tolist(), strict=True)):
        small = np.array([[[i % 256, i // 256, 99]]], np.uint8)
        yield bagfiles.packed(topic, stamp, small, delay=received - stamp)


def indexed(folder, sent, topics, by_hand=()):
    """The `frames` table of the messages in bags, name -> messages."""
    paths = [
        bagfiles.write(folder / name, sorted(each, key=lambda one: one.receive_ns), "ros1")
        for name, each in sent.items()
    ]
    out = folder / "frames.parquet"
    frames.run(
        sequence="walk", bags=paths, data_root=folder, topics={name: topic for name, topic in topics.items()}, out=out,
        by_hand=list(by_hand),
    )  # fmt: skip
    return tables.read(out, "frames")


# -- stamps ------------------------------------------------------------------------------------------------------------


def _run(draw, count, period, where, sign, most=0.2):
    """First picture, number and shift (s) of a run in a recording of `count` pictures."""
    length = int(draw.integers(2, most * count)) if where != "one" else 1
    first = {"first": 0, "last": count - length}.get(where, int(draw.integers(0.2 * count, 0.8 * count - length)))
    return first, length, sign * float(draw.uniform(1.2 * period, 0.95))


def _set(draw, count, period, sign):
    first = int(draw.integers(0.3 * count, 0.7 * count))
    return first, count - first, sign * float(draw.uniform(2 * period + 0.05, 3.0))


def _both(draw, count, period, apart):
    """A run that is early, and one that is late after it."""
    first, length, early = _run(draw, count // 2, period, "middle", -1)
    start = first + length + (count // 3 if apart else 0)
    return [(first, length, early), (start, max(length // 2, 2), float(draw.uniform(1.2 * period, 0.95)))]


STAMPS = {
    "clean": lambda *a: [],
    "early": lambda *a: [_run(*a, "middle", -1)],
    "late": lambda *a: [_run(*a, "middle", 1)],
    "one early": lambda *a: [_run(*a, "one", -1)],
    "one late": lambda *a: [_run(*a, "one", 1)],
    "early by periods": lambda draw, count, period: [
        (*_run(draw, count, period, "middle", 1)[:2], -period * int(draw.integers(2, max(0.9 / period, 3))))
    ],
    "first early": lambda *a: [_run(*a, "first", -1)],
    "first late": lambda *a: [_run(*a, "first", 1)],
    "last early": lambda *a: [_run(*a, "last", -1)],
    "last late": lambda *a: [_run(*a, "last", 1)],
    "early, later late": lambda *a: _both(*a, True),
    "early, at once late": lambda *a: _both(*a, False),
    "set back": lambda *a: [_set(*a, -1)],
    "set forward": lambda *a: [_set(*a, 1)],
}


def stamps(seeds):
    print(f"{'level':<7}{'stamps':<24}{'named':>7}{'refused':>9}{'otherwise':>11}{'untold':>8}")
    for level, kind in ((level, kind) for level in levels.LEVELS for kind in STAMPS):
        found = Counter()
        for seed in range(1, seeds + 1):
            how, said = of_stamps(level, kind, seed)
            found[how] += 1
            if how in ("otherwise", "untold") and said is not None:
                print(f"{level} {kind} {seed}: {said}", file=sys.stderr)
        _print(f"{level:<7}{kind:<24}", found)


def of_stamps(level, kind, seed):
    """How the fault of a seed is found, and what is said."""
    draw = np.random.default_rng([seed, 14])
    fps = float(draw.choice(RATES))
    settings = levels.from_dict(
        {"preset": level, "seed": seed, "subjects": 1, "sequences": 1, "duration_s": SECONDS, "fps": fps}
    )
    walk = levels.sequences(settings)[0]
    recorded = {name: clocks.clocks_of(settings, walk)[0][name] for name in ("cam01", "cam02")}
    ill, split = str(draw.choice([*recorded])), draw.random() < 0.3
    sent, true, wrong, runs, lost = {"a": [], "b": []}, {}, {}, [], set()
    for name, clock in recorded.items():
        given, off = clock.stamp_ns.copy(), np.zeros(len(clock.stamp_ns), bool)
        if name == ill:
            runs = STAMPS[kind](draw, len(given), 1 / fps)
            for first, length, by in runs:
                given[first : first + length] += round(1e9 * by)
                off[first : first + length] = True
        # a message that is there twice has one header
        shown = clock.messages
        received = clock.receive_ns[shown] + simulate.REPEATED_AFTER_NS * np.r_[False, np.diff(shown) == 0]
        order = np.argsort(received, kind="stable")
        shown, received = shown[order], received[order]
        if 1 - len(given) / round(1 + fps * np.ptp(clock.stamp_ns) / 1e9) > MOST_LOST:
            lost.add(f"walk/{name}")
        true[name], wrong[name] = clock.stamp_ns[shown], off[shown]
        messages = list(pictures(TOPIC.format(name), given[shown], received))
        part = int(0.6 * len(messages)) if split else len(messages)
        sent["a"] += messages[:part]
        sent["b"] += messages[part:]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        try:
            table = indexed(
                folder, {bag: each for bag, each in sent.items() if each}, {one: TOPIC.format(one) for one in recorded}
            )
        except DiorError as error:
            return _refused(kind, ill, runs, str(error)), str(error)
        out = {key: folder / f"{key}.parquet" for key in ("out", "out_dropped", "findings")}
        audit.run(sequence="walk", frames=folder / "frames.parquet", data_root=folder, **out)
        warned = [
            (scope, severity, code, text)
            for scope, severity, code, text in tables.read_findings(out["findings"])
            if severity != "info" and code != "same_stamp" and not (code == "pictures_lost" and scope in lost)
        ]
    if not runs:
        return ("otherwise", [text for *_, text in warned]) if warned else ("named", None)
    own = {one: tables.of_camera(table, one) for one in recorded}
    holds = all(
        len(own[one]["stamp_ns"]) == len(true[one])
        and (
            np.abs(own[one]["stamp_ns"] - true[one]) / 1e9
            <= np.maximum(4 * np.nan_to_num(own[one]["restored_sigma_s"]), 2e-6)
        ).all()
        for one in recorded
    )
    told = all((np.isfinite(own[one]["restored_s"]) == wrong[one]).all() for one in recorded)
    named = holds and told and {code for _, _, code, _ in warned} == {"stamps_restored"}
    scopes = {scope for scope, *_ in warned}
    if named and scopes == {f"walk/{ill}"}:
        return "named", None
    if not warned:
        return "untold", f"{fps} Hz {runs}"
    return "otherwise", f"{fps} Hz {ill} {runs} split {split}: {[text for *_, text in warned]}"


def _refused(kind, ill, runs, said):
    """Whether an error has the cause in its sentence: the clock that was set, or what cannot be restored."""
    found = re.search(r"the header clock was set (back|forward) by ([0-9.]+) s", said)
    if ill not in said or not runs:
        return "otherwise"
    if found:
        # by what happens within the recording: what is early at first is set forward later
        by_s = [-by if first == 0 else by for first, _, by in runs]
        right = any(abs((1 if found[1] == "forward" else -1) * float(found[2]) - by) < 0.1 for by in by_s)
        return ("named" if kind.startswith("set") else "refused") if right else "otherwise"
    return "refused" if "header stamps of pictures" in said else "otherwise"


# -- lenses ------------------------------------------------------------------------------------------------------------

SIZES = ((1280, 720), (640, 480), (1920, 1080), (848, 480))


def lens(draw):
    """What a CameraInfo has of a full sensor (width, height, K, D, P), and the size of its pictures."""
    width, height = SIZES[draw.integers(len(SIZES))]
    f, c = draw.uniform(0.6, 1.2) * width, (np.array([width, height]) - 1) / 2 + draw.normal(0, 10, 2)
    K = np.array([[f, 0, c[0]], [0, 1.001 * f, c[1]], [0, 0, 1]])
    P = np.c_[np.diag([0.9, 0.9, 1.0]) @ K, np.zeros(3)]
    said = {"width": width, "height": height, "k": K, "d": draw.normal(0, 0.05, 5), "p": P}
    return said | {"binning": (0, 0), "roi": (0, 0, 0, 0), "size": (width, height), "rectified": False}


def _window(draw, said):
    """A region of interest (x, y, width, height), even and smaller than the sensor."""
    width, height = (2 * int(draw.uniform(0.2, 0.45) * n) for n in said["size"])
    left, top = (2 * int(draw.integers(1, (said[side] - n) // 2)) for side, n in (("width", width), ("height", height)))
    return left, top, width, height


def _binned(size, n):
    return tuple(side // n for side in size)


def _roi(draw, said, **more):
    roi = _window(draw, said)
    return {"roi": roi, "size": roi[2:]} | {key: change(roi, said) for key, change in more.items()}


def _zero(shape):
    return lambda draw, said: {"rectified": True, "p": np.zeros(shape)}


# kind -> what CameraInfo and pictures are changed to, and the words that name it (clean: none)
LENSES = {
    "whole": (lambda draw, said: {}, ""),
    "rectified": (lambda draw, said: {"rectified": True}, ""),
    "a region": (lambda draw, said: _roi(draw, said), ""),
    "binned": (lambda draw, said: {"binning": (2, 2), "size": _binned(said["size"], 2)}, ""),
    "a region, binned": (
        lambda draw, said: _roi(draw, said, size=lambda roi, _: _binned(roi[2:], 2)) | {"binning": (2, 2)}, ""
    ),
    "rectified region": (lambda draw, said: _roi(draw, said) | {"rectified": True}, ""),
    "P is zero": (_zero((3, 4)), "P is all zero"),
    "whole, said a region": (lambda draw, said: {"roi": _window(draw, said)}, "region of interest"),
    "a region, said whole": (lambda draw, said: {"size": _window(draw, said)[2:]}, "but the intrinsics are for"),
    "a region beyond": (
        lambda draw, said: _roi(draw, said, roi=lambda roi, said: (said["width"] - roi[2] // 2, *roi[1:])),
        "region of interest",
    ),
    "size of the region": (
        lambda draw, said: _roi(
            draw, said, width=lambda roi, _: roi[2], height=lambda roi, _: roi[3]
        ),
        "region of interest",
    ),
    "whole, said binned": (lambda draw, said: {"binning": (2, 2)}, "binning"),
    "binned, said whole": (lambda draw, said: {"size": _binned(said["size"], 2)}, "but the intrinsics are for"),
    "binned by 2, said 4": (
        lambda draw, said: {"binning": (4, 4), "size": _binned(said["size"], 2)}, "binning"
    ),
    "a region, said binned": (lambda draw, said: _roi(draw, said) | {"binning": (2, 2)}, "binning"),
    "turned pictures": (lambda draw, said: {"size": said["size"][::-1]}, "but the intrinsics are for"),
}  # fmt: skip


def lenses(seeds):
    print(f"{'lenses':<31}{'named':>7}{'refused':>9}{'otherwise':>11}{'untold':>8}")
    for kind, (change, words) in LENSES.items():
        found = Counter()
        for seed in range(1, seeds + 1):
            draw = np.random.default_rng([seed, 15])
            said = lens(draw)
            said |= change(draw, said)
            how, text = of_lens(said, words)
            found[how] += 1
            if how in ("otherwise", "untold"):
                print(f"{kind} {seed}: {text}", file=sys.stderr)
        _print(f"{kind:<31}", found)


def of_lens(said, words):
    """How the fault of a lens is found, and what is said; of a clean one, whether the lens is that of its pictures."""
    (width, height), roi, binning = said["size"], said["roi"], said["binning"]
    topic = "/cam01/image_rect_color/compressed" if said["rectified"] else TOPIC.format("cam01")
    told = bagfiles.info("/cam01/camera_info", bagfiles.T0, said["d"], size=(said["height"], said["width"]))
    told.content.update(
        k=said["k"].ravel(), p=said["p"].ravel(), binning_x=binning[0], binning_y=binning[1],
        roi=dict(zip(("x_offset", "y_offset", "width", "height"), roi, strict=True)),
    )  # fmt: skip
    shown = [
        bagfiles.packed(topic, bagfiles.T0 + i * 33_333_333, np.full((height, width, 3), i, np.uint8)) for i in range(2)
    ]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        try:
            indexed(folder, {"a": [told, *shown]}, {"cam01": topic})
            intrinsics.run(
                session="day", camera="cam01", role="close", topic=topic, source="camera_info", board={},
                frames=folder / "frames.parquet", sequence="walk", data_root=folder, out=folder / "lens.parquet",
                findings=folder / "findings.parquet",
            )  # fmt: skip
        except DiorError as error:
            return "named" if words and words in str(error) else "otherwise", str(error)
        lens = camera_tables.read_cameras(folder / "lens.parquet")["cam01"].intrinsics
        warned = [
            text for _, severity, _, text in tables.read_findings(folder / "findings.parquet") if severity != "info"
        ]
    if words or warned:
        return ("otherwise" if warned else "untold"), warned
    true = (said["p"] if said["rectified"] else said["k"])[:, :3]
    # the corners of the picture by the full sensor: a pixel of n is from n i - 1/2 to n i + n - 1/2 there
    n = max(binning[0], 1)
    ends = np.array([[0, 0], [width - 1, height - 1]]) * n + (n - 1) / 2 + roi[:2]
    rays = (ends - true[:2, 2]) / true[[0, 1], [0, 1]]
    back = rays * (lens.fx, lens.fy) + (lens.cx, lens.cy)
    right = np.abs(back - [[0, 0], [width - 1, height - 1]]).max() < 1e-6
    right &= any(lens.distortion) != said["rectified"] and (lens.width, lens.height) == said["size"]
    return ("named" if right else "otherwise"), lens


# -- recorders ---------------------------------------------------------------------------------------------------------


def _apart(draw):
    """How much later one recorder began than another ended, s: a moment to days."""
    return float(np.exp(draw.uniform(np.log(0.05), np.log(3e5))))


def recorders(seeds):
    print(f"{'recorders':<31}{'named':>7}{'refused':>9}{'otherwise':>11}{'untold':>8}")
    for kind in RECORDERS:
        found = Counter()
        for seed in range(1, seeds + 1):
            how, text = of_recorders(kind, seed)
            found[how] += 1
            if how != "named":
                print(f"{kind} {seed}: {text}", file=sys.stderr)
        _print(f"{kind:<31}", found)


# kind -> of one of three computers, when it starts after the first, in spans of one; and whether it is clean
RECORDERS = {
    "all at once": ("overlap", True),
    "one through another": ("chain", True),
    "given by hand": ("given", True),
    "one after the others": ("after", False),
    "one before the others": ("before", False),
    "all one after the other": ("each", False),
    "and a clock is set": ("after", False),
}


def of_recorders(kind, seed):
    """How recorders that do not overlap are found, and what is said."""
    draw = np.random.default_rng([seed, 16])
    span, count, (how, clean) = float(draw.uniform(3, 10)), int(draw.integers(2, 4)), RECORDERS[kind]
    begin = draw.uniform(0, 0.3 * span, count)
    ill = int(draw.integers(count))
    if how in ("after", "given"):
        begin[ill] = np.delete(begin, ill).max() + span + _apart(draw)
    elif how == "before":
        begin[ill] = np.delete(begin, ill).min() - span - _apart(draw)
    elif how == "chain":
        begin = draw.uniform(0.7, 0.9) * span * np.arange(count)
    elif how == "each":
        begin = np.cumsum([span + _apart(draw) for _ in range(count)])
    sent, topics, late = {}, {}, []
    for pc, at in enumerate(begin):
        cameras = [f"cam{2 * pc + k + 1:02d}" for k in range(int(draw.integers(1, 3)))]
        sent[f"pc{pc}"] = []
        for camera in cameras:
            topics[camera] = TOPIC.format(camera)
            stamps_ns = bagfiles.T0 + np.round(1e9 * (at + np.arange(0, span, 1 / 30))).astype(np.int64)
            header = stamps_ns - round(1.5e9) * (np.arange(len(stamps_ns)) > len(stamps_ns) / 2) * (
                kind == "and a clock is set"
            )
            sent[f"pc{pc}"] += pictures(topics[camera], header, stamps_ns + 4_000_000)
        late += cameras if pc == ill else []
    with tempfile.TemporaryDirectory() as name:
        try:
            indexed(Path(name), sent, topics, late if how == "given" else ())
        except DiorError as error:
            text = str(error)
            both = re.search(r"that of (.*) ended [0-9.]+ s before that of (.*) began", text)
            if not both:
                return "otherwise", text
            # one side are the cameras of that computer alone; which are apart from each other, if all are
            sides = [set(re.findall(r"cam\d\d", side)) for side in both.groups()]
            right = not clean and (how == "each" or set(late) in sides)
            return "named" if right else "otherwise", text
    return ("named" if clean else "untold"), ""


def _print(what, found):
    print(f"{what}{found['named']:>7}{found['refused']:>9}{found['otherwise']:>11}{found['untold']:>8}", flush=True)


PARTS = {"stamps": stamps, "lenses": lenses, "recorders": recorders}


def main():
    seeds = int(sys.argv[1]) if len(sys.argv) > 1 else 20
    for part in sys.argv[2:] or PARTS:
        PARTS[part](seeds)


if __name__ == "__main__":
    main()
