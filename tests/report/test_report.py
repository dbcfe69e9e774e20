import hashlib
import re

import numpy as np
import pytest

from dior.evaluate import statistics
from dior.ingest import audit
from dior.report import report, scene_file
from dior.tables import tables
from dior.tables.files import write_text
from tests.report import test_reid


def audited(capture):
    """Files of the audit of each sequence: the table, what was dropped, and the frames it is about."""
    folder, files = capture.root / "results", {"audits": [], "dropped": [], "frames": []}
    for sequence in capture.sequences:
        frames = tables.read(folder / f"frames/{sequence}.parquet", "frames")
        rows, dropped = [], []
        for camera in tables.ordered_unique(frames["camera"]):
            one = audit.audit(tables.of_camera(frames, camera), np.zeros((frames["camera"] == camera).sum(), bool))
            rows.append(one.row | {"camera": camera, "bag": "a.bag", "looked_at": 0, "black": 0})
            dropped += [(camera, *lost) for lost in one.dropped]
        tables.write(folder / f"audit/{sequence}.parquet", "stamp_audit", {k: [r[k] for r in rows] for k in rows[0]})
        columns = dict(zip(("camera", "frame", "stamp_ns", "reason"), zip(*dropped, strict=True), strict=True))
        tables.write(folder / f"audit/{sequence}.dropped.parquet", "dropped_frames", columns)
        files["audits"].append(folder / f"audit/{sequence}.parquet")
        files["dropped"].append(folder / f"audit/{sequence}.dropped.parquet")
        files["frames"].append(folder / f"frames/{sequence}.parquet")
    return files


def counted(capture):
    """statistics.csv of the capture."""
    made = capture.root / "results/evaluate/statistics.csv"
    files = audited(capture)
    statistics.run(
        root=capture.root,
        labels=[path for one in capture.sequences.values() for path in one.labels],
        skeletons=capture.skeletons,
        frames=files["frames"],
        dropped=files["dropped"],
        gallery=None,
        out=made,
    )
    return made


def write(capture, out, scenes=()):
    report.run(
        root=capture.root,
        title="A & B",
        evaluated=report.Evaluated(
            metrics=capture.metrics,
            frame_metrics=capture.frame_metrics,
            quantiles=capture.quantiles,
            statistics=counted(capture),
            recognition=test_reid.written(capture.root / "results/reid", test_reid.table()),
        ),
        findings=capture.findings,
        scene=report.Scene(capture.cameras, capture.covariances, capture.turns, capture.skeletons),
        times=report.Times(**audited(capture), clocks=capture.clocks, clock_costs=capture.clock_costs),
        media=report.Media(overlays=[], clips=[], scenes=list(scenes)),
        effort=None,
        out=out,
        out_timing=out.parent / "timing.csv",
    )
    return (out / "index.html").read_text()


def pages(out):
    """Texts of all pages of a report by path."""
    return {path: path.read_text() for path in sorted(out.rglob("*.html"))}


@pytest.fixture(scope="module")
def made(capture, tmp_path_factory):
    out = tmp_path_factory.mktemp("report") / "report"
    return out, write(capture, out)


def test_every_asset_is_there_and_nothing_comes_from_the_network(made, capture):
    out, _ = made
    assert len(pages(out)) == 2 + len(capture.sequences)
    for page_path, text in pages(out).items():
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
        assert 'href="../index.html"' in page_text and f"timeline_{sequence}.svg" in page_text
        for other in names[max(i - 1, 0) : i] + names[i + 1 : i + 2]:
            assert f'href="{other}.html"' in page_text


def test_findings_are_told_in_words_and_escaped(made):
    out, text = made
    whole = " ".join(pages(out).values())
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
        assert (out / f"assets/plots/stamps_{sequence}.svg").stat().st_size > 2000


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
        assert f'src="../assets/plots/clocks_{sequence}.svg" alt="Residual over the offset' in clocks
        assert (out / f"assets/plots/clocks_{sequence}.svg").stat().st_size > 2000
    page_text = (out / "sequences/outdoor_01.html").read_text()
    assert re.search(r'cam04</td>.*class="light look">not known</span>', page_text)


def test_plots_have_axes_with_units(made):
    out, _ = made
    plots = sorted((out / "assets/plots").glob("*.svg"))
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
    scenes = {}
    for sequence, told in (("outdoor_01", header), ("outdoor_02", None)):
        scenes[sequence] = out / f"assets/{sequence}/scene.js"
        write_text(scenes[sequence], scene_file.text_of(told, {}))
    for name in ("old.html", "outdoor_02.3d.html"):
        write_text(out / "sequences" / name, "")
    write(capture, out, scenes.values())
    assert {path.name for path in (out / "sequences").glob("*3d*")} == {"outdoor_01.3d.html"}
    assert {path.name for path in (out / "viewer").iterdir()} == {"three.min.js", "viewer.css", "viewer.js"}
    beside = (out / "sequences/outdoor_01.html").read_text()
    assert 'href="outdoor_01.3d.html"' in beside and 'href="outdoor_01.3d.html#camera=cam01&amp;frame=7"' in beside
    assert "3d.html" not in (out / "sequences/outdoor_02.html").read_text() + (out / "index.html").read_text()
    page = (out / "sequences/outdoor_01.3d.html").read_text()
    links = re.findall(r'(?:src|href)="([^"#]+)', page)
    assert "../viewer/three.min.js" in links and all((out / "sequences" / link).is_file() for link in links)
    assert "onclick" not in page and 'type="module"' not in page and "http" not in page
