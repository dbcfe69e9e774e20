"""The protocols on made-up embeddings with known answers."""

import numpy as np
import pytest

from dior.errors import DiorError
from dior.reid import protocols, statistics
from dior.reid.protocols import Item

SUBJECTS, WALKS = 14, 4
CAMERAS = ("cam01", "cam02", "cam03", "cam04")


def items_of(subjects=SUBJECTS, walks=WALKS, cameras=CAMERAS, sessions=1):
    """Every subject walks `walks` times in each environment, seen by all of its cameras."""
    return [
        Item(f"S{s:02d}", f"{environment}_{s:02d}_{w}", f"{environment}_{s % sessions}", environment, camera)
        for environment in ("indoor", "outdoor")
        for s in range(subjects)
        for w in range(walks)
        for camera in cameras
    ]


def distances(points):
    return np.linalg.norm(points[:, None] - points[None], axis=-1)


def of_subject(items, random, noise=0.0):
    """Embeddings that tell subjects apart, and nothing else."""
    where = protocols.numbered([item.subject for item in items])
    people = random.standard_normal((where.max() + 1, 16))
    return people[where] + noise * random.standard_normal((len(items), 16))


def of_recording(items, random):
    """Embeddings that tell recordings apart, but not whose they are."""
    where = protocols.numbered([item.recording for item in items])
    return random.standard_normal((where.max() + 1, 16))[where] + 1e-3 * random.standard_normal((len(items), 16))


@pytest.mark.parametrize("protocol", protocols.PROTOCOLS)
def test_perfect_embeddings_are_always_right(protocol):
    items = items_of()
    found = protocols.trials(distances(of_subject(items, np.random.default_rng(1))), items, protocol)
    score = statistics.score(found, items)
    assert score.hits == score.n and score.mean_ap == pytest.approx(1) and score.cmc[0] == 1
    assert score.low == score.high == 1 and score.verdict == "above chance"


def test_the_papers_grid_is_k_of_392():
    items = items_of()
    found = protocols.trials(distances(np.random.default_rng(2).standard_normal((len(items), 8))), items, "per_camera")
    for view in found.views:
        score = statistics.score(found.of(view), items)
        assert score.n == 392
        # chance: each gallery camera has 4 right ones among 56
        assert score.chance == pytest.approx(28 / 392)
        assert abs(score.rank1 - score.chance) < 0.06
    assert len(found.views) == 8 and len(found.probe) == 8 * 392
    # per gallery camera and then averaged, as the authors' function does: the same grid
    view = ("outdoor", "cam02")
    own = found.of(view)
    match = protocols.matches(own, items)[:, 0]
    camera = [items[i].view for i in own.ranked[:, 0]]
    cells = [match[[c == other for c in camera]].mean() for other in found.views if other != view]
    assert np.mean(cells) == pytest.approx(statistics.score(own, items).rank1)


@pytest.mark.parametrize(
    ("protocol", "count", "right", "size"),
    [("per_camera", 7, 4, 56), ("pooled", 1, 28, 392), ("other_recording", 7, None, None), ("other_place", 4, 4, 56)],
)
def test_galleries_have_what_they_should(protocol, count, right, size):
    items = items_of()
    found = protocols.trials(np.zeros((len(items),) * 2), items, protocol).of(("indoor", "cam03"))
    assert len(found.probe) == 56 * count
    assert all(items[i].view == ("indoor", "cam03") for i in found.probe)
    match = protocols.matches(found, items)
    if right:
        assert set(match.sum(axis=1)) == {right} and set((found.ranked >= 0).sum(axis=1)) == {size}
        return
    for probe, row, own in zip(found.probe, found.ranked, match, strict=True):
        near = items[row[0]].environment == "indoor"
        assert (row >= 0).sum() == (55 if near else 56) and own.sum() == (3 if near else 4)
        assert items[probe].recording not in {items[i].recording for i in row if i >= 0}


def test_simultaneous_pictures_are_found_by_the_paper_s_protocol_only():
    """A recording is known again: that is no recognition of a person, and only P1 and P2 reward it."""
    items = items_of()
    far = distances(of_recording(items, np.random.default_rng(3)))
    scores = {
        protocol: statistics.score(protocols.trials(far, items, protocol), items) for protocol in protocols.PROTOCOLS
    }
    # 3 of 7 gallery cameras show the same recording
    assert scores["per_camera"].rank1 > 3 / 7
    assert scores["pooled"].rank1 == 1
    assert scores["other_recording"].rank1 < 0.15 and scores["other_place"].rank1 < 0.15
    # the null keeps the cameras of a recording together, so it is not fooled
    assert scores["pooled"].verdict == "at chance"
    assert scores["other_recording"].verdict == "at chance"


def test_a_session_is_no_person():
    """Embeddings that tell the sessions apart, in which the subjects are nested, are at chance."""
    items = items_of(sessions=3)
    day = protocols.numbered([item.session.rsplit("_")[1] for item in items])
    random = np.random.default_rng(4)
    points = 5.0 * day[:, None] + random.standard_normal((len(items), 3))
    score = statistics.score(protocols.trials(distances(points), items, "other_recording"), items)
    assert score.rank1 > 2.2 * score.chance
    assert score.verdict == "at chance"


def test_ranks_and_precision_by_hand():
    items = [Item("A", "r1", "s", "indoor", "c1")] + [
        Item(who, f"g{i}", "s", "indoor", "c2") for i, who in enumerate("BABA")
    ]
    far = np.zeros((5, 5))
    far[0, 1:] = 1, 2, 3, 4
    found = protocols.trials(far, items, "per_camera").of(("indoor", "c1"))
    match = protocols.matches(found, items)
    assert match.tolist() == [[False, True, False, True]]
    assert protocols.hits(match, 6).tolist() == [[False, True, True, True, True, True]]
    assert protocols.average_precision(match) == pytest.approx([(1 / 2 + 2 / 4) / 2])
    score = statistics.score(found, items)
    assert (score.hits, score.n, score.chance) == (0, 1, 0.5)
    assert score.cmc[:2] == (0, 1)


def test_equal_distances_are_taken_in_order():
    items = items_of(subjects=3, walks=1, cameras=("c1", "c2"))
    found = protocols.trials(np.zeros((len(items),) * 2), items, "per_camera")
    assert (np.diff(found.ranked, axis=1) > 0).all()
    score = statistics.score(found, items)
    # the first of three is right for one subject of three
    assert score.rank1 == pytest.approx(1 / 3)


def test_a_subject_who_is_not_in_the_gallery_has_no_trial():
    items = [
        Item("A", "r1", "s", "indoor", "c1"),
        Item("B", "r2", "s", "indoor", "c1"),
        Item("A", "r3", "t", "outdoor", "c1"),
    ]
    found = protocols.trials(np.ones((3, 3)), items, "per_camera")
    assert [items[i].recording for i in found.probe] == ["r1", "r3"]
    nothing = protocols.trials(np.ones((2, 2)), items[:2], "per_camera")
    score = statistics.score(nothing, items[:2])
    assert score.n == 0 and np.isnan(score.rank1) and score.verdict == "no trial"


def test_the_interval_is_over_subjects():
    """Half of the people are always found, the others never: with more walks of each the interval stays."""
    for walks in (2, 8):
        items = items_of(walks=walks, cameras=("c1",))
        sure = np.array([int(item.subject[1:]) % 2 == 0 for item in items])
        where = protocols.numbered([item.subject for item in items])
        points = np.where(sure, where * 10.0, [100.0 + 7 * (item.environment == "outdoor") for item in items])
        points = points + 1e-3 * np.arange(len(items)) * ~sure
        score = statistics.score(protocols.trials(distances(points[:, None]), items, "other_place"), items)
        assert 0.5 <= score.rank1 < 0.6 and score.low < 0.32 and score.high > 0.72


def test_the_null_is_right_as_often_as_it_says():
    """Without any signal p is below 5 % about 5 % of the time."""
    items = items_of(subjects=8, walks=3, cameras=("c1", "c2"), sessions=2)
    random = np.random.default_rng(5)
    exchanges = statistics.exchanged(items, 199)
    scores = [
        statistics.score(
            protocols.trials(distances(random.standard_normal((len(items), 4))), items, "other_recording"),
            items,
            exchanges,
        ).p
        for _ in range(100)
    ]
    assert np.mean(np.array(scores) <= 0.05) <= 0.10 and np.mean(np.array(scores) <= 0.5) > 0.35


def test_distances_must_be_numbers():
    items = items_of(subjects=2, walks=1)
    with pytest.raises(DiorError, match="finite"):
        protocols.trials(np.full((len(items),) * 2, np.nan), items, "pooled")
    with pytest.raises(DiorError, match="no protocol 'pool'.*pooled"):
        protocols.trials(np.zeros((len(items),) * 2), items, "pool")


def test_what_is_held_out_asks_and_never_answers():
    items = items_of(subjects=4)
    held = np.array([item.recording.endswith("_3") for item in items])
    found = protocols.trials(np.zeros((len(items),) * 2), items, "other_recording", held)
    assert set(found.probe.tolist()) == set(np.flatnonzero(held).tolist())
    assert not held[found.ranked[found.ranked >= 0]].any()
    # 3 walks of 4 people are left in each gallery camera
    assert found.ranked.shape == (held.sum() * 7, 12)


def test_the_null_and_its_p_are_of_the_exchanges_that_reach_the_rate():
    """All four are found; of 20 exchanges one keeps everybody's name and 19 take it from the nearest."""
    items = [Item(who, f"{who}_{camera}", "lab", "indoor", camera) for camera in ("cam1", "cam2") for who in "AB"]
    far = np.abs(np.subtract.outer([0, 1, 0, 1], [0, 1, 0, 1])).astype(float)
    exchanges = np.array([[0, 1, 0, 1]] + 19 * [[0, 0, 1, 1]])
    score = statistics.score(protocols.trials(far, items, "per_camera"), items, exchanges)
    assert (score.hits, score.n) == (4, 4)
    assert score.p == pytest.approx(2 / 21)
    assert score.null == pytest.approx(0.05)


def test_inverse_precision_is_by_the_last_right_one():
    match = np.array([[True, True, False, False], [True, False, False, True], [False, True, False, False]])
    assert protocols.inverse_precision(match) == pytest.approx([1, 2 / 4, 1 / 2])


def test_tar_counts_pairs_of_one_person_nearer_than_all_but_one_of_a_hundred_others():
    """By sorting all pairs at hand; perfect embeddings accept all, and random ones as many as there are false ones."""
    items, random = items_of(), np.random.default_rng(8)
    where = protocols.numbered([item.subject for item in items])
    for noise in (0.0, 0.8, 100.0):
        far = distances(of_subject(items, random, noise))
        found = protocols.trials(far, items, "pooled")
        score = statistics.score(found, items)
        view = protocols.numbered(["".join(item.view) for item in items])
        asked = view[:, None] != view
        one = where[:, None] == where
        others = np.sort(far[asked & ~one])
        right = far[asked & one] < others[len(others) // 100]
        assert score.tar == pytest.approx(right.mean())
        assert score.tar_range[0] <= score.tar <= score.tar_range[1]
        assert score.mean_inp_range[0] <= score.mean_inp <= score.mean_inp_range[1]
        assert score.mean_ap_range[0] <= score.mean_ap <= score.mean_ap_range[1]
        assert score.rank5_range[0] <= score.cmc[4] <= score.rank5_range[1]
        if noise == 0:
            assert score.tar == 1 and score.mean_inp == pytest.approx(1)
    # nothing is known of who it is
    assert abs(score.tar - 0.01) < 0.005


def test_too_few_pairs_say_nothing_of_tar():
    items = items_of(subjects=2, walks=1, cameras=("cam01", "cam02"))
    found = protocols.trials(distances(np.random.default_rng(9).standard_normal((len(items), 4))), items, "pooled")
    assert np.isnan(statistics.score(found, items).tar)
    with pytest.raises(ValueError, match="pairs of two people say nothing"):
        protocols.accepted(found, protocols.matches(found, items), 0.001)
