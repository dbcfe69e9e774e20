"""The release: the labels of the subjects who agreed to it, under pseudonyms, with a card and checksums.

INPUTS   the project's sheets; `labels_2d` per sequence and camera, `skeletons_3d` and `frames` per sequence, `cameras`,
         `metrics` per sequence (results/evaluate) and per session (results/adjust), `gallery` if there is one
OUTPUT   results/release/dior-<version>/: labels_2d/<subject>/<sequence>.<camera>.parquet,
         skeletons_3d/<subject>/<sequence>.parquet, frames/<subject>/<sequence>.parquet, cameras.parquet,
         sequences.parquet, subjects.parquet, gallery.parquet, metrics.csv, README.md (dataset card), SHA256SUMS
Units as in schemas.py. A subject is its pseudonym in every path and column. Same input, same bytes: no clock, no names
of machines or files. A subject who did not agree is in no file and no count.
"""

import os
import shutil
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from dior import tables
from dior.consistency import consents
from dior.errors import DiorError
from dior.evaluate import statistics
from dior.evaluate.metrics import as_csv, merged
from dior.files import write_text
from dior.progress import told
from dior.project import sheets
from dior.provenance import file_sha256
from dior.release import card
from dior.schemas import SCHEMAS, VERSION

SUMS = "SHA256SUMS"
SHEET_COLUMNS = ("sequence", "session", "environment", "outfit", "walk")


def run(*, project, version, title, license, authors, labels, skeletons, frames, cameras, metrics, gallery, out):
    """Build the release folder `out` whole beside its place and put it there.

    `project`: the folder that holds config/. `labels`, `skeletons`, `frames`, `cameras`, `metrics`: lists of tables,
    named as the steps name them (<sequence>.<camera>.parquet, <sequence>.parquet); those of sequences that are not
    released may be among them and are left out. `gallery`: its table or None. Raises DiorError where nobody agreed to
    the release and where a released sequence lacks a table or is labelled as another subject's.
    """
    (rows, _), (subjects, _) = sheets(project)
    processed = [row for row in rows.values() if not row["exclude_reason"]]
    released = released_rows(processed, subjects)
    _withdraw(Path(out), {row["subject"] for row in released.values()})
    if not released:
        shutil.rmtree(out, ignore_errors=True)
        raise DiorError("config/subjects.tsv: no subject's consent_release is yes, so there is nothing to release")
    found = {
        "labels_2d": _by_sequence(labels, released, "labels"),
        "skeletons_3d": _by_sequence(skeletons, released, "skeleton"),
        "frames": _by_sequence(frames, released, "frames"),
    }
    with _folder_in_place(Path(out)) as folder:
        for name, row in told(released.items(), len(released), "sequences", "release"):
            who = row["subject"]
            for path in found["labels_2d"][name]:
                _release_labels(path, row, folder / "labels_2d" / who / path.name)
            _release_skeleton(found["skeletons_3d"][name][0], row, folder / "skeletons_3d" / who / f"{name}.parquet")
            _release_frames(found["frames"][name][0], folder / "frames" / who / f"{name}.parquet")
        rig = _released_cameras(cameras, {row["session"] for row in released.values()})
        tables.write(folder / "cameras.parquet", "cameras", rig)
        tables.write(folder / "sequences.parquet", "sequences", _sequences(released))
        tables.write(folder / "subjects.parquet", "subjects", _subjects(released, subjects))
        pictures = _gallery(gallery, released) if gallery else {"angle": ()}
        if gallery:
            tables.write(folder / "gallery.parquet", "released_gallery", pictures)
        figures = _figures(metrics, released, everyone=len(released) == len(processed))
        write_text(folder / "metrics.csv", as_csv(figures))
        facts = {"version": version, "title": title, "license": license, "authors": list(authors)}
        roles = dict(zip(zip(rig["session"], rig["camera"], strict=True), rig["role"], strict=True))
        files = {name: [path for paths in found[name].values() for path in paths] for name in found}
        counted = statistics.rows_of(released, roles, *files.values(), angles=pictures["angle"])
        example = next(iter(found["labels_2d"].values()))[0].name
        write_text(
            folder / "README.md", card.text(facts, list(released.values()), counted, figures, bool(gallery), example)
        )
        write_text(folder / SUMS, _sums(folder))


def _withdraw(out, kept):
    """Remove what is beside the release of everybody but `kept`: who withdrew is in no file any more.

    That is everybody's tarball but theirs, and the exports, which are not by person.
    """
    shutil.rmtree(out.with_name(f"{out.name}-exports"), ignore_errors=True)
    for tarball in out.parent.glob(f"{out.name}-*.tar"):
        if tarball.name.removeprefix(f"{out.name}-").removesuffix(".tar") not in kept:
            tarball.unlink()


def released_rows(rows, subjects):
    """Sheet rows, by sequence and sorted, of the subjects who agreed; `subject` is the pseudonym, `real` who it is."""
    kept = [
        {**row, "real": row["subject"], "subject": subjects[row["subject"]]["pseudonym"]}
        for row in rows
        if row["subject"] in subjects and consents(subjects[row["subject"]])
    ]
    return {row["sequence"]: row for row in sorted(kept, key=lambda row: (row["subject"], row["sequence"]))}


def _by_sequence(paths, released, what):
    """Files of each released sequence; the step's file names start with it and hold no other dot before the camera."""
    found = {name: [] for name in released}
    for path in map(Path, paths):
        name = path.name.split(".")[0]
        if name in found:
            found[name].append(path)
    for name, files in found.items():
        if not files or (what != "labels" and len(files) > 1):
            raise DiorError(f"release: sequence '{name}' has {len(files)} tables of {what}; run its steps first")
    return {name: sorted(files, key=lambda path: path.name) for name, files in found.items()}


def _release_labels(path, row, out):
    tables.write_arrow(out, _as_pseudonym(tables.read_arrow(path, "labels_2d"), path, row))


def _release_skeleton(path, row, out):
    tables.write_arrow(out, _as_pseudonym(tables.read_arrow(path, "skeletons_3d"), path, row))


def _as_pseudonym(table, path, row):
    """The table with the pseudonym as its subject; its metadata is made anew, so that nothing else slips through."""
    for column, expected in (("subject", row["real"]), ("sequence", row["sequence"])):
        names = pc.unique(table[column].cast(pa.string())).to_pylist()
        if names not in ([expected], []):
            raise DiorError(
                f"{path}: the {column} is {names[0]}, but the sheet says {expected}; delete it and run again"
            )
    at = table.schema.get_field_index("subject")
    field = SCHEMAS["labels_2d"].field("subject")
    one = pa.DictionaryArray.from_arrays(pa.array(np.zeros(len(table), np.int32)), pa.array([row["subject"]]))
    return _plain_metadata(table.set_column(at, field, one))


def _plain_metadata(table):
    kind = table.schema.metadata[b"dior_table"].decode()
    return table.replace_schema_metadata({"dior_table": kind, "dior_table_version": VERSION})


def _release_frames(path, out):
    """The index of the pictures without the bag, topic and receive stamp, which name machines and files."""
    there = [name for name in tables.columns_of("released_frames") if name in tables.columns_of("frames")]
    table = tables.read(path, "frames", there)
    tables.write(out, "released_frames", table)


def _released_cameras(paths, sessions):
    """Columns of the final cameras of the released sessions, sorted by session and camera."""
    parts = [tables.read(path, "cameras") for path in paths]
    if not parts:
        raise DiorError("release: no table of cameras is given")
    table = {key: np.concatenate([part[key] for part in parts]) for key in parts[0]}
    table = tables.rows(table, np.array([session in sessions for session in table["session"]], bool))
    names = list(zip(table["session"], table["camera"], strict=True))
    for name in names:
        if names.count(name) > 1:
            raise DiorError(f"release: camera '{name[1]}' of session '{name[0]}' is in two tables of cameras")
    for session in sorted(sessions - set(table["session"])):
        raise DiorError(f"release: session '{session}' has no table of cameras; run its steps first")
    return tables.rows(table, np.array(sorted(range(len(names)), key=names.__getitem__)))


def _sequences(released):
    columns = {key: [row[key] for row in released.values()] for key in (*SHEET_COLUMNS, "subject")}
    return {**columns, "session_order": [int(row["session_order"]) for row in released.values()]}


def _subjects(released, subjects):
    real = {row["subject"]: row["real"] for row in released.values()}
    names = sorted(real)

    def metres(column):
        return [float(subjects[real[name]][column] or "nan") for name in names]

    return {"subject": names, "height_m": metres("height_m"), "height_sigma_m": metres("height_sigma_m")}


def _gallery(path, released):
    """Columns of the gallery of the released subjects, by pseudonym, without the files, which name machines."""
    pseudonyms = {row["real"]: row["subject"] for row in released.values()}
    table = tables.read(path, "gallery")
    table = tables.rows(table, np.array([name in pseudonyms for name in table["subject"]], bool))
    table["subject"] = np.array([pseudonyms[name] for name in table["subject"]], object)
    order = np.lexsort([table[key].astype(str) for key in ("angle", "outfit", "subject")])
    return {key: table[key][order] for key in tables.columns_of("released_gallery")}


def _figures(paths, released, everyone):
    """Rows of metrics.csv: those of the released sequences, pooled over them.

    A row of no sequence (the adjustment's) is about all subjects of a session, so it stays only where `everyone` is
    released.
    """
    columns, rows = tables.columns_of("metrics"), []
    for path in paths:
        table = tables.read(path, "metrics")
        for cells in zip(*(table[c].tolist() for c in columns), strict=True):
            figure = dict(zip(columns, cells, strict=True))
            if figure["sequence"] in released:
                rows.append({**figure, "subject": released[figure["sequence"]]["subject"]})
            elif everyone and not figure["sequence"] and not figure["subject"]:
                rows.append(figure)
    return merged(rows)


def _sums(folder):
    """Lines as `sha256sum` writes them, by path."""
    files = sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file())
    return "".join(f"{file_sha256(folder / file)}  {file}\n" for file in files)


@contextmanager
def _folder_in_place(out):
    """Yield an empty folder beside `out` that takes its place if nothing was raised.

    What an earlier, killed build left beside it is removed, and so is every file of an earlier release.
    """
    out.parent.mkdir(parents=True, exist_ok=True)
    part, old = (out.with_name(f".{out.name}.{kind}") for kind in ("part", "old"))
    for left in (part, old):
        shutil.rmtree(left, ignore_errors=True)
    part.mkdir()
    try:
        yield part
        if out.exists():
            os.replace(out, old)
        os.replace(part, out)
    finally:
        for left in (part, old):
            shutil.rmtree(left, ignore_errors=True)
