"""2D labels of one camera: the 3D skeleton at every picture's own stamp, projected.

INPUTS   skeleton (`skeletons_3d`: mocap indoors, triangulated outdoors), the camera, frames, offsets
OUTPUTS  `labels_2d`: one row per frame and joint, px in the recorded picture
Paper, section 3D-2D re-projection. A label is evaluated at its picture's stamp, between the instants of the skeleton.
"""

import numpy as np

from dior import camera as cam
from dior import tables
from dior.errors import DiorError
from dior.sampling import at_pictures


def labels(camera, points):
    """Pixels (F, J, 2), depth (F, J) m and status (F, J) of world points (F, J, 3).

    A label outside the picture keeps its pixel; behind the camera there is none.
    """
    uv, depth = cam.project(camera, points)
    known = np.isfinite(points).all(axis=-1)
    with np.errstate(invalid="ignore"):
        behind = known & (depth <= 0)
    status = np.where(
        ~known,
        "missing_3d",
        np.where(behind, "behind_camera", np.where(cam.in_frame(camera.intrinsics, uv), "ok", "out_of_frame")),
    )
    return uv, np.where(known, depth, np.nan), status


def run(*, sequence, subject, camera, cameras, skeleton, frames, offsets, source, out):
    """Write the labels of one camera of one sequence. `cameras`: `cameras` tables, one of which holds the camera."""
    rig = tables.read_cameras(cameras)
    if camera not in rig or rig[camera].wTc is None:
        raise DiorError(f"{sequence}, camera {camera}: {', '.join(map(str, cameras))} gives no pose of it")
    rows = tables.of_camera(tables.read(frames, "frames"), camera)
    if not len(rows["frame"]):
        raise DiorError(f"{sequence}, camera {camera}: {frames} lists no picture of it")
    cam.check_picture_size(rig[camera].intrinsics, rows["width"][0], rows["height"][0], f"{sequence}, camera {camera}")
    clock = tables.read(offsets, "offsets")
    mine = np.flatnonzero(clock["camera"] == camera)
    if not len(mine):
        raise DiorError(f"{sequence}, camera {camera}: {offsets} has no clock for it")
    offset_s, drift_ppm = clock["offset_s"][mine[0]], clock["drift_ppm"][mine[0]]
    points, bridged, joints = at_pictures(tables.read(skeleton, "skeletons_3d"), rows["stamp_ns"], offset_s, drift_ppm)
    uv, depth, status = labels(rig[camera], points)
    count, each = status.shape
    once = np.zeros(count * each, int)
    words = [source, "interpolated"]
    has_source = (status != "missing_3d").ravel()
    tables.write(
        out,
        "labels_2d",
        {
            "subject": tables.Repeated([subject], once),
            "sequence": tables.Repeated([sequence], once),
            "camera": tables.Repeated([camera], once),
            "joint": tables.Repeated(joints, np.tile(np.arange(each), count)),
            "frame": np.repeat(rows["frame"], each),
            "stamp_ns": np.repeat(rows["stamp_ns"], each),
            "u": uv[..., 0].ravel(),
            "v": uv[..., 1].ravel(),
            "depth": depth.ravel(),
            "status": status.ravel(),
            "source": tables.Repeated(words, np.where(has_source, bridged.ravel().astype(int), -1)),
        },
    )
