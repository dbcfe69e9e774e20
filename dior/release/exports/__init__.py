"""Exports: the release in the formats of the tools that use such data.

INPUTS   a finished release folder, nothing else
OUTPUTS  beside the release: a folder <format>/ for each format, README.md (what each is, how to load it), SHA256SUMS
What is about one camera is read once for all formats that want it, and so is what is about a walk. Same release, same
bytes. Each format is a module with `ABOUT`, its part of the README, and `writer(folder, release)`, a context that
yields a function to be called with every recording and its pose, or with every walk and its body.
"""

from contextlib import ExitStack
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

from dior.errors import DiorError, nearest
from dior.progress import reporting
from dior.release import checksums
from dior.tables.files import folder_written_whole, write_text

if TYPE_CHECKING:
    from dior.release.exports.recordings import Release

BY_RECORDING = ("coco", "opengait", "gaitgraph", "webdataset")
BY_WALK = ("trc", "c3d", "bids")
FORMATS = (*BY_RECORDING, *BY_WALK)
# the tables of recordings and walks that are exported
READ = ("labels_2d", "skeletons_3d", "frames", "gait_events")
HEAD = """\
# {name}: exports

Made from the release `{name}` alone, by subject's pseudonym and with its licence and terms; its `README.md` says what
the labels are and how good they are. `sha256sum -c SHA256SUMS` checks this folder. What is `suspect` in the
release has no place here either: no keypoint, no point, and where a format knows no empty recording, none.

COCO-17 is taken by name from labels that have these joints (outdoor). Indoor labels are motion capture markers: joint
centres are derived from them in 3D by rules (below) and projected at each picture's own stamp. They are marked as
derived; what the rules themselves are wrong by is not in their sigma: against the simulated skeleton 2 cm in the mean,
5 cm at the hips; against what Plug-in-Gait made of a real walk, with that subject's own widths, 16 mm at the hips,
10 mm at knees and ankles.

| joints | rule |
|---|---|
| hips | from the middle of LASI and RASI, their distance W: 0.19 W back, 0.30 W down, 0.36 W outwards (Bell, Brand) |
| knees, ankles | half the width of the joint (knee 105 mm, ankle 72 mm) and of a marker (14 mm) inwards of KNE or \
ANK, with a right angle at the joint, in the plane of THI or TIB (Plug-in-Gait) |
| shoulders | 45 mm and half a marker below SHO, with a right angle to the middle of the thorax (Plug-in-Gait) |
| elbows | half of 75 mm and of a marker inwards of ELB, along the axis that upper arm and forearm stand on |
| wrists | the middle of WRA and WRB |
| nose, eyes, ears | offsets from the head band, in proportion to it |

Where markers lack, the nearest marker stands for the joint, or nothing does.
"""


def run(*, release: Path, formats: list[str], out: Path) -> None:
    """Write the exports of a release folder in `formats` to the folder `out`, whole or not at all.

    Raises DiorError for an unknown format, for a folder that is no release and for one that is damaged.
    """
    from dior.release.exports import bids, c3d, coco, gaitgraph, opengait, poses, recordings, trc, webdataset

    modules = {"coco": coco, "opengait": opengait, "gaitgraph": gaitgraph, "webdataset": webdataset}
    modules |= {"trc": trc, "c3d": c3d, "bids": bids}
    for name in formats:
        if name not in FORMATS:
            raise DiorError(f"release: exports: there is no format '{name}'{nearest(name, FORMATS)}")
    found = recordings.read(release)
    checksums.check(found.folder, READ)
    chosen = [name for name in FORMATS if name in formats]
    with folder_written_whole(out) as folder:
        with ExitStack() as stack:
            adders = _writers(stack, modules, [name for name in chosen if name in BY_RECORDING], folder, found)
            for recording in reporting(
                found.recordings if adders else (), len(found.recordings), "recordings", "exports"
            ):
                pose = poses.of(recordings.labels_of(recording), recording.camera)
                missing = recordings.missing_pictures(recording)
                for add in adders:
                    add(recording, pose, missing)
        with ExitStack() as stack:
            adders = _writers(stack, modules, [name for name in chosen if name in BY_WALK], folder, found)
            for walk in reporting(found.walks if adders else (), len(found.walks), "walks", "exports"):
                body = recordings.body_of(walk)
                for add in adders:
                    add(walk, body)
        parts = [f"## {name}\n\n{modules[name].ABOUT}" for name in chosen]
        write_text(folder / "README.md", "\n".join([HEAD.format(name=found.folder.name), *parts]))
        write_text(folder / checksums.SUMS, checksums.text(checksums.of_folder(folder)))


def _writers(
    stack: ExitStack, modules: dict[str, ModuleType], names: list[str], folder: Path, release: "Release"
) -> list[Any]:
    return [stack.enter_context(modules[name].writer(folder / name, release)) for name in names]
