import hashlib
import json
import re

import numpy as np
import pytest

from dior.evaluate import statistics
from dior.gait import gait
from dior.ingest import audit
from dior.project import project as projects
from dior.report import page, report, scene_file
from dior.tables import tables
from dior.tables.files import write_text
from tests.report import chromium, test_reid


def audited(capture, sequence):
    """Files of the audit of a sequence: the table, what was dropped, and the frames it is about."""
    folder = capture.root / "results"
    frames = tables.read(folder / f"frames/{sequence}.parquet", "frames")
    rows, dropped = [], []
    for camera in tables.ordered_unique(frames["camera"]):
        one = audit.audit(tables.of_camera(frames, camera), np.zeros((frames["camera"] == camera).sum(), bool))
        rows.append(one.row | {"camera": camera, "bag": "a.bag", "looked_at": 0, "black": 0})
        dropped += [(camera, *lost) for lost in one.dropped]
    files = (folder / f"audit/{sequence}.parquet", folder / f"audit/{sequence}.dropped.parquet")
    tables.write(files[0], "stamp_audit", {k: [r[k] for r in rows] for k in rows[0]})
    columns = dict(zip(("camera", "frame", "stamp_ns", "reason"), zip(*dropped, strict=True), strict=True))
    tables.write(files[1], "dropped_frames", columns)
    return *files, folder / f"frames/{sequence}.parquet"


def counted(capture):
    """statistics.csv of the capture."""
    made = capture.root / "results/evaluate/statistics.csv"
    files = [audited(capture, sequence) for sequence in capture.sequences]
    statistics.run(
        root=capture.root,
        labels=[path for one in capture.sequences.values() for path in one.labels],
        skeletons=capture.skeletons,
        frames=[frames for _, _, frames in files],
        dropped=[dropped for _, dropped, _ in files],
        gallery=None,
        out=made,
    )
    return made


def pages_of(capture, out):
    """The arguments of the step page for each sequence of the capture, in the order of the sheet; none has 3D."""
    project = projects.load(capture.root)
    names, found = list(project.sequences), {}
    for i, (sequence, own) in enumerate(zip(names, map(capture.sequences.get, names), strict=True)):
        session, assets = project.session_of(sequence), out / "assets" / sequence
        measures = capture.root / f"results/evaluate/{sequence}.parquet"
        write_text(assets / "scene.js", scene_file.text_of(None, {}))
        found[sequence] = {
            "sequence": sequence, "within": [session, project.subject_of(sequence)], "about": session,
            "roles": {name: one["role"] for name, one in project.cameras(session).items()}, "title": "A & B",
            "before": names[i - 1] if i else "", "after": names[i + 1] if i + 1 < len(names) else "",
            "measured": page.Measured(
                measures, measures.with_suffix(".frames.parquet"), own.skeleton, *walked(own.skeleton, sequence)
            ),
            "findings": [about(capture, sequence)], "cameras": [capture.root / f"results/cameras/{session}.parquet"],
            "times": page.Times(*audited(capture, sequence), capture.clocks, capture.clock_costs),
            "media": page.Media(assets / "sheets", None, assets / "scene.js"),
            "out": out / f"sequences/{sequence}.html", "out_3d": out / f"sequences/{sequence}.3d.html",
            "out_facts": assets / "facts.json", "out_plots": assets / "plots",
        }  # fmt: skip
    return found


def walked(skeleton, sequence):
    """The tables `gait_parameters` and `gait_events` of a walk, beside its skeleton."""
    files = [skeleton.with_name(f"{sequence}.gait{part}.parquet") for part in ("", ".events", ".steps", ".findings")]
    out, out_events, out_steps, findings = files
    gait.run(
        sequence=sequence, subject="S01", skeleton=skeleton, out=out, out_events=out_events, out_steps=out_steps,
        findings=findings,
    )  # fmt: skip
    return out, out_events


def about(capture, sequence):
    """The findings of the capture that are about a sequence alone, in a table."""
    path = capture.root / f"results/audit/{sequence}.findings.parquet"
    every = [finding for table in capture.findings for finding in tables.read_findings(table)]
    tables.write_findings(path, [finding for finding in every if finding[0].startswith(sequence)])
    return path


def write(capture, out, pages=None, findings=()):
    """All pages; `pages`: the arguments of the step page; `findings`: tables of what a comparison tells."""
    pages = pages or pages_of(capture, out)
    for own in pages.values():
        page.run(**own)
    report.run(
        root=capture.root,
        title="A & B",
        evaluated=report.Evaluated(
            metrics=capture.metrics,
            quantiles=capture.quantiles,
            statistics=counted(capture),
            recognition=test_reid.written(capture.root / "results/reid", test_reid.table()),
        ),
        told=[own["out_facts"] for own in pages.values()],
        findings=list(findings),
        scene=report.Scene(capture.cameras, capture.covariances, capture.turns),
        effort=None,
        out=out,
        out_timing=out.parent / "timing.csv",
    )
    return (out / "index.html").read_text()


def texts(out):
    """Texts of all pages of a report by path."""
    return {path: path.read_text() for path in sorted(out.rglob("*.html"))}


@pytest.fixture(scope="module")
def made(capture, tmp_path_factory):
    out = tmp_path_factory.mktemp("report") / "report"
    return out, write(capture, out)


def test_every_asset_is_there_and_nothing_comes_from_the_network(made, capture):
    out, _ = made
    assert len(texts(out)) == 2 + 2 * len(capture.sequences)
    for page_path, text in texts(out).items():
        links = set(re.findall(r'(?:src|href|poster)="([^"]+)"', text))
        assert links, page_path
        for link in links:
            path, _, anchor = link.partition("#")
            target = page_path if not path else page_path.parent / path
            assert target.is_file(), f"{page_path}: {link}"
            assert not anchor or f'id="{anchor}"' in target.read_text(), f"{page_path}: {link}"
        assert "http://" not in text and "https://" not in text


def test_a_sequence_has_a_page_that_is_linked_both_ways(made, capture):
    out, text = made
    names = list(dict.fromkeys(re.findall(r'href="sequences/(\w+)\.html', text)))
    assert sorted(names) == sorted(capture.sequences)
    for i, sequence in enumerate(names):
        assert f'href="sequences/{sequence}.html' in text
        page_text = (out / f"sequences/{sequence}.html").read_text()
        assert 'href="../index.html"' in page_text and f"assets/{sequence}/plots/timeline.svg" in page_text
        for other in names[max(i - 1, 0) : i] + names[i + 1 : i + 2]:
            assert f'href="{other}.html"' in page_text


def test_findings_are_told_in_words_and_escaped(made):
    out, text = made
    whole = " ".join(texts(out).values())
    assert "something is &lt;wrong&gt; here" in text and "<wrong>" not in whole
    assert "no detections between 1.2 s and 1.9 s" in whole
    assert "A &amp; B" in text
    assert "of 2 of the 2 people in the release, config/subjects.tsv does not say in consent_pictures" in text


def test_re_identification_is_shown_where_it_is_there(made):
    out, text = made
    assert 'href="#recognised"' in text and '<details class="part" id="recognised">' in text
    assert "says nothing about recognising anybody in far pictures" in " ".join(text.split())
    assert (out / "assets/plots/reid_cmc.svg").is_file()


def test_every_sequence_and_camera_has_a_light(made, capture):
    _, text = made
    for sequence in capture.sequences:
        assert sequence in text
    assert text.count("cam04") >= len(capture.sequences)


def test_stamps_are_told_and_drawn(made, capture):
    """cam03 loses five pictures."""
    out, text = made
    page_text = (out / "sequences/outdoor_01.html").read_text()
    row = re.search(r"<tr><td>cam03</td>(.*?)</tr>", page_text)[1]
    assert re.findall(r">([^<]*)</td>", row)[4] == "5"
    for sequence in capture.sequences:
        assert (out / f"assets/{sequence}/plots/stamps.svg").stat().st_size > 2000


def test_clocks_are_told_and_drawn(made, capture):
    """In the table, in a plot of each sequence and in one of all."""
    out, text = made
    assert 'src="assets/plots/clocks.svg"' in text and "8 clocks are estimated, 1 given by hand, 1 not known" in text
    for sequence in capture.sequences:
        page_text = (out / f"sequences/{sequence}.html").read_text()
        clocks = page_text.split('<section id="clocks">')[1].split("</section>")[0]
        assert [re.search(r"<td>(cam\d+)</td>", row)[1] for row in clocks.split("<tr>")[2:]] == [
            "cam01", "cam02", "cam03", "cam04",
        ]  # fmt: skip
        assert f'src="../assets/{sequence}/plots/clocks.svg" alt="Residual over the offset' in clocks
        assert (out / f"assets/{sequence}/plots/clocks.svg").stat().st_size > 2000
    page_text = (out / "sequences/outdoor_01.html").read_text()
    assert re.search(r'cam04</td>.*class="light look">not known</span>', page_text)


def test_plots_have_axes_with_units(made):
    out, _ = made
    plots = sorted((out / "assets").glob("*/plots/*.svg")) + sorted((out / "assets/plots").glob("*.svg"))
    assert len(plots) > 4
    words = " ".join(path.read_text() for path in plots)
    assert "px" in words and "n " in words


@pytest.mark.slow
def test_two_runs_give_the_same_bytes(made, capture, tmp_path):
    """Whatever an earlier run left there of sequences that are gone."""
    out, _ = made
    for name in ("assets/gone_07/cam01.jpg", "assets/plots/stamps_gone_07.svg", "sequences/gone_07.html"):
        (tmp_path / "again" / name).parent.mkdir(parents=True)
        (tmp_path / "again" / name).touch()
    write(capture, tmp_path / "again")

    def hashes(folder):
        files = sorted(p for p in folder.rglob("*") if p.is_file())
        return {p.relative_to(folder).as_posix(): hashlib.sha256(p.read_bytes()).hexdigest() for p in files}

    assert hashes(out) == hashes(tmp_path / "again")


def test_a_sequence_with_3d_has_a_page_for_it(capture, tmp_path):
    out, camera = tmp_path / "report", {"name": "cam01", "tile": [320, 180], "colour": "#0072B2", "rays": "labels"}
    moment = {"camera": "cam01", "frame": 7, "time": 0.25, "text": "Furthest from the truth: 3.00 px"}
    header = {"joints": ["nose"], "cameras": [camera], "moments": [moment]}
    given = pages_of(capture, out)
    write_text(given["outdoor_01"]["media"].scene, scene_file.text_of(header, {}))
    write_text(out / "sequences/old.3d.html", "")
    index = write(capture, out, given)
    assert not (out / "sequences/old.3d.html").exists()
    assert {path.name for path in (out / "viewer").iterdir()} == {"three.min.js", "viewer.css", "viewer.js"}
    beside = (out / "sequences/outdoor_01.html").read_text()
    assert 'href="outdoor_01.3d.html"' in beside and 'href="outdoor_01.3d.html#camera=cam01&amp;frame=7"' in beside
    assert "3d.html" not in (out / "sequences/outdoor_02.html").read_text()
    # the worst pictures are led to in 3D, where there is any
    worst = re.findall(r'href="(sequences/[^"]*)">(\w+) (\w+) frame (\d+)</a>', index)
    assert {name for _, name, _, _ in worst} == {"outdoor_01", "outdoor_02"}
    for link, name, own, frame in worst:
        in_3d = f"{name}.3d.html#camera={own}&amp;frame={frame}"
        assert link == f"sequences/{in_3d if name == 'outdoor_01' else f'{name}.html#{own}'}"
    page_text = (out / "sequences/outdoor_01.3d.html").read_text()
    links = re.findall(r'(?:src|href)="([^"#]+)', page_text)
    assert "../viewer/three.min.js" in links and all((out / "sequences" / link).is_file() for link in links)
    assert "onclick" not in page_text and 'type="module"' not in page_text and "http" not in page_text
    other = (out / "sequences/outdoor_02.3d.html").read_text()
    assert "has a place in 3D" in other and "scene.js" not in other and 'href="outdoor_01.3d.html"' in other


def test_what_a_comparison_tells_is_on_the_index_and_told_to_the_pages(capture, tmp_path):
    """A camera that moved in the course of the session is red in all its walks, whose own pages do not know of it."""
    out, moved = tmp_path / "report", tmp_path / "moved.findings.parquet"
    tables.write_findings(moved, [("field/cam02", "error", "camera_bumped", "cam02 was turned by 2 degrees")])
    index = write(capture, out, findings=[moved])
    assert "cam02 was turned by 2 degrees" in index
    told = json.loads((out / "compared.js").read_text().removeprefix("window.compared = ").removesuffix(";\n"))
    assert set(told) == {"outdoor_01", "outdoor_02"}
    for sequence, one in told.items():
        assert one["cameras"]["cam02"]["level"] == "bad" == one["level"]
        assert one["cameras"]["cam02"]["reasons"] == ["cam02 was turned by 2 degrees"]
        text = (out / f"sequences/{sequence}.html").read_text()
        assert "was turned" not in text and 'src="../compared.js"' in text


@pytest.mark.skipif(chromium.program() is None, reason="no Chromium here")
def test_a_page_shows_what_a_comparison_tells(capture, tmp_path):
    out, moved = tmp_path / "report", tmp_path / "moved.findings.parquet"
    bumped = ("field/cam02", "error", "camera_bumped", "cam02 was <turned>")
    asked = "who is it? Point, or in config/people/outdoor_01.yaml, such as `seeds: <u>` with the pixel of their middle"
    others = [("outdoor_01", "warning", "high_error", "the error is high"), ("outdoor_01", "error", "subject", asked)]
    tables.write_findings(moved, [bumped, *others])
    write(capture, out, findings=[moved])
    with chromium.opened() as browser:
        browser.open(out / "sequences/outdoor_01.html", ready="document.readyState === 'complete'")
        assert browser.run("document.querySelector('h1 .light').textContent") == "fix it"
        assert browser.run("document.querySelector('#notes p:not(.fix)').textContent") == "the error is high"
        typed = "in config/people/outdoor_01.yaml type seeds: <u> with the pixel of their middle"
        assert browser.run("document.querySelector('#notes .fix').textContent") == typed
        cell = "document.querySelector('[data-camera=cam02]')"
        assert browser.run(f"{cell}.className") == "cell bad"
        assert browser.run(f"{cell}.querySelector('li').textContent") == "cam02 was <turned>"
        assert browser.run(f"{cell}.querySelector('.light').textContent") == "fix it"
        assert not browser.said
