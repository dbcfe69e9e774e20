"""Configs to train and evaluate OpenGait and FastPoseGait on an export, for one GPU.

OUTPUTS  opengait/configs/{gaitgraph2,gaittr,skeletongait,gpgait}.yaml
Keys and numbers are those of the toolkits' own configs for SUSTech1K (configs/<method>/<method>_SUSTech1K.yaml of
ShiqiYu/OpenGait and BNU-IVC/FastPoseGait), but for paths, the number of GPUs, which the batch of an evaluation has to
be, and the classes, which are the people trained on. What a config lacks is in the toolkit's configs/default.yaml.
"""

from pathlib import Path
from typing import Any, TypeAlias

import yaml

from dior.tables.files import write_text

Transforms: TypeAlias = list[dict[str, Any]]
# where the export is linked to in a checkout of a toolkit
PLACE = "./datasets/dior"
HEATMAPS = "./datasets/dior-heatmaps"
# people that the toolkits' own weights of SUSTech1K were trained on: the classes of who trains on nobody here
SUSTECH1K = 250
FRAMES = {"frames_num_fixed": 60, "frames_skip_num": 0}
NO_FLOAT16 = {"enable_float16": False}

COMMANDS = f"""\
OpenGait and FastPoseGait print a figure for each condition of SUSTech1K; it is a number only where every view has a
probe of that condition, and `nan` for those that nobody here walked in. Nothing of them has to be changed. They were
not run for this: they want a GPU and are in no registry; the names, files and configs follow their code.

In a checkout of OpenGait (for `gpgait.yaml` of FastPoseGait, `fastposegait/main.py`), with this folder at
`{PLACE}`:

```bash
ln -s <this folder> {PLACE}
python -m torch.distributed.launch --nproc_per_node=1 opengait/main.py --phase train \\
  --cfgs {PLACE}/configs/gaitgraph2.yaml
python -m torch.distributed.launch --nproc_per_node=1 opengait/main.py --phase test \\
  --cfgs {PLACE}/configs/gaitgraph2.yaml
```

With more GPUs `evaluator_cfg.sampler.batch_size` has to be their number. `skeletongait.yaml` wants heat maps, 8 kB a
picture, which OpenGait makes of the poses here:

```bash
python -m torch.distributed.launch --nproc_per_node=1 datasets/pretreatment_heatmap.py \\
  --pose_data_path={PLACE}/data --save_root={HEATMAPS} --dataset_name=SUSTech1K
```
"""


def write(folder: Path, name: str, partition: dict[str, list[str]]) -> None:
    """Write the configs to `folder` for the partition `name`."""
    classes = len(partition["TRAIN_SET"]) or SUSTECH1K
    for method, config in {
        "gaitgraph2": gaitgraph2(),
        "gaittr": gaittr(),
        "skeletongait": skeletongait(classes),
        "gpgait": gpgait(classes),
    }.items():
        root = f"{HEATMAPS}/SUSTech1K_sigma_8.0_/pkl" if method == "skeletongait" else f"{PLACE}/data"
        data = {
            "dataset_name": "SUSTech1K",
            "test_dataset_name": "SUSTech1K",
            "dataset_root": root,
            "dataset_partition": f"{PLACE}/partition/{name}.json",
            "num_workers": 4,
            "remove_no_gallery": False,
        }
        text = yaml.safe_dump({"data_cfg": data, **config}, sort_keys=False)
        write_text(folder / f"{method}.yaml", text)


def gaitgraph2() -> dict[str, Any]:
    multi = {"type": "GaitGraphMultiInput"}
    return {
        "evaluator_cfg": _evaluated("GaitGraph2", 2000, "cos", [multi], sample_type="fixed_ordered", **FRAMES),
        "loss_cfg": [{"type": "SupConLoss_Lp", "loss_term_weight": 1, "temperature": 0.01, "log_prefix": "SupConLoss"}],
        "model_cfg": {
            "model": "GaitGraph2",
            "joint_format": "coco",
            "input_num": 3,
            "reduction": 8,
            "block": "Bottleneck",
            "input_branch": [5, 64, 32],
            "main_stream": [32, 128, 256],
            "num_class": 128,
            "tta": True,
        },
        "optimizer_cfg": {"solver": "AdamW", "lr": 0.005, "weight_decay": 1e-05},
        "scheduler_cfg": {"scheduler": "OneCycleLR", "max_lr": 0.005, "total_steps": 2000},
        "trainer_cfg": _trained(
            "GaitGraph2",
            2000,
            200,
            {"type": "CommonSampler", "batch_size": 768, "sample_type": "fixed_ordered", **FRAMES},
            [
                {"type": "FlipSequence", "probability": 0.5},
                {"type": "InversePosesPre", "probability": 0.1},
                {"type": "JointNoise", "std": 0.25},
                {"type": "PointNoise", "std": 0.05},
                {"type": "RandomMove", "random_r": [4, 1]},
                multi,
            ],
        ),
    }


def gaittr() -> dict[str, Any]:
    given = [{"type": "GaitTRMultiInput", "joint_format": "coco"}, {"type": "SkeletonInput"}]
    return {
        "evaluator_cfg": _evaluated("GaitTR", 40000, "euc", [_in_turn(given)], sample_type="all_ordered"),
        "loss_cfg": {"type": "TripletLoss", "margin": 0.3, "log_prefix": "triplet"},
        "model_cfg": {
            "model": "GaitTR",
            "in_channels": [10, 64, 64, 128, 256],
            "num_class": 128,
            "joint_format": "coco",
        },
        "optimizer_cfg": {"solver": "Adam", "lr": 0.001, "weight_decay": 2e-05},
        "scheduler_cfg": {
            "scheduler": "OneCycleLR",
            "three_phase": True,
            "max_lr": 0.001,
            "div_factor": 100,
            "final_div_factor": 1000.0,
            "total_steps": 40000,
            "pct_start": 0.475,
        },
        "trainer_cfg": _trained(
            "GaitTR",
            40000,
            4000,
            {"type": "TripletSampler", "batch_size": [32, 4], "sample_type": "fixed_ordered", **FRAMES},
            [
                {"type": "PointNoise", "std": 0.3},
                {"type": "InversePosesPre", "probability": 0.1},
                {"type": "JointNoise", "std": 0.3},
                *given,
            ],
        ),
    }


def skeletongait(classes: int) -> dict[str, Any]:
    cut = {"type": "BaseSilCuttingTransform"}
    return {
        "evaluator_cfg": _evaluated(
            "SkeletonGait", 50000, "euc", [cut], sample_type="all_ordered", frames_all_limit=720
        )
        | {"enable_float16": True},
        "loss_cfg": _triplet_and_softmax(0.2),
        "model_cfg": {
            "model": "DeepGaitV2",
            "Backbone": {"in_channels": 2, "mode": "p3d", "layers": [1, 1, 1, 1], "channels": [64, 128, 256, 512]},
            "SeparateBNNecks": {"class_num": classes},
        },
        "optimizer_cfg": {"solver": "SGD", "lr": 0.1, "momentum": 0.9, "weight_decay": 0.0005},
        "scheduler_cfg": {"scheduler": "MultiStepLR", "gamma": 0.1, "milestones": [20000, 30000, 40000]},
        "trainer_cfg": _trained(
            "SkeletonGait",
            50000,
            10000,
            {"type": "TripletSampler", "batch_size": [8, 8], "sample_type": "fixed_unordered", "frames_num_fixed": 10},
            [
                {"type": "RandomPerspective", "prob": 0.2},
                cut,
                {"type": "RandomHorizontalFlip", "prob": 0.2},
                {"type": "RandomRotate", "prob": 0.2},
            ],
        )
        | {"enable_float16": True},
    }


def gpgait(classes: int) -> dict[str, Any]:
    """FastPoseGait's; its data sets have to say how they are held, which its own configs leave to the default."""
    given = [{"type": "RescaleCenter"}, {"type": "HOD_MultiInput"}, {"type": "SkeletonInput"}]
    augmented: Transforms = [
        {"type": "RescaleCenter", "center": "neck", "scale": 225},
        {"type": "HOD_MultiInput", "joint_format": "coco"},
        {"type": "SkeletonInput"},
    ]
    return {
        "evaluator_cfg": _evaluated("gpgait", 40000, "euc", [_in_turn(given)], sample_type="all_ordered"),
        "loss_cfg": _triplet_and_softmax(0.3, triplet={"is_hard_loss": True}, softmax={"label_smooth": False}),
        "model_cfg": {
            "model": "gpgait",
            "in_channels": [2, 64, 64, 128, 256],
            "num_class": classes,
            "share_num": 3,
        },
        "optimizer_cfg": {"solver": "Adam", "lr": 0.001, "weight_decay": 2e-05},
        "scheduler_cfg": {
            "scheduler": "OneCycleLR",
            "three_phase": True,
            "max_lr": 0.001,
            "div_factor": 100,
            "total_steps": 40000,
            "pct_start": 0.5,
        },
        "trainer_cfg": _trained(
            "gpgait",
            40000,
            10000,
            {"type": "TripletSampler", "batch_size": [8, 8], "sample_type": "fixed_unordered", "frames_num_fixed": 60},
            augmented,
        ),
    }


def _evaluated(name: str, saved_at: int, metric: str, transform: Transforms, **sampled: Any) -> dict[str, Any]:
    return {
        **NO_FLOAT16,
        "restore_ckpt_strict": True,
        "restore_hint": saved_at,
        "save_name": name,
        "eval_func": "evaluate_indoor_dataset",
        "metric": metric,
        "sampler": {"type": "InferenceSampler", "batch_size": 1, **sampled},
        "transform": transform,
    }


def _trained(name: str, steps: int, every: int, sampler: dict[str, Any], transform: Transforms) -> dict[str, Any]:
    return {
        **NO_FLOAT16,
        "save_name": name,
        "restore_hint": 0,
        "total_iter": steps,
        "save_iter": every,
        "with_test": True,
        "log_iter": 100,
        "sync_BN": True,
        "fix_BN": False,
        "sampler": sampler,
        "transform": [_in_turn(transform)],
    }


def _in_turn(transforms: Transforms) -> dict[str, Any]:
    return {"type": "Compose", "trf_cfg": transforms}


def _triplet_and_softmax(margin: float, triplet: Any = None, softmax: Any = None) -> list[dict[str, Any]]:
    return [
        {
            "type": "TripletLoss",
            "loss_term_weight": 1.0,
            "margin": margin,
            "log_prefix": "triplet",
            **(triplet or {}),
        },
        {
            "type": "CrossEntropyLoss",
            "loss_term_weight": 1.0,
            "scale": 16,
            "log_prefix": "softmax",
            "log_accuracy": True,
            **(softmax or {}),
        },
    ]
