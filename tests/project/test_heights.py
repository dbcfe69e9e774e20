"""Heights are in no parameter of a rule; the step reads them in the sheet."""

import json

import pytest

from dior.errors import DiorError
from dior.project import heights, project
from tests.project.test_project import edit, root  # noqa: F401


@pytest.mark.parametrize("stature", ["", "stature: true\n"])
def test_they_are_left_out_and_filled_in_again(root, stature):  # noqa: F811
    path = root / "config/sessions/field/session.yaml"
    path.write_text(path.read_text() + stature)
    known = project.load(root).metric_facts("field")
    assert [fact["height_m"] for fact in known["heights"]] == [1.72] and len(known["stature"]) == bool(stature)
    passed = json.dumps(heights.without(known))
    assert "1.72" not in passed and "S01" not in passed and "zebra-0001" in passed
    people = root / "config/subjects.tsv"
    assert heights.filled(json.loads(passed), people) == known
    assert heights.filled(known, None) == known


def test_a_height_that_was_taken_out_meanwhile_is_one_sentence(root):  # noqa: F811
    known = heights.without(project.load(root).metric_facts("field"))
    edit(root, "subjects.tsv", "1.72\t0.01", "\t")
    with pytest.raises(DiorError, match="'zebra-0001' has no height_m any more; run the workflow again"):
        heights.filled(known, root / "config/subjects.tsv")
