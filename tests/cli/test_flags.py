import inspect
import sys
from dataclasses import dataclass, fields, is_dataclass
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace
from typing import get_type_hints

import pytest

from dior.cli import flags, main, words
from dior.cli.commands import COMMANDS
from dior.evaluate import timing
from dior.project.steps import MODULES


def parameters(step):
    """What `run` takes as Python itself tells it: whether there is a default, by name; fields of dataclasses too."""
    run = import_module(f"dior.{MODULES[step]}").run
    hints, found = get_type_hints(run), {}
    for name, parameter in inspect.signature(run).parameters.items():
        if is_dataclass(hints[name]):
            found |= {name: given for name, given in parameters_of_class(hints[name])}
        else:
            found[name] = parameter.default is not parameter.empty
    return found


def parameters_of_class(known):
    made = inspect.signature(known).parameters
    return [(field.name, made[field.name].default is not inspect.Parameter.empty) for field in fields(known)]


@pytest.mark.parametrize("step", MODULES)
def test_flags_are_the_arguments_of_the_step(step):
    assert {name: flag.default for name, flag in flags.flags_of(step).items()} == parameters(step)


@pytest.mark.parametrize("step", MODULES)
def test_every_flag_has_a_text(step):
    lacking = [flag.typed for flag in flags.flags_of(step).values() if len(flag.text) < 5]
    assert not lacking
    text = flags.help_of(step)
    assert all(f"  {flag.typed} " in text for flag in flags.flags_of(step).values())


def test_no_text_is_told_that_no_flag_needs():
    named = {name for step in MODULES for name in flags.flags_of(step)}
    named |= {name for module in COMMANDS.values() for name in inspect.signature(import_module(module).run).parameters}
    assert words.TEXTS.keys() <= named


def test_the_text_of_a_flag_is_what_the_docstring_says_after_its_name():
    doc = """Do it to `bags`.

    `one`, `two`: `cameras` tables of
    those; `three`: a file (none indoors), `four`: what is left. `five` and `six`: the rest, if
    there is any. Raises DiorError.
    """
    names = ("one", "two", "three", "four", "five", "six", "cameras", "out")
    assert {name: flags.text_of(name, doc) for name in names} == {
        **dict.fromkeys(("one", "two"), "`cameras` tables of those"),
        "three": "a file (none indoors)",
        "four": "what is left",
        **dict.fromkeys(("five", "six"), "the rest, if there is any"),
        **{name: words.TEXTS[name] for name in ("cameras", "out")},
    }


STEP = '''
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from dior.made_of import there


@dataclass(frozen=True)
class Here:
    """`near`: how near."""

    near: float
    far: int = 3


def run(*, a: str, b: str = "", c: int, d: float = 1.0, e: Path, f: Path | None, g: list[Path], h: list[str],
        i: dict[str, str], j: dict[str, Path], k: dict[str, Any], l: list[Any] = [], m: Literal["x", "y"], here: Here,
        there: there.There) -> None:
    """Nothing."""
'''
THERE = """
from dataclasses import dataclass


@dataclass(frozen=True)
class There:
    over: list[str]
"""


@dataclass(frozen=True)
class Found:
    origin: str


@pytest.fixture
def step(tmp_path, monkeypatch):
    """A step with a parameter of each kind."""
    (tmp_path / "step.py").write_text(STEP)
    (tmp_path / "there.py").write_text(THERE)
    places = {"dior.made_up": "step.py", "dior.made_of.there": "there.py"}
    monkeypatch.setattr(flags, "find_spec", lambda module: Found(str(tmp_path / places[module])))
    monkeypatch.setitem(MODULES, "made", "made_up")
    flags._tree.cache_clear()
    yield "made"
    flags.flags_of.cache_clear()
    flags._tree.cache_clear()


ALL = {
    "a": (["--a", "text"], "text"),
    "b": (["--b"], ""),
    "c": (["--c", "-4"], -4),
    "d": (["--d", "-.5"], -0.5),
    "e": (["--e", "x.csv"], Path("x.csv")),
    "f": (["--f"], None),
    "g": (["--g", "x", "y"], [Path("x"), Path("y")]),
    "h": (["--h=--x"], ["--x"]),
    "i": (["--i", "cam01=/a=b", "cam02="], {"cam01": "/a=b", "cam02": ""}),
    "j": (["--j", "cam01=c"], {"cam01": Path("c")}),
    "k": (["--k", '{"x": [1, null]}'], {"x": [1, None]}),
    "l": (["--l", "[]"], []),
    "m": (["--m", "y"], "y"),
    "near": (["--near", "2"], 2.0),
    "far": (["--far", "5"], 5),
    "over": (["--over"], []),
}


def test_each_kind_of_parameter_is_read(step):
    given = [word for words, _ in ALL.values() for word in words]
    assert flags.parsed(step, given) == {name: value for name, (_, value) in ALL.items()}
    assert flags.flags_of(step)["near"].within == ("here", "Here") and flags.flags_of(step)["near"].text == "how near"
    assert flags.flags_of(step)["over"].within == ("there", "there.There")


def test_fields_of_a_dataclass_are_put_into_one(step, monkeypatch):
    """And the job's cost is that of the flags as they were given."""
    asked: dict = {}
    noted: dict = {}

    @dataclass(frozen=True)
    class Here:
        near: float
        far: int

    @dataclass(frozen=True)
    class There:
        over: list

    made = SimpleNamespace(Here=Here, there=SimpleNamespace(There=There), run=lambda **given: asked.update(given))
    monkeypatch.setitem(sys.modules, "dior.made_up", made)
    monkeypatch.setattr(timing, "write", lambda name, given, started: noted.update({name: given}))
    assert main.main([step, *(word for words, _ in ALL.values() for word in words)]) == 0
    plain = {name: value for name, (_, value) in ALL.items()}
    apart = {name: plain[name] for name in plain if name not in ("near", "far", "over")}
    assert asked == apart | {"here": Here(2.0, 5), "there": There([])} and noted == {step: plain}


def test_what_may_be_left_out(step):
    needed = [word for name in "acekm" for word in ALL[name][0]] + ALL["near"][0]
    empty = {"f": None, "g": [], "h": [], "i": {}, "j": {}, "over": []}
    assert flags.parsed(step, needed) == {name: ALL[name][1] for name in ("a", "c", "e", "k", "m", "near")} | empty
    with pytest.raises(flags.UsageError, match="^--c and --m must be given"):
        flags.parsed(step, [word for name in "aek" for word in ALL[name][0]] + ALL["near"][0])


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["--c", "4.5"], "--c takes INTEGER, not '4.5'"),
        (["--d", "soon"], "--d takes NUMBER, not 'soon'"),
        (["--e", "x", "y"], "--e takes PATH, not 'x' 'y'"),
        (["--e"], "--e takes PATH, not nothing"),
        (["--f", "x", "y"], r"--f takes \[PATH\], not 'x' 'y'"),
        (["--i", "cam01"], "--i takes .KEY=TEXT .+, not 'cam01'"),
        (["--k", "{"], "--k takes JSON {...}, not '{'"),
        (["--k", "[1]"], "--k takes JSON {...}, not '.1.'"),
        (["--k", "[" * 100_000], "--k takes JSON {...}, not "),
        (["--e", ""], "--e takes PATH, not ''"),
        (["--g", "x", ""], "--g takes .PATH .+, not 'x' ''"),
        (["--m", "z"], r"--m takes x\|y, not 'z'"),
        (["--fra", "5"], "there is no flag --fra .did you mean '--far'"),
        (["--a", "x", "--a", "y"], "--a is given twice"),
    ],
)
def test_what_is_wrong_is_said(step, words, text):
    name = words[0].removeprefix("--")
    others = [word for key in ("a", "c", "e", "k", "m", "near") if key != name for word in ALL[key][0]]
    with pytest.raises(flags.UsageError, match=text):
        flags.parsed(step, [*others, *words])


def test_a_parameter_that_no_flag_can_be_made_of_is_a_fault(step, tmp_path):
    for text in ("def run(*, a: set[str]) -> None: ...", "def run(*, a) -> None: ..."):
        flags.flags_of.cache_clear()
        flags._tree.cache_clear()
        (tmp_path / "step.py").write_text(text)
        with pytest.raises(TypeError, match="dior.made_up.run: a(:| has no)"):
            flags.flags_of(step)
