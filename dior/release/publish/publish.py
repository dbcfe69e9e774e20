"""`dior publish`: send a release to the Hugging Face Hub, or as a draft to Zenodo.

INPUTS   a release folder, for Zenodo its tarballs beside it; the token of an account, from the environment
OUTPUTS  a dataset repository of the Hub that holds the release's files and no others, or a draft of its tarballs

1. Where to is asked for, with the token: nothing is changed there.
2. The release is verified as `dior verify` does; what is damaged or edited is not sent.
3. A question says what would be sent, and to whom. Without a yes nothing is.
A line that broke off is typed again: what is there already is not sent a second time.
"""

import sys
from pathlib import Path

from dior.errors import DiorError
from dior.release import checksums
from dior.release.publish.delivery import Delivery


def run(release: Path, *, hub: str = "", zenodo: bool = False, yes: bool = False) -> None:
    """Send a release to the Hugging Face Hub or to Zenodo, after it was verified and you have said yes.

    `release`: its folder; `hub`: dataset repository of the Hub, such as lab/walks, which is made private where it is
    not there; `zenodo`: to a draft on Zenodo, as the tarballs beside the folder; `yes`: what is asked is answered yes.

    Raises DiorError without a place, a token or the library that it takes, for a release that `dior verify` finds a
    problem in, and where the site is out of reach, refuses or breaks off.
    """
    if bool(hub) == zenodo:
        raise DiorError("say where to: --hub and a dataset repository such as lab/walks, or --zenodo")
    listed = checksums.read(release)
    if "sequences.parquet" not in listed:
        raise DiorError(f"{release}: is no release, which has a sequences.parquet; name the folder dior-<version>")
    delivery = _delivery(release, listed, hub)
    _verified(delivery)
    if not yes and not _agreed(delivery.question):
        print("nothing was sent")
        return
    print(delivery.send())


def _delivery(release: Path, listed: dict[str, str], hub: str) -> Delivery:
    if hub:
        from dior.release.publish import to_hub

        return to_hub.delivery(release, listed, hub)
    from dior.release.publish import to_zenodo

    return to_zenodo.delivery(release, listed)


def _verified(delivery: Delivery) -> None:
    """Raise DiorError unless all that would be sent is whole."""
    from dior.release.verify import verify

    for paths in delivery.sources:
        verify.run(paths)


def _agreed(question: str) -> bool:
    """Ask on the terminal. Raises DiorError where there is nobody to ask."""
    print(f"{question} [y/N] ", end="", file=sys.stderr, flush=True)
    answer = sys.stdin.readline()
    if not answer:
        raise DiorError("nothing was sent: there is nobody to ask; --yes answers the question")
    return answer.strip().lower() in ("y", "yes")
