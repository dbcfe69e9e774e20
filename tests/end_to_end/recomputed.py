"""Figures of metrics.csv computed once more with pandas, from the tables of a project alone.

Nothing of dior is used but the names of files: Parquet through pandas, CSV through pandas, arithmetic in columns.
"""

import numpy as np
import pandas as pd

KEY = ["subject", "sequence", "camera", "role"]
POOLS = {
    "everything": [],
    "role": ["role"],
    "camera": ["camera", "role"],
    "subject": ["subject"],
    "subject and role": ["subject", "role"],
    "sequence": ["subject", "sequence", "role"],
    "recording": KEY,
}


def values(project):
    """metric -> rows of KEY, joint and value, one per label, picture or mark."""
    labels = _labels(project)
    seen = labels[labels["status"].isin(["ok", "occluded"])]
    marks = _marks(project, labels)
    return {
        "coverage": labels.assign(value=(labels["status"] != "missing_3d").astype(float)),
        "error_to_truth_2d": _distance(seen.merge(_truth(project), on=["sequence", "camera", "frame", "joint"])),
        "reprojection_error": _reprojection(project, seen),
        "in_box_share": _boxes(project, seen),
        "mark_error": marks,
    }


def pooled(table, keep):
    """Mean and count of the values by the columns `keep`, with empty text for all others."""
    grouped = table.dropna(subset="value").assign(one="").groupby(["one", *keep], observed=True)["value"]
    found = grouped.agg(["mean", "size"]).reset_index()
    return found.assign(**{key: "" for key in [*KEY, "joint"] if key not in keep})


def interval(table, draws):
    """2.5th and 97.5th percentile of the mean when S subjects are drawn `draws(S)` (R, S) times each; [] of one."""
    by_subject = table.dropna(subset="value").groupby("subject", observed=True)["value"].agg(["size", "sum"])
    by_subject = by_subject.sort_values(["size", "sum"])
    if len(by_subject) < 2:
        return []
    means = [np.dot(t, by_subject["sum"]) / np.dot(t, by_subject["size"]) for t in draws(len(by_subject))]
    return np.percentile(means, [2.5, 97.5]).tolist()


def _sheet(project):
    return pd.read_csv(project / "config/sequences.tsv", sep="\t", dtype=str).fillna("")


def _labels(project):
    parts = [pd.read_parquet(path) for path in sorted((project / "results/reproject").glob("*.parquet"))]
    labels = pd.concat(
        [part.astype({c: str for c in ("subject", "sequence", "camera", "joint", "status")}) for part in parts]
    )
    far = (labels["sequence"].str.startswith("outdoor")) & (labels["camera"] == "cam04")
    return labels.assign(role=np.where(far, "long_range", "close"))


def _distance(table):
    return table.assign(value=np.hypot(table["u"] - table["other_u"], table["v"] - table["other_v"]))


def _truth(project):
    row = _sheet(project).set_index("sequence")["truth"]
    parts = [pd.read_parquet(project / "results/simulate" / path / "labels_2d.parquet") for path in row]
    truth = pd.concat(parts).astype({c: str for c in ("sequence", "camera", "joint", "status")})
    truth = truth[truth["status"].isin(["ok", "occluded"])]
    return _other(truth)[["sequence", "camera", "frame", "joint", "other_u", "other_v"]]


def _other(table):
    return table.rename(columns={"u": "other_u", "v": "other_v"})


def _reprojection(project, seen):
    """Detections with the sides exchanged back where triangulate found them exchanged."""
    parts = []
    for sequence in sorted(set(seen["sequence"])):
        path, exchanged = (
            project / f"results/{name}.parquet"
            for name in (f"triangulate/{sequence}.detections", f"triangulate/{sequence}.swaps")
        )
        if not exchanged.exists():
            continue
        found = pd.read_parquet(path).astype({"camera": str, "joint": str}).assign(sequence=sequence)
        swaps = pd.read_parquet(exchanged).astype({"camera": str})
        swaps = swaps.loc[swaps["swapped"] & swaps["frame"].notna(), ["camera", "frame", "part"]].drop_duplicates()
        found = found.merge(swaps.assign(swapped=True), on=["camera", "frame"], how="left")
        side = found["joint"].str.extract("^(left|right)_")[0]
        turned = found["joint"].str.replace("^(left|right)_", "", regex=True)
        turned = side.map({"left": "right_", "right": "left_"}).fillna("") + turned
        leg = found["joint"].str.contains("hip|knee|ankle|heel|foot")
        of_joint = found["part"].isin(["all", "legs"]).where(leg, found["part"].isin(["all", "rest"]))
        found["joint"] = np.where(found["swapped"].eq(True) & of_joint, turned, found["joint"])
        parts.append(found[found["score"] >= 0.3])
    found = _other(pd.concat(parts))[["sequence", "camera", "frame", "joint", "other_u", "other_v"]]
    close = seen[seen["role"] == "close"]
    return _distance(close.merge(found.dropna(), on=["sequence", "camera", "frame", "joint"]))


def _boxes(project, seen):
    parts = []
    for path in sorted((project / "config/boxes").glob("*.csv")):
        sequence, camera = path.stem.split(".")
        parts.append(pd.read_csv(path).assign(sequence=sequence, camera=camera))
    both = seen.merge(pd.concat(parts), on=["sequence", "camera", "frame"])
    inside = both["u"].between(both["u_min"], both["u_max"]) & both["v"].between(both["v_min"], both["v_max"])
    return both.assign(value=inside.astype(float))


def _marks(project, labels):
    parts = [pd.read_parquet(path) for path in sorted((project / "results/locate").glob("*/*.marks.parquet"))]
    marks = pd.concat(parts).astype({"sequence": str, "camera": str, "joint": str})
    known = labels[["subject", "sequence", "camera", "role"]].drop_duplicates()
    return marks.merge(known, on=["sequence", "camera"]).assign(value=lambda table: table["residual_px"])
