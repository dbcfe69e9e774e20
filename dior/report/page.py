"""The page of one sequence: its cameras in all their words, what happened over time, pictures, clip and findings; its
page in 3D; and what the index needs of it.

INPUTS   of the sequence: `metrics`, `frame_metrics`, `skeletons_3d`, its gait, findings, `cameras`, `stamp_audit`,
         `dropped_frames`, `frames`, `offsets`, `clock_costs`, contact sheets (overlays), the clip, scene.js (viewer)
OUTPUTS  <report>/sequences/<sequence>.html and <sequence>.3d.html, with links that hold from there;
         <report>/assets/<sequence>/plots/*.svg and facts.json (facts.py)

What only a comparison with other sequences tells is not known here: the index writes it to <report>/compared.js, which
the page loads and shows (templates/compared.js).
"""

from dataclasses import dataclass
from pathlib import Path

from dior.geometry import camera_tables
from dior.report import cards, clocks, facts, gait, lights, pages, red_labels, scene_file, stamps, walk_figures
from dior.tables import tables
from dior.tables.files import folder_written_whole, write_text


@dataclass(frozen=True)
class Measured:
    """What was measured of the labels.

    `metrics`: table `metrics` of the sequence; `frame_metrics`: table `frame_metrics` of the sequence; `skeleton`:
    table `skeletons_3d` of the sequence; `gait`: table `gait_parameters` of the sequence; `gait_events`: table
    `gait_events` of the sequence.
    """

    metrics: Path
    frame_metrics: Path
    skeleton: Path
    gait: Path
    gait_events: Path


@dataclass(frozen=True)
class Times:
    """When the pictures were taken: their stamps and the cameras' clocks.

    `audit`: table `stamp_audit` of the sequence; `dropped`: table `dropped_frames` of the sequence; `frames`: table
    `frames` of the sequence; `clocks`: tables `offsets`; `clock_costs`: tables `clock_costs`, where two have a camera's
    the first counts.
    """

    audit: Path
    dropped: Path
    frames: Path
    clocks: list[Path]
    clock_costs: list[Path]


@dataclass(frozen=True)
class Media:
    """Pictures and films that the page shows.

    `overlays`: the folder of the contact sheets, `<camera>.jpg`; `clip`: a film with its poster beside it, or none;
    `scene`: scene.js with the folder pictures beside it.
    """

    overlays: Path
    clip: Path | None
    scene: Path


def run(
    *,
    sequence: str,
    within: list[str],
    about: str,
    roles: dict[str, str],
    title: str,
    before: str = "",
    after: str = "",
    measured: Measured,
    findings: list[Path],
    cameras: list[Path],
    times: Times,
    media: Media,
    out: Path,
    out_3d: Path,
    out_facts: Path,
    out_plots: Path,
) -> None:
    """Write the pages of one sequence, its figures and its facts.

    `within`: session and subject of the sequence; `about`: what the page says of it; `before`: sequence before it in
    the sheet; `after`: sequence after it; `findings`: tables `findings` about it and its session; `out_3d`: page in 3D
    to write; `out_facts`: JSON file to write; `out_plots`: folder of the figures to write.
    """
    report = out.parent.parent
    table = tables.read(measured.frame_metrics, "frame_metrics")
    by_camera = facts.by_camera(table)
    recorded = {camera: by_camera[camera] for camera in roles if "coverage" in by_camera.get(camera, {})}
    measures = red_labels.by_camera(tables.read(measured.metrics, "metrics"))
    figures = {camera: own for (_, camera), own in measures.items()}
    for camera, own in recorded.items():
        figures.setdefault(camera, {})["lost_pictures"] = lights.lost_share(own["coverage"][0])
    audited = stamps.read(sequence, times.audit, times.dropped, times.frames)
    found = lights.by_mocap(finding for path in findings for finding in tables.read_findings(path))
    labelled = {camera for camera, own in figures.items() if "coverage" in own}
    found = [*dict.fromkeys(found), *lights.noticed(sequence, roles, audited.lags, labelled)]
    clocked = clocks.read(sequence, roles, times.clocks, times.clock_costs, found)
    fx = {name: one.intrinsics.fx for path in cameras for name, one in camera_tables.read_cameras(path).items()}
    walked = gait.read(measured.gait, measured.gait_events)
    sheets = cards.sheets_of(media.overlays, report)
    scene = scene_file.header_of(media.scene)
    with folder_written_whole(out_plots) as folder:
        drawn = walk_figures.Drawn(folder, out_plots.relative_to(report).as_posix(), sequence)
        figures_shown = {
            "timeline": drawn.timeline(recorded),
            "stamps": drawn.stamps(audited),
            "clock_costs": drawn.clock_costs(clocked),
            "gait_timeline": drawn.gait(walked),
        }
    environment, names = pages.environment(), {sequence, *within, *roles}
    told = {"title": title, "sequence": sequence, "before": before, "after": after, "scene": scene}
    page = environment.get_template("sequence.html.j2").render(
        **told,
        **figures_shown,
        card=cards.card(sequence, within, roles, figures, fx, found, sheets),
        about=about,
        stamp_rows=audited.rows,
        clocks=clocked,
        gait=walked,
        clip=cards.clip_of(media.clip, report),
        findings=cards.shown(finding for finding in found if finding[0] and lights.about(finding[0], names)),
    )
    worst = facts.worst_of(table)
    recordings = {
        camera: facts.recording(
            figures.get(camera, {}),
            by_camera.get(camera, {}),
            clocked.clocks.get(camera) if clocked else None,
            worst.get(camera, {}),
        )
        for camera in roles
    }
    walk, pose = facts.walk_of(measured.skeleton)
    left = facts.Facts(sequence, found, recordings, walk, pose, scene is not None)
    write_text(out_facts, facts.as_text(left))
    write_text(out_3d, environment.get_template("scene.html.j2").render(**told))
    write_text(out, page)
