"""What the dataset cost: machine seconds by step, and people's minutes where they are noted, apart from each other.

INPUTS   the jobs' timings below logs/ (dior/evaluate/timing.py), config/effort.tsv where there is one
OUTPUTS  results/timing.csv, <report>/cost.html: the only outputs that differ between two runs of the same input, which
         is why the costs have a page of their own
"""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from dior.arrays import AnyPath
from dior.evaluate import timing
from dior.project.project import Project
from dior.project.schema_check import read_sheet
from dior.report.numbers import count
from dior.tables.files import write_text

if TYPE_CHECKING:
    import jinja2

EFFORT = "config/effort.tsv"


def write(
    environment: "jinja2.Environment", project: Project, frames: int, effort: Path | None, out_timing: Path, out: Path
) -> None:
    """Write the table and the page. `environment`: Jinja's, `frames`: of the dataset, `effort`: file or None."""
    people = list(project.released_subjects)
    jobs = timing.collect(project.root / "logs", project.sequences, project.sessions, people)
    rows = timing.by_step(jobs, frames)
    write_text(out_timing, timing.as_csv(rows))
    most = max((row["cpu_s"] for row in rows[:-1]), default=0.0)
    page = environment.get_template("cost.html.j2").render(
        frames=count(frames),
        machine=[_machine(row, most) for row in sorted(rows[:-1], key=lambda row: -row["cpu_s"])],
        total=_machine(rows[-1], most),
        cores=sorted({job["cores"] for job in jobs}),
        human=human(effort, frames) if effort else None,
    )
    write_text(Path(out), page)


def _machine(row: dict[str, Any], most: float) -> dict[str, Any]:
    per_frame = f"{1000 * row['cpu_s_per_frame']:.3g}" if row["cpu_s_per_frame"] != "" else "unknown"
    return {
        "step": row["step"],
        "jobs": count(row["jobs"]),
        "frames": count(row["frames"]),
        "cpu": f"{row['cpu_s']:.1f}",
        "wall": f"{row['wall_s']:.1f}",
        "ms_per_frame": per_frame,
        "share": round(100 * row["cpu_s"] / most) if most else 0,
    }


def human(effort: AnyPath, frames: int) -> dict[str, Any] | None:
    """What people did, as `lines` (what, minutes, count, minutes each), all `minutes`, and `seconds_per_frame`.

    None where nothing is noted yet.
    """
    sheet, _ = read_sheet(effort, "effort", "what", EFFORT)
    if not sheet:
        return None
    lines, minutes = [], 0.0
    for row in sheet.values():
        took = float(row["minutes"])
        each = f"{took / int(row['count']):.3g}" if int(row["count"] or 0) else ""
        lines.append({"what": row["what"], "minutes": f"{took:g}", "count": row["count"], "each": each})
        minutes += took
    per_frame = f"{60 * minutes / frames:.3g}" if frames else "unknown"
    return {"lines": lines, "minutes": f"{minutes:g}", "seconds_per_frame": per_frame}
