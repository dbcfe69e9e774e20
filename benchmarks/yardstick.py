"""Whether the report's light tells long-range labels that are right from those that are off, by boxes that are tight,
fair or large: how often it is green, amber and red, and what each yardstick says.

usage: python -m benchmarks.long_range yardstick [SEEDS] [FIRST]

Captures and boxes are those of `benchmarks.long_range`: around the rendered plain body, 60 m away, each edge drawn with
1 px sd; `habit`: what each edge is further out in every box (px, sd), drawn anew for each seed. `right`: the true
camera, which owes boxes nothing, so that each box is a yardstick; `off`: it is turned by so much, in a direction of
chance; `placed`: by these boxes, as `align` does it, each judged by a fit without it; `and another`: a second drawer,
with a habit of his own, drew every third of the pictures, and judges. `light`: captures that are green, amber and red;
`held`: the same where only the boxes judge that are kept back, which are none of 10. `share`, `expected`: `in_box_*`;
`lacking`, `beside`: what the light compares, their means; `error`: that of the labels, px; `inside`: share of the 95 %
ellipses that hold the truth; `habit_px`: what the fit takes for it; `differ`: drawers that are said to differ.
"""

from itertools import product

import numpy as np

from benchmarks import long_range
from dior.body.names import MLKIT_33
from dior.calibrate import align
from dior.calibrate.outline import boxes_fit, drawers
from dior.evaluate import labels_in_boxes
from dior.evaluate.grids import LabelGrid
from dior.geometry import covariance
from dior.geometry.camera import in_frame, project
from dior.project import boxes as hand_boxes
from dior.report import lights

MARGINS_PX, HABITS_PX, COUNTS = (-1.0, 0.0, 1.0, 3.0), (0.0, 0.5), (10, 30)
OFF_PX = {"right": 0.0, "1 px off": 1.0, "2 px off": 2.0, "4 px off": 4.0}
OTHER_SEED, OTHER_DRAWS = 5000, 3  # added to the seed of another person's hand; he draws one picture in so many


def grid_of(camera, points, frames):
    """The labels of a camera, at the joints (F, J, 3) m of the pictures `frames`."""
    uv = project(camera, points)[0]
    there = np.isfinite(uv).all(axis=-1) & in_frame(camera.intrinsics, uv)
    return LabelGrid(camera.name, frames, frames, list(MLKIT_33), np.where(there[..., None], uv, np.nan), there, ~there)


def turned(camera, seed, off_px):
    """The camera whose labels are `off_px` away, in a direction of chance."""
    angle = np.random.default_rng([seed, 6]).uniform(0, 2 * np.pi)
    turn = off_px / camera.intrinsics.fx * np.array([np.cos(angle), np.sin(angle), 0.0])
    return covariance.moved(camera, np.concatenate([turn, np.zeros(3)]))


def pooled(measured):
    """Metric -> mean of what is there, as the step `evaluate` has it of one camera."""
    means = {name: values[np.isfinite(values)] for name, _, values in measured}
    return {name: float(values.mean()) for name, values in means.items() if values.size}


def level_of(figures):
    return lights.judge({**figures, "coverage": 1.0}, long_range.FX, role="long_range").level


def judged(measured, **more):
    """The figures of one capture with what the light compares, the light, and that by the boxes kept back alone."""
    figures = pooled(measured)
    compared = lights.boxes_compared(figures)
    held = {name: value for name, value in figures.items() if not name.startswith(("left_out", "other_drawer"))}
    return figures | {
        "lacking": compared["in_box_lacking"], "beside": compared["beside_boxes"], "light": level_of(figures),
        "held": level_of(held) if "held_back_expected" in held else "none", **more,
    }  # fmt: skip


def by_truth(level, seed, margin, habit, count, off_px, worn="plain"):
    """`judged` of the true camera turned by `off_px`, by boxes that placed nothing."""
    made, _ = long_range.capture(level, seed)
    frames, edges = boxes_of(seed, count, margin, habit, worn)
    grid = grid_of(turned(made.cameras[3], seed, off_px), made.points[frames], frames)
    every = labels_in_boxes.judged("left_out", grid, edges, np.ones(count, bool))
    return judged([*labels_in_boxes.figures(grid, edges), *every])


def by_fits(level, seed, margin, habit, count, worn="plain", another=False):
    """`judged` of a camera that these boxes placed; `another`: a second drawer judges."""
    made, points = long_range.capture(level, seed)
    frames, edges = boxes_of(seed, count, margin, habit, worn)
    theirs = frames[::OTHER_DRAWS], boxes_of(seed, count, margin, habit, worn, OTHER_SEED)[1][::OTHER_DRAWS]
    compared = drawers.apart([{"A": (frames, edges), "B": theirs}] if another else [])
    prior_px = long_range.freedom().habit_px
    freedom = long_range.freedom(drawers.habit(prior_px, compared))
    used, where = ~hand_boxes.kept_back(frames), f"{level} {seed}"
    seen = long_range.observed(level, points[frames[used]], edges[used], made.seconds[frames[used]])
    start = long_range.off(made.given[3], seed)
    fitted = boxes_fit.fit(start, freedom, seen, where)
    shift = align.left_out(start, freedom, seen, fitted, hand_boxes.folds(frames[used]), where)
    grid = grid_of(fitted.camera, points[frames], frames)
    measured = [*labels_in_boxes.figures(grid, edges), *labels_in_boxes.left_out(grid, edges, frames[used], shift)]
    if another:
        hand = labels_in_boxes.of_frames(grid, *theirs)
        measured += labels_in_boxes.judged("other_drawer", grid, hand, np.array(np.isfinite(hand).all(axis=1)))
    error, spread = long_range.label_errors(level, seed, fitted)
    said = [code for _, _, code, _ in drawers.findings("", compared, prior_px, freedom.habit_px)]
    return judged(
        measured, error=np.linalg.norm(error, axis=-1).mean(), inside=long_range.inside(error, spread),
        habit_px=freedom.habit_px, differ="drawers_differ" in said,
    )  # fmt: skip


def boxes_of(seed, count, margin, habit, worn, other=0):
    """Frames (B,) and edges (B, 4) px of the boxes that somebody drew; `other` is added to the seed of his hand."""
    rows = long_range.spread_over(count)
    tight = long_range.body(seed, rows, worn)
    return np.array(rows), long_range.drawn(tight, seed + other, margin, habit=habit)


TRUE = {name: (by_truth, {"off_px": off}) for name, off in OFF_PX.items()}
FITTED = {"placed": (by_fits, {}), "placed, and another": (by_fits, {"another": True})}
# whose labels: those of the truth do not depend on the detector
WAYS = {"true": TRUE, **dict.fromkeys(long_range.LEVELS, FITTED)}
FIGURES = {
    "in_box_share": "share", "in_box_expected": "expected", "lacking": "lacking", "beside": "beside", "error": "error",
    "inside": "inside", "habit_px": "habit_px", "differ": "differ",
}  # fmt: skip


def table(seeds):
    """Print what the yardsticks say of each way of drawing and of each kind of labels."""
    found = {}
    for seed in seeds:
        for group, ways in WAYS.items():
            for count, habit, margin in product(COUNTS, HABITS_PX, MARGINS_PX):
                for name, (how, given) in ways.items():
                    level = long_range.LEVELS[0] if group == "true" else group
                    one = how(level, seed, margin, habit, count, **given)
                    found.setdefault((group, count, habit, margin, name), []).append(one)
        for kept in (long_range.capture, long_range.body):
            kept.cache_clear()
    shown = None
    for (group, count, habit, margin, name), each in found.items():
        if shown != (shown := (group, count, habit)):
            print(f"{group} labels, {count} boxes, habit {habit:g} px, {len(seeds)} seeds")
            print(f"  margin {'':<20}" + "".join(f"{word:>9}" for word in ("light", "held", *FIGURES.values())))
        text = f"  {margin:>+6g} {name:<20}"
        for key in ("light", "held"):
            text += f"{'/'.join(str(sum(one[key] == color for one in each)) for color in lights.LEVELS[:3]):>9}"
        text += "".join(f"{np.mean([one[key] for one in each]):>9.3f}" if key in each[0] else "" for key in FIGURES)
        print(text, flush=True)
