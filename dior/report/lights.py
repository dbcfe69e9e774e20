"""What the numbers mean: a traffic light per sequence and camera, with the reason in words.

INPUTS   rows of metrics.csv, `frame_metrics`, `findings`, the sheets
OUTPUT   `Light`s and findings; nothing is drawn or written here
"""

from collections.abc import Collection, Container, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from dior.arrays import Ints
from dior.geometry import culprit
from dior.geometry.camera import REFERENCE_FX
from dior.report.key_figures import Row
from dior.report.numbers import show
from dior.tables.words import MOST_LOST

# scope, severity, code, text
Finding: TypeAlias = tuple[str, str, str, str]
# severity, code, text of a finding, of which it is known what it is about
Told: TypeAlias = tuple[str, str, str]
LEVELS = ("good", "look", "bad", "none")
WORDS = {"good": "good", "look": "look at it", "bad": "fix it", "none": "left out"}


@dataclass(frozen=True)
class Limit:
    """From where on a figure is amber (`look`) and red (`bad`). `sign` +1: large is bad, -1: small is bad.

    `wrong`: what a red one says is wrong (`report.red_labels`): "" no label, "camera" where the camera's labels are,
    "drawn" the same, and the 3D where many of the cameras that it is drawn from say so.
    """

    metric: str
    look: float
    bad: float
    sign: int
    unit: str
    words: str
    why: str
    wrong: str = ""
    scaled_by_fx: bool = False


# where `why` gives no measurement, chosen: `look` where a person would want to see it, `bad` where labels are no use
LIMITS = (
    Limit("coverage", 0.95, 0.80, -1, "share", "{} of the joints have a label", "more than a few gaps"),
    Limit(
        "in_picture_share", 0.50, 0.05, -1, "share", "{} of the labels are in the picture",
        "a camera that looks elsewhere has all its labels outside, and nothing else shows it", "camera",
    ),
    Limit(
        "lost_pictures", MOST_LOST, 0.05, 1, "share", "{} of the pictures were lost in the recording",
        "estimated from gaps between the stamps; labels are never made up for lost pictures",
    ),
    Limit(
        "reprojection_error", 15.0, 30.0, 1, "px", "labels are {} from the detections",
        "a real detector has 10-15 px of noise at a focal length of 1680 px; limits are scaled by the focal length",
        "drawn", scaled_by_fx=True,
    ),
    Limit("mark_error", 3.0, 6.0, 1, "px", "the clicked marks fit to {}", "a person clicks to about 1-2 px", "camera"),
    Limit(
        "check_error", 3.0, 6.0, 1, "px", "labels are {} from the hand checks", "a person clicks to about 1-2 px",
        "drawn",
    ),
    Limit(
        "in_box_share", 0.95, 0.70, -1, "share", "{} of the labels are in the hand boxes",
        "only where it is not known what perfect labels would score in boxes drawn like these", "camera",
    ),
    Limit(
        "in_box_lacking", 0.05, 0.30, 1, "share", "{} fewer labels are in the hand boxes than perfect ones would be",
        "tight boxes hold few labels and large ones any; of 6 boxes kept back, perfect labels lack 5 % in one of 10 "
        "walks where boxes are tight, and in none where they are 3 px large", "camera",
    ),
    Limit(
        "beside_boxes", 0.08, 0.20, 1, "share", "labels lie {} of their height beside the middle of the hand boxes",
        "perfect ones lie up to 4 % below it: the crown is further above the joints of the head than the soles below "
        "those of the feet, and a person draws one edge further out than the other", "camera",
    ),
    Limit("error_to_truth_2d", 3.0, 6.0, 1, "px", "labels are {} from the truth", "only in simulated captures"),
    Limit(
        "swapped_share", 0.25, np.inf, 1, "share", "left and right were exchanged in {} of the detections",
        "they are turned back before use; when they are many, some will have been overlooked",
    ),
)  # fmt: skip
# a walk whose error is that many times the median of at least so many others stands out; chosen: a wrong clock or a
# bystander multiplies the error, people and outfits do not double it
STANDS_OUT, OTHERS = 2.0, 2
YARDSTICKS = {"in_box_share", "in_box_lacking", "check_error", "error_to_truth_2d"}
# boxes of the drawer whose boxes steps use that judge, the best first: each by a fit without it; kept back from every
# fit, which are fewer; all, which placed the camera
BOXES_THAT_JUDGE = ("left_out", "held_back", "in_box")
# what is wrong where neither a figure nor a finding says it, and what an innocent camera's light says of the culprit
NO_LABELS, UNCHECKED, BESIDE_CULPRIT = "no_labels", "unchecked", "beside_culprit"
SEVERITY_LEVEL = {"info": "good", "warning": "look", "error": "bad"}


@dataclass(frozen=True)
class Light:
    """`level` is one of LEVELS; `reasons`: what made it amber or red; `facts`: the other figures in words;
    `faults`: the reasons as (level, code, words), where a code is a finding's, a figure's metric or one of those below.
    """

    level: str
    reasons: tuple[str, ...] = ()
    facts: tuple[str, ...] = ()
    faults: tuple[tuple[str, str, str], ...] = ()

    @property
    def word(self) -> str:
        return WORDS[self.level]


def worst(levels: Iterable[str]) -> str:
    """The most serious of levels."""
    return max(levels, key=LEVELS.index, default="good")


def judge(figures: Mapping[str, float], fx: float | None, findings: Iterable[Told] = (), role: str = "close") -> Light:
    """The `Light` of a camera of a sequence.

    `figures`: metric -> value, `fx` px or None, `findings`: those that are about this camera.
    No `coverage` means that there are no labels. A long-range camera without a yardstick is never good. Hand boxes
    judge against what perfect labels would score in them, as in `boxes_compared`.
    """
    figures = boxes_compared(figures)
    found = [(SEVERITY_LEVEL[severity], text, code) for severity, code, text in findings]
    if "coverage" not in figures:
        found.append(("bad", "no labels were made", NO_LABELS))
    if role == "long_range" and not YARDSTICKS & set(figures):
        found.append(("look", "nothing checks these labels: draw boxes on some frames (config/boxes/)", UNCHECKED))
    for limit in LIMITS:
        value = figures.get(limit.metric)
        if value is None:
            continue
        level, text = of_figure(limit, value, fx)
        if level != "good" or limit.metric not in ("in_picture_share", "lost_pictures", "swapped_share"):
            found.append((level, text, limit.metric))
    ordered = sorted(found, key=lambda item: -LEVELS.index(item[0]))
    return Light(
        worst(level for level, _, _ in found),
        tuple(text for level, text, _ in ordered if level != "good"),
        tuple(text for level, text, _ in ordered if level == "good"),
        tuple((level, code, text) for level, text, code in ordered if level != "good"),
    )


def of_figure(limit: Limit, value: float, fx: float | None) -> tuple[str, str]:
    """(one of LEVELS, words) of a figure of a camera with focal length `fx` px, None where it is not known."""
    by = fx / REFERENCE_FX if limit.scaled_by_fx and fx else 1.0
    look, bad = limit.sign * limit.look * by, limit.sign * limit.bad * by
    level = "bad" if limit.sign * value > bad else "look" if limit.sign * value > look else "good"
    text = limit.words.format(show(value, limit.unit))
    return level, text if level == "good" else f"{text} (limit {show(limit.look * by, limit.unit)})"


def boxes_compared(figures: Mapping[str, float]) -> dict[str, float]:
    """The figures, with what hand boxes tell in place of the bare share in them: the first of BOXES_THAT_JUDGE.

    Where others drew, too, the mean of what these and the drawer whose boxes are used say: each has habits, and of two
    people's the middle is nearer to the truth than either.
    """
    found = dict(figures)
    lacking, beside = [], []
    for names in (BOXES_THAT_JUDGE, ("other_drawer",)):
        shares = ([found.get(f"{of}_{what}", np.nan) for what in ("expected", "share")] for of in names)
        lacking += [expected - share for expected, share in shares if np.isfinite(expected - share)][:1]
        # what hides a part of everybody leaves one axis untold: the other one says how far off labels are at least
        offsets = (np.array([found.get(f"{of}_offset_{axis}", np.nan) for axis in "uv"]) for of in names)
        beside += [np.nan_to_num(offset) for offset in offsets if np.isfinite(offset).any()][:1]
    if lacking:
        found["in_box_lacking"] = max(float(np.mean(lacking)), 0.0)
        found.pop("in_box_share", None)
    if beside:
        found["beside_boxes"] = float(np.linalg.norm(np.mean(beside, axis=0)))
    return found


def about(scope: str, names: Iterable[str]) -> bool:
    """Whether a finding's scope, words separated by "/", says nothing but `names` (of a sequence, camera, ...)."""
    return {word for word in scope.split("/") if word} <= set(names)


def findings_of(findings: Collection[Finding], sequence: str, within: Iterable[str], camera: str = "") -> list[Told]:
    """Those of `findings` that are about a sequence, or about one of its cameras. `within`: its session and subject.

    What is said of a camera that does not belong to the others comes first, and is about the sequence, too: its 3D is
    drawn by it.
    """
    names = {sequence, *within, camera} - {""}
    culprits = [
        (severity, code, text)
        for scope, severity, code, text in findings
        if code in culprit.CODES and {sequence, camera} - {""} <= set(scope.split("/"))
    ]
    return culprits + [
        (severity, code, text)
        for scope, severity, code, text in findings
        if code not in culprit.CODES
        and about(scope, names)
        and scope
        and ((camera in scope.split("/")) if camera else True)
    ]


def beside_culprit(light: Light, findings: Iterable[Finding], sequence: str, camera: str) -> Light:
    """The light of a camera, the other one that draws its labels first among its reasons."""
    named: dict[str, None] = {}
    for scope, _, code, _ in findings:
        first, *cameras = scope.split("/")
        if code in culprit.CODES and first == sequence and cameras and camera not in cameras:
            named |= dict.fromkeys(cameras)
    if not named or light.level == "good":
        return light
    text = f"the labels follow the 3D, which {' or '.join(named)} may have drawn aside: look there first"
    return replace(light, reasons=(text, *light.reasons), faults=((light.level, BESIDE_CULPRIT, text), *light.faults))


def by_mocap(findings: Iterable[Finding]) -> list[Finding]:
    """The findings, with whose fault it is where detections do not lie on the motion capture (`calibrate.clocks`).

    Where they do in no camera it is the C3D's, where they do in most a camera's. One alone cannot tell.
    """
    findings = list(findings)
    metres: dict[str, dict[str, dict[str, str]]] = {}
    for scope, _, code, text in findings:
        if code in ("mocap_apart", "mocap_agrees"):
            sequence, _, camera = scope.partition("/")
            metres.setdefault(sequence, {"mocap_apart": {}, "mocap_agrees": {}})[code][camera] = text.split()[0]
    found: list[Finding] = []
    for sequence, by_code in metres.items():
        apart, agree = by_code["mocap_apart"], by_code["mocap_agrees"]
        each = ", ".join(f"{camera} {off} m" for camera, off in sorted((apart | agree).items()))
        what = f"at the lag that fits best the joints of the motion capture are beside the detections by: {each}"
        mend = "is its pose (its marks) wrong, or are its detections another camera's, walk's or person's?"
        if len(apart) > 1 and not agree:
            text = (
                f"the motion capture is not that of this recording: {what}; is mocap.c3d another walk's, or does it "
                f"begin at quite another time (config/offsets/{sequence}.yaml)?"
            )
            found.append((sequence, "error", "culprit_c3d", text))
        elif len(apart) < len(agree):
            for camera in apart:
                text = f"{camera} does not belong to the others: {what}; {mend}"
                found.append((f"{sequence}/{camera}", "error", "culprit_camera", text))
        elif apart:
            text = (
                f"the motion capture and {', '.join(apart)} do not belong together, and it cannot be told whose fault "
                f"it is: {what}; is mocap.c3d another walk's? If not, of each camera: {mend}"
            )
            found.append(("/".join((sequence, *apart)), "error", "culprit_unclear", text))
    return [finding for finding in findings if finding[2] != "mocap_apart"] + found


def noticed(sequence: str, cameras: Iterable[str], pictures: Container[str], labelled: Container[str]) -> list[Finding]:
    """Findings of what is not there: a sequence that failed, a camera that is missing.

    `pictures`: those of its `cameras` that have recorded any; `labelled`: those that have labels.
    (scope, severity, code, text) tuples.
    """
    cameras, found = list(cameras), []
    if not any(camera in labelled for camera in cameras):
        text = (
            "the sequence failed: none of its cameras has labels; the logs say why, and an exclude_reason in "
            "config/sequences.tsv leaves it out"
        )
        found.append((sequence, "error", "sequence_failed", text))
    for camera in cameras:
        if camera not in pictures:
            text = "the camera is missing: the recordings of this sequence have no picture of it"
            found.append((f"{sequence}/{camera}", "error", "camera_missing", text))
    return found


def standing_out(rows: list[Row], environment: Mapping[str, str]) -> list[Finding]:
    """Findings about sequences whose labels are much further from the detections than those of the others.

    `rows`: of metrics.csv, `environment`: sequence -> indoor | outdoor.
    """
    errors = {
        row["sequence"]: row["value"]
        for row in rows
        if row["metric"] == "reprojection_error"
        and row["sequence"] in environment
        and row["role"] == "close"
        and not row["camera"]
        and not row["joint"]
    }
    found = []
    for sequence, error in errors.items():
        others = [e for s, e in errors.items() if s != sequence and environment[s] == environment[sequence]]
        if len(others) >= OTHERS and error > STANDS_OUT * np.median(others):
            text = (
                f"the error is high: labels are {show(error, 'px')} from the detections, where those of the other "
                f"sequences are {show(float(np.median(others)), 'px')}; look for a wrong offset of a clock, a "
                "bystander who was followed and a camera that was moved"
            )
            found.append((sequence, "warning", "high_error", text))
    return found


def lost_share(stamp_ns: Ints) -> float:
    """Share of pictures missing from stamps (F,) ns, by the gaps that are a multiple of the median period."""
    if len(stamp_ns) < 3:
        return 0.0
    steps = np.diff(np.sort(stamp_ns))
    lost = (np.rint(steps / np.median(steps)).astype(int) - 1).clip(0).sum()
    return float(lost / (lost + len(stamp_ns)))
