"""A release as a dataset repository of the Hugging Face Hub, by the Hub's own library.

INPUTS   a release folder; the token that the library knows (HF_TOKEN, or `hf auth login`)
OUTPUTS  one commit: the files that SHA256SUMS lists, the list and its signature, and nothing else
Files of an earlier release that this one does not have are deleted in the same commit, so that nobody stays who
withdrew; the Hub keeps old revisions (docs/people.md). The library sends nothing that the Hub has already, and a commit
is there whole or not at all.
"""

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from dior.errors import DiorError, many
from dior.release import checksums
from dior.release.publish.delivery import Delivery, settings, told

NEEDS = "`dior publish --hub` needs huggingface_hub; install it: pip install -e '.[hub]'"
# what the Hub puts into every repository
ITS_OWN = frozenset({".gitattributes"})
REFUSED = {
    401: "the token is not taken; make one that may write at huggingface.co/settings/tokens, and set HF_TOKEN",
    403: "the token may not write there; it has to be one that may write, of a member of the organisation",
    404: "there is no such repository or person, or the token may not see it",
    413: "a file, or all of them together, is too large for the Hub",
    429: "too much was asked of the Hub in a short time; wait for an hour and type the same line again",
}


def delivery(release: Path, listed: dict[str, str], repo: str) -> Delivery:
    """What would be sent to the dataset `repo`. Raises DiorError without the library, a token or the Hub."""
    try:
        import huggingface_hub
    except ImportError:
        raise DiorError(NEEDS) from None
    token = huggingface_hub.get_token()
    if not token:
        raise DiorError("no token of the Hugging Face Hub: set HF_TOKEN to one that may write, or `hf auth login`")
    # asked for again, as the library reads it once when it is imported
    api = huggingface_hub.HfApi(endpoint=os.environ.get("HF_ENDPOINT"), token=token)
    names = [*sorted(listed), checksums.SUMS]
    names += [checksums.SIGNATURE] if (release / checksums.SIGNATURE).is_file() else []
    there = _there(api, repo)
    gone = sorted(set(there or ()) - set(names) - ITS_OWN)
    question = f"Send {told(release, [release / name for name in names], 'file')} to the {_shown(api, repo, there)}"
    question += f", and delete {many(len(gone), 'file')} there that the release does not have" if gone else ""

    def send() -> str:
        return _sent(api, repo, release, names, gone, new=there is None)

    return Delivery(([release],), f"{question}?", send)


def _there(api: Any, repo: str) -> list[str] | None:
    """Files of the dataset `repo`; None where there is no such repository."""
    from huggingface_hub.errors import RepositoryNotFoundError

    with _said(api, repo):
        # the Hub answers a token that it does not know as if there were no such repository
        api.whoami()
        try:
            return list(api.list_repo_files(repo, repo_type="dataset"))
        except RepositoryNotFoundError:
            return None


def _shown(api: Any, repo: str, there: list[str] | None) -> str:
    where = f"dataset {repo} of {api.endpoint}"
    if there is None:
        return f"new private {where}"
    with _said(api, repo):
        private = api.repo_info(repo, repo_type="dataset").private
    return f"{'private' if private else 'PUBLIC'} {where}"


def _sent(api: Any, repo: str, release: Path, names: Sequence[str], gone: Sequence[str], new: bool) -> str:
    from huggingface_hub import CommitOperationAdd, CommitOperationDelete
    from huggingface_hub.utils import disable_progress_bars

    disable_progress_bars()
    with _said(api, repo, "; nothing of this release shows there yet, and the same line goes on where it was"):
        if new:
            api.create_repo(repo, repo_type="dataset", private=True)
        operations = [
            *(CommitOperationAdd(path_in_repo=name, path_or_fileobj=str(release / name)) for name in names),
            *(CommitOperationDelete(path_in_repo=name) for name in gone),
        ]
        message = f"Release {settings(release)['version'] or release.resolve().name}"
        api.create_commit(repo, operations, commit_message=message, repo_type="dataset")
        there = set(api.list_repo_files(repo, repo_type="dataset")) - ITS_OWN
    if there != set(names):
        other = sorted(there ^ set(names))
        raise DiorError(
            f"{repo}: {many(len(other), 'file')} there that the release has not, or the other way round, first "
            f"'{other[0]}'; is there a .gitignore?"
        )
    url = f"{api.endpoint}/datasets/{repo}"
    return f"{many(len(names), 'file')} at {url}" + ("; it is private until you change that there" if new else "")


@contextmanager
def _said(api: Any, repo: str, then: str = "") -> Iterator[None]:
    """Raise DiorError for what the library raises. `then`: what to do after a failure on the way."""
    from huggingface_hub import errors

    # errors of the connection, by OSError and the library below, which is another in other versions
    connection: Any = errors.HfHubHTTPError.__bases__
    try:
        yield
    except errors.HfHubHTTPError as error:
        status = error.response.status_code if error.response is not None else 0
        why = REFUSED.get(status) or f"the Hub answers {status}: {error.server_message or str(error).splitlines()[0]}"
        raise DiorError(f"{repo}: {why}{then if status >= 500 else ''}") from None
    except errors.HFValidationError as error:
        raise DiorError(
            f"{repo}: is no name of a repository, such as lab/walks: {str(error).splitlines()[0]}"
        ) from None
    except errors.OfflineModeIsEnabled:
        raise DiorError("HF_HUB_OFFLINE is set, so that nothing is sent; unset it") from None
    except connection as error:
        raise DiorError(
            f"{api.endpoint} cannot be reached, or broke off ({str(error) or type(error).__name__}){then}"
        ) from None
