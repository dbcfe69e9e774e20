"""What the pages know of a project: its sheets, and tables that steps make of its recordings, before any run.

INPUTS   the project in the working directory, its recordings, results/ where there are any
OUTPUTS  tables in memory, by the same functions as the steps, whose files lie in a folder that ends with the studio
A page may be open while files of config/ are edited elsewhere: each request reads what has changed since.
"""

import os
import threading
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass
from glob import glob
from pathlib import Path
from tempfile import TemporaryDirectory
from types import TracebackType
from typing import Any, TypeAlias

import numpy as np

from dior.arrays import Table
from dior.calibrate import intrinsics
from dior.calibrate.marks.marks import Motion, read_motion
from dior.errors import DiorError, Faults
from dior.geometry.camera import Camera
from dior.geometry.camera_tables import unplaced
from dior.ingest import detections, frames, mocap, moving, video_frames, video_starts
from dior.project import running, todos
from dior.project.contents import Project
from dior.project.project import as_far_as_it_goes
from dior.release.look import reader
from dior.tables import tables

# chosen: a person is 20 px tall in pictures that wide, and more would not show what moves better
SCENE_PX = 1280
# of what is large, how many are kept; chosen: a scene of one camera in one walk has 4 MB, and so has a table; a page of
# a session reads the tables of all its walks
LAST = {"scene": 8, "result": 100}
# (path, time of change ns, size) of files
State: TypeAlias = tuple[tuple[str, int, int], ...]


@dataclass(frozen=True)
class Read:
    """A project as it was read: `project`, None where the sheets are wrong, what is wrong, and what is still TODO."""

    project: Project | None
    faults: tuple[DiorError, ...]
    unfinished: tuple[todos.Todo, ...]


class Workspace:
    """The project in the working directory. To be used in a `with`, which ends with its temporary folder."""

    def __init__(self) -> None:
        self.name = Path.cwd().name
        self._folder = TemporaryDirectory(prefix="dior_studio_", ignore_cleanup_errors=True)
        self._alone = _lock_of(Path.cwd())
        self._lock = threading.Lock()
        self._made: dict[tuple[str, ...], tuple[Any, Any]] = {}
        self._making: dict[tuple[str, ...], threading.Lock] = {}

    def __enter__(self) -> "Workspace":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._folder.cleanup()
        if self._alone is not None:
            os.close(self._alone)

    @property
    def others(self) -> bool:
        """Whether another studio was open on the project when this one began."""
        return self._alone is None

    def read(self) -> Read:
        """The project as its files are now."""

        def make() -> Read:
            faults, unfinished = Faults(), todos.found(".")
            project = as_far_as_it_goes(Path("."), faults, unfinished=unfinished)
            return Read(project, tuple(faults.found), tuple(unfinished))

        # folders may be links, which os.walk leaves out; sessions are two deep, and what is in them one more
        paths = [path for depth in range(1, 5) for path in glob("/".join(["config", *["*"] * depth]))]
        return self._kept(("project",), state_of(paths), make)

    def project(self) -> Project:
        """The project, without the sessions whose files are wrong. Raises DiorError where nothing is left."""
        read = self.read()
        if read.project is None:
            left = [*todos.errors(read.unfinished), *read.faults]
            raise DiorError(f"config/ cannot be read yet: {left[0]}" if left else "config/ has no walk yet")
        return read.project

    def frames(self, walk: str, camera: str) -> Table:
        """Table `frames` of one camera. Raises DiorError as the step does, but not where recordings do not overlap."""
        project = self.project()
        settings = project.cameras(project.session_of(walk))[camera]
        filmed, sidecars, rates = (
            {one: value for one, value in found.items() if one == camera}
            for found in (project.videos(walk), project.sidecars(walk), project.video_rates(walk))
        )

        def make() -> Table:
            out = self._frames_file(walk, camera)
            frames.run(
                sequence=walk, bags=[] if filmed else [*map(Path, project.bags(walk))],
                data_root=Path(project.data_root), topics={camera: project.topics(walk)[camera]}, out=out,
                by_hand=[camera], in_bags={camera: settings["bag"]} if "bag" in settings else {},
                recorded=video_frames.Recorded(_paths(filmed), _paths(sidecars), rates),
            )  # fmt: skip
            return tables.read(out, "frames")

        key = state_of(project.picture_files(walk)), repr(settings), repr(project.sequence(walk))
        return self._kept(("frames", walk, camera), key, make)

    def _frames_file(self, walk: str, camera: str) -> Path:
        return Path(self._folder.name) / f"{walk}.{camera}.frames.parquet"

    def search_s(self, walk: str, camera: str) -> float:
        """How far (s, either way) the clock of a camera may be off the motion capture's. Raises as `frames`."""
        self.frames(walk, camera)
        return video_starts.search_s(self._frames_file(walk, camera), absolute=True)

    def frames_with(self, walk: str, camera: str, frame: object) -> Table:
        """`frames`, of which `frame` is one. Raises DiorError where it is not."""
        table = self.frames(walk, camera)
        count = len(table["frame"])
        if isinstance(frame, bool) or not isinstance(frame, int) or not 0 <= frame < count:
            raise DiorError(f"{camera} has no frame {frame!s:.40} in {walk}, whose last is {count - 1}")
        return table

    def _written(self, name: str, pictures: Iterable[Table]) -> Path:
        """A file of the table `frames` of several cameras, for a step to read."""
        out, parts = Path(self._folder.name) / name, list(pictures)
        columns = tables.columns_of("frames")
        tables.write(out, "frames", {key: np.concatenate([one[key] for one in parts]) for key in columns})
        return out

    def stamps(self, walk: str) -> dict[str, Table]:
        """The tables of all cameras of a walk that can be read, by name. Raises DiorError where there is none."""
        found, faults = {}, Faults()
        for camera in self.project().cameras_of(walk):
            with faults.kept():
                found[camera] = self.frames(walk, camera)
        if not found:
            faults.tell()
        return found

    def version(self, walk: str) -> str:
        """A word for the state of the files that a walk's pictures are read from, for their addresses."""
        return f"{hash(state_of(self.project().picture_files(walk))) & 0xFFFFFFFF:08x}"

    def motion(self, walk: str) -> Motion:
        """The markers of an indoor walk, as the step `mocap` has them. Raises DiorError as it does."""
        project = self.project()
        given = project.mocap(walk)
        if not given:
            raise DiorError(f"'{walk}' has no motion capture in sequences.tsv")
        stamps = list(self.stamps(walk).values())
        settings, log = project.mocap_settings(walk), project.trigger_log(walk)

        def make() -> Motion:
            folder = Path(self._folder.name)
            every, out = self._written(f"{walk}.frames.parquet", stamps), folder / f"{walk}.mocap.parquet"
            mocap.run(
                sequence=walk, subject=project.subject_of(walk), c3d=Path(given[0]), frames=every,
                trigger_log=Path(log[0]) if log else None, out=out, capture=project.capture(walk),
                units=settings["units"], up=settings["up"], people=Path("config/subjects.tsv"),
                session_file=Path(project.session_file(project.session_of(walk))),
                names=next(map(Path, project.marker_names()), None),
            )  # fmt: skip
            return read_motion(out)[1]

        key = state_of([*given, *log, *project.picture_files(walk)]), repr(settings), repr(project.sequence(walk))
        return self._kept(("mocap", walk), key, make)

    def motion_file(self, walk: str) -> Path:
        """The table that `motion` is read from. Raises DiorError as it does."""
        self.motion(walk)
        return Path(self._folder.name) / f"{walk}.mocap.parquet"

    def lens(self, session: str, camera: str) -> Camera:
        """A camera without a pose, as the step `intrinsics` has it. Raises DiorError as it does."""
        project = self.project()
        walk, settings = project.first_sequence(session), project.cameras(session)[camera]
        pictures, source = self.frames(walk, camera), settings["intrinsics"]
        given = source if isinstance(source, dict) else {}
        board = {} if "file" in given else given

        def make() -> Camera:
            folder = Path(self._folder.name)
            indexed = self._written(f"{session}.{camera}.frames.parquet", [pictures])
            out = folder / f"{session}.{camera}.lens.parquet"
            intrinsics.run(
                session=session, camera=camera, role=settings["role"], topic=settings["topic"] or "",
                source="board" if board else given.get("file", "camera_info"), name=given.get("name") or "",
                board=board, distortion_model=settings.get("distortion_model") or "",
                info_topic=settings.get("camera_info") or "", sigma=str(settings.get("intrinsics_sigma", "")),
                frames=indexed, sequence=walk, data_root=Path(project.data_root), out=out,
                findings=folder / f"{session}.{camera}.lens.findings.parquet",
            )  # fmt: skip
            return unplaced(out, camera)

        key = state_of(project.picture_files(walk)), repr(settings)
        return self._kept(("lens", session, camera), key, make)

    def scene(self, walk: str, camera: str) -> tuple[int, moving.Scene | None]:
        """A camera's pictures without what moves, so many times smaller that they are SCENE_PX wide at most; None where
        none can be read."""
        table, root = self.frames(walk, camera), Path(self.project().data_root)
        width = int(table["width"][0])
        factor = next((one for one in (1, 2, 4) if width <= one * SCENE_PX), 8)

        def make() -> moving.Scene | None:
            some = reader(table, root)(moving.samples(len(table["frame"])), factor)
            pictures = [picture for _, picture in some]
            return moving.scene_of(pictures) if pictures else None

        return factor, self._kept(("scene", walk, camera), state_of(self.project().picture_files(walk)), make)

    def detected(self, walk: str) -> tuple[Table, Table]:
        """Tables `detections` and `detected_people` of the close cameras, of the last run or, where there is none, as
        the step `detections` reads them, but not compared with the pictures. Raises DiorError as it does."""
        found = self.result(f"results/detections/{walk}.parquet", "detections")
        others = self.result(f"results/detections/{walk}.people.parquet", "detected_people")
        if found is not None and others is not None:
            return found, others
        project = self.project()
        pattern = project.detections_pattern(walk)
        if not pattern or project.detected_here(walk):
            raise DiorError(
                f"'{walk}' has no detections yet; " + ("run the workflow" if pattern else "name them in the sheet")
            )
        close, settings = project.close(project.session_of(walk)), project.config["detector"]
        pictures = [self.frames(walk, camera) for camera in close]

        def make() -> tuple[Table, Table]:
            folder = Path(self._folder.name)
            indexed = self._written(f"{walk}.close.parquet", pictures)
            out, people = (folder / f"{walk}.{name}.parquet" for name in ("detections", "people"))
            detections.run(
                sequence=walk, pattern=pattern, cameras=close, format=settings["format"], frames=indexed, looked_at=[],
                out=out, findings=folder / f"{walk}.detections.findings.parquet",
                first_frame=settings["first_frame"], out_people=people,
            )  # fmt: skip
            return tables.read(out, "detections"), tables.read(people, "detected_people")

        files = [path for what, path in project.recordings(walk).items() if what.startswith("detections.")]
        key = state_of([*files, *project.picture_files(walk)]), repr(settings), repr(project.sequence(walk))
        return self._kept(("detected", walk), key, make)

    def result(self, path: str, name: str, columns: Iterable[str] | None = None) -> Table | None:
        """A table of results/ as the last run left it, None where there is none."""
        wanted = None if columns is None else list(columns)
        state = state_of([path])
        if not state:
            return None
        return self._kept(("result", path, repr(wanted)), state, lambda: tables.read(path, name, wanted))

    def kept(self, key: tuple[str, ...], state: Any, make: Callable[[], Any]) -> Any:
        """For a page: what `make` gives, made again only where `state` is another. `key`: the page's own."""
        return self._kept(("page", *key), state, make)

    def _kept(self, key: tuple[str, ...], state: Any, make: Callable[[], Any]) -> Any:
        """What `make` gives, made again only where `state` is another than when it was made. One thread makes it."""
        with self._lock:
            making = self._making.setdefault(key, threading.Lock())
        with making:
            with self._lock:
                found = self._made.pop(key, None)
            if found is None or found[0] != state:
                found = state, make()
            with self._lock:
                # the last one that was asked for comes last
                self._made[key] = found
                for old in [one for one in self._made if one[0] == key[0]][: -LAST.get(key[0], len(self._made))]:
                    del self._made[old]
            return found[1]


def _lock_of(project: Path) -> int | None:
    """The project's folder, open and locked until it is closed; None where another studio has it.

    A folder, since no file is to be left of it, however the process ends, and one that is taken away might be another's
    already. Some network file systems know no such locks; there no studio sees another.
    """
    folder = os.open(project, os.O_RDONLY)
    with suppress(OSError):
        if not running.locked(folder):
            os.close(folder)
            return None
    return folder


def state_of(paths: Iterable[str]) -> State:
    """Of the files that are there, sorted; folders count by what is in them."""
    found = []
    for path in paths:
        inside = [os.path.join(path, name) for name in sorted(os.listdir(path))] if os.path.isdir(path) else []
        for each in [path, *inside]:
            with suppress(OSError):
                status = os.stat(each)
                found.append((each, status.st_mtime_ns, status.st_size))
    return tuple(sorted(found))


def _paths(found: dict[str, str]) -> dict[str, Path]:
    return {camera: Path(path) for camera, path in found.items()}
