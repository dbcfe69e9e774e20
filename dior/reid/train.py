"""A network trained with a lab's own gallery, and tested with walks or sessions that it has not seen.

INPUTS   COCO-17 labels of every walk (dior/reid/inputs.py), the sheet; weights to begin with, or none
OUTPUTS  <out>: the weights, as torch.save writes them; <out>.json: how they were made and what they recognise
Sequences are `canonical` (dior/reid/inputs.py), in training and when the weights are used. Losses, augmentation,
optimiser and its schedule are those of each network's authors; what differs is the size: STEPS batches instead of
hundreds of epochs.

Every batch has a random generator of its own, and the training so far is saved every SAVE_S seconds beside `out`: a run
that was killed continues there, and ends with the same bytes as one that was not (same machine, same threads; on a GPU
within rounding).
"""

import hashlib
import io
import json
import math
import time
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dior.arrays import Floats, Ints
from dior.errors import DiorError
from dior.progress import reporting
from dior.reid import augment, checkpoint, embed, inputs, networks, protocols, recognise, split, statistics
from dior.tables.files import write_text, written_whole

if TYPE_CHECKING:
    import torch
    from torch import nn

ADAPTATION = "canonical"
# chosen: minutes on two cores for a lab's gallery; the seed is any
STEPS, SEED = 200, 1
# subjects of a batch; chosen: small batches for galleries of few people
PEOPLE = 8


@dataclass(frozen=True)
class Recipe:
    """How a network is trained, by its authors but for the batch's size and the step from given weights (chosen).

    `sequences` of each subject of a batch, `views` of each (GaitGraph's contrast needs two); `rate`: the optimiser's
    largest step, from random weights and from given ones; `optimiser` of torch.optim, and its `decay` of weights.
    """

    sequences: int
    rate: tuple[float, float]
    views: int = 1
    optimiser: str = "Adam"
    decay: float = 1e-5


RECIPES = {
    "gaitgraph": Recipe(2, (1e-2, 1e-3), views=2),
    "gaitmixer": Recipe(4, (6e-3, 2e-3)),
    "gaitformer": Recipe(4, (6e-3, 2e-3)),
    "gaitgraph2": Recipe(4, (5e-3, 5e-4), optimiser="AdamW"),
}
# s between two savings; chosen: little is lost, and saving takes no time to speak of
SAVE_S = 30.0
# of a held-out walk: found among the others' training walks, from other cameras
PROTOCOLS = ("other_recording", "other_place")
COLUMNS = ("protocol", "rank1", "low", "high", "hits", "n", "chance", "p", "verdict")


def run(
    *,
    project: Path = Path("."),
    labels: Path,
    network: Literal["gaitgraph", "gaitmixer", "gaitformer", "gaitgraph2"],
    out: Path,
    weights: Path | None = None,
    test_sessions: list[str] | None = None,
    steps: int = STEPS,
    seed: int = SEED,
) -> None:
    """Train a network with the project's walks and write `out` and `out`.json.

    `project`: folder that holds config/; `labels`: folder of COCO-17 labels, results/reid; `network`: the one
    to train; `out`: file of the weights to write, such as lab.pt; `weights`: those to begin with, none for random ones;
    `test_sessions`: sessions to test with, none for the last walk of every subject in each session;
    `steps`: batches to train with; `seed`: of all that is random.

    Raises DiorError where the gallery is too small to be split.
    """
    from dior.project import project as projects

    networks.torch()
    known = projects.load(project)
    paths = {name: labels / f"{name}.parquet" for name in known.sequences}
    missing = [name for name, path in paths.items() if not path.is_file()]
    if missing:
        raise DiorError(
            f"{labels}: no COCO-17 labels of {len(missing)} of {len(paths)} sequences, such as {missing[0]}; run "
            "`dior run reid` first"
        )
    # a canonical sequence does not depend on the width of the picture
    widths = {name: dict.fromkeys(known.cameras_of(name), inputs.WIDTH) for name in paths}
    shown = recognise.gallery(known.rows, paths, widths)
    parts = split.of({name: known.rows[name] for name in known.sequences}, test_sessions or ())
    for row in train_and_test(network, shown, parts, out, weights, steps, seed)["test"]:
        print(
            f"{row['weights']}: {row['protocol']} rank-1 {row['rank1']:.1%} ({row['hits']} of {row['n']}, 95 % "
            f"interval {row['low']:.1%} to {row['high']:.1%}, chance {row['chance']:.1%}): {row['verdict']}"
        )


def train_and_test(
    name: str,
    shown: recognise.Gallery,
    parts: split.Split,
    out: Path,
    weights: Path | None = None,
    steps: int = STEPS,
    seed: int = SEED,
) -> dict[str, Any]:
    """Write weights and their report, from a `recognise.Gallery` and a `split.Split`; returns what the report holds."""
    given = shown.given(ADAPTATION)
    recordings = np.array([item.recording for item in shown.items])
    train = np.flatnonzero(np.isin(recordings, parts.train))
    subjects = np.array([shown.items[i].subject for i in train])
    if len(set(subjects.tolist())) < split.LEAST_SUBJECTS:
        raise DiorError("fewer than two subjects have sequences that are whole enough to train with")
    network, losses = trained(name, [given[i] for i in train], subjects, out, weights, steps, seed)
    before = [(weights.name, checkpoint.load(name, weights))] if weights else []
    rows = [
        {"weights": which, **row}
        for which, one in (*before, (out.name, network))
        for row in tested(name, one, given, shown.items, parts)
    ]
    report = {
        **{"network": name, "adaptation": ADAPTATION, "from": weights.name if weights else None},
        **{"seed": seed, "steps": steps},
        **{"loss_first": _mean(losses[:10]), "loss_last": _mean(losses[-10:])},
        **{"subjects": len(set(subjects.tolist())), "sequences": len(train)},
        **{"train": parts.train, "held_out": parts.test, "unused": parts.unused, "test": rows},
    }
    write_text(Path(f"{out}.json"), json.dumps(report, indent=1) + "\n")
    return report


def tested(
    name: str, network: "nn.Module", given: Sequence[Floats], items: Sequence[protocols.Item], parts: split.Split
) -> list[dict[str, Any]]:
    """Rows (COLUMNS) of the held-out walks looked for among those of the training; `given`: adapted sequences."""
    kept = [i for i, item in enumerate(items) if item.recording in {*parts.train, *parts.test}]
    items = [items[i] for i in kept]
    held = np.array([item.recording in set(parts.test) for item in items], bool)
    far = embed.distances(name, embed.embeddings(name, network, [given[i] for i in kept]))
    rows = []
    for protocol in PROTOCOLS:
        score = statistics.score(protocols.trials(far, items, protocol, held), items)
        row = {"protocol": protocol, **{key: getattr(score, key) for key in COLUMNS[1:]}}
        rows.append({key: None if isinstance(v, float) and math.isnan(v) else v for key, v in row.items()})
    return rows


def trained(
    name: str,
    sequences: Sequence[Floats],
    subjects: ArrayLike,
    out: Path,
    weights: Path | None = None,
    steps: int = STEPS,
    seed: int = SEED,
) -> tuple["nn.Module", list[float]]:
    """The trained network, in evaluation mode, and the loss of every step; writes `out`.

    `sequences`: (F, 17, 2) adapted, of `subjects` (N,); `weights`: a checkpoint to begin with, or None.
    """
    torch = networks.torch()
    device = "cuda" if torch.cuda.is_available() else "cpu"
    torch.manual_seed(seed)
    network = networks.build(name)
    if weights:
        checkpoint.fill(network, checkpoint.read(weights), name, weights)
    network.to(device).train()
    recipe = RECIPES[name]
    most = recipe.rate[1 if weights else 0]
    optimiser = getattr(torch.optim, recipe.optimiser)(network.parameters(), lr=most, weight_decay=recipe.decay)
    numbers = protocols.numbered(subjects)
    state, job = Path(f"{out}.training.npz"), _job(name, sequences, numbers, weights, steps, seed)
    losses, rates = _resumed(state, job, network, optimiser), one_cycle(steps, most)
    saved = time.monotonic()
    for step in reporting(range(len(losses), steps), steps - len(losses), "steps", f"training {name}"):
        for group in optimiser.param_groups:
            group["lr"], group["betas"] = rates[step]
        losses.append(_step(name, network, optimiser, sequences, numbers, seed, step))
        if not np.isfinite(losses[-1]):
            raise DiorError(f"{out}: the training of {name} came apart at step {step} (the loss is no number)")
        if time.monotonic() - saved >= SAVE_S:
            _save(state, job, network, optimiser, losses)
            saved = time.monotonic()
    network.eval()
    save_weights(out, network)
    state.unlink(missing_ok=True)
    return network, losses


def _step(
    name: str,
    network: "nn.Module",
    optimiser: "torch.optim.Optimizer",
    sequences: Sequence[Floats],
    numbers: Ints,
    seed: int,
    step: int,
) -> float:
    """One batch; its loss."""
    import torch

    from dior.reid import losses

    random = np.random.default_rng([seed, step])
    # dropout
    torch.manual_seed(int(random.integers(2**31)))
    recipe = RECIPES[name]
    picked = np.repeat(augment.batch(numbers, PEOPLE, recipe.sequences, random), recipe.views)
    given = batch_of(name, [sequences[i] for i in picked.tolist()], random)
    device = next(network.parameters()).device
    found = network(torch.from_numpy(given).to(device))
    loss = losses.OF[name](found, torch.from_numpy(numbers[picked]).to(device))
    optimiser.zero_grad()
    loss.backward()
    optimiser.step()
    return loss.item()


def batch_of(name: str, sequences: Sequence[Floats], random: np.random.Generator) -> NDArray[np.float32]:
    """Input of a network, float32, of sequences (F, 17, 2), each augmented."""
    augmented = augment.OWN.get(name, augment.augmented)
    parts = [augmented(uv, random) for uv in sequences]
    if name not in embed.SURE:
        return np.stack([embed.given(name, part, np.nan) for part in parts]).astype(np.float32)
    made = [embed.given(name, part, augment.confidences(embed.CONFIDENCE, random)[..., None]) for part in parts]
    return np.stack(made).astype(np.float32)


def one_cycle(steps: int, most: float) -> list[tuple[float, tuple[float, float]]]:
    """(rate, betas of Adam) of each step: torch's OneCycleLR as it comes, which the authors use.

    All are made before the first, since a training that is continued needs those of its middle.
    """
    torch = networks.torch()
    optimiser = torch.optim.Adam([torch.zeros(1)], lr=most)
    cycle = torch.optim.lr_scheduler.OneCycleLR(optimiser, most, total_steps=steps)
    found = []
    for _ in range(steps):
        found.append((optimiser.param_groups[0]["lr"], optimiser.param_groups[0]["betas"]))
        optimiser.step()
        cycle.step()
    return found


def save_weights(path: Path, network: "nn.Module") -> None:
    """The weights as torch.save writes them; the same weights give the same bytes, wherever they are."""
    import torch

    text = io.BytesIO()
    torch.save({key: value.cpu() for key, value in network.state_dict().items()}, text)
    with written_whole(path) as part:
        part.write_bytes(text.getvalue())


def _job(name: str, sequences: Sequence[Floats], numbers: Ints, weights: Path | None, steps: int, seed: int) -> str:
    """What a training so far is of: it is continued only by the same."""
    digest = hashlib.sha256(numbers.astype("<i8").tobytes())
    for uv in sequences:
        digest.update(np.ascontiguousarray(uv, "<f8").tobytes())
    given = hashlib.sha256(Path(weights).read_bytes()).hexdigest() if weights else ""
    return json.dumps([name, steps, seed, given, digest.hexdigest()])


def _save(path: Path, job: str, network: "nn.Module", optimiser: "torch.optim.Optimizer", losses: list[float]) -> None:
    values = {"job": np.array(job), "losses": np.array(losses)}
    values |= {f"model/{key}": value.cpu().numpy() for key, value in network.state_dict().items()}
    for i, one in optimiser.state_dict()["state"].items():
        values |= {f"adam/{i}/{key}": value.cpu().numpy() for key, value in one.items()}
    with written_whole(path) as part, open(part, "wb") as file:
        np.savez(file, allow_pickle=False, **values)


def _resumed(path: Path, job: str, network: "nn.Module", optimiser: "torch.optim.Optimizer") -> list[float]:
    """Losses of the steps that `_save` wrote of the same job, its state put back; [] where there are none."""
    import torch

    if not path.is_file():
        return []
    try:
        with np.load(path, allow_pickle=False) as file:
            values = {key: file[key] for key in file.files}
        same = str(values["job"]) == job
    except (OSError, ValueError, KeyError, zipfile.BadZipFile) as error:
        raise DiorError(f"{path}: not a training that can be continued ({error}); delete it to begin anew") from None
    if not same:
        raise DiorError(f"{path}: the training begun there is of other sequences or settings; delete it to begin anew")
    checkpoint.fill(network, _below(values, "model/"), job, path)
    state = optimiser.state_dict()
    for key, value in _below(values, "adam/").items():
        i, what = key.split("/")
        state["state"].setdefault(int(i), {})[what] = torch.from_numpy(value)
    optimiser.load_state_dict(state)
    return values["losses"].tolist()


def _below(values: Mapping[str, NDArray[Any]], prefix: str) -> dict[str, NDArray[Any]]:
    return {key.removeprefix(prefix): value for key, value in values.items() if key.startswith(prefix)}


def _mean(values: list[float]) -> float | None:
    return float(np.mean(values)) if values else None
