"""Dataclasses that hold arrays compare by identity: `==` of two would ask whether an array is true, and raise."""

import ast
import re
from functools import cache
from pathlib import Path

import dior

PACKAGE = Path(dior.__file__).parent
ARRAYS = {"Floats", "Ints", "Bools", "Texts", "Table", "NDArray", "ndarray"}


@cache
def classes():
    """(module, class) of all dataclasses of the package, by their source: names of modules start with `dior`."""
    found = []
    for path in sorted(PACKAGE.rglob("*.py")):
        module = ".".join(("dior", *path.relative_to(PACKAGE).with_suffix("").parts)).removesuffix(".__init__")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ClassDef) and any("dataclass" in ast.unparse(d) for d in node.decorator_list):
                found.append((module, node))
    return found


def holds_arrays(node):
    """Whether a field is annotated as an array, or as something that may be or may hold one; functions hold none."""
    fields = (ast.unparse(s.annotation) for s in node.body if isinstance(s, ast.AnnAssign))
    return any(ARRAYS & set(re.findall(r"\w+", note)) for note in fields if not note.startswith("Callable"))


def compares_fields(node):
    """Whether `==` of the class goes through the fields."""
    decorator = next(d for d in node.decorator_list if "dataclass" in ast.unparse(d))
    words = {k.arg: ast.unparse(k.value) for k in getattr(decorator, "keywords", ())}
    own = any(isinstance(s, ast.FunctionDef) and s.name == "__eq__" for s in node.body)
    return not own and words.get("eq", "True") != "False"


def test_dataclasses_are_found():
    assert len(classes()) > 60
    assert sum(holds_arrays(node) for _, node in classes()) > 30


def test_dataclasses_with_arrays_compare_by_identity():
    wrong = [f"{module}.{node.name}" for module, node in classes() if holds_arrays(node) and compares_fields(node)]
    assert not wrong, f"@dataclass(frozen=True, eq=False) is missing: {', '.join(wrong)}"
