"""What a person types of `dior`, and its help: a cyclopts application.

Only the module of the command that is typed is imported; what the others do is read from the first sentence of their
source. The texts of the flags are those of `dior.cli.flags`, from the docstrings.
"""

import inspect
import re
from collections.abc import Callable
from dataclasses import is_dataclass
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Any, get_type_hints

from cyclopts import App, CycloptsError, Group, Parameter

import dior
from dior.cli import flags
from dior.project.steps import MODULES

# command -> module whose `run` does it
COMMANDS = {
    "init": "dior.init.init",
    "check": "dior.check.check",
    "pseudonyms": "dior.project.pseudonyms",
    "run": "dior.project.run",
    "studio": "dior.studio.studio",
    "verify": "dior.release.verify.verify",
    "diff": "dior.release.diff.diff",
    "assess": "dior.assess.assess",
    "formats": "dior.cli.formats",
    "publish": "dior.release.publish.publish",
    "export-cameras": "dior.release.export_cameras",
    "export": "dior.release.export_rrd",
    "angles": "dior.release.angles.angles",
    "forget": "dior.project.forget",
    "trigger": "dior.ingest.trigger",
    "simulate": "dior.simulate.config",
    "train-reid": "dior.reid.train",
}
ABOUT = "From raw multi-camera gait captures to 2D and 3D skeleton labels."
EPILOGUE = (
    "Names are spelled with `-` or `_`, as you like. Exit codes: 0 all is well; 1 something is wrong with what was "
    "given, or `diff` found differences; 2 the command line is wrong, or `diff` was given no release."
)
COMPLETION = "--install-completion"


def run(words: list[str]) -> int:
    """Run one command; returns its exit code. Raises UsageError for a command line that is wrong."""
    name = words[0].replace("_", "-")
    try:
        return _app(name)([name, *words[1:]], result_action="return_value") or 0
    except CycloptsError as error:
        raise flags.UsageError(" ".join(str(error).split())) from None


def _app(typed: str) -> App:
    """The application; `typed`: the command whose module it takes, or COMPLETION for all."""
    app = App(
        name="dior",
        help=ABOUT,
        help_epilogue=EPILOGUE,
        version=lambda: dior.__version__,
        default_parameter=Parameter(negative=(), consume_multiple=True, name_transform=_flag),
        print_error=False,
        exit_on_error=False,
    )
    steps = Group("Steps of the workflow", sort_key=1, help="`snakemake` runs these; `dior <step> --help` tells more.")
    of_steps = {name.replace("_", "-"): f"dior.{module}" for name, module in MODULES.items()}
    for order, (name, module) in enumerate((COMMANDS | of_steps | COMMANDS).items()):
        command: Any = _documented(module) if typed in (name, COMPLETION) else f"{module}:run"
        group = None if name in COMMANDS else steps
        app.command(command, name=name, help=_first_sentence(module), group=group, sort_key=order)
    app.register_install_completion_command(COMPLETION)
    return app


def _first_sentence(module: str) -> str:
    """Of a module's docstring, from its source."""
    spec = find_spec(module)
    if spec is None or spec.origin is None:
        raise ModuleNotFoundError(f"there is no module {module}")
    docstring = Path(spec.origin).read_text(encoding="utf-8").split('"""')[1]
    sentence = " ".join(docstring.split("\n\n")[0].split()).split(". ")[0].rstrip(".")
    text = re.sub(r"^`dior [^`]+`: ", "", sentence)
    return text[:1].upper() + text[1:]


def _flag(name: str) -> str:
    """What a parameter is called on the command line; a module that uses json calls its flag `as_json`."""
    return name.removeprefix("as_").replace("_", "-")


def _json(hint: Any) -> dict[str, Any]:
    """What cyclopts is told of a parameter that is JSON: it would leave what is nested as text."""
    if "Any" not in str(hint):
        return {}
    kind = next(kind for begin, kind in flags.JSON.items() if str(hint).startswith(begin))
    return {"converter": lambda _, tokens: kind.value([tokens[0].value]), "accepts_keys": False, "n_tokens": 1}


def _documented(module: str) -> Callable[..., Any]:
    """The `run` of a module, its parameters with the texts of their flags and dataclasses as their fields."""
    command = import_module(module).run
    parameters = []
    for name, hint in get_type_hints(command).items():
        if name != "return":
            text = flags.text_of(name, command.__doc__ or "")
            old = inspect.signature(command).parameters[name]
            # words for another program begin as they like
            others = old.kind is old.VAR_POSITIONAL
            how = Parameter(help=text, allow_leading_hyphen=others, **_json(hint))
            how = Parameter(name="*") if is_dataclass(hint) else how
            parameters.append(old.replace(annotation=Annotated[hint, how]))

    def documented(*args: Any, **kwargs: Any) -> Any:
        return command(*args, **kwargs)

    documented.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]  # as inspect documents it
    return documented
