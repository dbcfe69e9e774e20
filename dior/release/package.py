"""The release: the labels of the subjects who agreed to it, under pseudonyms, with a card and checksums.

INPUTS   the project's config; `labels_2d` and pictures (`released_frames`) per sequence and camera, `skeletons_3d`,
         gait, `frames`, `detections` and the checksums of the recordings per sequence, `marks`, `cameras` and
         `camera_covariance` of the sessions, `offsets` (clocks), `metrics` and `findings`, `gallery` if there is one
OUTPUT   results/release/dior-<version>/: the tables of layout.py, README.md (dataset card), LICENSE, CITATION.cff,
         croissant.json, provenance.json, metrics.csv, card.jpg if a picture may be shown, ro-crate-metadata.json if
         there is a day or year of publication and, last, SHA256SUMS
Units as in dior/tables/schemas/. A subject is its pseudonym in every path and column. Same input, same bytes: no clock,
no names of machines or files. A subject who did not agree is in no file and no count. What a red light says is wrong
has no place in it, unless the lab accepts it (suspect.py).
"""

import json
import shutil
import sys
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import repeat
from pathlib import Path
from typing import Any

from dior.arrays import AnyPath
from dior.errors import DiorError
from dior.evaluate import statistics
from dior.evaluate.metrics import as_csv
from dior.progress import reporting
from dior.project import licenses, publication
from dior.project import project as projects
from dior.release import cameras as rigs
from dior.release import (
    card,
    card_picture,
    checksums,
    citation,
    crate,
    croissant,
    escape,
    layout,
    metrics_csv,
    people_tables,
    provenance_json,
    splits,
    suspect,
    walk_files,
)
from dior.release.people_tables import Walks
from dior.report import headline
from dior.tables import tables
from dior.tables.files import folder_written_whole, write_text

# what the step calls the files of each part about gait, after the sequence
GAIT_FILES = {"gait": "", "gait_events": ".events", "gait_steps": ".steps"}
# walks at once, as many as the rule has threads
THREADS = 2


@dataclass(frozen=True)
class WalkFiles:
    """What the steps made of each sequence, in files that they name <sequence>.parquet or <sequence>.<camera>.parquet.

    `labels`: tables `labels_2d`; `pixels`: tables `released_frames`; `covers`: tables `released_covers`, in files
    <sequence>.<camera>.covers.parquet; `skeletons`: tables `skeletons_3d`; `gait`: tables of the gait, in files
    <sequence>.parquet, <sequence>.events.parquet and <sequence>.steps.parquet; `frames`: tables `frames`;
    `detections`: tables `detections`; `clocks`: tables `offsets`; `quantiles`: tables `label_quantiles`;
    `provenance`: checksums of the recordings, a JSON file each.
    """

    labels: list[Path]
    pixels: list[Path]
    covers: list[Path]
    skeletons: list[Path]
    gait: list[Path]
    frames: list[Path]
    detections: list[Path]
    clocks: list[Path]
    quantiles: list[Path]
    provenance: list[Path]


@dataclass(frozen=True)
class CameraFiles:
    """The poses of the sessions' cameras, and the marks that placed them.

    `marks`: tables `marks`; `cameras`: tables `cameras`; `covariances`: tables `camera_covariance`.
    """

    marks: list[Path]
    cameras: list[Path]
    covariances: list[Path]


def run(
    *,
    project: Path,
    config: dict[str, Any],
    of_walks: WalkFiles,
    of_cameras: CameraFiles,
    metrics: list[Path],
    findings: list[Path],
    gallery: Path | None,
    steps: dict[str, str],
    out: Path,
) -> None:
    """Build the release folder `out` whole beside its place and put it there.

    `project`: the folder that holds config/; `config`: the content of config.yaml. Files of sequences that are not
    released may be among the others and are left out. `findings`: tables `findings` of the steps; `gallery`: its table
    or None; `steps`: hash of each step's code.
    Raises DiorError where nobody agreed to the release and where a released sequence lacks a table or is labelled as
    another subject's.
    """
    loaded, out = projects.load(project, config), Path(out)
    kept = set(loaded.released_subjects)
    _withdraw(out, kept)
    if not kept:
        shutil.rmtree(out, ignore_errors=True)
        raise DiorError("config/subjects.tsv: no subject's consent_release is yes, so there is nothing to release")
    found = {
        "labels": _by_name(of_walks.labels, "labels"),
        "pixels": _by_name(of_walks.pixels, "pictures"),
        "covers": {name.removesuffix(".covers"): path for name, path in _by_name(of_walks.covers, "covers").items()},
        "skeletons": _by_name(of_walks.skeletons, "skeletons"),
        "gait": _by_name(of_walks.gait, "gait"),
        "frames": _by_name(of_walks.frames, "frames"),
        # those that triangulate chose are called <sequence>.detections
        "detections": {
            name.partition(".")[0]: path for name, path in _by_name(of_walks.detections, "detections").items()
        },
        "checksums": _by_name(of_walks.provenance, "checksums"),
    }
    needed = {name: _of(found["frames"], name, "frames") for name in loaded.released_sequences}
    walks = people_tables.released_walks(loaded, needed)
    sources = {name: _sources(walk, found, of_cameras.marks, loaded) for name, walk in walks.items()}
    recordings = {name: _of(found["checksums"], name, "checksums") for name in walks}
    checked = {session: loaded.heads_checked(session) for session in {walk["session"] for walk in walks.values()}}
    rig = rigs.released(of_cameras.cameras, of_cameras.covariances, walks, checked)
    joint = rigs.covariance(of_cameras.covariances, walks)
    accepted = {key: why for walk in walks.values() for key, why in loaded.labels_accepted(walk["session"]).items()}
    robust = loaded.config["triangulate"]["method"] == "robust"
    lights = suspect.red_lights(walks, rig, metrics, findings, accepted, robust)
    for line in suspect.said(lights, accepted, walks):
        print(f"release: {line}", file=sys.stderr)
    without_place = {name: suspect.without_place(lights, name) for name in walks}
    made_of = provenance_json.of(loaded, walks, recordings, steps, suspect.told(lights))
    for line in citation.lacks(loaded.config["release"]):
        print(f"release: {line}", file=sys.stderr)
    with folder_written_whole(out) as folder:
        with ThreadPoolExecutor(THREADS) as pool:
            written = pool.map(
                walk_files.write, repeat(folder), walks.values(), sources.values(), without_place.values()
            )
            for _ in reporting(written, len(walks), "sequences", "release"):
                pass
        pictures = people_tables.gallery(gallery, walks) if gallery else {}
        # from here on a session is called as the release calls it
        walks = {name: walk | {"session": walk["released_session"]} for name, walk in walks.items()}
        roles = dict(zip(zip(rig["session"], rig["camera"], strict=True), rig["role"], strict=True))
        about: dict[str, tuple[str, dict[str, Any]]] = {
            "cameras": ("released_cameras", rig),
            "camera_covariance": ("camera_covariance", joint),
            "clocks": ("released_clocks", rigs.clocks(of_walks.clocks, walks)),
            "lights": ("released_lights", suspect.columns(lights)),
            "sequences": ("sequences", people_tables.sequences(walks)),
            "subjects": ("subjects", people_tables.subjects(walks, loaded.subjects)),
            "splits": ("splits", splits.columns(walks, roles)),
            "gallery": ("released_gallery", pictures),
        }
        for name, (table, columns) in about.items():
            if len(next(iter(columns.values()), ())):
                tables.write(folder / f"{name}.parquet", table, columns)
        rows = metrics_csv.released(metrics, walks, without_place)
        write_text(folder / "metrics.csv", as_csv(rows))
        counted = _counted(folder, walks, roles, sources, pictures.get("angle", ()))
        looked_at = [row for row in zip(rig["session"], rig["camera"], rig["heads_checked"], strict=True) if row[2]]
        good = headline.lines(_told(walks, roles, rows, lights), headline.read(of_walks.quantiles))
        covered = loaded.config["release"]["faces"] != "shown"
        shown = card_picture.write(folder, about["sequences"][1], rig) if covered else ""
        _write_about(folder, loaded, walks, counted, rows, made_of, looked_at, lights, good, shown)
        checksums.write(folder)


def _withdraw(out: Path, kept: set[str]) -> None:
    """Remove what is beside the release of everybody but `kept`, so that who withdrew is in no file any more.

    That is everybody's tarball but theirs, half-made ones too, and the exports, which are not by person. The tarball of
    metadata names everybody, so that it is always made anew.
    """
    shutil.rmtree(out.with_name(f"{out.name}-exports"), ignore_errors=True)
    before = {path.name for path in out.glob("labels_2d/*")}
    if gone := before - kept:
        print(f"release: {len(gone)} of {len(before)} people of the last build are not in it any more", file=sys.stderr)
    for tarball in out.parent.glob(f"{out.name}-*.tar"):
        if tarball.name.removeprefix(f"{out.name}-").removesuffix(".tar") not in kept:
            tarball.unlink()
    for left in (*out.parent.glob(f".{out.name}-*.part.tar"), *out.parent.glob(f".{out.name}-*.part.json")):
        if left.name.removeprefix(f".{out.name}-").rpartition(".part.")[0] not in kept:
            left.unlink()


def _by_name(paths: Iterable[AnyPath], what: str) -> dict[str, Path]:
    """Files by name without the suffix. Raises DiorError for two of one name."""
    found: dict[str, Path] = {}
    for path in map(Path, paths):
        if path.stem in found:
            raise DiorError(f"release: '{path.stem}' has two tables of {what}: {found[path.stem]} and {path}")
        found[path.stem] = path
    return found


def _of(files: dict[str, Path], name: str, what: str) -> Path:
    if name not in files:
        raise DiorError(f"release: '{name}' has no table of {what}; run its steps first")
    return files[name]


def _sources(
    walk: dict[str, Any], found: dict[str, dict[str, Path]], marks: list[Path], project: projects.Project
) -> walk_files.Sources:
    """The files about one walk."""
    name = walk["sequence"]

    def by_camera(kind: str, what: str) -> dict[str, Path]:
        return {camera: _of(found[kind], f"{name}.{camera}", what) for camera in walk["cameras"]}

    def by_hand(files: dict[str, str]) -> dict[str, Path]:
        return {camera: project.root / path for camera, path in files.items()}

    return walk_files.Sources(
        labels=by_camera("labels", "labels"),
        pixels=by_camera("pixels", "pictures"),
        covers=by_camera("covers", "covers"),
        skeleton=_of(found["skeletons"], name, "skeletons"),
        gait={part: _of(found["gait"], f"{name}{file}", "gait") for part, file in GAIT_FILES.items()},
        frames=_of(found["frames"], name, "frames"),
        detections=found["detections"].get(name),
        boxes=by_hand(project.boxes(name)),
        checks=by_hand(project.checks(name)),
        marks=tuple(sorted(marks)),
    )


def _counted(
    folder: Path,
    walks: Walks,
    roles: dict[tuple[str, str], str],
    sources: dict[str, walk_files.Sources],
    angles: Iterable[str],
) -> list[dict[str, Any]]:
    """Rows of statistics.csv for the released walks, of the labels and the 3D as they are in the release `folder`."""
    labels, skeletons = (sorted(folder.glob(f"{name}/*/*.parquet")) for name in ("labels_2d", "skeletons_3d"))
    frames = [source.frames for source in sources.values()]
    return statistics.rows_of(walks, roles, labels, skeletons, frames, angles=angles)


def _told(
    walks: Walks, roles: dict[tuple[str, str], str], rows: list[dict[str, Any]], lights: list[suspect.RedLight]
) -> dict[tuple[str, str], headline.Told]:
    """What the card's first lines are made of: labels that are red and that nobody accepts are not in the release."""
    red = {(light.sequence, light.camera) for light in lights if not light.accepted}
    figures: dict[tuple[str, str], dict[str, float]] = {}
    for row in rows:
        if row["sequence"] and row["camera"] and not row["joint"] and not row["tool"]:
            figures.setdefault((row["sequence"], row["camera"]), {})[row["metric"]] = row["value"]
    return {
        (name, camera): headline.Told(
            (walk["environment"], roles[walk["session"], camera]),
            "bad" if {(name, camera), (name, "")} & red else "good",
            figures.get((name, camera), {}),
        )
        for name, walk in walks.items()
        for camera in walk["cameras"]
    }


def _joints(folder: Path, walks: Walks) -> dict[str, list[str]]:
    """The joints of the labels by environment, as the first recording of each has them."""
    found: dict[str, list[str]] = {}
    for name, walk in walks.items():
        paths = sorted(folder.glob(f"labels_2d/{walk['subject']}/{name}.*.parquet"))
        if walk["environment"] not in found and paths:
            joints = tables.read(paths[0], "labels_2d", ["joint"])["joint"]
            found[walk["environment"]] = tables.ordered_unique(joints)
    return dict(sorted(found.items()))


def _write_about(
    folder: Path,
    project: projects.Project,
    walks: Walks,
    counted: list[dict[str, Any]],
    figures: list[dict[str, Any]],
    made_of: dict[str, Any],
    checked: list[tuple[str, str, str]],
    lights: list[suspect.RedLight],
    good: list[headline.Line],
    shown: str,
) -> None:
    """Write what tells about the release: card, licence, citation, Croissant and provenance."""
    release = project.config["release"]
    parts = layout.parts_of(folder)
    example = min(path.relative_to(folder).as_posix() for path in folder.glob("labels_2d/*/*.parquet"))
    agreed = any(project.consents(who, "pictures") for who in project.released_subjects)
    picture = card.Picture(shown, agreed)
    joints = _joints(folder, walks)
    text = card.text(release, walks, counted, figures, parts, example, checked, lights, good, joints, picture)
    write_text(folder / "README.md", text)
    write_text(folder / "LICENSE", licenses.text(release, project.root))
    write_text(folder / "CITATION.cff", citation.text(release))
    described = croissant.content(folder, release, card.summary(walks, counted), card.simulated(walks.values()))
    write_text(folder / "croissant.json", escape.json_in_page(_json(described)))
    write_text(folder / "provenance.json", _json(made_of))
    if publication.published(release):
        # of all that is there
        crated = crate.content(folder, release, described["description"])
        write_text(folder / crate.FILE, escape.json_in_page(_json(crated)))


def _json(content: dict[str, Any]) -> str:
    return json.dumps(content, indent=1, ensure_ascii=False) + "\n"
