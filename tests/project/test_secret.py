"""Digests of what is in the sheets can be guessed by nobody who has not the project's key."""

import stat

import pytest

from dior.errors import DiorError
from dior.project import secret


def test_a_key_is_made_once_and_for_its_owner_only(tmp_path):
    key = secret.key_of(tmp_path)
    assert secret.key_of(tmp_path) != key and not list(tmp_path.iterdir()), "asking writes nothing"
    secret.keep(tmp_path, key)
    secret.keep(tmp_path, secret.key_of(tmp_path / "elsewhere"))
    assert secret.key_of(tmp_path) == key
    assert stat.S_IMODE((tmp_path / secret.FILE).stat().st_mode) == 0o600


def test_a_digest_tells_a_change_and_nothing_without_the_key(tmp_path):
    key, other = secret.key_of(tmp_path), secret.key_of(tmp_path)
    person = {"subject": "zebra-0001", "height_m": 1.72}
    found = secret.digest(key, person)
    assert found == secret.digest(key, dict(reversed(person.items()))) and "1.72" not in found
    assert found != secret.digest(key, person | {"height_m": 1.73})
    assert found != secret.digest(other, person), "else a list of heights would tell"


@pytest.mark.parametrize("text", ["", "abc", "0" * 63 + "x"])
def test_what_is_no_key_is_refused(tmp_path, text):
    (tmp_path / secret.FILE).write_text(text)
    with pytest.raises(DiorError, match=r"\.dior_key: this is no key .* delete the file, a new one is made"):
        secret.key_of(tmp_path)
