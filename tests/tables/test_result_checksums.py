"""A result is read only if it is what its job wrote: in a project's results/, and nowhere else is anything asked."""

import shutil
import subprocess

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from benchmarks.damage import random_flips, silent
from dior.errors import DiorError
from dior.evaluate import metrics, statistics
from dior.ingest import detections
from dior.release import provenance
from dior.report import reid
from dior.tables import result_checksums, tables
from dior.tables.files import write_text
from dior.tables.schemas import PICTURE, SCHEMAS, VOCABULARY

OFFSETS = {"sequence": ["walk_1"] * 3, "camera": ["cam01", "cam02", "cam03"], "offset_s": [0.1, 0.2, 0.3]}


@pytest.fixture
def project(tmp_path):
    """A project that has nothing yet."""
    (tmp_path / "mine/config").mkdir(parents=True)
    (tmp_path / "mine/config/config.yaml").touch()
    return tmp_path / "mine"


@pytest.fixture
def table(project):
    """A result of it."""
    tables.write(project / "results/clocks/walk_1.parquet", "offsets", OFFSETS)
    return project / "results/clocks/walk_1.parquet"


def flip(path, bit=800):
    content = bytearray(path.read_bytes())
    content[bit // 8] ^= 1 << bit % 8
    path.write_bytes(content)


def refused(path, name="offsets"):
    with pytest.raises(DiorError) as error:
        tables.read(path, name)
    assert "\n" not in str(error.value) and str(path) in str(error.value)
    return str(error.value)


AGAIN = "run snakemake again with `--forcerun results/clocks/walk_1.parquet`"


def test_a_flipped_bit_an_edit_and_another_runs_table_are_refused(project, table, tmp_path):
    assert tables.read(table, "offsets")["offset_s"].tolist() == [0.1, 0.2, 0.3]
    whole = table.read_bytes()
    flip(table)
    said = refused(table)
    assert said.endswith(AGAIN) and "is not what its job wrote" in said
    table.write_bytes(whole)
    assert len(tables.read(table, "offsets")["camera"]) == 3
    other = OFFSETS | {"offset_s": [0.1, 0.2, 0.4]}
    tables.write(tmp_path / "theirs.parquet", "offsets", other)
    shutil.copy(tmp_path / "theirs.parquet", table)
    assert refused(table).endswith(AGAIN)
    with pytest.raises(DiorError, match="not what its job wrote"):
        tables.metadata(table)
    with pytest.raises(DiorError, match="not what its job wrote"):
        next(tables.read_in_parts(table, "offsets", None, 2))
    # its job writes it anew
    tables.write(table, "offsets", other)
    assert tables.read(table, "offsets")["offset_s"].tolist() == [0.1, 0.2, 0.4]


def test_tables_in_each_others_place_and_a_folder_of_another_project_are_refused(project, table, tmp_path):
    second = project / "results/clocks/walk_2.parquet"
    tables.write(second, "offsets", OFFSETS | {"offset_s": [0, 0, 0]})
    (tmp_path / "theirs/config").mkdir(parents=True)
    (tmp_path / "theirs/config/config.yaml").touch()
    theirs = tmp_path / "theirs/results/clocks/walk_1.parquet"
    tables.write(theirs, "offsets", OFFSETS | {"offset_s": [1, 2, 3]})
    table.rename(table.with_name("aside"))
    second.rename(table)
    table.with_name("aside").rename(second)
    assert "not what its job wrote" in refused(table) and "not what its job wrote" in refused(second)
    shutil.rmtree(table.parent)
    shutil.copytree(theirs.parent, table.parent)
    assert "not what its job wrote" in refused(table)
    assert tables.read(theirs, "offsets")["offset_s"].tolist() == [1, 2, 3]


def test_a_whole_project_and_its_results_may_be_copied(project, table, tmp_path):
    shutil.copytree(project, tmp_path / "copied")
    assert len(tables.read(tmp_path / "copied/results/clocks/walk_1.parquet", "offsets")["camera"]) == 3
    # with results/ alone what is noted comes along, and is asked for without a config
    shutil.copytree(project / "results", tmp_path / "apart/results")
    apart = tmp_path / "apart/results/clocks/walk_1.parquet"
    assert len(tables.read(apart, "offsets")["camera"]) == 3
    flip(apart)
    assert "not what its job wrote" in refused(apart)


def test_results_on_another_disk_behind_a_link(project, tmp_path, monkeypatch):
    (tmp_path / "large").mkdir()
    (project / "results").symlink_to(tmp_path / "large")
    monkeypatch.chdir(project)
    tables.write("results/clocks/walk_1.parquet", "offsets", OFFSETS)
    assert len(tables.read("results/clocks/walk_1.parquet", "offsets")["camera"]) == 3
    flip(project / "results/clocks/walk_1.parquet")
    with pytest.raises(DiorError, match="^results/clocks/walk_1.parquet: is not what its job wrote"):
        tables.read("results/clocks/walk_1.parquet", "offsets")


def test_a_result_that_no_job_noted_is_refused_with_what_to_run(project, table):
    by_hand = table.with_name("walk_2.parquet")
    shutil.copy(table, by_hand)
    assert "no job has noted" in refused(by_hand) and "--forcerun results/clocks/walk_2.parquet" in refused(by_hand)
    entry = result_checksums.result_at(table).entry
    for damaged in ("", "0" * 64, f"{'0' * 64}  results/clocks/walk_2.parquet\n", "\0" * 99):
        entry.write_text(damaged)
        assert refused(table).endswith(AGAIN)
    entry.write_bytes(b"\xff" * 99)
    assert refused(table).endswith(AGAIN)
    # a project of an older dior, or copied without what begins with a dot
    shutil.rmtree(project / "results/.sha256")
    said = refused(table)
    assert (
        "`--forceall`" in said and f"{project}/results/.sha256 is missing" in said and "copy that folder, too" in said
    )


def test_elsewhere_nothing_is_noted_and_nothing_asked(project, table, tmp_path):
    for path in (
        tmp_path / "a.parquet",
        tmp_path / "results/a.parquet",
        project / "data/results.parquet",
        project / "results/release/dior-1.0.0/clocks.parquet",
    ):
        tables.write(path, "offsets", OFFSETS)
        assert result_checksums.result_at(path) is None and len(tables.read(path, "offsets")["camera"]) == 3
    noted = [path for path in (project / "results/.sha256").rglob("*") if path.is_file()]
    assert noted == [result_checksums.result_at(table).entry] and not (tmp_path / "results/.sha256").exists()
    shutil.copy(table, tmp_path / "copied.parquet")
    assert pd.read_parquet(tmp_path / "copied.parquet")["offset_s"].tolist() == [0.1, 0.2, 0.3]
    assert len(tables.read(tmp_path / "copied.parquet", "offsets")["camera"]) == 3


def test_what_is_noted_is_what_sha256sum_checks(project, table):
    write_text(project / "results/evaluate/metrics.csv", "metric\n")
    line = "find results/.sha256 -type f -exec cat {} + | sha256sum --check --quiet"
    assert subprocess.run(line, shell=True, cwd=project, capture_output=True).returncode == 0
    flip(table)
    done = subprocess.run(line, shell=True, cwd=project, capture_output=True, text=True)
    assert done.returncode == 1 and done.stdout == "results/clocks/walk_1.parquet: FAILED\n"


def test_pages_pictures_and_recordings_are_not_noted(project):
    for name in (
        "report/index.html",
        "report/assets/a/cam01.jpg",
        "simulate/a/mlkit/cam01.jsonl",
        "simulate/a/pc1.bag",
    ):
        write_text(project / "results" / name, "x")
    assert not (project / "results/.sha256").exists()


CSV = {
    "results/evaluate/metrics.csv": metrics.read,
    "results/evaluate/statistics.csv": statistics.read,
    "results/reid/table.csv": lambda path: reid.read(path, path, path),
    "results/provenance/walk_1.json": provenance.read,
    "results/detect/walk_1.cam01.json": lambda path: detections.format_of(path, "auto", "walk_1, cam01"),
}


@pytest.mark.parametrize("name", CSV)
def test_results_that_are_no_tables_are_checked_too(project, name):
    path = project / name
    text = '[{"image_id": 1}]\n' if name.endswith("json") else "metric,value\n"
    write_text(path, text)
    path.write_text(text.replace("1", "2").replace("value", "valve"))
    with pytest.raises(DiorError, match=f"is not what its job wrote.* `--forcerun {name}`"):
        CSV[name](path)


def test_columns_are_those_of_the_table(tmp_path, project, table):
    whole = tables.to_arrow("offsets", OFFSETS)
    for other, said in (
        (whole.drop_columns(["sigma_s"]), "lacks columns"),
        (whole.append_column("more", pa.nulls(3)), "has a column 'more'"),
        (whole.select(whole.schema.names[::-1]), "in another order"),
        (whole.set_column(2, pa.field("offset_s", pa.string()), pa.nulls(3, pa.string())), "holds string, not double"),
    ):
        pq.write_table(other.replace_schema_metadata(whole.schema.metadata), tmp_path / "a.parquet")
        assert said in refused(tmp_path / "a.parquet"), said
    # what is not read may be missing: tables of an older release are compared with those of this one
    pq.write_table(whole.drop_columns(["sigma_s"]), tmp_path / "a.parquet")
    assert len(tables.read(tmp_path / "a.parquet", "offsets", ["camera", "offset_s"])["camera"]) == 3
    with pytest.raises(DiorError, match="has no column 'sigma_s'"):
        tables.read(tmp_path / "a.parquet", "offsets", ["sigma_s"])


def made_up(name, rows, seed=0):
    """Columns of a table with something in each."""
    random = np.random.default_rng(seed)

    def column(field):
        kind = field.type
        if kind == PICTURE:
            return [random.bytes(50) for _ in range(rows)]
        if pa.types.is_dictionary(kind) or pa.types.is_string(kind):
            words = VOCABULARY.get((name, field.name)) or [f"{field.name}_{i}" for i in range(5)]
            return random.choice(list(words), rows).tolist()
        if pa.types.is_fixed_size_list(kind):
            return random.standard_normal((rows, kind.list_size))
        if pa.types.is_boolean(kind):
            return random.random(rows) < 0.5
        return random.standard_normal(rows) if pa.types.is_floating(kind) else random.integers(0, 100, rows)

    return {field.name: column(field) for field in SCHEMAS[name]}


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(SCHEMAS))
def test_no_flipped_bit_of_any_kind_of_table_is_silent(project, name):
    """300 at random; outside of a project many are, so that the flips do reach what is read."""
    path = project / f"results/step/{name}.parquet"
    tables.write(path, name, made_up(name, 200))
    bits = random_flips(path.stat().st_size, 300, 1)
    assert len(bits) == 300
    assert list(silent(path, lambda one: tables.read(one, name), bits)) == []
    assert len(tables.read(path, name)[SCHEMAS[name].names[0]]) == 200


@pytest.mark.slow
def test_every_bit_of_a_table_counts(project, table):
    """Of the footer and the page headers, too, which no checksum of Parquet's covers."""
    read = lambda path: tables.read(path, "offsets")  # noqa: E731
    assert list(silent(table, read, range(8 * table.stat().st_size))) == []
    outside = project / "a.parquet"
    shutil.copy(table, outside)
    some = random_flips(table.stat().st_size, 300, 1)
    assert len(list(silent(outside, read, some, Exception))) > 30


def test_the_checksum_is_that_of_others(tmp_path):
    """Of "abc", in the standard (FIPS 180-2, B.1)."""
    (tmp_path / "a").write_bytes(b"abc")
    assert result_checksums.file_sha256(tmp_path / "a").startswith("ba7816bf8f01cfea")
