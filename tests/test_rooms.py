"""Who may import whom: the package's rooms stand in an order, and an import only goes downwards."""

import ast
from functools import cache
from pathlib import Path

import dior

PACKAGE = Path(dior.__file__).parent
# each room may import those before it; docs/architecture.md draws it
ROOMS = (
    ("errors", "progress", "paths", "arrays", "shortage", "formats", "tables", "project", "geometry", "body", "clocks")
    + ("gait", "ingest", "calibrate", "reconstruct", "label", "evaluate", "reid", "report", "release")
    + ("init", "assess", "check", "studio", "simulate", "cli")
)
CALIBRATE = ("readers", "lens", "marks", "clock", "outline", "bundle")
RULES = ("intrinsics", "locate", "place", "reference", "adjust", "clocks", "align", "follow")


@cache
def imports():
    """(module, what it imports) of the package, as tuples of names without `dior`, imports inside functions too."""
    modules, found = {}, []
    for path in PACKAGE.rglob("*.py"):
        parts = path.relative_to(PACKAGE).with_suffix("").parts
        modules[parts[:-1] if parts[-1] == "__init__" else parts] = path
    for module, path in sorted(modules.items()):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "dior":
                base = tuple(node.module.split(".")[1:])
                for alias in node.names:
                    found.append((module, (*base, alias.name) if (*base, alias.name) in modules else base))
    return [(module, used) for module, used in found if module and used]


def test_all_rooms_are_in_the_order():
    assert {module[0] for module, _ in imports()} <= {*ROOMS, "__main__"} and len(imports()) > 500


def test_imports_go_downwards():
    upwards = [(m, u) for m, u in imports() if m[0] in ROOMS and ROOMS.index(u[0]) > ROOMS.index(m[0])]
    assert not upwards


def test_simulate_is_used_by_the_command_alone():
    """The simulator must not help to make the labels."""
    assert {m[0] for m, u in imports() if u[0] == "simulate"} <= {"simulate", "cli"}


def test_calibrate_shows_its_rules_and_has_its_rooms_below():
    names = {path.stem for path in (PACKAGE / "calibrate").glob("*.py")} - {"__init__"}
    assert names == set(RULES)
    inside = [(m[1:], u[1:]) for m, u in imports() if m[0] == u[0] == "calibrate"]
    for module, used in inside:
        if len(module) == 1:
            assert len(used) > 1, f"{module} and {used} are rules: what both need has a room below"
        else:
            assert len(used) > 1 and CALIBRATE.index(used[0]) <= CALIBRATE.index(module[0]), (module, used)


def test_no_two_modules_use_each_other():
    below = {}
    for module, used in imports():
        below.setdefault(module, set()).add(used)

    done = set()

    def visit(module, path):
        if module in done:
            return
        for used in sorted(below.get(module, ())):
            assert used not in path, " -> ".join(".".join(m) for m in (*path, used))
            visit(used, (*path, used))
        done.add(module)

    for module in sorted(below):
        visit(module, (module,))
