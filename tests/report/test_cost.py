import csv
import json

import pytest

from dior.errors import DiorError
from dior.report import cost, pages
from dior.report.numbers import count


class Project:
    sequences, sessions, released_subjects = ("walk",), ("field",), ()

    def __init__(self, root):
        self.root = root


def written(tmp_path, effort=None):
    (tmp_path / "logs/frames").mkdir(parents=True, exist_ok=True)
    used = {"step": "frames", "session": None, "sequence": "walk", "camera": None, "frames": 3600}
    (tmp_path / "logs/frames/walk.timing.json").write_text(json.dumps(used | {"cpu_s": 9, "wall_s": 12.5, "cores": 1}))
    cost.write(pages.environment(), Project(tmp_path), 3600, effort, tmp_path / "timing.csv", tmp_path / "cost.html")
    with open(tmp_path / "timing.csv", newline="") as stream:
        return list(csv.DictReader(stream)), (tmp_path / "cost.html").read_text()


def test_machine_seconds_are_told_by_step(tmp_path):
    rows, text = written(tmp_path)
    assert [(row["step"], row["cpu_s_per_frame"]) for row in rows] == [("frames", "0.0025"), ("all", "0.0025")]
    assert '<td class="number">2.5</td>' in text and count(3600) in text
    assert "Nobody has noted" in text and "http" not in text


def test_minutes_of_people_stand_apart(tmp_path):
    sheet = tmp_path / "effort.tsv"
    sheet.write_text("what\tminutes\tcount\nmarks & <boxes>\t30\t60\nnudging\t2.5\t\n")
    rows, text = written(tmp_path, sheet)
    assert "32.5 minutes" in text and "0.542 s per picture" in text
    assert "marks &amp; &lt;boxes&gt;" in text
    assert [row["step"] for row in rows] == ["frames", "all"]
    sheet.write_text("what\tminutes\nmarks\ta lot\n")
    with pytest.raises(DiorError, match="effort.tsv line 2.*minutes"):
        written(tmp_path, sheet)
