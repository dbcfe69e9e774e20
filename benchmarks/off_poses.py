"""Heads that a release would show where the pose of a camera is wrong by some angle, which nothing tells but the
pictures: what `benchmarks.blur` prints last.

usage: python -m benchmarks.off_poses [SECONDS] [LEVELS] [BYSTANDERS] [SEEDS]      (4 ideal,real nobody,stands,walks 1)

Neither the labels' sigma nor the sequence's light know of the error here, so that only what the pictures show is
measured. A picture counts as bare with one pixel that is at least half head, hair, cap or bun and under no cover.
`not released`: of all pictures; `own cover alone`: pictures in which the subject's cover leaves such a pixel; `bare`
and `bystander bare`: of the released pictures, those that show some of the subject's head, and of somebody else's.
"""

import sys
import tempfile
from collections import defaultdict

import cv2
import numpy as np

from benchmarks import head_scenes, steps
from dior.errors import DiorError
from dior.geometry import covariance
from dior.ingest import moving
from dior.release import faces, head_blur, head_evidence, heads, look
from dior.simulate import simulate
from dior.simulate.motion import motion_of
from dior.simulate.settings import sequence_named

ANGLES_DEG = (0.0, 0.1, 0.3, 0.5, 1.0)
EVERY = 2
BYSTANDERS = {
    "nobody": {"bystander": 0.0},
    "stands": {"bystander": 0.4},
    # the detector does not see who walks past
    "walks": {"bystander": 0.6, "bystander_walks": True, "detector": {"taken": 0.0}},
}
COLUMNS = ("n", "lost", "bare_before", "bare", "bare_other", "area")


def of_capture(seed, level, who, seconds):
    """(level, who, role, angle) -> counts of COLUMNS of a capture."""
    total = defaultdict(lambda: np.zeros(len(COLUMNS)))
    with tempfile.TemporaryDirectory() as folder:
        settings = {"preset": level, "seed": seed, "subjects": 1, "duration_s": seconds, "gallery": False}
        try:
            made = steps.labelled(folder, **settings, **BYSTANDERS[who])
        except DiorError as error:
            print(f"{level}, seed {seed}, {who} is refused: {error}", file=sys.stderr)
            return {}
        for name, views in made.views.items():
            walk = sequence_named(made.settings, name)
            others = simulate.observe(made.settings, walk, motion_of(made.settings, walk))[1]
            for camera, seen in views.items():
                for key, counts in of_camera(made, name, camera, seen, others[camera]).items():
                    total[level, who, *key] += counts
    return dict(total)


def of_camera(made, name, camera, seen, other):
    """(role, angle) -> counts of COLUMNS of a camera of a walk."""
    shown = seen.clock.messages[::EVERY]
    scene = head_scenes.scene_of(made, name, seen, other)
    jpegs = [scene.picture(i) for i in shown]
    own, others = ([scene.head(i, person) for i in shown] for person in range(2)) if len(scene.people) > 1 else (
        [scene.head(i, 0) for i in shown], [None] * len(shown)
    )  # fmt: skip
    subject = every(found_known(made, name, camera))
    role = "long_range" if seen.camera.role == "long_range" else "close"
    path = made.folder / f"data/{name}/mlkit/{camera}.jsonl"
    found = faces.NOBODY
    if camera in made.project.close(made.project.session_of(name)):
        whole = found_known(made, name, camera).rows
        found = faces.read(path, "mlkit", made.project.config["detector"]["min_score"], whole, name)
        found = some(found)
    boxes = made.folder / f"config/boxes/{name}.{camera}.csv"
    drawn = heads.drawn_boxes(boxes if boxes.exists() else None, found_known(made, name, camera).rows)[::EVERY]
    factor = look.factor_of(covered_by(subject)[0])
    small = [moving_picture(jpeg, factor) for jpeg in jpegs]
    total = {}
    shown_as = "indoor" if made.project.indoor(name) else role
    for angle in ANGLES_DEG:
        counts = np.zeros(len(COLUMNS))
        for turn in turns(angle, f"{name}.{camera}"):
            wrong = turned(subject, turn)
            masks = masks_of(wrong, small, factor)
            counts += of_pose(wrong, role, found, drawn, masks, factor, own, others)
        total[shown_as, angle] = counts
    return total


def found_known(made, name, camera):
    """What the step `heads` knows of a camera of a walk."""
    session, project = made.project.session_of(name), made.project
    step = "locate" if project.indoor(name) else "adjust" if camera in project.close(session) else "align"
    paths = [made.made(step, session if step == "adjust" else f"{session}/{camera}")]
    return heads.known(
        name, camera, paths, steps.skeleton_of(made, name), made.made("frames", name),
        steps.clock_tables(made, name, camera, ""), steps.labels_of(made, name, camera),
    )  # fmt: skip


def every(known):
    """Every EVERY-th picture of it."""
    rows = {key: values[::EVERY] for key, values in known.rows.items()}
    parts = (getattr(known, key)[::EVERY] for key in ("times", "middle", "own", "sigma", "points"))
    return heads.Known(rows, known.camera, *parts, known.joints)


def some(found):
    """The faces of these pictures."""
    mine = found.row % EVERY == 0
    return faces.Faces(found.row[mine] // EVERY, found.joints, found.uv[mine], found.middle[mine], found.height[mine])


def covered_by(subject):
    box, status = subject.boxes()
    return np.where((status == "ok")[:, None], heads.on_grid(box), np.nan), status


def masks_of(subject, small, factor):
    """What stands out in the pictures `small`, the scene being taken from where the 3D does not have the subject."""
    box, _ = covered_by(subject)
    there = head_evidence.subject_of(subject.camera, box, subject.middle, subject.points, subject.joints, factor)
    chosen = moving.samples(len(small)).tolist()
    bodies = [head_evidence.whole_body(small[i].shape[:2], there, i) for i in chosen]
    scene = moving.scene_of([small[i] for i in chosen], bodies)
    return [moving.standing_out(picture, scene) for picture in small]


def moving_picture(jpeg, factor):
    flag = cv2.IMREAD_COLOR if factor == 1 else getattr(cv2, f"IMREAD_REDUCED_COLOR_{factor}")
    return cv2.imdecode(jpeg, flag)


def turns(angle_deg, name):
    """Turns (3,) rad about the camera's axes: none, or one to a side and one up or down."""
    if not angle_deg:
        return [np.zeros(3)]
    random = np.random.default_rng(list(name.encode()))
    signs = random.choice([-1.0, 1.0], 2) * np.deg2rad(angle_deg)
    return [np.array([0.0, signs[0], 0.0]), np.array([signs[1], 0.0, 0.0])]


def turned(subject, turn):
    camera = covariance.moved(subject.camera, np.concatenate([turn, np.zeros(3)]))
    return heads.Known(
        subject.rows, camera, subject.times, subject.middle, subject.own, subject.sigma, subject.points, subject.joints
    )


def of_pose(subject, role, found, drawn, masks, factor, own, others):
    box, status = covered_by(subject)
    seen = look.judged(subject.walker(box, drawn), role, found, enumerate(masks), factor)
    doubtful = heads.doubtful(subject)
    counts = np.zeros(len(COLUMNS))
    for i, head in enumerate(own):
        there, other = bool(head.any()), others[i] is not None and bool(others[i].any())
        if not there and not other or status[i] == "unknown":
            continue
        high, wide = head.shape
        only = np.zeros((high, wide), bool)
        if np.isfinite(box[i]).all():
            rows, columns = head_blur.inside(box[i], high, wide)
            only[rows, columns] = head_blur.ellipse(
                box[i], np.arange(rows.start, rows.stop), np.arange(columns.start, columns.stop)
            )
        covered = only.copy()
        for edges in seen.others[i]:
            rows, columns = head_blur.inside(edges, high, wide)
            covered[rows, columns] = True
        lost = seen.sure[i] != "ok" or doubtful[i]
        bare = bool((head & ~covered).any())
        counts += (
            1, lost, bool((head & ~only).any()), bare and not lost, other and not lost and (others[i] & ~covered).any(),
            0 if lost else covered.mean() / max(head.mean(), 1e-6) if there else 0,
        )  # fmt: skip
    return counts


def print_table(results):
    """`results`: dicts of `of_capture`. Cameras and bystanders apart, then all of a level and an angle."""
    total = defaultdict(lambda: np.zeros(len(COLUMNS)))
    for found in results:
        for (level, who, role, angle), counts in found.items():
            total[level, who, role, angle] += counts
            total[level, "all", "all", angle] += counts
    print(
        f"\n{'level':<8}{'bystander':<11}{'cameras':<12}{'off, deg':>9}{'pictures':>10}{'not released, %':>17}"
        f"{'own cover alone, %':>20}{'bare, %':>9}{'bystander bare, %':>19}"
    )
    for (level, who, role, angle), (n, lost, before, bare, other, _) in sorted(total.items(), key=_order):
        out = max(n - lost, 1)
        print(
            f"{level:<8}{who:<11}{role.replace('_', ' '):<12}{angle:>9}{int(n):>10}{100 * lost / n:>17.2f}"
            f"{100 * before / n:>20.2f}{100 * bare / out:>9.2f}{100 * other / out:>19.2f}"
        )


def _order(row):
    level, who, role, angle = row[0]
    return level, who == "all", who, role, angle


def main():
    given = [*sys.argv[1:], *("4", "ideal,real", ",".join(BYSTANDERS), "1")[len(sys.argv) - 1 :]]
    seconds, (levels, who, seeds) = float(given[0]), (words.split(",") for words in given[1:])
    cases = [(int(seed), level, one, seconds) for seed in seeds for level in levels for one in who]
    print(f"seeds {', '.join(seeds)}, walks of {seconds:g} s, every {EVERY}nd picture; limit: bare at most 0.1 %")
    print_table([of_capture(*case) for case in cases])


if __name__ == "__main__":
    main()
