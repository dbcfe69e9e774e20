"""YAML files that people write, read so that nothing in them can hang, crash or surprise.

INPUTS   files of a project's config/, and others that are YAML
OUTPUTS  plain dicts, lists, texts and numbers
What would be deep, large or endless is found in the parser's events, before anything is made of it: the loader itself
calls itself for each level, in C until the stack ends. Loads no numerics.
"""

from collections.abc import Iterator
from functools import cache
from typing import TYPE_CHECKING, Any

from dior.errors import DiorError
from dior.paths import AnyPath
from dior.project.plain_text import text_of

if TYPE_CHECKING:
    import yaml

# chosen: ten times what the largest file of a project with hundreds of walks has
MOST_BYTES = 1 << 20
# chosen: no key of the schemas lies deeper than 8
MOST_DEPTH = 40
# chosen: an alias counts as all that it stands for
MOST_VALUES = 100_000
# what ROS 2 writes for a time without an end; Python itself prints no number of thousands of digits
LARGEST = 2**64
# what PyYAML's constructors raise besides its own errors, for `2023-02-30` or `!!int x`
NO_SUCH_VALUE = (ValueError, TypeError, LookupError, AttributeError, OverflowError)


def read_yaml(path: AnyPath, shown: AnyPath | None = None) -> Any:
    """The content of a YAML file ({} for an empty one). `shown` is the file's name in messages.

    Raises DiorError for no file, no YAML, a key given twice, and what is nested or repeated beyond all reason.
    """
    shown = shown or path
    return yaml_of(text_of(path, shown, MOST_BYTES), shown)


def yaml_of(text: str, shown: AnyPath) -> Any:
    """The content of a YAML text; raises as `read_yaml`."""
    import yaml

    try:
        _check_events(text)
        content = yaml.load(text, _loader())
    except DiorError as error:
        raise DiorError(f"{shown}{' ' if str(error).startswith('line ') else ': '}{error}") from None
    except (yaml.YAMLError, RecursionError) as error:
        mark, at = getattr(error, "problem_mark", None), getattr(error, "position", None)
        line = mark.line + 1 if mark else text.count("\n", 0, at) + 1 if isinstance(at, int) else None
        where = f" line {line}" if line else ""
        reason = getattr(error, "problem", None) or str(error).split("\n")[0]
        fix = "check the indentation and quotes"
        if "another document" in reason:
            fix = "are two files joined? keep what is on one side of its `---`"
        elif line and "\t" in "".join(text.split("\n")[line - 1 : line]):
            fix = "a line is indented with blanks, and this one holds a tab; replace it"
        raise DiorError(f"{shown}{where}: not valid YAML ({reason}); {fix}") from None
    return {} if content is None else content


def scalars_of(path: AnyPath, shown: AnyPath | None = None) -> Iterator[tuple[int, str, str]]:
    """Yield line, keys with dots, and text of every value of a YAML file, those of a list under the list's key.

    Raises as `read_yaml`.
    """
    text = text_of(path, shown or path, MOST_BYTES)
    # refused here, it is neither deep nor endless
    yaml_of(text, shown or path)
    for line, keys, node in scalar_nodes(text):
        yield line, keys, node.value


def scalar_nodes(text: str) -> Iterator[tuple[int, str, "yaml.ScalarNode"]]:
    """The same of a text that `yaml_of` reads, with PyYAML's node of each value, which knows where it stands."""
    import yaml

    yield from _scalars(yaml.compose(text, _base()), ())


def _scalars(node: "yaml.Node | None", keys: tuple[str, ...]) -> Iterator[tuple[int, str, "yaml.ScalarNode"]]:
    import yaml

    if isinstance(node, yaml.MappingNode):
        for key, value in node.value:
            yield from _scalars(value, (*keys, str(key.value)))
    elif isinstance(node, yaml.SequenceNode):
        for value in node.value:
            yield from _scalars(value, keys)
    elif isinstance(node, yaml.ScalarNode):
        yield node.start_mark.line + 1, ".".join(keys), node


def _check_events(text: str) -> None:
    """Raise DiorError, `line <n>: ` before its text, where the values of a YAML text are too deep or too many."""
    import yaml

    # per open list or mapping its anchor and how many values it holds; the first stands for the file
    inside: list[tuple[str | None, int]] = [(None, 0)]
    sizes: dict[str, int] = {}
    for event in yaml.parse(text, _base()):
        line = event.start_mark.line + 1
        if isinstance(event, yaml.CollectionEndEvent):
            anchor, size = inside.pop()
            if anchor:
                sizes[anchor] = size
        elif isinstance(event, yaml.CollectionStartEvent):
            inside.append((event.anchor, 1))
            if len(inside) > MOST_DEPTH:
                raise DiorError(f"line {line}: nested {MOST_DEPTH} times; is a bracket or a quote left open?")
            continue
        elif isinstance(event, yaml.AliasEvent):
            if any(anchor == event.anchor for anchor, _ in inside):
                raise DiorError(f"line {line}: '*{event.anchor}' stands for what it is in; write the values out")
            size = sizes.get(event.anchor, 1)
        elif isinstance(event, yaml.ScalarEvent):
            size = 1
            if event.anchor:
                sizes[event.anchor] = 1
        else:
            continue
        around, before = inside[-1]
        inside[-1] = around, before + size
        if before + size > MOST_VALUES:
            raise DiorError(f"line {line}: more than {MOST_VALUES} values, aliases (*) written out; is it the file?")


def _base() -> Any:
    import yaml

    # PyYAML may have been built without the loader in C
    return getattr(yaml, "CSafeLoader", yaml.SafeLoader)


@cache
def _loader() -> "type[yaml.SafeLoader]":
    import yaml

    base: Any = _base()

    class Loader(base):
        """A safe loader that does not let the second of two equal keys win in silence."""

        def construct_object(self, node: "yaml.Node", deep: bool = False) -> Any:
            where = f"line {node.start_mark.line + 1}: "
            try:
                value = super().construct_object(node, deep=deep)
            except NO_SUCH_VALUE:
                shown = node.value[:40] if isinstance(node.value, str) else node.tag
                raise DiorError(f"{where}'{shown}' is no value of its kind; put it in quotes if it is text") from None
            if isinstance(value, int) and abs(value) >= LARGEST:
                raise DiorError(f"{where}a number of 20 digits or more; put it in quotes if it is text")
            return value

    def mapping(loader: "yaml.SafeLoader", node: "yaml.MappingNode") -> dict[Any, Any]:
        first: dict[str, int] = {}
        for key, _ in node.value:
            line = key.start_mark.line + 1
            if not isinstance(key, yaml.ScalarNode):
                raise DiorError(f"the key on line {line} is no plain word")
            if key.value in first:
                raise DiorError(f"key '{key.value:.40}' is given twice, on lines {first[key.value]} and {line}")
            first[key.value] = line
        return loader.construct_mapping(node, deep=True)

    def day(loader: "yaml.SafeLoader", node: "yaml.ScalarNode") -> str:
        """Text as it stands, since no schema has a type for it; raises for what is no day."""
        loader.construct_yaml_timestamp(node)
        return node.value

    Loader.add_constructor(yaml.resolver.BaseResolver.DEFAULT_MAPPING_TAG, mapping)
    Loader.add_constructor("tag:yaml.org,2002:timestamp", day)
    return Loader
