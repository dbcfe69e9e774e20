"""Do the labels' error ellipses hold, everywhere? Many captures, each simulated and labelled anew.

usage: python -m benchmarks.coverage run FOLDER FIRST LAST [ideal|real ...] [right|off ...] [close]
       python -m benchmarks.coverage FOLDER ...

The first form labels the captures of the seeds FIRST to LAST, walks of 8 s, and writes what it counts, one file a
capture, into FOLDER; captures that are there already are not made again. The levels and lenses (intrinsics `right`, or
0.3 % `off` by the simulator, and taken for that) are both by default; `close` leaves the lab and its cameras out, which
takes half the time. The second form prints the tables of all captures in the folders. A folder holds captures of one
version of the code.

A 95 % ellipse should hold 95 % of the true keypoints wherever they are: by depth, by how large the person is in the
picture (body heights), seen or hidden, by speed (of the keypoint across the line of sight). Where it cannot be told
whether a wall hides the legs (`doubtful`, by `occluder_doubtful` of `align`; else `told`), the ellipse reaches from one
reading of the boxes to the other, and holds nearly always: these captures are in no other cell than `all`. The labels
of one capture share its cameras' and its detector's errors, so that captures are what is drawn anew for the intervals
(`bootstrap`). A cell passes where its interval meets 90-98 % (else it is `outside`), and counts where 100 captures
contribute, long range 200 (else they are `few`). The person who draws boxes has the habit that `align.habit_px`
expects, drawn anew for every capture.
"""

import json
import sys
import tempfile
from pathlib import Path

import numpy as np

from benchmarks import steps
from dior.errors import DiorError
from dior.evaluate import bootstrap
from dior.tables import files, tables

INSIDE = 5.991  # chi-square with 2 degrees of freedom, 95 %
PASSES = 0.90, 0.98
GROUPS = ("indoor", "close", "long range")
NEEDED = {"indoor": 100, "close": 100, "long range": 200}
EVERY = 5  # labels of every fifth picture
SECONDS, HABIT_PX = 8.0, 0.5
LEVELS, LENSES = ("ideal", "real"), {"right": 0.0, "off": 0.003}
# the edges of the cells, a group's own where there are any
CUTS = (
    ("depth", {"long range": (57, 60, 63), "": (2, 3, 4, 6)}, "m"),
    ("size", {"long range": (20, 22, 24), "": (150, 250, 400, 600)}, "px"),
    ("speed", {"": (0.5, 1.5, 3.0)}, "m/s"),
)


def counted(seed, level, lens, close=False):
    """Of one capture {group: {cell: sums (5,)}}: the number of labels, of those inside, the sums of (error / sigma)^2
    (mean of u and v), of errors px and of sigmas px. Empty where the capture is refused."""
    places = {"environments": ["outdoor"]} if close else {}
    with tempfile.TemporaryDirectory() as folder:
        try:
            made = steps.labelled(
                folder, preset=level, seed=seed, subjects=1, duration_s=SECONDS, gallery=False,
                intrinsics_error=LENSES[lens], box_habit_px=HABIT_PX, **places,
            )  # fmt: skip
        except DiorError as error:
            print(f"seed {seed}, {level}, {lens}: refused, {error}", file=sys.stderr)
            return {}
        out = {}
        for name, views in made.views.items():
            for camera, seen in views.items():
                role = seen.placed.camera.role
                group = "indoor" if made.project.indoor(name) else "long range" if role == "long_range" else "close"
                table = tables.read(steps.labels_of(made, name, camera), "labels_2d")
                sums_of = of_labels(table, seen, group)
                if group == "long range" and sums_of:
                    reading = _reading(made, name, camera)
                    cells = sums_of if reading == "told" else {"all": sums_of["all"]}
                    sums_of = {**cells, reading: sums_of["all"]}
                for cell, sums in sums_of.items():
                    out.setdefault(group, {}).setdefault(cell, np.zeros(5))
                    out[group][cell] += sums
    return {group: {cell: sums.tolist() for cell, sums in cells.items()} for group, cells in out.items()}


def _reading(made, name, camera):
    path = made.made("align", f"{made.project.session_of(name)}/{camera}", ".findings")
    return "doubtful" if any(code == "occluder_doubtful" for *_, code, _ in tables.read_findings(path)) else "told"


def of_labels(table, seen, group):
    """{cell: sums (5,)} of a camera's labels against its `truth.View`."""
    values, joints = tables.grid(table, "u", "v", "sigma_u", "sigma_v", "rho_uv")
    where = [seen.joints.index(joint) for joint in joints]
    shown = seen.clock.messages
    fx = seen.camera.intrinsics.fx
    speed = np.linalg.norm(np.gradient(seen.uv, seen.seconds, axis=0), axis=-1) * seen.depth / fx
    size = np.broadcast_to(body_px(seen)[:, None], seen.depth.shape)
    true, status, depth, speed, size = (
        x[shown][:, where][::EVERY] for x in (seen.uv, seen.status, seen.depth, speed, size)
    )
    values = values[::EVERY]
    keep = np.isin(status, ("ok", "occluded")) & np.isfinite(values).all(axis=-1) & np.isfinite(speed)
    miss, sigma, rho = values[keep][:, :2] - true[keep], values[keep][:, 2:4], values[keep][:, 4]
    z = miss / sigma
    distance = (z[:, 0] ** 2 - 2 * rho * z[:, 0] * z[:, 1] + z[:, 1] ** 2) / (1 - rho**2)
    each = np.stack(
        [
            np.ones(len(z)), distance <= INSIDE, (z**2).mean(axis=1), np.linalg.norm(miss, axis=1),
            np.linalg.norm(sigma, axis=1),
        ]
    )  # fmt: skip
    cells = [np.full(len(z), "all", object), np.where(status[keep] == "occluded", "hidden", "seen").astype(object)]
    for (name, of, unit), x in zip(CUTS, (depth, size, speed), strict=True):
        edges = of.get(group, of[""])
        cells.append(np.array(_names(name, edges, unit), object)[np.digitize(x[keep], edges)])
    out = {}
    for names in cells:
        for name in np.unique(names):
            out[str(name)] = each[:, names == name].sum(axis=1)
    return out


def body_px(seen):
    """How tall the person is in the pictures (P,), px: the stature, as far away as the hips are."""
    points = seen.landmarks
    stature = np.median(points[..., 2].max(axis=1) - points[..., 2].min(axis=1))
    depth = (points[:, 23:25].mean(axis=1) - seen.camera.centre) @ seen.camera.wRc[:, 2]
    return seen.camera.intrinsics.fx * stature / depth


def _names(name, edges, unit):
    first, last = f"{name} < {edges[0]} {unit}", f"{name} > {edges[-1]} {unit}"
    return [first, *(f"{name} {a}-{b} {unit}" for a, b in zip(edges[:-1], edges[1:], strict=True)), last]


def cells_of(group):
    """Names of a group's cells as they are printed."""
    cuts = [_names(name, of.get(group, of[""]), unit) for name, of, unit in CUTS]
    return ["all", "told", "doubtful", "seen", "hidden", *(name for names in cuts for name in names)]


def run(folder, first, last, chosen):
    folder.mkdir(parents=True, exist_ok=True)
    levels = [level for level in LEVELS if level in chosen] or LEVELS
    lenses = [lens for lens in LENSES if lens in chosen] or list(LENSES)
    for seed in range(first, last + 1):
        for level in levels:
            for lens in lenses:
                path = folder / f"{level}.{lens}.{seed}.json"
                if not path.exists():
                    files.write_text(path, json.dumps(counted(seed, level, lens, "close" in chosen), indent=1))


def pooled(folders):
    """{(level, lens, group): {cell: sums (captures, 5)}}, and the number of captures that were refused by (level,
    lens)."""
    found, refused = {}, {}
    for path in sorted(path for folder in folders for path in Path(folder).glob("*.json")):
        level, lens, _ = path.stem.split(".")
        each = json.loads(path.read_text())
        refused[level, lens] = refused.get((level, lens), 0) + (not each)
        for group, cells in each.items():
            for cell, sums in cells.items():
                found.setdefault((level, lens, group), {}).setdefault(cell, []).append(sums)
    return {key: {cell: np.array(rows) for cell, rows in cells.items()} for key, cells in found.items()}, refused


def print_tables(folders):
    found, refused = pooled(folders)
    for (level, lens), count in refused.items():
        if count:
            print(f"{level}, intrinsics {lens}: {count} captures were refused")
    for level in LEVELS:
        for lens in LENSES:
            for group in GROUPS:
                cells = found.get((level, lens, group))
                if cells:
                    print(f"\n{level}, intrinsics {lens}, {group}")
                    print(
                        f"  {'labels':<20}{'captures':>9}{'number':>9}{'in 95 % ellipse':>17}{'interval':>16}"
                        f"{'rms error/sigma':>17}{'error, px':>11}{'sigma, px':>11}"
                    )
                    for cell in (name for name in cells_of(group) if name in cells):
                        _print_row(cell, cells[cell], NEEDED[group])


def _print_row(cell, rows, needed):
    total = rows.sum(axis=0)
    share, low, high = total[1] / total[0], *bootstrap.of_mean(rows[:, 1], rows[:, 0])
    met = low <= PASSES[1] and high >= PASSES[0]
    said = "" if met else "  outside"
    print(
        f"  {cell:<20}{len(rows):>9}{int(total[0]):>9}{share:>17.3f}{f'{low:.3f}-{high:.3f}':>16}"
        f"{np.sqrt(total[2] / total[0]):>17.2f}{total[3] / total[0]:>11.2f}{total[4] / total[0]:>11.2f}"
        f"{said}{'' if len(rows) >= needed else '  few'}"
    )


def main():
    if len(sys.argv) < 2:
        raise SystemExit(__doc__)
    if sys.argv[1] == "run":
        run(Path(sys.argv[2]), int(sys.argv[3]), int(sys.argv[4]), sys.argv[5:])
        print_tables([sys.argv[2]])
    else:
        print_tables(sys.argv[1:])


if __name__ == "__main__":
    main()
