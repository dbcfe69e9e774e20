"""The report's table of what is in the dataset, from results/evaluate/statistics.csv; nothing is counted here."""

from typing import Any, TypeAlias

from dior.evaluate import statistics
from dior.report.numbers import count

# a row of statistics.csv, as dior.evaluate.statistics.read gives it
Row: TypeAlias = dict[str, Any]
LINES = (
    ("sequences", "walks"),
    ("subjects", "subjects"),
    ("outfits", "outfits"),
    ("walks", "walk patterns"),
    ("camera_recordings", "camera recordings"),
    ("frames", "pictures"),
    ("keypoints_2d", "2D keypoints"),
    ("keypoints_3d", "3D keypoints"),
    ("gallery_pictures", "gallery pictures"),
    ("dropped_frames", "pictures lost or there twice"),
)
OF_CAMERA = ("frames", "keypoints_2d", "missing_2d", "dropped_frames")
REASONS = (("missing_2d", "2D keypoints"), ("missing_3d", "3D keypoints"), ("dropped_frames", "pictures"))


def section(rows: list[Row]) -> dict[str, Any]:
    """What templates/dataset.html.j2 shows: `places`, `lines` of their counts, `reasons` and `properties`."""
    environments = sorted({row["environment"] for row in rows} - {""})
    places = [(name, name, "") for name in environments]
    if statistics.of(rows, "frames", role="long_range"):
        places.append(("of these, long range", "", "long_range"))
    places.append(("all", "", ""))
    lines = [
        (title, [_cell(rows, what, environment, role) for _, environment, role in places])
        for what, title in LINES
        if statistics.of(rows, what)
    ]
    cameras = sorted(
        {(r["environment"], r["camera"], r["role"]) for r in rows if r["what"] == "frames" and r["camera"]}
    )
    return {
        "places": [name for name, _, _ in places],
        "lines": lines,
        "cameras": [
            (place, camera, role.replace("_", " "), [_cell(rows, what, place, role, camera) for what in OF_CAMERA])
            for place, camera, role in cameras
        ],
        "reasons": [
            (title, row["reason"].replace("_", " "), count(row["value"]))
            for what, title in REASONS
            for row in rows
            if row["what"] == what and row["reason"] and not any(row[c] for c in ("environment", "role", "camera"))
        ],
        "properties": statistics.properties(rows),
    }


def _cell(rows: list[Row], what: str, environment: str, role: str, camera: str = "") -> str:
    """A count for people; empty where the figure has no such part (a subject has no camera)."""
    known = {(row["environment"], row["role"], row["camera"]) for row in rows if row["what"] == what}
    parted = any(place[1] for place in known) if role else any(place[0] for place in known) if environment else True
    return count(statistics.of(rows, what, environment, role, camera)) if parted else ""
