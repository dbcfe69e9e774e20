"""Training: what it learns, that it is the same twice, and that it goes on where it was stopped."""

import json
from dataclasses import replace

import numpy as np
import pytest

from dior.errors import DiorError
from dior.reid import augment, checkpoint, embed, inputs, networks, recognise, split, train
from dior.reid.protocols import Item

torch = pytest.importorskip("torch", reason="PyTorch is not installed: pip install -r requirements-reid.txt")

from dior.reid import losses  # noqa: E402
from tests.cases import slow  # noqa: E402

SUBJECTS, WALKS, FRAMES = 3, 3, 64


def sequences(seed=0, walks=WALKS):
    """People who are broad or narrow: (subjects x walks) sequences (64, 17, 2) px, and of whom they are."""
    random = np.random.default_rng(seed)
    base = np.stack([random.uniform(-20, 20, 17), np.linspace(-50, 50, 17)], axis=-1)
    found, who = [], []
    for subject in range(SUBJECTS):
        for _ in range(walks):
            turn = 0.2 * np.arange(FRAMES) + random.uniform(0, 6)
            uv = base * (0.5 + 0.5 * subject, 1.0) + 5 * np.sin(turn)[:, None, None] * (1.0, 0.0)
            found.append(uv + inputs.MIDDLE + random.standard_normal(uv.shape))
            who.append(f"S{subject}")
    return found, np.array(who)


@pytest.fixture(autouse=True)
def small(monkeypatch):
    monkeypatch.setattr(train, "PEOPLE", 2)
    few = {name: replace(recipe, sequences=2) for name, recipe in train.RECIPES.items()}
    monkeypatch.setattr(train, "RECIPES", few)
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(threads)


SLOW = [slow(name) for name in ("gaitgraph", "gaitformer", "gaitgraph2")]


# the contrast of 3 right ones shares the probability: it cannot be less
LEAST = {"gaitgraph": losses.TEMPERATURE / losses.BASE_TEMPERATURE * np.log(3)}
NEWER = ("gaitgraph2",)
# batches; chosen: few, and enough
STEPS = {"gaitgraph2": 12}


@pytest.mark.parametrize("name", ["gaitmixer", *SLOW])
def test_the_loss_goes_down_and_the_weights_can_be_loaded(name, tmp_path):
    given, who = sequences()
    network, found = train.trained(name, given, who, tmp_path / "w.pt", steps=14 if name == "gaitmixer" else 40)
    found = np.array(found) - LEAST.get(name, 0.0)
    assert found[-4:].mean() < 0.8 * found[:4].mean()
    loaded = checkpoint.load(name, tmp_path / "w.pt")
    assert (embed.embeddings(name, loaded, given) == embed.embeddings(name, network, given)).all()
    assert [path.name for path in tmp_path.iterdir()] == ["w.pt"]


@pytest.mark.parametrize("name", NEWER)
def test_two_made_up_walkers_are_told_apart(name, tmp_path):
    """Two people who differ in breadth, walks that the training has not seen, from few steps."""
    given, who = sequences()
    two = [i for i, subject in enumerate(who) if subject != "S1"]
    train.trained(name, [given[i] for i in two], who[two], tmp_path / "w.pt", steps=STEPS[name])
    loaded = checkpoint.load(name, tmp_path / "w.pt")
    new = sequences(walks=2 * WALKS)[0]
    unseen = [new[i] for i in range(len(new)) if i // (2 * WALKS) != 1]
    found = embed.embeddings(name, loaded, [*(given[i] for i in two), *unseen])
    far = embed.distances(name, found)[len(two) :, : len(two)]
    nearest = who[two][far.argmin(axis=1)]
    assert nearest.tolist() == ["S0"] * 2 * WALKS + ["S2"] * 2 * WALKS


@pytest.mark.parametrize("name", ["gaitgraph", *NEWER])
def test_the_same_seed_gives_the_same_bytes_and_another_does_not(name, tmp_path):
    given, who = sequences()
    for file, seed in (("a.pt", 1), ("b.pt", 1), ("c.pt", 2)):
        train.trained(name, given, who, tmp_path / file, steps=2, seed=seed)
    a, b, c = ((tmp_path / file).read_bytes() for file in ("a.pt", "b.pt", "c.pt"))
    assert a == b != c


@pytest.mark.parametrize("name", ["gaitmixer", *SLOW])
def test_a_killed_training_goes_on_to_the_same_bytes(name, tmp_path, monkeypatch):
    given, who = sequences()
    train.trained(name, given, who, tmp_path / "whole.pt", steps=3)
    monkeypatch.setattr(train, "SAVE_S", 0.0)
    step, done = train._step, []

    def killed(*args):
        if len(done) == 2:
            raise KeyboardInterrupt
        done.append(args[-1])
        return step(*args)

    monkeypatch.setattr(train, "_step", killed)
    with pytest.raises(KeyboardInterrupt):
        train.trained(name, given, who, tmp_path / "cut.pt", steps=3)
    assert not (tmp_path / "cut.pt").exists() and (tmp_path / "cut.pt.training.npz").is_file()
    monkeypatch.setattr(train, "_step", lambda *args: done.append(args[-1]) or step(*args))
    _, found = train.trained(name, given, who, tmp_path / "cut.pt", steps=3)
    assert done == [0, 1, 2] and len(found) == 3
    assert (tmp_path / "cut.pt").read_bytes() == (tmp_path / "whole.pt").read_bytes()
    assert not (tmp_path / "cut.pt.training.npz").exists()


def test_a_training_of_something_else_is_not_gone_on_with(tmp_path):
    given, who = sequences()
    network = networks.build("gaitgraph")
    optimiser = torch.optim.Adam(network.parameters())
    train._save(tmp_path / "w.pt.training.npz", "another", network, optimiser, [1.0])
    with pytest.raises(DiorError, match="other sequences or settings"):
        train.trained("gaitgraph", given, who, tmp_path / "w.pt", steps=2)
    begun = (tmp_path / "w.pt.training.npz").read_bytes()
    for damaged in (b"nothing", begun[: len(begun) // 2]):
        (tmp_path / "w.pt.training.npz").write_bytes(damaged)
        with pytest.raises(DiorError, match="not a training that can be continued"):
            train.trained("gaitgraph", given, who, tmp_path / "w.pt", steps=2)


def test_given_weights_are_where_it_begins(tmp_path):
    given, who = sequences()
    torch.manual_seed(3)
    train.save_weights(tmp_path / "first.pt", networks.build("gaitgraph"))
    train.trained("gaitgraph", given, who, tmp_path / "more.pt", weights=tmp_path / "first.pt", steps=1)
    first, more = (checkpoint.read(tmp_path / file) for file in ("first.pt", "more.pt"))
    # the first step of the schedule is a small one
    assert 0 < np.abs(more["fcn.weight"] - first["fcn.weight"]).max() < 1e-3


def test_held_out_walks_are_looked_for_among_the_training_and_never_trained_with(tmp_path, monkeypatch):
    given, who = sequences()
    sheet = {f"w{i}": {"subject": s, "session": "lab", "session_order": str(i)} for i, s in enumerate(who)}
    items = [Item(s, f"w{i}", "lab", "indoor", cam) for cam in ("cam01", "cam02") for i, s in enumerate(who)]
    shown = recognise.Gallery(tuple(items), (*given, *given), (320,) * len(items), ())
    parts = split.of(sheet)
    seen = []
    real = train.trained
    monkeypatch.setattr(train, "trained", lambda name, some, *rest: seen.extend(some) or real(name, some, *rest))
    train.train_and_test("gaitgraph", shown, parts, tmp_path / "w.pt", steps=2)
    found = json.loads((tmp_path / "w.pt.json").read_text())
    assert len(seen) == 2 * SUBJECTS * (WALKS - 1) == found["sequences"]
    held = [given[i] for i in range(len(who)) if f"w{i}" in parts.test]
    assert not any(np.array_equal(inputs.adapted(a, 320, train.ADAPTATION), b) for a in held for b in seen)
    # a held-out sequence per camera and subject, in the one other camera
    assert found["test"][0]["n"] == 2 * SUBJECTS and found["held_out"] == list(parts.test)


def test_the_schedule_rises_to_its_most_and_falls():
    """By a cosine over 30 % of the steps and one over the rest; from 1/25 of the most, to 1e-4 of that."""
    rates, betas = zip(*train.one_cycle(41, 6e-3), strict=True)
    top, end = 0.3 * 41 - 1, 40
    step = np.arange(41)
    rise, fall = (1 - np.cos(np.pi * step / top)) / 2, (1 + np.cos(np.pi * (step - top) / (end - top))) / 2
    low, last = 6e-3 / 25, 6e-3 / 25 / 1e4
    assert rates == pytest.approx(np.where(step <= top, low + rise * (6e-3 - low), last + fall * (6e-3 - last)))
    assert betas[0] == (0.95, 0.999) and min(betas)[0] == pytest.approx(0.85, abs=1e-3) and betas[-1][0] == 0.95


def test_an_augmented_sequence_is_60_frames_of_the_same_body():
    uv = sequences()[0][0]
    for seed in range(8):
        found = augment.augmented(uv, np.random.default_rng(seed))
        assert found.shape == (60, 17, 2)
        # the mirror is about each frame's middle
        assert np.abs(np.sort(found.mean(axis=(0, 1))) - np.sort(uv.mean(axis=(0, 1)))).max() < 3
    still = np.zeros((61, 17, 2))
    assert 0.15 < augment.augmented(still, np.random.default_rng(0)).mean(axis=0).std() < 0.35


def test_a_batch_has_as_many_of_everybody():
    who = np.array([0] * 5 + [1] * 1 + [2] * 9)
    picked = augment.batch(who, 2, 4, np.random.default_rng(0))
    assert len(picked) == 8 and sorted(np.unique(who[picked], return_counts=True)[1].tolist()) == [4, 4]
