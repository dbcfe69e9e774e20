"""dior: from raw multi-camera gait captures to 2D and 3D skeleton labels.

What others may build on, each imported when it is first asked for (docs/api.md has examples):

- `Camera`, `Intrinsics`: a camera with its lens and its pose in the world
- `project_points`: world points to recorded pixels and depths
- `triangulate`: pixels of several cameras to 3D joints, without the views that disagree
- `read_project`: the config and the sheets of a project, checked
- `read_release`, `read_labels`: the walks and cameras of a released dataset, and the labels of one of its recordings
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from dior.geometry.camera import Camera, Intrinsics
    from dior.geometry.camera import project as project_points
    from dior.project.project import load as read_project
    from dior.reconstruct.robust import triangulate
    from dior.release.exports.recordings import labels_of as read_labels
    from dior.release.exports.recordings import read as read_release

__version__ = "0.2.0"
__all__ = (
    "Camera",
    "Intrinsics",
    "__version__",
    "project_points",
    "read_labels",
    "read_project",
    "read_release",
    "triangulate",
)

# public name -> the module and its name there
_PLACES = {
    "Camera": ("dior.geometry.camera", "Camera"),
    "Intrinsics": ("dior.geometry.camera", "Intrinsics"),
    "project_points": ("dior.geometry.camera", "project"),
    "triangulate": ("dior.reconstruct.robust", "triangulate"),
    "read_project": ("dior.project.project", "load"),
    "read_release": ("dior.release.exports.recordings", "read"),
    "read_labels": ("dior.release.exports.recordings", "labels_of"),
}


def __getattr__(name: str) -> Any:
    if name not in _PLACES:
        raise AttributeError(f"module 'dior' has no attribute '{name}'")
    module, own = _PLACES[name]
    return getattr(import_module(module), own)


def __dir__() -> list[str]:
    return sorted(__all__)
