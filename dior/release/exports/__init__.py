"""Exports: the release in the formats of the tools that use such data.

INPUTS   a finished release folder, nothing else
OUTPUTS  a folder <format>/ for each format, README.md (what each is and how to load it) and SHA256SUMS, beside the release
What is about one camera is read once for all formats that want it, and so is what is about a walk. Same release, same
bytes. Each format is a module with `ABOUT`, its part of the README, and `writer(folder, release)`, a context that yields
a function to be called with every recording and its pose, or with every walk and its body.
"""

from contextlib import ExitStack
from pathlib import Path

from dior.errors import DiorError, nearest
from dior.files import folder_written_whole, write_text
from dior.progress import told
from dior.provenance import file_sha256

BY_RECORDING = ("coco", "opengait", "gaitgraph", "webdataset")
BY_WALK = ("trc", "c3d", "bids")
FORMATS = (*BY_RECORDING, *BY_WALK)
SUMS = "SHA256SUMS"
HEAD = """\
# {name}: exports

Made from the release `{name}` alone, by subject's pseudonym and with its licence and terms; its `README.md` says what
the labels are and how good they are. `sha256sum -c SHA256SUMS` checks this folder.

COCO-17 is taken by name from labels that have these joints (outdoor). Indoor labels are motion capture markers: joint
centres are derived from them in 3D by documented rules (dior/coco17.py) and projected at each picture's own stamp; they
are marked as derived, and the error of the rules, 1 to 5 cm, is not in their sigma.
"""


def run(*, release, formats, out):
    """Write the exports of a release folder in `formats` to the folder `out`, whole or not at all.

    Raises DiorError for an unknown format and for a folder that is no release.
    """
    from dior.release.exports import bids, c3d, coco, gaitgraph, opengait, poses, recordings, trc, webdataset

    modules = {"coco": coco, "opengait": opengait, "gaitgraph": gaitgraph, "webdataset": webdataset}
    modules |= {"trc": trc, "c3d": c3d, "bids": bids}
    for name in formats:
        if name not in FORMATS:
            raise DiorError(f"release: exports: there is no format '{name}'{nearest(name, FORMATS)}")
    found = recordings.read(release)
    chosen = [name for name in FORMATS if name in formats]
    with folder_written_whole(out) as folder:
        with ExitStack() as stack:
            adders = _writers(stack, modules, [name for name in chosen if name in BY_RECORDING], folder, found)
            for recording in told(found.recordings if adders else (), len(found.recordings), "recordings", "exports"):
                pose = poses.of(recordings.labels_of(recording), recording.camera)
                missing = recordings.missing_pictures(recording)
                for add in adders:
                    add(recording, pose, missing)
        with ExitStack() as stack:
            adders = _writers(stack, modules, [name for name in chosen if name in BY_WALK], folder, found)
            for walk in told(found.walks if adders else (), len(found.walks), "walks", "exports"):
                body = recordings.body_of(walk)
                for add in adders:
                    add(walk, body)
        parts = [f"## {name}\n\n{modules[name].ABOUT}" for name in chosen]
        write_text(folder / "README.md", "\n".join([HEAD.format(name=found.folder.name), *parts]))
        write_text(folder / SUMS, _sums(folder))


def _writers(stack, modules, names, folder, release):
    return [stack.enter_context(modules[name].writer(folder / name, release)) for name in names]


def _sums(folder):
    """Lines of SHA256SUMS, as `sha256sum` writes them, of all files in a folder, by path."""
    names = sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file())
    return "".join(f"{file_sha256(folder / name)}  {name}\n" for name in names)
