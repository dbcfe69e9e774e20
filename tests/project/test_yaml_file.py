"""YAML that is deep, large, endless or of strange kinds: one sentence with the line, and soon."""

import time

import pytest

from dior.errors import DiorError
from dior.project.schema_check import check
from dior.project.yaml_file import LARGEST, MOST_DEPTH, read_yaml

BOMB = "a: &a0 [x,x,x,x,x,x,x,x,x]\n" + "".join(f"b{i}: &a{i + 1} [{','.join([f'*a{i}'] * 9)}]\n" for i in range(12))
MERGED = "a: &a0 {k: 1}\n" + "".join(f"b{i}: &a{i + 1} {{<<: [*a{i}, *a{i}], z{i}: 1}}\n" for i in range(40))


def read(folder, text):
    path = folder / "x.yaml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_yaml(path, "config/x.yaml")


def refused(folder, text):
    begun = time.process_time()
    with pytest.raises(DiorError) as caught:
        read(folder, text)
    assert time.process_time() - begun < 1.0
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("a: 1\nb: 2023-02-30\n", "config/x.yaml line 2: '2023-02-30' is no value of its kind; put it in quotes"),
        ("2023-13-01: 3\n", "config/x.yaml line 1: '2023-13-01' is no value of its kind"),
        ("a: 2001-12-14 21:59:99\n", "config/x.yaml line 1: '2001-12-14 21:59:99' is no value"),
        ("a: !!int x\n", "config/x.yaml line 1: 'x' is no value of its kind"),
        ("a: !!bool x\n", "config/x.yaml line 1: 'x' is no value of its kind"),
        ("a: !!timestamp x\n", "config/x.yaml line 1: 'x' is no value of its kind"),
        ("a: 0x_\n", "config/x.yaml line 1: '0x_' is no value of its kind"),
        ("a: !!python/object:os.system x\n", "config/x.yaml line 1: not valid YAML (could not determine a constructor"),
        ("a: !mine x\n", "config/x.yaml line 1: not valid YAML (could not determine a constructor for the tag '!mine'"),
        ("a: " + "9" * 5000, "config/x.yaml line 1: '99999"),
        ("a: 0x" + "f" * 5000, "config/x.yaml line 1: a number of 20 digits or more"),
        ("a: " + ":".join(["59"] * 3000) + ".5", "config/x.yaml line 1: '59:59"),
        ("a: " + "[" * 2000 + "]" * 2000, "config/x.yaml line 1: nested 40 times; is a bracket or a quote left open?"),
        ("a: " + "[" * 50_000, "config/x.yaml line 1: nested 40 times"),
        ("- " * 50_000, "config/x.yaml line 1: nested 40 times"),
        ("? " * 50_000, "config/x.yaml line 1: nested 40 times"),
        ("a:\n" + "".join(" " * i + "b:\n" for i in range(1, 900)), "config/x.yaml line 40: nested 40 times"),
        (BOMB, "config/x.yaml line 6: more than 100000 values, aliases (*) written out"),
        (MERGED, "config/x.yaml line "),
        ("a: &x [1, *x]\n", "config/x.yaml line 1: '*x' stands for what it is in"),
        ("a: *x\n", "config/x.yaml line 1: not valid YAML (found undefined alias)"),
        ("a: b\n" * 300_000, "config/x.yaml: has 2 MB, and at most 1 MB are read"),
        ("[" + "1," * 200_000 + "1]", "config/x.yaml line 1: more than 100000 values"),
        ("a: 1\nb: \x07\n", "config/x.yaml line 2: not valid YAML (unacceptable character #x0007"),
        ("a: 1\n---\nb: 1\n", "config/x.yaml line 2: not valid YAML (but found another document)"),
        ("a: 1\nb: 1\na: 2\n", "config/x.yaml: key 'a' is given twice, on lines 1 and 3"),
        ("a: é\n".encode("latin-1"), "config/x.yaml line 1: the byte 0xe9 is not UTF-8"),
        ("a: 1\n".encode("utf-16"), "config/x.yaml: is UTF-16"),
    ],
)
def test_what_no_person_means_is_refused_soon(tmp_path, text, sentence):
    assert refused(tmp_path, text).startswith(sentence)


def test_the_fix_is_for_what_was_typed(tmp_path):
    assert refused(tmp_path, "a:\n\tb: 1\n").endswith(
        "a line is indented with blanks, and this one holds a tab; replace it"
    )
    assert refused(tmp_path, "a: [1\n").endswith("check the indentation and quotes")
    # no spreadsheet writes YAML
    assert "Excel" not in refused(tmp_path, "a: é\n".encode("latin-1"))


def test_what_a_person_may_write_is_read(tmp_path):
    text = "\ufeffa: &x {b: 1, c: [1.5, yes, ~, 2024-02-29]}\nd: *x\ne: {<<: *x, b: 2}\nf: 1_000\n"
    content = read(tmp_path, text)
    assert content["d"] == content["a"] and content["e"]["b"] == 2 and content["f"] == 1000
    assert read(tmp_path, "") == {} and read(tmp_path, "# nothing\n") == {}


def test_ros2_writes_times_without_an_end(tmp_path):
    """metadata.yaml of a ROS 2 bag holds stamps in ns, and 2^63 - 1 for a deadline that is none."""
    text = f"a: {{nsec: {2**63 - 1}, stamp: 1708000000000000000, none: {LARGEST - 1}}}\n"
    assert read(tmp_path, text)["a"]["nsec"] == 2**63 - 1
    assert "20 digits" in refused(tmp_path, f"a: {LARGEST}\n")


def test_the_depth_that_is_allowed(tmp_path):
    inside = MOST_DEPTH - 2
    assert read(tmp_path, "a: " + "[" * inside + "]" * inside)
    assert "nested" in refused(tmp_path, "a: " + "[" * (inside + 1) + "]" * (inside + 1))


def test_a_number_that_fits_no_float_is_none_of_a_config():
    with pytest.raises(DiorError, match=r"x.yaml: 'cam01.offset_s' is 1000000000000000000000, which is more than any"):
        check({"cam01": {"offset_s": 10**21}}, "offsets", "x.yaml")


def test_a_whole_number_with_a_point_is_one():
    config = check({"detector": {"first_frame": 1.0}}, "config", "config.yaml")
    assert repr(config["detector"]["first_frame"]) == "1"
    seed = {"camera": "cam01", "frame": 7.0, "u": 1.0, "v": 2.0}
    people = check({"seeds": [seed]}, "people", "walk.yaml")
    assert repr(people["seeds"][0]["frame"]) == "7" and repr(people["seeds"][0]["u"]) == "1.0"
    with pytest.raises(DiorError, match="'detector.first_frame' is 1.5 but should be a whole number"):
        check({"detector": {"first_frame": 1.5}}, "config", "config.yaml")
