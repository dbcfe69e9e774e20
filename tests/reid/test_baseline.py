"""The baseline on made-up measurements: people are found, sessions are not."""

import numpy as np
import pytest

from dior.reid import baseline, protocols, statistics
from dior.reid.features import FEATURES, Gait
from dior.reid.protocols import Item

D = len(FEATURES)


def gallery(people, sessions_sd, subjects=14, sessions=3, walks=4, noise=1.0, seed=1, informative=10):
    """Items and measurements: what a person, a session and a walk add to each feature."""
    random = np.random.default_rng(seed)
    own = np.zeros((subjects, D))
    own[:, :informative] = people * random.standard_normal((subjects, informative))
    days = {}
    items, gaits = [], []
    for environment in ("indoor", "outdoor"):
        for s in range(subjects):
            day = f"{environment}_{s % sessions}"
            days.setdefault(day, sessions_sd * random.standard_normal(D))
            for w in range(walks):
                items.append(Item(f"S{s:02d}", f"{environment}_{s}_{w}", day, environment, "cam01"))
                values = own[s] + days[day] + noise * random.standard_normal(D)
                gaits.append(Gait(0.1 * values, np.full(D, 0.1 * noise)))
    return items, gaits


def score(items, gaits, protocol="other_place"):
    found, small = baseline.distances(gaits, [i.subject for i in items], [i.session for i in items])
    assert np.allclose(found, found.T)
    return statistics.score(protocols.trials(found, items, protocol), items), small


def test_different_people_are_found():
    got, small = score(*gallery(people=3.0, sessions_sd=0.0))
    assert got.rank1 > 0.9 and got.verdict == "above chance" and small == []


@pytest.mark.slow
def test_the_same_people_on_other_days_are_not():
    """Subjects are nested in sessions, whose errors are large: nothing of that may help."""
    rates = [score(*gallery(people=0.0, sessions_sd=5.0, seed=seed))[0].rank1 for seed in range(4)]
    assert np.mean(rates) == pytest.approx(1 / 14, abs=0.025)


def test_a_sessions_scale_does_not_help():
    items, gaits = gallery(people=0.0, sessions_sd=0.0)
    size = FEATURES.index("size")
    for item, gait in zip(items, gaits, strict=True):
        gait.values[size] += 5.0 * int(item.session[-1])
    assert score(items, gaits)[0].rank1 < 0.13


@pytest.mark.slow
def test_a_sessions_errors_do_not_hurt():
    alone = score(*gallery(people=2.0, sessions_sd=0.0))[0].rank1
    assert score(*gallery(people=2.0, sessions_sd=20.0))[0].rank1 == pytest.approx(alone)


def test_features_that_vary_within_a_person_count_less():
    items, gaits = gallery(people=2.0, sessions_sd=0.0)
    random = np.random.default_rng(3)
    worse = [Gait(g.values + np.where(np.arange(D) >= 30, 5.0, 0) * random.standard_normal(D), g.sigma) for g in gaits]
    assert score(items, worse)[0].rank1 > 0.75


@pytest.mark.slow
def test_a_recording_that_is_noisy_counts_less():
    items, gaits = gallery(people=2.0, sessions_sd=0.0)
    far = baseline.distances(gaits, [i.subject for i in items], [i.session for i in items])[0]
    unsure = [Gait(g.values, g.sigma * (5.0 if i == 0 else 1.0)) for i, g in enumerate(gaits)]
    near = baseline.distances(unsure, [i.subject for i in items], [i.session for i in items])[0]
    # it says less, whether for or against
    assert np.std(near[0, 1:]) < 0.5 * np.std(far[0, 1:])
    assert np.corrcoef(near[0, 1:], far[0, 1:])[0, 1] > 0.8


@pytest.mark.slow
def test_nobody_is_measured_by_his_own_noise():
    """Without any signal a person's own recordings are no further from each other than from others'."""
    rates = [score(*gallery(people=0.0, sessions_sd=0.0, seed=seed), "other_recording")[0].rank1 for seed in range(4)]
    assert np.mean(rates) == pytest.approx(3.5 / 55.5, abs=0.03)


def test_a_session_of_few_people_is_named():
    items, gaits = gallery(people=2.0, sessions_sd=0.0, subjects=4, sessions=4)
    got, small = score(items, gaits)
    assert small == sorted({item.session for item in items}) and got.rank1 > 0.5
    # no size: it may be the session's
    values, _ = baseline.centred([g.values for g in gaits], [i.session for i in items], [i.subject for i in items])
    assert (values[:, FEATURES.index("size")] == 0).all()


def test_two_people_are_compared_by_the_standard_errors():
    items, gaits = gallery(people=3.0, sessions_sd=0.0, subjects=2, sessions=1)
    assert score(items, gaits)[0].rank1 == 1
