"""Start: what is left to do by hand, what each would bring, and the line to run next, or a button that runs it."""

import os
import re
import shutil
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from functools import partial
from itertools import takewhile
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from urllib.parse import urlencode

from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route

from dior.calibrate.locate import FEWEST
from dior.calibrate.marks import marks as hand_marks
from dior.check import computer
from dior.errors import DiorError, Faults, many
from dior.project import running, todos
from dior.project.contents import Project
from dior.project.cross_checks import NotMarked
from dior.project.plain_text import rows_of, text_of
from dior.project.project import as_far_as_it_goes
from dior.report import last_run
from dior.studio import hand_files, report_page
from dior.studio.live_pose import FRAMES
from dior.studio.pages import PAGES, in_memory, one_of, page, sent, workspace_of
from dior.studio.runs import Runs
from dior.studio.workspace import Read, Workspace
from dior.tables import tables

# what the docs ask for: docs/formats.md
MARKS, BOXES = 10, 20
LIGHTS = {"look": "amber", "bad": "red"}
VERDICT, REPORT = report_page.FOLDER / "verdict.txt", report_page.FOLDER / "index.html"
# findings that a person answers, and the page on which
ANSWERED = {
    "clock_unknown": ("/time", "Set the clock"),
    "clock_uncertain": ("/time", "Look at the clock"),
    "who_is_subject": ("/who", "Say who is the subject"),
    "somebody_else": ("/who", "Look who is the subject"),
    "mark_rejected": ("/marks", "Look at a mark"),
    "mark_suspect": ("/marks", "Look at a mark"),
    "pose_uncertain": ("/marks", "Add marks"),
    "pose_unchecked": ("/marks", "Add marks"),
}


@dataclass(frozen=True)
class Task:
    """One thing to do by hand. `state`: missing, weak or done; `says`: how far it is; `brings`: what it is good for;
    `link`: the page to do it on, "" where that is an editor."""

    what: str
    where: str
    state: str
    says: str
    brings: str
    link: str = ""


def start(request: Request) -> Response:
    """The page."""
    read = workspace_of(request).read()
    found = [] if read.project is None else [*tasks(read.project)]
    unfinished: dict[str, list[dict[str, Any]]] = {}
    for todo in read.unfinished:
        before = unfinished.setdefault(todo.path, [])
        told = hint(todo)
        again = bool(before) and before[-1]["told"] == told
        before.append(asdict(todo) | {"row": row_of(todo), "told": told, "hint": "the same" if again else told})
    said = VERDICT.read_text(encoding="utf-8") if VERDICT.is_file() else ""
    left = [task for task in found if task.state != "done"]
    return page(
        request, "start.html.j2", unfinished=unfinished, left=left, done=[task for task in found if task not in left],
        faults=[str(one) for one in faults_of(read)],
        verdict=said,
        report=report_page.address(request.app.state.token), on_disk=str(REPORT.resolve()), folder=str(Path.cwd()),
        others=workspace_of(request).others,
    )  # fmt: skip


def faults_of(read: Read) -> list[DiorError]:
    """What is wrong with the files, but marks and boxes that are missing, which are a task, and what a value must not
    be that is still to be filled in."""
    told = [one for one in read.faults if not isinstance(one, NotMarked)]
    return [one for one in told if not read.unfinished or todos.WORD not in str(one)]


def hint(todo: todos.Todo) -> str:
    """What the comments of a file say of a value: in a sheet those of its column, else those right above it."""
    lines = text_of(todo.path, todo.path).splitlines()
    if todo.path.endswith(".tsv"):
        begin = f"# {todo.key}: "
        return next((line.removeprefix(begin) for line in lines if line.startswith(begin)), "")
    above = [*takewhile(lambda line: line.lstrip().startswith("#"), reversed(lines[: todo.line - 1]))]
    return " ".join(line.strip(" #") for line in reversed(above))


def row_of(todo: todos.Todo) -> str:
    """What a row of a sheet is of, by its first cell; of a YAML file the line."""
    # it may be shorter by now
    line = next(iter(text_of(todo.path, todo.path).splitlines()[todo.line - 1 :]), "")
    return line.split("\t")[0] if todo.path.endswith(".tsv") else f"line {todo.line}"


async def fill(request: Request) -> Response:
    """Put what was typed in the place of a TODO: {"path", "line", "key", "value"}."""
    told = await sent(request)
    filled: dict[todos.Todo, str] = in_memory(request, "filled")
    return JSONResponse(await run_in_threadpool(_filled, workspace_of(request), told, filled))


def _filled(workspace: Workspace, told: dict[str, Any], filled: dict[todos.Todo, str]) -> dict[str, Any]:
    """What is written, and what is `wrong` in its file now; `filled`: what was filled in here may be mended here.
    Raises DiorError for a value that the steps would refuse."""
    path, line, key, value = (told.get(name) for name in ("path", "line", "key", "value"))
    wanted = next(
        (one for one in [*todos.found("."), *filled] if (one.path, one.line, one.key) == (path, line, key)), None
    )
    if wanted is None or not isinstance(value, str):
        raise DiorError("this is no value that is still to be filled in; load the page again")
    value = as_typed(wanted.path, value)
    if value.startswith(todos.WORD):
        raise DiorError(f"'{wanted.key}' would be {todos.WORD} still; fill in what it is")
    before = filled.get(wanted, todos.WORD)
    hand_files.fill_in(wanted.path, wanted.line, wanted.key, value, before, partial(_check_value, wanted, value))
    filled[wanted] = value
    read = workspace.read()
    wrong = [str(one) for one in faults_of(read) if wanted.path in str(one)]
    return {"value": value, "wrong": wrong}


def _check_value(todo: todos.Todo, value: str, draft: Path) -> None:
    """Refuse a value in a file that will be as `draft`, with the sentence of who reads the project."""
    name = todo.key.rsplit(".", 1)[-1]
    if name == "subject" and todo.path.endswith(".tsv") and not todo.path.endswith("/subjects.tsv"):
        # with values to be filled in, too, the sheets are not compared yet
        (_, header), *rows = rows_of("config/subjects.tsv", "config/subjects.tsv", "\t")
        known = [dict(zip(header, cells, strict=False)).get("subject", "") for _, cells in rows]
        one_of("subject of config/subjects.tsv", value, known)
    with TemporaryDirectory(prefix="dior_studio_") as folder:
        root = Path(folder)
        for entry in Path(".").iterdir():
            if entry.name != "config":
                (root / entry.name).symlink_to(entry.resolve())
        shutil.copytree("config", root / "config", copy_function=_link_to)
        had = _sentences(root)
        (root / todo.path).unlink()
        shutil.copyfile(draft, root / todo.path)
        # what else is wrong in the file, and is seen only now, does not stand in the way
        new = [one for one in _sentences(root) if one not in had and todo.path in one]
        told = [one for one in new if re.search(rf"\b{re.escape(name)}\b", one) or f"'{value}'" in one]
    if told:
        raise DiorError(told[0])


def _link_to(source: str, link: str) -> None:
    os.symlink(os.path.abspath(source), link)


def _sentences(root: Path) -> list[str]:
    """What is wrong with the files of a project's config/ but what is missing yet."""
    faults, unfinished = Faults(), todos.found(root)
    as_far_as_it_goes(root, faults, unfinished=unfinished)
    return [str(one) for one in faults_of(Read(None, tuple(faults.found), tuple(unfinished)))]


def as_typed(path: str, value: str) -> str:
    """A value as its file takes it: numbers with commas, as one notes a place, are a list in YAML."""
    value = value.strip()
    numbers = r"-?[\d.]+(\s*,\s*-?[\d.]+)+"
    return f"[{value}]" if path.endswith(".yaml") and re.fullmatch(numbers, value) else value


def tasks(project: Project) -> Iterator[Task]:
    """What is done by hand in a project, in the order of the sessions, and then what the last run asks."""
    for session in project.sessions:
        walks = project.sequences_of(session)
        for camera, settings in project.cameras(session).items():
            if settings["locate"] == "marks":
                yield _marks(project, session, camera, len(walks))
            if settings["role"] == "long_range" or settings["locate"] == "align":
                for walk in walks:
                    yield _boxes(project, walk, camera)
    yield from _asked(project)
    yield from _lit(project)


def _marks(project: Project, session: str, camera: str, walks: int) -> Task:
    path, link = project.marks_file(session, camera), _link("/marks", session=session, camera=camera)
    brings = f"the camera's place; without it there are no labels of {many(walks, 'recording')}"
    count = frames = 0
    if Path(path).is_file():
        try:
            read = hand_marks.read(path)
        except DiorError as error:
            return Task("Mark markers", f"{session} {camera}", "missing", str(error), brings, link)
        count, frames = len(read), len(set(zip(read.sequence.tolist(), read.frame.tolist(), strict=True)))
    says = f"{many(count, 'mark')} on {many(frames, 'picture')}; {MARKS} or more on each of {FRAMES} pictures are asked"
    state = "missing" if count < FEWEST else "weak" if frames < FRAMES or count < MARKS * FRAMES else "done"
    return Task("Mark markers", f"{session} {camera}", state, says, brings, link)


def _boxes(project: Project, walk: str, camera: str) -> Task:
    link = _link("/boxes", walk=walk, camera=camera)
    path, count = project.boxes(walk).get(camera), 0
    brings = "the camera's direction to a fraction of a pixel, and a judgement of its labels that no step has seen"
    if path:
        try:
            # a row without edges is no box
            count = sum(any(cells[1:5]) for _, cells in rows_of(path, path)[1:])
        except DiorError as error:
            return Task("Draw boxes", f"{walk} {camera}", "missing", str(error), brings, link)
    says = f"{count} drawn; {BOXES} to 30 are asked"
    state = "missing" if not count else "weak" if count < BOXES else "done"
    return Task("Draw boxes", f"{walk} {camera}", state, says, brings, link)


def _asked(project: Project) -> Iterator[Task]:
    """What findings of the last run ask a person."""
    for path in sorted(Path("results").glob("[a-z]*/**/*.findings.parquet")):
        try:
            found = tables.read_findings(path)
        except DiorError as error:
            # that a run at work has taken away by now is no task
            if path.exists():
                yield Task("Run it again", path.stem.removesuffix(".findings"), "weak", str(error), "what it found")
            continue
        for scope, severity, code, text in found:
            if severity == "info" or code not in ANSWERED:
                continue
            first, _, camera = scope.partition("/")
            if first not in project.sequences and first not in project.sessions:
                continue  # somebody who may not be processed any more, or a walk that is excluded
            address, what = ANSWERED[code]
            named = {"session" if first in project.sessions else "walk": first}
            yield Task(what, scope.replace("/", " "), "weak", text, "", _link(address, camera=camera, **named))


def _lit(project: Project) -> Iterator[Task]:
    """Cameras whose labels the last report would have looked at."""
    levels = {name: one.get("level") for name, one in last_run.figures(REPORT.parent).items()}
    for session in project.sessions:
        for camera, settings in project.cameras(session).items():
            level = str(levels.get(f"{session}/{camera}"))
            if level not in LIGHTS:
                continue
            address = "/long-range" if settings["role"] == "long_range" else "/frames"
            link = _link(address, session=session, walk=project.first_sequence(session), camera=camera)
            says = f"{LIGHTS[level]} in the last report, which says why and what to type"
            yield Task("Look at the labels", f"{session} {camera}", "weak", says, "labels that can be released", link)


def _link(address: str, **words: str) -> str:
    return f"{address}?{urlencode({key: word for key, word in words.items() if word})}" if address in PAGES else ""


def checked(request: Request) -> Response:
    """What `dior check` says, but the marks and boxes that are missing, which are a task."""
    told = _runs(request).check()
    not_marked = {str(one) for one in workspace_of(request).read().faults if isinstance(one, NotMarked)}
    faults = [one for one in told["faults"] if f"{one['file']}: {one['text']}" not in not_marked]
    plan = computer.Plan(**told["plan"]) if told["plan"] else ""
    return JSONResponse({
        "faults": _by_walk(faults), "warnings": _by_walk(told["warnings"]), "plan": str(plan)
    })  # fmt: skip


def _by_walk(faults: list[dict[str, Any]]) -> list[dict[str, Any]]:
    return [one | {"walk": walk} for one in faults for walk in one["walks"] or [""]]


def run(request: Request) -> Response:
    """How the run goes that was begun here, or somewhere else."""
    return JSONResponse(asdict(_runs(request).told()) | {"elsewhere": running.at_work(".")})


async def begin(request: Request) -> Response:
    """Begin or end a run: {"do": "run", "dry" or "end"}."""
    wanted = (await sent(request)).get("do")
    runs = _runs(request)
    acts: dict[str, Callable[[], None]] = {"run": runs.begin, "dry": partial(runs.begin, "-n"), "end": runs.end}
    if not isinstance(wanted, str) or wanted not in acts:
        raise DiorError(f"do is none of {', '.join(acts)}")
    await run_in_threadpool(acts[wanted])
    return JSONResponse(asdict(runs.told()) | {"elsewhere": ""})


def _runs(request: Request) -> Runs:
    found: Runs = in_memory(request, "runs", Runs)
    return found


ROUTES = [
    Route("/", start),
    Route("/api/fill", fill, methods=["POST"]),
    Route("/api/check", checked),
    Route("/api/run", run),
    Route("/api/run", begin, methods=["POST"]),
]
