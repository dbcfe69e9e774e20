"""Inverse kinematics by OpenSim: a model of a walker's own segments, and its angles at every instant.

INPUTS   `Skeleton` (segments.py), a TRC file of the same points
OUTPUTS  an OpenSim model; coordinates (T, C), degrees and m
The model is dior's own, made for kinematics: rigid segments of 1 kg, no muscles. A hip is a ball, a knee a hinge, an
ankle bends and turns, the pelvis is free and the trunk a ball on it. Names and signs of the coordinates are those of
OpenSim's gait models (Rajagopal et al., IEEE Trans. Biomed. Eng. 63 (2016) 2068-2079), but the pelvis turns by
rotation, list and tilt in this order (Baker, Gait & Posture 13 (2001) 1-6), which is right whatever way people walk.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from dior.arrays import Bools, Floats
from dior.release.angles.segments import Segment, Skeleton

if TYPE_CHECKING:
    import opensim

X, Y, Z = (1, 0, 0), (0, 1, 0), (0, 0, 1)
_PELVIS = (("pelvis_rotation", Y), ("pelvis_list", X), ("pelvis_tilt", Z))
_TRUNK = (("lumbar_extension", Z), ("lumbar_bending", X), ("lumbar_rotation", Y))
SHIFTS = ("pelvis_tx", "pelvis_ty", "pelvis_tz")
# chosen: with that of OpenSim's tool, 1e-5, turns about long axes end half a degree from where they would come to
ACCURACY = 1e-6
# chosen: a hip is known to a few centimetres only, and legs that hang in a wrong place would tilt the pelvis
WEIGHT_OF_PELVIS = 10.0
# of a locked coordinate; that of OpenSim's tool
CONSTRAINTS = 20.0


def turns(segment: str) -> tuple[tuple[str, tuple[int, int, int]], ...]:
    """The angles by which a segment turns against the one above it, in their order, each about an axis of its own."""
    part, _, end = segment.partition("_")
    x, y = (X, Y) if end == "r" else ((-1, 0, 0), (0, -1, 0))
    return {
        "pelvis": _PELVIS,
        "torso": _TRUNK,
        "femur": ((f"hip_flexion_{end}", Z), (f"hip_adduction_{end}", x), (f"hip_rotation_{end}", y)),
        "tibia": ((f"knee_angle_{end}", (0, 0, -1)),),
        "foot": ((f"ankle_angle_{end}", Z), (f"ankle_rotation_{end}", y)),
    }[part]


def angles_of(skeleton: Skeleton) -> list[str]:
    """The angles of a skeleton, in order; the tilt of a trunk that has none of its own is not among them."""
    names = [name for segment in skeleton.segments for name, _ in turns(segment.name)]
    return [name for name in names if not (skeleton.stiff and name == "lumbar_extension")]


def model_of(skeleton: Skeleton, name: str) -> "opensim.Model":
    """The model of a skeleton."""
    import opensim

    model = opensim.Model()
    model.setName(name)
    bodies = {"": model.getGround()}
    for segment in skeleton.segments:
        body = opensim.Body(segment.name, 1.0, opensim.Vec3(0), opensim.Inertia(0.01, 0.01, 0.01))
        model.addBody(body)
        model.addJoint(_joint(segment, bodies[segment.above], body))
        bodies[segment.name] = body
        for marker, place in segment.markers.items():
            model.addMarker(opensim.Marker(marker, body, _vector(place)))
    model.finalizeConnections()
    if skeleton.stiff:
        model.updCoordinateSet().get("lumbar_extension").set_locked(True)
    return model


def _joint(segment: Segment, above: "opensim.PhysicalFrame", body: "opensim.Body") -> "opensim.CustomJoint":
    import opensim

    transform = opensim.SpatialTransform()
    moves = list(enumerate(turns(segment.name)))
    if not segment.above:
        moves += [(3 + i, move) for i, move in enumerate(zip(SHIFTS, (X, Y, Z), strict=True))]
    used = [axis for i, (_, axis) in moves if i < 3]
    # no two axes of a joint may be parallel, those that do not turn included
    for i, axis in enumerate([*used, *[one for one in (X, Y, Z) if np.abs(np.array(used) @ one).max() == 0]][:3]):
        transform.updTransformAxis(i).setAxis(opensim.Vec3(*axis))
    for i, (name, axis) in moves:
        along = transform.updTransformAxis(i)
        along.setCoordinateNames(opensim.ArrayStr(name, 1))
        along.setAxis(opensim.Vec3(*axis))
        along.set_function(opensim.LinearFunction(1.0, 0.0))
    none = opensim.Vec3(0)
    return opensim.CustomJoint(
        f"{segment.name}_joint", above, _vector(segment.joint), none, body, none, none, transform
    )


def _vector(values: Floats) -> "opensim.Vec3":
    import opensim

    return opensim.Vec3(*(float(value) for value in values))


def known_of(skeleton: Skeleton, seen: Mapping[str, Bools]) -> dict[str, Bools]:
    """Whether each segment is known (T,): enough of its markers are `seen` (T,), and the trunk that tilts a pelvis."""
    known: dict[str, Bools] = {}
    for one in skeleton.segments:
        known[one.name] = np.asarray(np.sum([seen[name] for name in one.markers], axis=0) >= one.needs)
    if skeleton.stiff:
        known["pelvis"] = known["pelvis"] & known["torso"]
    return known


def told_by(segment: Segment) -> tuple[str, ...]:
    """The segments that have to be known for the angles of a segment; a hip's turn shows in the shank."""
    below = (segment.name.replace("femur", "tibia"),) if segment.name.startswith("femur") else ()
    return (segment.name, *below, *([segment.above] if segment.above else []))


def solved(skeleton: Skeleton, model: "opensim.Model", trc: Path, seen: Mapping[str, Bools]) -> dict[str, Floats]:
    """Coordinates (T,) by name, degrees (shifts: m), of the markers in a TRC file; NaN where not known.

    `seen` (T,) by marker. Where the pelvis was not known before, the search begins at `middle` and `heading`.
    """
    import opensim

    state = model.initSystem()
    weights = opensim.SetMarkerWeights()
    for segment in skeleton.segments:
        for marker in segment.markers:
            weight = 1.0 if segment.above or skeleton.stiff else WEIGHT_OF_PELVIS
            weights.cloneAndAppend(opensim.MarkerWeight(marker, weight))
    reference = opensim.MarkersReference(str(trc), weights)
    solver = opensim.InverseKinematicsSolver(model, reference, opensim.SimTKArrayCoordinateReference(), CONSTRAINTS)
    solver.setAccuracy(ACCURACY)
    coordinates = {one.getName(): one for one in model.getCoordinateSet()}
    known = known_of(skeleton, seen)
    names = [*angles_of(skeleton), *SHIFTS]
    wanted = [coordinates[name] for name in names]
    times = reference.getMarkerTable().getIndependentColumn()
    values = np.full((len(times), len(names)), np.nan)
    at = -2
    for i in np.flatnonzero(known["pelvis"]).tolist():
        state.setTime(times[i])
        if i > at + 1:
            start = (skeleton.heading[i], *skeleton.middle[i])
            for name, value in zip(("pelvis_rotation", *SHIFTS), start, strict=True):
                coordinates[name].setValue(state, float(value), False)
            solver.assemble(state)
        else:
            solver.track(state)
        at = i
        values[i] = [one.getValue(state) for one in wanted]
    out = dict(zip(names, values.T, strict=True))
    for segment in skeleton.segments:
        unknown = ~np.logical_and.reduce([known[name] for name in told_by(segment)])
        for name, _ in turns(segment.name):
            if name in out:
                out[name] = np.rad2deg(np.where(unknown, np.nan, out[name]))
    return out
