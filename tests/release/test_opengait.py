"""OpenGait and FastPoseGait take the export as it is: their loaders' and evaluators' rules hold, by values.

The rules are those of data/dataset.py and evaluation/evaluator.py of both, and datasets/pretreatment_heatmap.py of
OpenGait.
"""

import csv
import json
import os
import pickle
import pickletools
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from dior.release import exports
from dior.release.exports import conditions, opengait
from dior.release.exports.recordings import Recording, ReleasedWalk
from tests.release import small

# of the evaluators: a type that has one of these words in it is in the gallery, or a probe of that name
GALLERY = ("00-nm",)
PROBES = {
    "Normal": ("01-nm",), "Bag": ("bg",), "Clothing": ("cl",), "Carrying": ("cr",), "Umberalla": ("ub",),
    "Uniform": ("uf",), "Occlusion": ("oc",), "Night": ("nt",), "Overall": ("01", "02", "03", "04"),
}  # fmt: skip
RANKS = 5


def has(kind, words):
    return any(word in kind for word in words)


def loaded(root, partition, part):
    """(subject, type, view, files) as the loaders find them."""
    names = json.loads(partition.read_text())[part]
    return [
        (who, kind, view, sorted(os.listdir(root / who / kind / view)))
        for who in names
        if who in os.listdir(root)
        for kind in sorted(os.listdir(root / who))
        for view in sorted(os.listdir(root / who / kind))
    ]


def figures(rows, nearest):
    """Rank-1 of each kind of probe in % as the evaluators print it. `nearest`: the index in the gallery of who is
    nearest to a probe."""
    views = sorted({view for _, _, view, _ in rows})
    found = {}
    for name, words in PROBES.items():
        rank = np.full((len(views), len(views)), np.nan)
        for i, probe_view in enumerate(views):
            probes = [row for row in rows if row[2] == probe_view and has(row[1], words)]
            for j, gallery_view in enumerate(views):
                gallery = [row for row in rows if row[2] == gallery_view and has(row[1], GALLERY)]
                assert len(gallery) >= RANKS, "topk of fewer raises"
                hits = [gallery[nearest(probe, gallery)][0] == probe[0] for probe in probes]
                if probes:
                    rank[i, j] = 100 * np.mean(hits)
        found[name] = np.mean((rank - np.diag(np.diag(rank))).sum(axis=1) / (len(views) - 1.0))
    return found


def walk(subject, nth, outfit="shirt", environment="indoor"):
    name = f"{subject}_{environment}_{nth}"
    return ReleasedWalk(subject, name, "s1", environment, outfit, "", nth, Path(name))


def recorded(walks, cameras=("cam01", "cam02"), tested=()):
    return [
        Recording(w, replace(small.camera("cam01"), name=name), Path(), Path(),
                  {"subject": "test" if w.subject in tested else "train"})
        for w in walks
        for name in cameras
    ]  # fmt: skip


def planned(recordings):
    walks = {r.walk.sequence: r.walk for r in recordings}.values()
    return opengait.planned(recordings, conditions.of_walks(walks))


def gallery_of(plan, people=None):
    """Rows of the gallery by view."""
    places = [place for place in plan.places.values() if people is None or place[0] in people]
    return Counter(view for _, kind, view in places if has(kind, GALLERY))


PEOPLE = [f"p{i}" for i in range(8)]


def test_five_people_need_one_walk_each_in_the_gallery():
    plan = planned(recorded([walk(who, n) for who in PEOPLE for n in (1, 2, 3)], tested=PEOPLE[:5]))
    assert {kind for _, kind, _ in plan.places.values()} == {"00-nm", "01-nm", "01-nm-1"}
    assert gallery_of(plan, PEOPLE[:5]) == {"indoor-cam01": 5, "indoor-cam02": 5}
    assert plan.partitions == {
        "subject": {"TRAIN_SET": PEOPLE[5:], "TEST_SET": PEOPLE[:5]},
        "everybody": {"TRAIN_SET": [], "TEST_SET": PEOPLE},
    }
    assert not plan.left_out and not plan.why


@pytest.mark.parametrize(("people", "walks"), [(2, 4), (3, 3), (4, 3), (2, 9)])
def test_fewer_people_put_more_walks_into_the_gallery_and_keep_a_probe(people, walks):
    tested = PEOPLE[:people]
    plan = planned(recorded([walk(who, n) for who in PEOPLE for n in range(walks)], tested=tested))
    assert all(count >= RANKS for count in gallery_of(plan, tested).values())
    for who in PEOPLE:
        kinds = {kind for subject, kind, _ in plan.places.values() if subject == who}
        assert len(kinds) == walks, "two walks of one type and view would be one sequence"
        assert any(has(kind, PROBES["Normal"]) for kind in kinds)


def test_no_type_is_of_two_sides_or_of_two_conditions():
    """The evaluators look for words anywhere in a type: a number in it may make it something else."""
    walks = [walk(who, n, outfit) for who in PEOPLE[:2] for n, outfit in enumerate(
        ["shirt"] * 30 + ["shirt, backpack"] * 30 + ["coat"] * 30
    )]  # fmt: skip
    plan = planned(recorded(walks, tested=PEOPLE[:2]))
    expected = {"shirt": "Normal", "shirt, backpack": "Bag", "coat": "Clothing"}
    outfit = {w.sequence: w.outfit for w in walks}
    for name, (_, kind, _) in plan.places.items():
        sides = {side for side, words in {"gallery": GALLERY, **PROBES}.items() if has(kind, words)}
        assert sides in ({"gallery"}, {expected[outfit[name.split(".")[0]]], "Overall"}), kind
    assert set(gallery_of(plan).values()) == {2 * 3}


def test_what_a_test_person_walked_in_a_view_with_too_few_is_left_out_with_the_reason():
    recordings = recorded([walk(who, n) for who in PEOPLE for n in (1, 2)], tested=PEOPLE[:6])
    recordings += recorded([walk(who, 3) for who in PEOPLE[:3]], ("far",), tested=PEOPLE[:6])
    recordings += recorded([walk(PEOPLE[7], 3)], ("other",))
    plan = planned(recordings)
    assert set(plan.left_out) == {f"{who}_indoor_3.far" for who in PEOPLE[:3]}
    assert set(plan.left_out.values()) == {"the gallery of view indoor-far has 0 walks, and the evaluators need 5"}
    assert f"{PEOPLE[7]}_indoor_3.other" in plan.places, "who is trained on may walk anywhere"
    assert set(plan.partitions) == {"subject"} and "other views" in plan.why[0]


def test_few_people_are_all_compared_and_too_few_nobody():
    plan = planned(recorded([walk(who, n) for who in PEOPLE[:5] for n in (1, 2)], tested=PEOPLE[:1]))
    assert plan.partitions == {"everybody": {"TRAIN_SET": [], "TEST_SET": PEOPLE[:5]}}
    assert plan.why == [
        "`partition/subject.json` is not here: 1 of the people to compare; of fewer than two every answer is right"
    ]
    plan = planned(recorded([walk(who, n) for who in PEOPLE[:2] for n in (1, 2)], tested=PEOPLE[:1]))
    assert not plan.partitions and len(plan.places) == 8, "the poses are there"
    assert "of 2 people, 0 of 2 views with 5 walks in the gallery" in plan.why[1]
    one_view = planned(recorded([walk(who, n) for who in PEOPLE for n in (1, 2)], ("cam01",), tested=PEOPLE[:5]))
    assert not one_view.partitions and "1 of 1 view with 5" in one_view.why[0]
    assert not planned([]).partitions


@pytest.mark.parametrize(
    ("outfits", "expected"),
    [
        (["shirt", "shirt", "coat"], ["nm", "nm", "cl"]),
        (["shirt, Backpack", "shirt", "shirt, backpack"], ["bg", "nm", "bg"]),
        (["handbag", "handbag", "coat"], ["bg", "bg", "nm"]),
        (["bag", "bag"], ["nm", "nm"]),
        (["coat without a bag", "coat, no bag", "baggy trousers"], ["nm", "cl", "cl"]),
        (["", "", "coat"], ["nm", "nm", "cl"]),
    ],
)
def test_the_usual_outfit_is_the_first_without_a_bag(outfits, expected):
    walks = [walk("p0", n, outfit) for n, outfit in enumerate(outfits)]
    assert list(conditions.of_walks(walks).values()) == expected


@pytest.fixture(scope="module")
def small_one(tmp_path_factory):
    root = tmp_path_factory.mktemp("small")
    exports.run(release=small.build(root / "dior-0.1.0"), formats=["opengait"], out=root / "out")
    return root / "out/opengait"


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Two people who are trained on and five who are tested on: two walks in a shirt, one with a bag, one in a coat."""
    people = {f"p{i}{i}": "test" if i < 5 else "train" for i in range(7)}
    outfits = ("shirt", "shirt", "bag", "coat")
    walks = [
        (who, f"{who}w{n}", "lab", n, "indoor", outfit, "line") for who in people for n, outfit in enumerate(outfits)
    ]
    root = tmp_path_factory.mktemp("many")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(small, "WALKS", walks)
        patch.setattr(small, "PART", people)
        release = small.build(root / "dior-0.1.0")
    exports.run(release=release, formats=["opengait"], out=root / "out")
    return root / "out/opengait"


@pytest.mark.parametrize("name", ["subject", "everybody"])
def test_the_evaluators_have_a_figure_for_each_condition(made, name):
    rows = loaded(made / "data", made / f"partition/{name}.json", "TEST_SET")
    assert len(rows) == (5 if name == "subject" else 7) * 4 * 2 and all(len(files) == 1 for *_, files in rows)
    right = figures(rows, lambda probe, gallery: [row[0] for row in gallery].index(probe[0]))
    wrong = figures(rows, lambda probe, gallery: [row[0] != probe[0] for row in gallery].index(True))
    walked = ("Normal", "Bag", "Clothing", "Overall")
    assert {name: right[name] for name in walked} == dict.fromkeys(walked, 100.0)
    assert {name: wrong[name] for name in walked} == dict.fromkeys(walked, 0.0)
    assert all(np.isnan(right[name]) for name in set(PROBES) - set(walked))


def test_loaders_find_poses_of_one_length_that_can_be_written_to(made, small_one):
    trained = loaded(made / "data", made / "partition/subject.json", "TRAIN_SET")
    assert {who for who, *_ in trained} == {"p55", "p66"}
    paths = sorted([*made.glob("data/*/*/*/*"), *small_one.glob("data/*/*/*/*")])
    assert len(paths) == 7 * 4 * 2 + 8
    # what SkeletonGait's pretreatment looks for
    assert paths == sorted([*made.glob("data/*/*/*/03*.pkl"), *small_one.glob("data/*/*/*/03*.pkl")])
    for path in paths:
        array = pickle.loads(path.read_bytes())
        assert array.shape == (small.PICTURES, 17, 3) and array.dtype == np.float32 and array.flags.writeable
    (path,) = (small_one / "data/pb22/00-nm/indoor-cam02").iterdir()
    uv, status = small.truth("indoor", "cam02")
    array = pickle.loads(path.read_bytes())
    np.testing.assert_allclose(array[..., :2], uv, atol=3e-3)
    np.testing.assert_array_equal(array[..., 2], np.isin(status, ("ok", "occluded")))


def test_a_small_release_has_its_poses_and_says_why_nothing_is_evaluated(small_one):
    assert not (small_one / "partition").exists() and not (small_one / "configs").exists()
    assert sorted(path.name for path in small_one.glob("data/*/*")) == ["00-nm"] * 2
    text = (small_one / "README.md").read_text()
    assert "`partition/subject.json` is not here: 1 of the people to compare" in text
    assert "0 of 4 views with 5 walks in the gallery" in text


def test_lists_say_what_is_what(made):
    rows = list(csv.DictReader((made / "sequences.csv").open()))
    assert len(rows) == 7 * 4 * 2 and not any(row["left_out"] for row in rows)
    for row in rows:
        place = made / "data" / row["subject"] / row["type"] / row["view"]
        assert [path.name for path in place.iterdir()] == [f"03-{row['sequence']}.{row['camera']}.pkl"]
    text = (made / "README.md").read_text()
    assert "| indoor-cam01 | 5 | 5 | 5 | 5 |" in text and "| indoor-cam02 | 7 | 7 | 7 | 7 |" in text
    assert "--cfgs ./datasets/dior/configs/gaitgraph2.yaml" in text


def test_configs_name_what_there_is_and_fit_one_gpu(made):
    found = {path.stem: yaml.safe_load(path.read_text()) for path in (made / "configs").iterdir()}
    assert set(found) == {"gaitgraph2", "gaittr", "skeletongait", "gpgait"}
    for name, config in found.items():
        data, evaluated, trained = (config[key] for key in ("data_cfg", "evaluator_cfg", "trainer_cfg"))
        # under another name the evaluators raise
        assert data["dataset_name"] == data["test_dataset_name"] == "SUSTech1K"
        assert data["dataset_partition"] == "./datasets/dior/partition/subject.json"
        if name != "skeletongait":
            assert data["dataset_root"] == "./datasets/dior/data"
        assert evaluated["sampler"]["batch_size"] == 1 and evaluated["restore_hint"] == trained["total_iter"]
        assert trained["total_iter"] % trained["save_iter"] == 0, "the last weights are saved"
        assert len(evaluated["transform"]) == len(trained["transform"]) == 1, "one for each kind of data"
        if trained["sampler"]["sample_type"] == "fixed_ordered":
            assert trained["sampler"]["frames_skip_num"] == 0
    assert (
        found["skeletongait"]["model_cfg"]["SeparateBNNecks"]["class_num"] == found["gpgait"]["model_cfg"]["num_class"]
    )
    assert found["gpgait"]["model_cfg"]["num_class"] == 2


def test_pickles_name_nothing_that_only_one_numpy_has():
    array = np.arange(6, dtype=np.float32).reshape(1, 2, 3)
    content = opengait.pickled(array)
    words = {arg for _, arg, _ in pickletools.genops(content) if isinstance(arg, str)}
    assert not any("core" in word for word in words), words
    np.testing.assert_array_equal(pickle.loads(content), array)
