"""The same cameras written in each format of calibrations, by the format's documentation or, OpenCV's, by OpenCV.

A writer takes a folder and cameras (`geometry.camera.Camera`) and returns by camera the file and its name in it.
"""

import json
import pickle

import cv2
import numpy as np
import yaml

from dior.geometry.camera import inverse_pose
from dior.release import export_cameras

FLIP = np.diag([1.0, -1.0, -1.0])


def _one(path, text, names):
    path.write_text(text)
    return {camera: (path, name) for camera, name in names.items()}


def pose2sim(folder, cameras):
    names = {camera.name: camera.name for camera in cameras}
    return _one(folder / "Calib.toml", export_cameras.pose2sim(cameras), names)


def anipose(folder, cameras, more="adjusted = true\nerror = 0.4\n"):
    """As `CameraGroup.dump` of aniposelib 0.8.0."""
    body = export_cameras.pose2sim(cameras).replace("fisheye = false\n", "").partition("[metadata]")[0]
    names = {camera.name: camera.name for camera in cameras}
    return _one(folder / "calibration.toml", f"{body}[metadata]\n{more}", names)


def freemocap(folder, cameras, floor=True):
    """As FreeMoCap 1.8.2, in mm, its board being the floor."""
    mm = [camera.at(_scaled(camera.wTc, 1000)) for camera in cameras]
    more = f"charuco_square_size = 39.0\ngroundplane_calibration = {'true' if floor else 'false'}\n"
    return anipose(folder, mm, more)


def caliscope(folder, cameras):
    """As `CameraArray.to_toml` of caliscope 0.11.8."""
    text, names = export_cameras.pose2sim(cameras).partition("[metadata]")[0], {}
    for number, camera in enumerate(cameras):
        text = text.replace(f'[{camera.name}]\nname = "{camera.name}"', f"[cameras.{number}]\ncam_id = {number}")
        names[camera.name] = str(number)
    return _one(folder / "camera_array.toml", text, names)


def kalibr(folder, cameras):
    names = {camera.name: f"cam{number}" for number, camera in enumerate(cameras)}
    return _one(folder / "camchain.yaml", export_cameras.kalibr(cameras, {}), names)


def opencv(folder, cameras, ending="yml"):
    found = {}
    for camera in cameras:
        lens, cTw = camera.intrinsics, inverse_pose(camera.wTc)
        path = folder / f"{camera.name}.{ending}"
        entries = {"image_width": lens.width, "image_height": lens.height, "camera_matrix": lens.K}
        entries |= {"distortion_coefficients": np.array([lens.distortion[:5]]), "R": cTw[:3, :3], "T": cTw[:3, 3:]}
        file = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
        for key, value in entries.items():
            file.write(key, np.ascontiguousarray(value) if isinstance(value, np.ndarray) else value)
        file.release()
        found[camera.name] = path, camera.name
    return found


def opencv_lists(folder, cameras):
    """As json.dump of Python writes arrays that tolist() made."""
    found = {}
    for camera in cameras:
        lens, cTw = camera.intrinsics, inverse_pose(camera.wTc)
        content = {"image_width": lens.width, "image_height": lens.height, "camera_matrix": lens.K.tolist()}
        content |= {"distortion_coefficients": list(lens.distortion[:5])}
        content |= {"R": cTw[:3, :3].tolist(), "T": cTw[:3, 3].tolist()}
        found |= _one(folder / f"{camera.name}_.json", json.dumps(content), {camera.name: f"{camera.name}_"})
    return found


def opencv_pair(folder, cameras):
    """The first two, as the stereo sample has them, and the size of the pictures that it leaves out."""
    first, second = cameras[:2]
    step = inverse_pose(second.wTc) @ first.wTc
    path = folder / "stereo.yml"
    file = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    entries = {"image_width": first.intrinsics.width, "image_height": first.intrinsics.height}
    for number, camera in enumerate((first, second), 1):
        entries |= {f"M{number}": camera.intrinsics.K, f"D{number}": np.array([camera.intrinsics.distortion[:5]])}
    for key, value in (entries | {"R": step[:3, :3].copy(), "T": step[:3, 3:].copy()}).items():
        file.write(key, value)
    file.release()
    return {first.name: (path, "1"), second.name: (path, "2")}


def ros_info(folder, cameras):
    found = {}
    for camera in cameras:
        lens = camera.intrinsics
        content = {
            "image_width": lens.width,
            "image_height": lens.height,
            "camera_name": camera.name,
            "camera_matrix": {"rows": 3, "cols": 3, "data": lens.K.ravel().tolist()},
            "distortion_model": "plumb_bob",
            "distortion_coefficients": {"rows": 1, "cols": 5, "data": list(lens.distortion[:5])},
        }
        found |= _one(folder / f"{camera.name}.yaml", yaml.safe_dump(content), {camera.name: camera.name})
    return found


def qualisys(folder, cameras):
    """As QTM exports them: mm, 1/64 px, y up and z backward."""
    parts = ["<?xml version='1.0' encoding='ASCII'?>\n<calibration type=\"regular\">\n<cameras>"]
    for camera in cameras:
        lens, turn = camera.intrinsics, FLIP @ camera.wRc.T
        x, y, z = 1000 * camera.centre
        k1, k2, p1, p2, k3 = lens.distortion[:5]
        edges = f'left="0" top="0" right="{lens.width - 1}" bottom="{lens.height - 1}"'
        cells = " ".join(f'r{i + 1}{j + 1}="{turn[i, j]!r}"' for i in range(3) for j in range(3)).replace(
            "np.float64", ""
        )
        parts.append(
            f'<camera active="1" calibrated="1" serial="{camera.name}"><fov_video {edges}/><fov_video_max {edges}/>\n'
            f'<transform x="{x:.17g}" y="{y:.17g}" z="{z:.17g}" {cells.replace("(", "").replace(")", "")}/>\n'
            f'<intrinsic focalLengthU="{64 * lens.fx:.17g}" focalLengthV="{64 * lens.fy:.17g}" '
            f'centerPointU="{64 * lens.cx:.17g}" centerPointV="{64 * lens.cy:.17g}" skew="0" sensorMinU="0" '
            f'sensorMinV="0" sensorMaxU="{64 * (lens.width - 1)}" sensorMaxV="{64 * (lens.height - 1)}" '
            f'radialDistortion1="{k1:.17g}" radialDistortion2="{k2:.17g}" radialDistortion3="{k3:.17g}" '
            f'tangentalDistortion1="{p1:.17g}" tangentalDistortion2="{p2:.17g}"/></camera>'
        )
    names = {camera.name: camera.name for camera in cameras}
    return _one(folder / "Calib.qca.txt", "\n".join([*parts, "</cameras>\n</calibration>\n"]), names)


def vicon(folder, cameras):
    """As Vicon's programs write them, without their lens: the pose and a pinhole of one focal length."""
    from scipy.spatial.transform import Rotation

    parts = ['<?xml version="1.0" encoding="UTF-8" standalone="no" ?>\n<Cameras NAME="" VERSION="1.0">']
    for number, camera in enumerate(cameras):
        lens = camera.intrinsics
        turn = " ".join(f"{one:.17g}" for one in Rotation.from_matrix(camera.wRc.T).as_quat())
        place = " ".join(f"{1000 * one:.17g}" for one in camera.centre)
        parts.append(
            f'<Camera DEVICEID="{number}" NAME="{camera.name}" PIXEL_ASPECT_RATIO="1" SKEW="0" '
            f'SENSOR_SIZE="{lens.width} {lens.height}"><KeyFrames><KeyFrame FOCAL_LENGTH="{lens.fx:.17g}" '
            f'ORIENTATION="{turn}" POSITION="{place}" PRINCIPAL_POINT="{lens.cx:.17g} {lens.cy:.17g}" '
            'VICON_RADIAL2="Vicon3Parameter 0 0 0 0 0"/></KeyFrames></Camera>'
        )
    return _one(
        folder / "lab.xcp", "\n".join([*parts, "</Cameras>\n"]), {camera.name: camera.name for camera in cameras}
    )


def opencap(folder, cameras):
    """As opencap-core's saveCameraParameters, in mm."""
    found = {}
    for number, camera in enumerate(cameras):
        lens, cTw = camera.intrinsics, inverse_pose(camera.wTc)
        content = {
            "intrinsicMat": lens.K,
            "distortion": np.array([lens.distortion[:5]]),
            "imageSize": np.array([[float(lens.height)], [float(lens.width)]]),
            "rotation": cTw[:3, :3],
            "translation": 1000 * cTw[:3, 3:],
        }
        path = folder / f"Cam{number}" / "cameraIntrinsicsExtrinsics.pickle"
        path.parent.mkdir()
        path.write_bytes(pickle.dumps(content))
        found[camera.name] = path, f"Cam{number}"
    return found


def _scaled(wTc, by):
    out = wTc.copy()
    out[:3, 3] *= by
    return out


# writer -> what a camera's YAML has to say of its poses: units, world
WRITERS = {
    pose2sim: ("", "as_given"),
    caliscope: ("", "as_given"),
    anipose: ("m", "as_given"),
    freemocap: ("", "as_given"),
    kalibr: ("", "from_walk"),
    opencv: ("m", "as_given"),
    opencv_lists: ("m", "as_given"),
    opencv_pair: ("m", "from_walk"),
    qualisys: ("", "as_given"),
    vicon: ("", "as_given"),
    opencap: ("", "from_walk"),
}
