"""Licences of data that a release can name: full name and where the text is, by SPDX identifier.

For any other licence `release.license_file` in config.yaml names the file with its text. Loads no numerics.
"""

import os
from typing import Any

from dior.errors import DiorError, nearest
from dior.paths import AnyPath

_PLACE = "https://creativecommons.org/"
KNOWN = {
    "CC0-1.0": ("Creative Commons Zero v1.0 Universal", f"{_PLACE}publicdomain/zero/1.0/legalcode"),
    "CC-BY-4.0": ("Creative Commons Attribution 4.0 International", f"{_PLACE}licenses/by/4.0/legalcode"),
    "CC-BY-SA-4.0": (
        "Creative Commons Attribution Share Alike 4.0 International",
        f"{_PLACE}licenses/by-sa/4.0/legalcode",
    ),
    "CC-BY-NC-4.0": (
        "Creative Commons Attribution Non Commercial 4.0 International",
        f"{_PLACE}licenses/by-nc/4.0/legalcode",
    ),
    "CC-BY-NC-SA-4.0": (
        "Creative Commons Attribution Non Commercial Share Alike 4.0 International",
        f"{_PLACE}licenses/by-nc-sa/4.0/legalcode",
    ),
    "CC-BY-ND-4.0": (
        "Creative Commons Attribution No Derivatives 4.0 International",
        f"{_PLACE}licenses/by-nd/4.0/legalcode",
    ),
    "CC-BY-NC-ND-4.0": (
        "Creative Commons Attribution Non Commercial No Derivatives 4.0 International",
        f"{_PLACE}licenses/by-nc-nd/4.0/legalcode",
    ),
}


def check(release: dict[str, Any], root: AnyPath) -> None:
    """Raise DiorError where the `release:` section of the config names a licence whose text is nowhere."""
    name, path = release["license"], release["license_file"]
    if path and not os.path.isfile(os.path.join(root, path)):
        raise DiorError(
            f"config/config.yaml: 'release.license_file' is '{path}', where there is no file; it is relative to the "
            "folder that holds config/"
        )
    if not path and name and name not in KNOWN:
        raise DiorError(
            f"config/config.yaml: 'release.license' is '{name}', whose text dior does not know{nearest(name, KNOWN)}; "
            f"take one of {', '.join(KNOWN)}, or name the file with the text in 'release.license_file'"
        )


def check_chosen(release: dict[str, Any]) -> None:
    """Raise DiorError where the `release:` section names no licence: what people agreed to, nobody else can know."""
    if not release["license"]:
        raise DiorError(
            "config/config.yaml: 'release.license' is not given, without which nothing can be released: what the "
            f"subjects agreed to decides; take one of {', '.join(KNOWN)}, or another with its text in "
            "'release.license_file'"
        )


def url(name: str) -> str:
    """Where the text of a licence is on the web; "" for one that is not known."""
    return KNOWN[name][1] if name in KNOWN else ""


def text(release: dict[str, Any], root: AnyPath) -> str:
    """Content of the file LICENSE: the text that the config names, or the known licence's name and place.

    Raises DiorError as `check_chosen`.
    """
    check_chosen(release)
    if release["license_file"]:
        with open(os.path.join(root, release["license_file"]), encoding="utf-8-sig") as stream:
            return stream.read().replace("\r\n", "\n")
    name, place = KNOWN[release["license"]]
    return f"{name}\nSPDX-License-Identifier: {release['license']}\n\nThe text of this licence: {place}\n"
