"""A page per sequence: its cameras in all their words, what happened over time, pictures, clip and findings.

INPUTS   the cards of all sequences, findings, figures and rows of the stamps by sequence, clips
OUTPUTS  <out>/sequences/<sequence>.html, with links that hold from there
"""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dior.report import lights
from dior.report.cards import shown
from dior.report.clocks import SequenceClocks
from dior.report.figures import Shown
from dior.tables.files import write_text

if TYPE_CHECKING:
    import jinja2


def write(
    environment: "jinja2.Environment",
    out: Path,
    title: str,
    cards: list[dict[str, Any]],
    findings: list[lights.Finding],
    names: Mapping[str, set[str]],
    timelines: Mapping[str, Shown],
    stamps: Mapping[str, Shown],
    stamp_rows: Mapping[str, tuple[dict[str, str], ...]],
    clocks: Mapping[str, SequenceClocks],
    clock_costs: Mapping[str, Shown],
    clips: Mapping[str, dict[str, str]],
    scenes: Mapping[str, dict[str, Any]],
) -> None:
    """Write the pages of `cards`, each linked to the one before and after, and remove those of other sequences.

    `environment`: Jinja's; `findings`: (scope, severity, code, text) of the whole project; `names`: sequence -> the
    words that a finding's scope may be made of to be about it; `timelines`, `stamps` (figures), `stamp_rows`, `clocks`
    (`clocks.SequenceClocks`), `clock_costs` (figures), `clips` (dicts video, poster) and `scenes` (headers of scene.js)
    by sequence, each only where there is one.
    """
    template, sequences = environment.get_template("sequence.html.j2"), [card["sequence"] for card in cards]
    folder = out / "sequences"
    for i, card in enumerate(cards):
        sequence = card["sequence"]
        own = [finding for finding in findings if finding[0] and lights.about(finding[0], names[sequence])]
        page = template.render(
            title=title,
            card=card,
            before=sequences[i - 1] if i else "",
            after=sequences[i + 1] if i + 1 < len(sequences) else "",
            timeline=timelines.get(sequence),
            stamps=stamps.get(sequence),
            stamp_rows=stamp_rows.get(sequence, ()),
            clocks=clocks.get(sequence),
            clock_costs=clock_costs.get(sequence),
            clip=clips.get(sequence),
            scene=scenes.get(sequence),
            findings=shown(own),
        )
        write_text(folder / f"{sequence}.html", page)
    kept = {*sequences, *(f"{sequence}.3d" for sequence in scenes)}
    for path in folder.glob("*.html"):
        if path.stem not in kept:
            path.unlink()
