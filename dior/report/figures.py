"""Which figures the index has, in the order of the paper, and what is written below each.

INPUTS   the project's sheets, rows of metrics.csv, the facts of the sequences, cameras
OUTPUTS  SVG files in one folder, and for each a dict src, title, caption, alt for the page's template
"""

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from dior.arrays import AnyPath, Floats
from dior.evaluate import bootstrap
from dior.evaluate.metrics import COLUMNS
from dior.geometry.camera import Camera
from dior.project.project import Project
from dior.report import certainty, check_figures, clocks, facts, joint_plot, plots, reid, scene
from dior.report.check_figures import ALL
from dior.report.facts import Facts
from dior.report.key_figures import Row
from dior.report.svg import Shown, drawn

if TYPE_CHECKING:
    import pandas as pd

# where the figures are, from the index
LINK = "assets/plots"
# title and figures
Section: TypeAlias = tuple[str, list[Shown]]
OF_PICTURE = "mean of a picture, px"


class Figures:
    """Draws what there is data for into `folder`, of rows of metrics.csv and the facts of the sequences."""

    def __init__(self, folder: Path, project: Project, rows: list[Row], told: Iterable[Facts]) -> None:
        self.folder, self.project, self.told = folder, project, list(told)
        import pandas as pd

        self.environment = {name: project.sequence(name)["environment"] for name in project.sequences}
        self.table = pd.DataFrame(rows, columns=COLUMNS)
        own = self.table.query("sequence != '' and camera != ''")
        self.by_camera = own.assign(environment=own["sequence"].map(self.environment).fillna(""))

    def _draw(self, name: str, draw: Callable[..., None], *args: Any, **words: Any) -> Shown:
        return drawn(self.folder, LINK, name, draw, *args, **words)

    def _strip(
        self, name: str, metric: str, group: str, colour: str, label: str, title: str, caption: str
    ) -> list[Shown]:
        """A strip of one metric, its rows grouped by the columns `group` and `colour`; [] without rows."""
        own = self.by_camera[(self.by_camera["metric"] == metric) & (self.by_camera["joint"] == "")]
        if own.empty:
            return []
        own = own.assign(place=own["environment"] + " " + own["camera"])
        points = list(own[[group, colour, "value", "n"]].itertuples(index=False, name=None))
        counts = {str(at): int(n) for at, n in own.groupby(group)["n"].sum().items()}
        total = check_figures.whole(self.table, metric, sum(counts.values()))
        intervals = {at: check_figures.interval(self.table, metric, n, camera=at) for at, n in counts.items()}
        caption += " One dot per sequence and camera; the bar is the mean weighted by n, the number of values"
        caption += ", the line below it its 95 % interval over the subjects." if total else "."
        alt = f"{title}, {len(points)} values in {len(counts)} groups"
        return [self._draw(name, plots.strip, points, label, title=title, caption=caption, alt=alt,
                           intervals=intervals, total=total)]  # fmt: skip

    def paper(self) -> list[Section]:
        """Sections in the paper's order: indoor, outdoor close range, long range."""

        error = "error, px"
        indoor = [
            *self._measures(check_figures.indoor),
            *self._strip(
                "mark_error_camera", "mark_error", "camera", "sequence", error,
                "Marks used to locate the cameras", "Residuals of the fit, outliers included.",
            ),
        ]  # fmt: skip
        close = [
            *self._strip(
                "reprojection_error_subject", "reprojection_error", "subject", "camera", error,
                "Labels against detections, by subject", "The paper's reprojection error.",
            ),
            *self._strip(
                "reprojection_error_camera", "reprojection_error", "camera", "subject", error,
                "Labels against detections, by camera", "The same, by camera.",
            ),
            *self._joints("reprojection_error", "Labels against detections, by joint", error),
            *self._distribution("reprojection_error", "Labels against detections, distribution", OF_PICTURE),
            *self._adjusted(),
        ]  # fmt: skip
        far = [*self._measures(check_figures.long_range), *self._measures(check_figures.detectors)]
        sections = (("Indoor", indoor), ("Outdoor, close range", close), ("Long range", far))
        return [(title, figures) for title, figures in sections if figures]

    def _measures(self, of: Callable[["pd.DataFrame"], list[check_figures.Drawing]]) -> list[Shown]:
        return [
            self._draw(m.name, m.draw, *m.args, title=m.title, caption=m.caption, alt=m.alt, **m.options)
            for m in of(self.table)
        ]

    def truth(self) -> list[Section]:
        """The section with errors against a known truth."""

        figures = [
            *self._strip(
                "truth_2d_camera", "error_to_truth_2d", "place", "subject", "error, px",
                "2D labels against the truth, by camera", "In-frame labels.",
            ),
            *self._distribution("error_to_truth_2d", "2D labels against the truth, distribution", OF_PICTURE),
            *self._joints("error_to_truth_2d", "2D labels against the truth, by joint", "error, px"),
        ]  # fmt: skip
        return [("Against the known truth", figures)] if figures else []

    def _joints(self, metric: str, title: str, label: str) -> list[Shown]:
        own = self.by_camera[(self.by_camera["metric"] == metric) & (self.by_camera["joint"] != "")]
        # group -> joint -> subject -> (sum of the values, n)
        sums: dict[str, dict[str, dict[str, tuple[float, int]]]] = {}
        for row in own.to_dict("records"):
            group = f"{row['environment']} {row['role'].replace('_', ' ')}".strip()
            by_subject = sums.setdefault(group, {}).setdefault(row["joint"], {})
            # added one after the other: pandas' sums differ in the last bit, and figures are compared byte by byte
            total, n = by_subject.get(row["subject"], (0.0, 0))
            by_subject[row["subject"]] = total + row["value"] * row["n"], n + row["n"]
        return [
            self._draw(
                f"{metric}_joint_{group.replace(' ', '_')}", joint_plot.draw,
                {joint: _mean(list(by_subject.values())) for joint, by_subject in sorted(by_joint.items())}, label,
                title=f"{title}, {group}",
                caption=f"Means over all sequences and cameras, from the head down. {check_figures.INTERVAL}",
                alt=f"{title}: {len(by_joint)} joints, left and right beside each other",
            )
            for group, by_joint in sorted(sums.items())
        ]  # fmt: skip

    def _distribution(self, metric: str, title: str, label: str) -> list[Shown]:
        series: dict[str, list[tuple[list[float], int]]] = {}
        for one in self.told:
            cameras = self.project.cameras(self.project.session_of(one.sequence))
            for camera, recording in one.recordings.items():
                if recording.spread.get(metric, ([], 0))[1]:
                    kind = f"{self.environment[one.sequence]} {cameras[camera]['role'].replace('_', ' ')}"
                    series.setdefault(kind, []).append(recording.spread[metric])
        if not series:
            return []
        joined = {name: facts.pooled(parts) for name, parts in series.items()}
        caption = "How many pictures are at or below an error; the horizontal axis ends at the 99th percentile."
        alt = f"{title}: cumulative curves of {', '.join(sorted(series))}"
        return [self._draw(f"{metric}_distribution", plots.distribution, joined, label, title=title, caption=caption,
                           alt=alt)]  # fmt: skip

    def _adjusted(self) -> list[Shown]:
        values: dict[str, dict[str, tuple[float, int]]] = {}
        own = self.table[self.table["metric"].isin(["adjust_error_before", "adjust_error_after"])]
        for row in own.to_dict("records"):
            name = " ".join(filter(None, (row["sequence"], row["camera"] or ALL)))
            values.setdefault(name, {})[row["metric"]] = (row["value"], row["n"])
        pairs = {
            name: (pair["adjust_error_before"][0], pair["adjust_error_after"][0], pair["adjust_error_after"][1])
            for name, pair in values.items()
            if len(pair) == 2
        }
        # by size, and all of them last
        pairs = dict(sorted(pairs.items(), key=lambda one: (one[0] == ALL, -one[1][1], one[0])))
        if not pairs:
            return []
        return [
            self._draw(
                "adjust", plots.before_after, pairs, "mean error, px", title="Before and after the adjustment",
                caption="Mean reprojection error of the points used to adjust the cameras; the largest first.",
                alt=f"Values before and after for {len(pairs)} rows",
            )
        ]  # fmt: skip

    def recognition(self, paths: Iterable[AnyPath]) -> dict[str, Any]:
        """What the page says of re-identification, with its figures."""
        found = reid.read(*paths)
        return reid.section(found) | {"figures": self._measures(lambda _: reid.figures(found))}

    def clocks(self) -> list[Section]:
        """The section with the clocks of all sequences."""
        clocked: dict[str, clocks.Known] = {}
        groups: dict[str, dict[str, clocks.Known]] = {}
        for one in self.told:
            known = {camera: own.clock for camera, own in one.recordings.items() if own.clock}
            if known:
                clocked[one.sequence] = known
                groups.setdefault(self.environment[one.sequence], {})[one.sequence] = known
        if not groups:
            return []
        figure = self._draw(
            "clocks", clocks.overview, groups, title="Clocks by session, in the order of recording",
            caption="Above zero a camera took its pictures later than its stamps say: 10 ms are 4 cm of a foot that "
            "swings at 4 m/s. The labels are made with these clocks. Lines are 95 % intervals; squares were given by "
            f"hand, red crosses are not known. {clocks.in_words(clocked)}",
            alt=f"Clock offsets of {sum(map(len, clocked.values()))} recordings of cameras in "
            f"{len(clocked)} sequences",
        )  # fmt: skip
        return [("Clocks", [figure])]

    def scenes(self, stations: Mapping[str, Mapping[str, Camera]]) -> list[Shown]:
        """Two figures per session: the cameras and the walks in space, and from above and the side."""
        walks: dict[str, dict[str, Floats]] = {}
        poses: dict[str, scene.Pose] = {}
        for one in self.told:
            if one.walk:
                session = self.project.session_of(one.sequence)
                walks.setdefault(session, {})[one.sequence] = facts.array_of(one.walk)
                if one.pose:
                    points, joints = one.pose
                    poses.setdefault(session, (facts.array_of(points), joints))
        figures = []
        for session in self.project.sessions:
            cameras = [c for _, c in sorted(stations.get(session, {}).items()) if c.wTc is not None]
            if not cameras:
                continue
            of_session = walks.get(session, {})
            drawn = cameras, of_session, poses.get(session)
            about = f"{len(cameras)} cameras, {len(of_session)} walks"
            figures += [
                self._draw(
                    f"space_{session}", scene.space, *drawn, title=f"{session}, in space",
                    caption=f"{about}. Pyramids show where the cameras look; lines are the mean of the joints over "
                    "each walk, grey on the floor; a camera that is far away is an arrow.",
                    alt=f"Session {session} in space: {about}",
                ),
                self._draw(
                    f"scene_{session}", scene.plan, *drawn, title=f"{session}, from above and from the side",
                    caption="Squares are cameras with their viewing direction (long range in orange; an arrow at the "
                    "edge where it is far away); lines are the mean of the joints over each walk, with the colours of "
                    "the picture in space.",
                    alt=f"Session {session} from above and the side: {about}",
                ),
            ]  # fmt: skip
        return figures

    def certainty(self, covariances: Iterable[AnyPath], turns: Iterable[AnyPath]) -> list[Shown]:
        """Per session how well the poses of its cameras are known, and whether the cameras stood still."""
        spreads, moved = certainty.spreads(covariances), certainty.turns(turns)
        figures = []
        for session in self.project.sessions:
            if session in spreads:
                figures.append(self._draw(
                    f"certainty_{session}", certainty.poses, spreads[session],
                    title=f"{session}, how well the cameras are known",
                    caption="Standard errors: of the position along the world's axes, of the direction about the "
                    "camera's own. What all cameras share, such as the scale, is in it.",
                    alt=f"Standard errors of {len(spreads[session])} cameras of session {session}",
                ))  # fmt: skip
            if session in moved:
                figures.append(self._draw(
                    f"moved_{session}", certainty.stood_still, moved[session],
                    title=f"{session}, did the cameras stand still?",
                    caption="By which turn since the first walk a camera, alone, would agree better with the others, "
                    "with 95 % bars. A camera that was bumped stays off from one walk on, and pulls the others along.",
                    alt=f"Turns of {len(moved[session])} cameras of session {session} by walk",
                ))  # fmt: skip
        return figures


def _mean(by_subject: list[tuple[float, int]]) -> plots.Value:
    """The mean of values of which each subject's sum and number are given, with its interval over the subjects."""
    sums, n = zip(*by_subject, strict=True)
    low, high = bootstrap.of_mean(np.array(sums), np.array(n))
    return sum(sums) / sum(n), low, high, sum(n)
