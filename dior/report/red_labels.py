"""Which labels a red light says are wrong: those of one camera, or of a whole walk, whose 3D is wrong.

INPUTS   the figures of a walk's cameras, findings about it and its session, and which cameras its 3D is drawn from
OUTPUT   `Red`s: of which camera, "" for the whole walk, and why in words that a release may tell

A figure (`lights.LIMITS`) is about the camera that has it; what it says is wrong is its `wrong`. How few joints have a
label, how many pictures were lost and how often left and right were exchanged says nothing against the labels that
there are; and the truth, which only a simulation has, must not help to make a release. Where half of the cameras that
the 3D is drawn from are red by figures that compare labels with what the pictures show, nothing says that the other
half is right: the 3D is wrong.

A finding with severity error is about the cameras that it names: robust triangulation leaves a view out that does not
agree with the others, so that one wrong camera hardly moves the labels of the others (`python -m benchmarks.culprit
labels`). Where every view is used as it is (`triangulate.method: rays`) it moves every point. The whole walk is wrong
then, and where a finding names no camera, or more than one, or of which nobody knows whether it is the wrong one.

The words are fixed: those of findings name files, other walks and numbers of people who may not be in the release.
"""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass

from dior.arrays import Table
from dior.report import lights
from dior.report.lights import Finding

# the camera that it names, if any, may be the right one
UNSETTLED = ("culprit_unclear",)
# what a release says of a finding, by its code; `{}` are the cameras that it names
WORDS = {
    "culprit_camera": "{} does not belong to the other cameras",
    "culprit_exchanged": "the detections of {} are exchanged",
    "culprit_unclear": "the cameras do not belong together",
    "culprit_c3d": "the motion capture is not that of this recording",
    "camera_bumped": "{} was turned in the course of the session",
    "clock_jump": "the clock of {} jumps",
    "world_scale": "the 3D has the wrong size",
    "world_bones": "the 3D has a bone of impossible length",
    "world_left_handed": "the 3D is mirrored",
    "world_axes": "Z is not up in the 3D",
    "world_floor": "the person does not walk on the floor",
    "world_vertical": "the person leans as nobody can",
    "world_speed": "the person moves faster than anybody can",
}
OTHERS = "an error that dior found ({})"


@dataclass(frozen=True)
class Red:
    """Labels that are wrong: of `camera`, or "" for the whole walk: its 3D, and the labels of all cameras, which are
    drawn from it. `reason`: why, in words without a name of a file or person."""

    camera: str
    reason: str


@dataclass(frozen=True)
class Judged:
    """A camera of a walk: its focal length `fx` px, and its `figures` by metric, over all joints."""

    fx: float
    figures: Mapping[str, float]


def of_walk(
    sequence: str,
    session: str,
    cameras: Mapping[str, Judged],
    makers: Collection[str],
    findings: Iterable[Finding] = (),
    robust: bool = True,
) -> list[Red]:
    """What is wrong with the labels of a walk: at most one `Red` for the walk and for each camera, the walk's first.

    `makers`: the cameras that its 3D is drawn from, none where it is motion capture; `findings`: (scope, severity,
    code, text), also such as are about other walks and sessions; `robust`: views that disagree with the others are left
    out of it.
    """
    reasons: dict[str, list[str]] = {}
    of_all = () if robust else makers
    for camera, code, named in _errors(sequence, session, cameras, of_all, findings):
        words = WORDS.get(code, OTHERS.format(code)).format(" and ".join(named) or "a camera")
        reasons.setdefault(camera, []).append(words)
    beside = []
    for name, judged in sorted(cameras.items()):
        red = _figures(judged)
        if red:
            reasons.setdefault(name, []).extend(words for _, words in red)
        if name in makers and any(wrong == "drawn" for wrong, _ in red):
            beside.append(name)
    if beside and 2 * len(beside) >= len(makers):
        words = f"the labels are beside what is seen in {' and '.join(beside)}, half or more of the cameras of the 3D"
        reasons.setdefault("", []).append(words)
    return [Red(camera, "; ".join(dict.fromkeys(reasons[camera]))) for camera in sorted(reasons)]


def by_camera(table: Table) -> dict[tuple[str, str], dict[str, float]]:
    """(sequence, camera) -> metric -> value of a table of figures, those over all joints by no other detector."""
    found: dict[tuple[str, str], dict[str, float]] = {}
    keys = ("sequence", "camera", "joint", "tool", "metric", "value")
    for sequence, camera, joint, tool, metric, value in zip(*(table[key].tolist() for key in keys), strict=True):
        if sequence and camera and not joint and not tool:
            found.setdefault((sequence, camera), {})[metric] = float(value)
    return found


def _figures(judged: Judged) -> list[tuple[str, str]]:
    """(`wrong` of the limit, words) of the figures of a camera that are red and say that labels are wrong."""
    figures = lights.boxes_compared(judged.figures)
    found = [
        (limit.wrong, *lights.of_figure(limit, figures[limit.metric], judged.fx))
        for limit in lights.LIMITS
        if limit.wrong and limit.metric in figures
    ]
    return [(wrong, words) for wrong, level, words in found if level == "bad"]


def _errors(
    sequence: str, session: str, cameras: Collection[str], of_all: Collection[str], findings: Iterable[Finding]
) -> list[tuple[str, str, list[str]]]:
    """(camera or "" for the walk, code, cameras that are named) of the findings with severity error about a walk.

    `of_all`: the cameras that move every point.
    """
    found = []
    for scope, severity, code, _ in lights.by_mocap(findings):
        if severity != "error" or not scope or not lights.about(scope, {sequence, session, *cameras}):
            continue
        named = [word for word in scope.split("/") if word in cameras]
        alone = len(named) == 1 and code not in UNSETTLED and named[0] not in of_all
        found.append((named[0] if alone else "", code, named))
    return found
