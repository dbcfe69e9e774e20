"""Others can read a release the same day: datasets, DuckDB, pandas and mlcroissant, without the network."""

import io
import json
import os
import re

import numpy as np
import pandas as pd
import pytest
import yaml

from dior.release import walk_files
from dior.tables import tables
from tests.release.made import RELEASE, ROLES, build

CONFIGS = {
    "labels_2d": 54, "skeletons_3d": 6, "frames": 27, "detections": 12, "boxes": 2, "marks": 3,
    "gait": 0, "gait_events": 0, "gait_steps": 0, "covers": 18,
    "cameras": 6, "camera_covariance": 8, "clocks": 9, "sequences": 3, "subjects": 2, "splits": 27,
}  # fmt: skip


def card(out):
    return (out / "README.md").read_text()


def block(out, language):
    """The first block of that language in the card."""
    return re.search(rf"```{language}\n(.*?)\n```", card(out), re.DOTALL)[1]


@pytest.fixture(scope="module")
def datasets(tmp_path_factory):
    """The library, kept from the network and from the cache of whoever runs the tests."""
    os.environ |= {"HF_HUB_OFFLINE": "1", "HF_HOME": str(tmp_path_factory.mktemp("hf"))}
    import datasets

    datasets.disable_progress_bars()
    return datasets


@pytest.mark.slow
def test_datasets_loads_every_config_with_its_types(built, datasets, tmp_path):
    out = built["out"]
    front = yaml.safe_load(card(out).split("---\n")[1])
    assert [part["config_name"] for part in front["configs"]] == list(CONFIGS)
    for name, rows in CONFIGS.items():
        if not rows:
            with pytest.raises(ValueError, match="corresponds to no data"):
                datasets.load_dataset(str(out), name, cache_dir=str(tmp_path))
            continue
        found = datasets.load_dataset(str(out), name, cache_dir=str(tmp_path))["train"]
        assert len(found) == rows, name
        kind = tables.metadata(next(out.glob(f"{name}/*/*.parquet"), out / f"{name}.parquet"))["dior_table"]
        assert list(found.features) == tables.columns_of(kind)
        assert all(found.features[key].dtype == "string" for key in ("subject", "camera") if key in found.features)
        assert "subject" not in found.features or set(found["subject"]) <= {"apple-0002", "zebra-0001"}
    rig = datasets.load_dataset(str(out), "cameras", cache_dir=str(tmp_path))["train"]
    assert rig.features["wTc"] == datasets.List(datasets.Value("float64"), length=16)
    assert rig["wTc"][0] == np.eye(4).ravel().tolist() and rig["covariance"][1] is None


def test_datasets_reads_gait_of_which_one_walk_has_none(datasets, tmp_path):
    event = {
        "subject": ["p"], "sequence": ["w"], "foot": ["left"], "event": ["toe_off"], "stamp_ns": [1], "instant": [1],
        "time_s": [0.1], "sigma_s": [0.1], "low_s": [0.1], "high_s": [0.1], "reason": [""],
    }  # fmt: skip
    whole = tables.to_arrow("gait_events", event)
    for name, table in (("a", whole.slice(0, 0)), ("b", whole)):
        walk_files.write_gait(tmp_path / f"{name}.parquet", table)
        assert len(tables.read(tmp_path / f"{name}.parquet", "gait_events")["foot"]) == table.num_rows
    files = [str(tmp_path / f"{name}.parquet") for name in "ab"]
    found = datasets.load_dataset("parquet", data_files=files, cache_dir=str(tmp_path / "cache"))["train"]
    assert len(found) == 1


@pytest.mark.slow
def test_datasets_decodes_the_pictures(built, datasets, tmp_path):
    found = datasets.load_dataset(str(built["out"]), "frames", cache_dir=str(tmp_path))["train"]
    assert isinstance(found.features["image"], datasets.Image)
    for row in found:
        if row["frame"] == 2:
            assert row["image"] is None and row["no_image"] == "head_unknown"
            continue
        assert row["image"].size == (64, 36) == (row["width"], row["height"]) and row["no_image"] is None
        assert abs(np.asarray(row["image"]).mean() - (40 * row["frame"] + 20)) < 2


def test_the_sql_line_of_the_card_is_the_mean_long_range_sigma_per_subject(built, monkeypatch):
    import duckdb

    out = built["out"]
    line = block(out, "sql")
    assert "\n" not in line and line in card(out)
    monkeypatch.chdir(out)
    answer = duckdb.sql(line).fetchall()
    labels = pd.concat(map(pd.read_parquet, out.glob("labels_2d/*/*.parquet")))
    roles = {camera for camera, role in ROLES.items() if role == "long_range"}
    far = labels[labels["camera"].isin(roles) & labels["status"].isin(["ok", "occluded"])].dropna(subset="sigma_v")
    sigma = np.sqrt((far["sigma_u"].astype(float) ** 2 + far["sigma_v"].astype(float) ** 2) / 2)
    expected = sigma.groupby(far["subject"].astype(str)).mean()
    assert [who for who, _ in answer] == ["apple-0002", "zebra-0001"] == sorted(expected.index)
    np.testing.assert_allclose([value for _, value in answer], expected.sort_index(), rtol=1e-6)


def test_the_cards_lines_of_python_run(built, datasets, monkeypatch, tmp_path):
    monkeypatch.chdir(built["out"])
    monkeypatch.setattr(datasets.config, "HF_DATASETS_CACHE", tmp_path)
    blocks = re.findall(r"```python\n(.*?)```", card(built["out"]), re.DOTALL)
    assert len(blocks) == 2
    scope = {}
    for code in blocks:
        exec(code, scope)
    assert scope["seen"]["u"]["nose"].tolist() == [0.0, 2.0, 4.0]
    assert len(scope["pictures"]) == 18 and set(scope["test"]["split"]) == {"subject"}


def test_croissant_of_a_release_with_a_day_has_no_warning_and_tells_of_the_people(made, tmp_path):
    import mlcroissant

    out = build(made, config=made["config"] | {"release": RELEASE | {"date": "2026-11-30"}})
    content = json.loads((out / "croissant.json").read_text())
    assert content["datePublished"] == "2026-11-30"
    assert "Gait is a biometric trait" in " ".join(content["rai:personalSensitiveInformation"])
    assert "heads are blurred" in " ".join(content["rai:dataPreprocessingProtocol"])
    dataset = mlcroissant.Dataset(str(out / "croissant.json"))
    issues = dataset.metadata.ctx.issues
    assert not issues.errors and not issues.warnings
    assert dataset.metadata.date_published.date().isoformat() == "2026-11-30"
    # every property that begins with rai: is one that the library knows, and is kept by it
    kept = {key for key in dataset.metadata.to_json() if key.startswith("rai:")}
    assert kept == {key for key in content if key.startswith("rai:")} and len(kept) >= 10


@pytest.mark.slow
def test_croissant_is_valid_and_its_records_are_the_rows(built):
    import mlcroissant

    dataset = mlcroissant.Dataset(str(built["out"] / "croissant.json"))
    issues = dataset.metadata.ctx.issues
    assert not issues.errors and [text for text in issues.warnings if "datePublished" not in text] == []
    assert dataset.metadata.ctx.is_v1_1()
    assert {record_set.id for record_set in dataset.metadata.record_sets} == set(CONFIGS)
    for name, rows in CONFIGS.items():
        assert len(list(dataset.records(name))) == rows, name
    boxes = [{key.split("/")[1]: value for key, value in row.items()} for row in dataset.records("boxes")]
    assert [(row["camera"], row["frame"], row["v_max"]) for row in boxes] == [(b"cam02", 1, 8.0), (b"cam02", 2, 4.5)]
    pictures = [row["frames/image"] for row in dataset.records("frames")]
    assert sum(picture is not None and picture.size == (64, 36) for picture in pictures) == 18
    rig = next(iter(dataset.records("cameras")))
    assert rig["cameras/wTc"] == np.eye(4).ravel().tolist() and rig["cameras/role"] == b"close"


def test_a_picture_is_the_jpeg_as_it_was_written(built):
    from PIL import Image

    shard = tables.read(built["out"] / "frames/apple-0002/walk_3.cam02.parquet", "released_frames")
    assert Image.open(io.BytesIO(shard["image"][0])).format == "JPEG" and shard["image"][2] is None
