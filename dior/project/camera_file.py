"""The file of one camera, config/sessions/<session>/<camera>.yaml, as a step reads it."""

from typing import Any

from dior.errors import DiorError
from dior.paths import AnyPath
from dior.project import schema_check


def camera_settings(path: AnyPath, needs: str = "") -> dict[str, Any]:
    """The content of a camera's YAML, checked against its schema; `needs` names the only `locate` that will do.

    Raises DiorError for what the schema refuses and for a section that the way of locating needs and is not there.
    """
    settings = schema_check.check(schema_check.read_yaml(path), "camera", path)
    how = settings["locate"]
    if needs and how not in needs.split("|"):
        raise DiorError(f"{path}: `locate` is {how}, this step is for {needs.replace('|', ' or ')}")
    section = {"tape": "tape", "align": "tape", "reference": "reference"}.get(how)
    if section and section not in settings:
        raise DiorError(f"{path}: `locate: {how}` needs the section `{section}`")
    return settings
