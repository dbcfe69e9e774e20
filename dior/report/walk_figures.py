"""Which figures the page of a sequence has, and what is written below each.

INPUTS   `frame_metrics` by camera, its stamps, clocks and gait
OUTPUTS  SVG files in one folder, and for each a dict src, title, caption, alt for the page's template
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dior.arrays import Floats, Ints
from dior.report import clocks, gait, stamps, walk_plots
from dior.report.facts import ByMetric
from dior.report.svg import Shown, drawn


@dataclass(frozen=True)
class Drawn:
    """Draws what there is data for into `folder`; `link`: to that folder from the index; `sequence`: whose it is."""

    folder: Path
    link: str
    sequence: str

    def timeline(self, recorded: Mapping[str, ByMetric]) -> Shown | None:
        """Errors over time, joints without a label, lost pictures; `recorded`: cameras that have labels."""
        if not recorded:
            return None
        start = min(by_metric["coverage"][0][0] for by_metric in recorded.values())

        def seconds(stamp_ns: Ints) -> Floats:
            return (stamp_ns - start) / 1e9

        metric, label = next(
            (
                (m, text)
                for m, text in (("error_to_truth_2d", "to truth, px"), ("reprojection_error", "to detections, px"))
                if any(m in by_metric for by_metric in recorded.values())
            ),
            ("", ""),
        )
        lanes = {
            camera: (seconds(stamps), 1 - share, seconds(lost_stamps(stamps)))
            for camera, (stamps, share, _) in ((c, r["coverage"]) for c, r in recorded.items())
        }
        errors = {
            camera: (seconds(by_metric[metric][0]), by_metric[metric][1])
            for camera, by_metric in recorded.items()
            if metric in by_metric
        }
        return drawn(
            self.folder, self.link, "timeline", walk_plots.timeline, lanes, errors, label,
            title="Errors, and what is missing",
            caption=("Mean error of each picture, and below it" if errors else "By camera")
            + " the share of the joints without a label (full height: all of them).",
            alt=f"Timeline of {self.sequence}: {len(lanes)} cameras",
        )  # fmt: skip

    def stamps(self, audited: stamps.SequenceStamps) -> Shown:
        """When pictures came late, are missing or repeated."""
        return drawn(
            self.folder, self.link, "stamps", walk_plots.stamps, audited.lags, audited.dropped,
            title="Late and lost pictures",
            caption="A picture that is late only in its receive stamp does no harm: labels use header stamps.",
            alt=f"Stamps of {self.sequence}: {len(audited.lags)} cameras",
        )  # fmt: skip

    def gait(self, walked: gait.Gait | None) -> Shown | None:
        """When the feet stood on the floor."""
        if walked is None:
            return None
        span = gait.span(walked.lanes)
        return drawn(
            self.folder, self.link, "gait", walk_plots.gait, walked.lanes, span, title="Stance and swing",
            caption="A bar is a stance, from heel strike to toe off, pale where it is left out; a dark line is the "
            "95 % interval of an event, the upper one that of a toe off.",
            alt=f"Stances of {self.sequence} from {span[0]:.1f} to {span[1]:.1f} s",
        )  # fmt: skip

    def clock_costs(self, clocked: clocks.SequenceClocks | None) -> Shown | None:
        """How well each offset fits."""
        if clocked is None or not clocked.costs:
            return None
        return drawn(
            self.folder, self.link, "clocks", clocks.costs, clocked, title="Which offset fits",
            caption="Mean residual with each offset of a camera's clock; a clear minimum tells the clock.",
            alt=f"Residual over the offset of the clocks of {len(clocked.costs)} cameras of {self.sequence}",
        )  # fmt: skip


def lost_stamps(stamp_ns: Ints) -> Ints:
    """Where pictures are missing: the middle of every gap of at least one and a half median periods, ns."""
    if len(stamp_ns) < 3:
        return stamp_ns[:0]
    stamp_ns = np.sort(stamp_ns)
    steps = np.diff(stamp_ns)
    gap = steps >= 1.5 * np.median(steps)
    return (stamp_ns[:-1][gap] + stamp_ns[1:][gap]) // 2
