"""Is the subject's head covered in the released pictures, and how much else is? Simulated captures, found clocks and
cameras, against the head that the simulator drew. And are pictures kept back where a pose is wrong?

usage: python -m benchmarks.blur [CAPTURES] [SECONDS]      (3 captures a level, seeds 1-3, walks of 5 s)

`covered`: share of the head's area that is covered, in pictures that are released; `least`: of one camera of one walk.
`times`: covered area over the head's; `most`: of one camera of one walk. `lost`: pictures that are not released. The
head is the skull and the face of the drawn body, hidden or not, its border pixels counted by what the head has of them.
Below, how many pictures and files a small fix of the camera writes anew, and how many where config/heads/ has the boxes
from before it; and last what `benchmarks.off_poses` tells of poses that are off, of as many captures with each kind of
bystander.
"""

import os
import sys
import tempfile
from collections import defaultdict
from concurrent.futures import ProcessPoolExecutor

import numpy as np

from benchmarks import off_poses, steps
from dior.body.names import MLKIT_33
from dior.errors import DiorError
from dior.geometry import covariance
from dior.release import head_blur, heads
from dior.simulate import draw
from dior.simulate.motion import motion_of
from dior.simulate.settings import sequence_named

EVERY = 3
SUBSAMPLES, SHIFT = 8, 4
HEAD = [i for i, limb in enumerate(draw._LIMBS) if limb[0] in ("skull", "face")]
FIXES_PX = (0.1, 0.3)
LIMITS = "limits: covered at least 99.9 %, times at most 6"


def of_capture(seed, level, seconds):
    """Rows (key, covered, head, area, pictures, lost) of every camera, and of every side it sees the head from; and
    of `rewritten`."""
    with tempfile.TemporaryDirectory() as folder:
        try:
            made = steps.labelled(folder, preset=level, seed=seed, subjects=1, duration_s=seconds, gallery=False)
        except DiorError as error:
            print(f"seed {seed} is refused: {error}", file=sys.stderr)
            return [], []
        rows, fixes = [], []
        for name, views in made.views.items():
            for camera, seen in views.items():
                found, changed = _of_camera(made, name, camera, seen)
                rows += [((level, *key), *numbers) for key, numbers in found.items()]
                fixes += [((level, *key), *numbers) for key, numbers in changed.items()]
    return rows, fixes


def _of_camera(made, name, camera, seen):
    indoor = made.project.indoor(name)
    role = "indoor" if indoor else "long range" if seen.camera.role == "long_range" else "close"
    box, status, known = found_heads(made, name, camera)
    motion = motion_of(made.settings, sequence_named(made.settings, name))
    shown = seen.clock.messages
    figure = draw.figure(seen.landmarks, motion.height)
    drawn = draw.outlines(seen.camera, figure, motion.height, "shirt", "S01").limbs[shown][:, HEAD, 0]
    faces = facing(seen, figure)[shown]
    lens = seen.camera.intrinsics
    total = defaultdict(lambda: np.zeros(5))
    for i in range(0, len(box), EVERY):
        row, column, part = head_mask(drawn[i], lens.width, lens.height)
        if part.sum() == 0:
            continue
        numbers = np.array([*measured(box[i], status[i], row, column, part, lens), 1, status[i] == "unknown"])
        total[role, camera] += numbers
        total[role, faces[i]] += numbers
    return dict(total), rewritten(role, known, box, status)


def found_heads(made, name, camera):
    """Boxes on the grid (F, 4) of the step `heads`, statuses (F,), and what it found them from."""
    known = off_poses.found_known(made, name, camera)
    box, status = known.boxes()
    return heads.on_grid(box), status, known


def head_mask(polygons, width, height):
    """(first row, first column, share of each pixel that the head has) of polygons (2, N, 2) px, in the picture."""
    import cv2

    low = np.floor(polygons.min(axis=(0, 1))).astype(int) - 1
    wide, high = np.ceil(polygons.max(axis=(0, 1))).astype(int) + 2 - low
    canvas = np.zeros((high * SUBSAMPLES, wide * SUBSAMPLES), np.uint8)
    for polygon in polygons:
        at = ((polygon - low + 0.5) * SUBSAMPLES - 0.5) * (1 << SHIFT)
        cv2.fillConvexPoly(canvas, np.round(at).astype(np.int32), 1, cv2.LINE_8, SHIFT)
    part = canvas.reshape(high, SUBSAMPLES, wide, SUBSAMPLES).mean(axis=(1, 3))
    rows, columns = head_blur.inside((*low, low[0] + wide, low[1] + high), height, width)
    return rows.start, columns.start, part[
        rows.start - low[1] : rows.stop - low[1], columns.start - low[0] : columns.stop - low[0]
    ]  # fmt: skip


def measured(box, status, row, column, part, lens):
    """(covered, of the head, covered in all) px^2 of a released picture; zeros for one that is not."""
    if status == "unknown":
        return 0.0, 0.0, 0.0
    if status == "out_of_frame":
        return 0.0, part.sum(), 0.0
    at = np.arange(row, row + part.shape[0]), np.arange(column, column + part.shape[1])
    rows, columns = head_blur.inside(box, lens.height, lens.width)
    whole = head_blur.ellipse(box, np.arange(rows.start, rows.stop), np.arange(columns.start, columns.stop))
    return part[head_blur.ellipse(box, *at)].sum(), part.sum(), whole.sum()


def facing(seen, figure):
    """Which side of the head (F,) the camera sees: front, side, back."""
    at = {name: seen.landmarks[:, MLKIT_33.index(name)] for name in ("nose", "left_ear", "right_ear")}
    ears = (at["left_ear"] + at["right_ear"]) / 2
    ahead, to_camera = at["nose"] - ears, seen.camera.centre - figure["skull"]
    cosine = (ahead * to_camera).sum(axis=1) / np.linalg.norm(ahead, axis=1) / np.linalg.norm(to_camera, axis=1)
    return np.select([cosine > 0.5, cosine < -0.5], ["front", "back"], "side")


def rewritten(role, known, box, status):
    """(role, fix) -> pictures, those whose box is another where the camera turns by a fix px both ways, shards, those
    that change; and the two once more where the boxes from before the fix are given."""
    found = {}
    for fix in FIXES_PX:
        turn = np.array([1.0, 1.0, 0.0, 0.0, 0.0, 0.0]) * fix / known.camera.intrinsics.fx
        given = (covariance.moved(known.camera, turn), known.middle, known.own, known.sigma)
        raw, state = heads.boxes(*given)
        fixed = heads.on_grid(raw)
        shown = (status == "ok") | (state == "ok")
        numbers = [len(box), 1]
        for other in (fixed, heads.kept(box, fixed, heads.boxes(*given, heads.KEPT_SIGMAS)[0])):
            changed = shown & ((status != state) | (other != box).any(axis=1))
            numbers += [changed.sum(), changed.any()]
        found[role, fix] = np.array(numbers)
    return found


def main():
    captures = int(sys.argv[1]) if len(sys.argv) > 1 else 3
    seconds = float(sys.argv[2]) if len(sys.argv) > 2 else 5.0
    print(f"{captures} captures a level, seeds 1-{captures}, walks of {seconds:g} s, every {EVERY}rd picture; {LIMITS}")
    jobs = [(seed, level) for level in ("ideal", "real") for seed in range(1, captures + 1)]
    with ProcessPoolExecutor(os.cpu_count()) as pool:
        done = list(pool.map(of_capture, *zip(*jobs, strict=True), [seconds] * len(jobs)))
    by_key = defaultdict(list)
    for key, *numbers in (row for rows, _ in done for row in rows):
        by_key[key].append(np.ravel(numbers))
        by_key[(*key[:2], "all")] += [np.ravel(numbers)] if key[2].startswith("cam") else []
    print(
        f"{'level':<8}{'cameras':<12}{'':<8}{'covered, %':>11}{'least':>8}{'times':>7}{'most':>7}{'lost, %':>9}{'n':>7}"
    )
    for key, parts in sorted(by_key.items()):
        each, (covered, head, area, count, lost) = np.array(parts), np.sum(parts, axis=0)
        with np.errstate(invalid="ignore", divide="ignore"):
            least, most = np.nanmin(each[:, 0] / each[:, 1]), np.nanmax(each[:, 2] / each[:, 1])
        print(
            f"{key[0]:<8}{key[1]:<12}{key[2]:<8}{100 * covered / head:>11.3f}{100 * least:>8.2f}{area / head:>7.2f}"
            f"{most:>7.2f}{100 * lost / count:>9.2f}{int(count):>7}"
        )
    fixes = defaultdict(lambda: np.zeros(6))
    for key, *numbers in (row for _, rows in done for row in rows):
        fixes[key] += np.ravel(numbers)
    print(
        f"\n{'written anew, %':<28}{'pictures':>10}{'files':>7}{'with config/heads:':>20}{'pictures':>10}{'files':>7}"
    )
    for (level, role, fix), (count, files, *changed) in sorted(fixes.items()):
        shares = [100 * number / of for number, of in zip(changed, (count, files) * 2, strict=True)]
        print(f"{level:<8}{role:<12}{fix:>5} px{shares[0]:>10.1f}{shares[1]:>7.0f}{shares[2]:>30.1f}{shares[3]:>7.0f}")
    cases = [(seed, level, who, seconds) for seed, level in jobs for who in off_poses.BYSTANDERS]
    with ProcessPoolExecutor(os.cpu_count()) as pool:
        off_poses.print_table(list(pool.map(off_poses.of_capture, *zip(*cases, strict=True))))


if __name__ == "__main__":
    main()
