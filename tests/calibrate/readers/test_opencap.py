"""OpenCap's pickle, written here as opencap-core and Pose2Sim's converter write it; and pickles that are programs."""

import pickle
import pickletools

import numpy as np
import pytest

from dior.calibrate.intrinsics import from_file
from dior.calibrate.place import reference_pose
from dior.calibrate.readers import opencap
from dior.errors import DiorError
from dior.geometry.camera import inverse_pose
from tests.calibrate.readers import rigs

PROTOCOLS = (2, 3, 4, 5)


def content(**change):
    cTw = inverse_pose(rigs.poses()[1])
    return {
        "intrinsicMat": rigs.K,
        "distortion": np.array([rigs.D]),
        "imageSize": np.array([[720.0], [1280.0]]),
        "rotation": cTw[:3, :3],
        "translation": 1000 * cTw[:3, 3:],
        "rotation_EulerAngles": np.zeros((3, 1)),
    } | change


def written(folder, value, protocol=4):
    path = folder / "Cam1" / "cameraIntrinsicsExtrinsics.pickle"
    path.parent.mkdir(exist_ok=True)
    path.write_bytes(value if isinstance(value, bytes) else pickle.dumps(value, protocol))
    return path


@pytest.mark.parametrize("protocol", PROTOCOLS)
@pytest.mark.parametrize("older", [False, True])
def test_pose_and_lens_by_the_name_of_the_file_or_of_its_folder(tmp_path, protocol, older):
    raw = pickle.dumps(content(), protocol)
    if older:
        raw = renamed(raw)
    path = written(tmp_path, raw)
    for name in ("Cam1", "cameraIntrinsicsExtrinsics"):
        rigs.same_pose(reference_pose(path, name, world="from_walk"), rigs.poses()[1])
        rigs.same_lens(path, name)


def renamed(raw):
    """The same pickle as numpy 1 writes it, whose module is `numpy.core`; frames and lengths are made anew."""
    found = pickle.loads(raw)
    protocol = raw[1]

    class Older(pickle._Pickler):
        def save_global(self, value, name=None):
            module = getattr(value, "__module__", "")
            if module.startswith("numpy._core"):
                self.write(pickle.GLOBAL + f"{module.replace('_core', 'core')}\n{value.__name__}\n".encode())
                self.memoize(value)
            else:
                super().save_global(value, name)

        dispatch = pickle._Pickler.dispatch | {type(test_it_has_no_floor): save_global, type(len): save_global}

    import io

    out = io.BytesIO()
    Older(out, protocol).dump(found)
    assert b"numpy.core" in out.getvalue()
    return out.getvalue()


def test_it_has_no_floor(tmp_path):
    path = written(tmp_path, content())
    with pytest.raises(DiorError, match="its world is that of OpenCap's checkerboard, which stands.*from_walk"):
        reference_pose(path, "Cam1")
    with pytest.raises(DiorError, match="its unit is mm by its format, and .* says m;"):
        reference_pose(path, "Cam1", units="m", world="from_walk")


@pytest.mark.parametrize("dtype", ["f4", ">f8", "i8", "u2"])
@pytest.mark.parametrize("order", "CF")
def test_arrays_of_other_numbers_and_orders(tmp_path, dtype, order):
    K = np.array([[900, 0, 640], [0, 901, 360], [0, 0, 1]]).astype(dtype, order=order)
    path = written(tmp_path, content(intrinsicMat=K, distortion=np.array(rigs.D), imageSize=np.array([720, 1280])))
    rigs.same_lens(path, "Cam1", matrix=K.astype(float))


class Runs:
    """What a pickle can do: call anything."""

    def __init__(self, call, *arguments):
        self.call, self.arguments = call, arguments

    def __reduce__(self):
        return self.call, self.arguments


@pytest.mark.parametrize("protocol", PROTOCOLS)
@pytest.mark.parametrize("call", [exec, open, getattr, np.load, np.fromfile, pickle.loads])
def test_nothing_is_run(tmp_path, protocol, call):
    target = tmp_path / "made"
    code = f"open({str(target)!r}, 'w')"
    value = content(more=Runs(call, *([code] if call is exec else [str(target), "w"])))
    path = written(tmp_path, value, protocol)
    with pytest.raises(DiorError, match=r"the pickle asks for .*, which is no number; nothing of it was run") as caught:
        reference_pose(path, "Cam1")
    assert str(path) in str(caught.value) and not target.exists()


def nested(depth):
    """A dict whose key is a tuple in a tuple in a tuple ...: its hash would end the stack."""
    return pickle.PROTO + b"\x02}" + b")" + pickle.TUPLE1 * depth + b"K\x01s."


@pytest.mark.parametrize(
    ("raw", "sentence"),
    [
        (nested(500_000), "has more than 10000 steps"),
        (nested(5_000), "has no `intrinsicMat`"),
        (pickle.dumps([1, 2]), "has no `intrinsicMat`"),
        (pickle.dumps(content())[:-40], "not readable as a pickle"),
        (b"\x80\x04.", "not readable as a pickle"),
        (b"\x80\x7f" + pickle.dumps(content())[2:], "not readable as a pickle"),
        (b"\x80\x04r\xff\xff\xff\xff.", "not readable as a pickle"),
    ],
)
def test_pickles_that_are_none(tmp_path, raw, sentence):
    path = written(tmp_path, raw)
    with pytest.raises(DiorError, match=sentence) as caught:
        reference_pose(path, "Cam1")
    assert str(path) in str(caught.value)


def test_an_array_has_as_many_numbers_as_it_says():
    """A shape of a terabyte, and an array of objects, are never made."""
    for shape in ((1 << 40,), (-9,), (3, 4), (True,) * 9):
        state = (1, shape, opencap._Dtype("f8"), False, bytes(72))
        with pytest.raises(ValueError, match="another size"):
            opencap._array().__setstate__(state)
    with pytest.raises(ValueError, match="an array of 'O'"):
        opencap._array().__setstate__((1, (1,), opencap._Dtype("O"), False, bytes(8)))


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"distortion": np.zeros((1, 3))}, "`distortion` must be"),
        ({"imageSize": np.zeros((2, 1))}, "pictures of 0 x 0 px cannot be"),
        ({"intrinsicMat": "K"}, "`intrinsicMat` must be 3 x 3 numbers"),
        ({"distortion": np.array(["a", "b"], object)}, r"not readable as a pickle \(an array of 'O8'"),
    ],
)
def test_what_is_refused(tmp_path, change, sentence):
    with pytest.raises(DiorError, match=sentence):
        from_file(written(tmp_path, content(**change)), "Cam1")
    assert len(list(pickletools.genops(pickle.dumps(content())))) < opencap.MOST_STEPS / 50
