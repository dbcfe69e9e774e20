"""What is wrong with a recording, camera by camera: time, space, world, lens; with its size and what to do.

INPUTS   a `Recording`
OUTPUTS  `Judged`: a `Row` for each camera, the faults of the recording, a verdict in one sentence
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from dior.assess import explain, lens, space, timing
from dior.assess.recording import Recording, View, common_grid, matched
from dior.body import wrong_world
from dior.body.plausible import Fault
from dior.calibrate.clock.from_mocap import WalkerJoints
from dior.errors import many
from dior.geometry import culprit

# chosen: a picture is of the nearest label, so that half of one is no error of a numbering
TOLERATED_PICTURES = 0.5
# of the world, what is told of 3D that fits its cameras; where its floor is and how fast somebody goes is theirs
OF_WORLD = ("world_scale", "world_left_handed")
# chosen: a detector that smooths over time is late by so much at most, since a step would be lost in more
SMOOTHED_S = 0.1
NOTHING_TO_COMPARE = "there is 2D without 3D in one camera: nothing to compare it with"


@dataclass(frozen=True, eq=False)
class Row:
    """A camera: `timing` against the 3D (or the first camera, where there is none), None where nothing is compared;
    `beside`, `lens`: None where not known; `faults`; `why`: why it cannot be told, or ""."""

    camera: str
    fps: float
    timing: timing.Timing | None
    beside: space.Beside | None
    lens: lens.Lens | None
    faults: tuple[Fault, ...]
    why: str = ""


@dataclass(frozen=True, eq=False)
class Judged:
    """`faults` are those of the recording as a whole, `world` how the 3D lies in the calibration's world, where told;
    `against`: what the times are told against."""

    name: str
    rows: tuple[Row, ...]
    faults: tuple[Fault, ...]
    world: explain.World | None
    against: str
    notes: tuple[str, ...]

    @property
    def wrong(self) -> bool:
        return bool(self.faults) or any(row.faults for row in self.rows)

    @property
    def told(self) -> bool:
        """Whether anything could be told of any camera."""
        return self.wrong or any(not row.why for row in self.rows)

    @property
    def verdict(self) -> str:
        """One sentence: within the errors, or what is wrong, or why nothing can be told."""
        own = [fault.text for fault in self.faults]
        own += [f"{row.camera}: {fault.text}" for row in self.rows for fault in row.faults]
        if own:
            return f"wrong: {'; '.join(own)}{self._lenses}"
        unknown = [row for row in self.rows if row.why]
        if not unknown:
            return f"within the errors in {many(len(self.rows), 'camera')}{self._lenses}"
        why = "; ".join(f"{row.camera}: {row.why}" for row in unknown)
        rest = len(self.rows) - len(unknown)
        within = f"; within the errors in {many(rest, 'other camera')}" if rest else ""
        return f"cannot tell ({why}){within}{self._lenses}"

    @property
    def _lenses(self) -> str:
        """Of which lenses nothing can be told, as the end of a sentence."""
        of = [row for row in self.rows if row.lens is not None and lens.untold([row.lens])]
        if not of:
            return ""
        which = "" if len(of) == len(self.rows) else f" of {', '.join(row.camera for row in of)}"
        return f"; the lens{which}: cannot tell ({lens.untold([row.lens for row in of if row.lens is not None])})"


def judged(recording: Recording) -> Judged:
    """`Judged` of a recording, by its 3D where there is any, else by its cameras against each other."""
    return _with_motion(recording) if recording.motion is not None else _views_alone(recording)


def _with_motion(recording: Recording) -> Judged:
    found = explain.explained(recording)
    right = found.recording
    assert right.motion is not None
    walker = right.motion.only(right.joints)
    rows = []
    for view, apart in zip(right.views, found.apart_m, strict=True):
        name = view.camera.name
        faults = [fault for about, fault in found.faults if about == name]
        if not apart <= explain.FITS_M:
            rows.append(_not_told(view, apart))
            continue
        rows.append(_of_camera(matched(view, right.joints, walker), walker, faults))
    whole = [fault for about, fault in found.faults if not about]
    whole += _of_all_times(rows)
    world = explain.aligned(_at_right_times(right, rows)) if all(not row.why for row in rows) else None
    codes = {fault.code for about, fault in found.faults if not about}
    if world is not None and not codes and not any(row.faults for row in rows if row.lens and row.lens.wrong):
        whole += [fault for fault in explain.world_faults(world) if fault.code != "world_shift"]
    of_person = wrong_world.of_person(recording.motion.xyz, recording.motion.names) if recording.motion else []
    told = {fault.code for fault in whole}
    whole += [_of_3d(fault) for fault in of_person if fault.code in OF_WORLD and fault.code not in told]
    return Judged(recording.name, tuple(rows), tuple(whole), world, "the 3D", recording.notes)


def _of_3d(fault: Fault) -> Fault:
    """A fault of the world as one of the 3D, without the keys of a project."""
    return Fault(fault.code, fault.text.replace("the world is", "the 3D is").partition(" (physics")[0])


def _not_told(view: View, apart: float) -> Row:
    why = (
        f"its 2D lies {apart:.2f} m beside the 3D at its best, and neither other cameras' 2D, other units, axes "
        "or poses nor another picture size explain it"
        if np.isfinite(apart)
        else "no joint is both in its 2D and in the 3D at the same time"
    )
    fault = (Fault("apart", why),) if np.isfinite(apart) else ()
    return Row(view.camera.name, view.fps, None, None, None, fault, "" if fault else why)


def _of_camera(view: View, walker: WalkerJoints, faults: list[Fault]) -> Row:
    """Time, lens and place of a camera that belongs to the 3D."""
    time = timing.of_view(view, walker)
    if time.why:
        return Row(view.camera.name, view.fps, time, None, None, tuple(faults), time.why)
    times = time.at(view.elapsed)
    bend = lens.of_view(view, walker, times)
    beside = space.of_view(view, walker, times)
    faults = [*faults, *time_faults(time, view.fps)]
    # a camera whose lens or pose is wrong lies beside as well
    if bend.wrong and not {fault.code for fault in faults} & {"image_scale", "pose"}:
        faults.append(_lens_fault(bend, drift_told=bool(np.isfinite(time.sigma_drift))))
    elif beside is not None and beside.wrong and not {fault.code for fault in faults} & {"image_scale", "pose"}:
        faults.append(_beside_fault(beside))
    return Row(view.camera.name, view.fps, time, beside, bend, tuple(faults))


def _at_right_times(recording: Recording, rows: Sequence[Row]) -> Recording:
    views = [
        replace(view, elapsed=row.timing.at(view.elapsed)) if row.timing is not None else view
        for view, row in zip(recording.views, rows, strict=True)
    ]
    return replace(recording, views=tuple(views))


def time_faults(time: timing.Timing, fps: float) -> list[Fault]:
    """What is wrong with the times of a camera beyond their intervals and half a picture."""
    tolerated = TOLERATED_PICTURES / fps
    found = []
    if abs(time.late_s) - time.half_s > tolerated:
        text = (
            f"its pictures are {abs(time.late_s):.3f} ± {time.half_s:.3f} s ({abs(time.late_s) * fps:.1f} pictures) "
            f"too {'early' if time.late_s > 0 else 'late'}: add {time.late_s:+.3f} s to their times"
        )
        found.append(Fault("offset", text))
    if (abs(time.drift) - time.half_drift) * time.length_s / 2 > tolerated:
        real = fps / (1 + time.drift)
        text = (
            f"its clock drifts by {1e6 * time.drift:+.0f} ± {1e6 * time.half_drift:.0f} ppm "
            f"({60e3 * time.drift:+.0f} ms a minute): {fps:.6g} pictures a second are {real:.6g}"
        )
        found.append(Fault("drift", text))
    if time.steps_s:
        text = f"its times step by up to {abs(time.steps_s):.3f} s: pictures, or frames of the 3D, are missing"
        found.append(Fault("step", text))
    return found


def _of_all_times(rows: Sequence[Row]) -> list[Fault]:
    """What may be the cause where every camera, of two or more, is late, or every one is early."""
    if len(rows) < 2 or not all("offset" in {fault.code for fault in row.faults} for row in rows):
        return []
    times = [row.timing for row in rows if row.timing is not None]
    off, half = np.array([time.late_s for time in times]), max(time.half_s for time in times)
    if len(set(np.sign(off))) > 1:
        return []
    low, high = sorted(np.abs(off))[0], sorted(np.abs(off))[-1]
    same = bool(high - low <= 2 * half + TOLERATED_PICTURES / min(row.fps for row in rows))
    said = f"the 2D of all cameras is too {'early' if off[0] > 0 else 'late'}, by {low:.3f} to {high:.3f} s"
    if off[0] < 0 and high <= SMOOTHED_S:
        return [Fault("all_offset", f"{said}: a detector that smooths over time, or the stamps")]
    if same:
        return [Fault("all_offset", f"{said}: the times of the 3D, or the stamps of all cameras")]
    return []


def _lens_fault(bend: lens.Lens, drift_told: bool) -> Fault:
    sized = []
    if bend.focal_wrong:
        sized.append(f"its focal length is {bend.focal:.3f} ± {bend.half_focal:.3f} times the calibration's")
    if bend.k1_wrong:
        sized.append(f"its k1 is {bend.k1:+.3f} ± {bend.half_k1:.3f} from the calibration's")
    text = f"its lens is wrong: {' and '.join(sized)}, {bend.edge_px:.0f} px at the edge; use its own intrinsics"
    # whoever goes along the picture at wrong times is where another lens would have them
    return Fault("lens", text if drift_told else f"{text} (or its clock drifts: the recording is too short to tell)")


def _beside_fault(beside: space.Beside) -> Fault:
    (u, v), (du, dv) = beside.px, beside.half_px
    text = (
        f"its 2D lies ({u:+.1f} ± {du:.1f}, {v:+.1f} ± {dv:.1f}) px beside the 3D, {100 * beside.metres:.0f} cm at the "
        "person: its pose is off, or the 2D was cropped or shifted"
    )
    return Fault("beside", text)


def _views_alone(recording: Recording) -> Judged:
    """A recording without 3D: its cameras against each other."""
    views, against = recording.views, f"{recording.views[0].camera.name}"
    if len(views) < 2:
        rows = tuple(Row(v.camera.name, v.fps, None, None, None, (), NOTHING_TO_COMPARE) for v in views)
        return Judged(recording.name, rows, (), None, against, recording.notes)
    grid = common_grid(views)
    if len(grid) < culprit.LEAST_INSTANTS:
        why = "its pictures and those of the others are of no time in common"
        rows = tuple(Row(v.camera.name, v.fps, None, None, None, (), why) for v in views)
        return Judged(recording.name, rows, (), None, against, recording.notes)
    faults: list[Fault] = []
    own: dict[str, Fault] = {}
    if not explain.agree(recording):
        recording, faults, own = _put_right(recording)
    rows = tuple(_against_first(recording, own))
    return Judged(recording.name, rows, tuple(faults), None, against, recording.notes)


def _put_right(recording: Recording) -> tuple[Recording, list[Fault], dict[str, Fault]]:
    """The recording without what explains why its views do not agree, the faults, and those of single cameras."""
    cameras = [view.camera for view in recording.views]
    verdict = explain.judged(recording)
    if verdict is not None and len(verdict.readings) == 1:
        (one,) = verdict.readings
        if one.exchange:
            a, b = one.cameras
            views = list(recording.views)
            views[a], views[b] = explain.given_to(views[a], views[b]), explain.given_to(views[b], views[a])
            fault = explain.exchange_fault([cameras[i].name for i in one.cameras])
            return replace(recording, views=tuple(views)), [fault], {}
        if one.pose is not None and one.posed:
            text = (
                f"its pose is wrong: the views agree once it is turned by {one.pose.turn_deg:.1f} degrees and moved by "
                f"{one.pose.shift_m:.2f} m (or its clock is); calibrate it again"
            )
            return recording, [], {cameras[one.cameras[0]].name: Fault("pose", text)}
    _, uv = explain.synced(recording)
    reading, _ = wrong_world.other_reading(cameras, uv, recording.joints)
    if reading is not None:
        views = [replace(v, camera=c) for v, c in zip(recording.views, reading.cameras, strict=True)]
        return replace(recording, views=tuple(views)), [Fault("poses", f"the calibration {reading.words}")], {}
    return recording, [], {}


def _against_first(recording: Recording, own: dict[str, Fault]) -> list[Row]:
    """Each camera against the first, by all of them."""
    grid = common_grid(recording.views)
    whole = explain.clocks_of(recording, grid)
    length = float(grid[-1] - grid[0])
    parts: list[tuple[float, dict[str, tuple[float, float, str]]]] = []
    count = min(int(length / timing.PART_S), timing.MOST_PARTS)
    if count >= timing.FEWEST_PARTS:
        for part in np.array_split(grid, count):
            found = explain.clocks_of(recording, part)
            parts.append((float(part.mean()), {name: timing.late(one) for name, one in found.items()}))
    rows = []
    for i, view in enumerate(recording.views):
        name = view.camera.name
        faults = [own[name]] if name in own else []
        if not i:
            rows.append(Row(name, view.fps, None, None, None, tuple(faults)))
            continue
        late, sigma, why = timing.late(whole[name])
        middle = float((grid[0] + grid[-1]) / 2)
        told = [(at - middle, *found[name][:2]) for at, found in parts if not found[name][2]]
        time = timing.of_parts(told, late, sigma, why, middle, length, view.fps)
        faults += time_faults(time, view.fps) if not time.why else []
        rows.append(Row(name, view.fps, time, None, None, tuple(faults), time.why if not faults else ""))
    return rows
