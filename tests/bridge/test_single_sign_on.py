"""The table `[single_sign_on]` of bridge.toml."""

from __future__ import annotations

from pathlib import Path

import pytest

from shm.bridge.description import is_safe, single_sign_on_of
from shm.errors import BadInput

TABLE = {
    "issuer": "https://login.example.org/realms/bridges",
    "client_id": "shm",
    "client_secret_file": "sign_on.secret",
}


def test_a_provider_is_described_once_and_is_known_by_its_host(tmp_path: Path) -> None:
    assert single_sign_on_of({}, tmp_path / "bridge.toml") is None
    found = single_sign_on_of({"single_sign_on": TABLE}, tmp_path / "bridge.toml")
    assert found is not None
    assert (found.host, found.user_claim) == ("login.example.org", "email")
    assert found.client_secret_file == tmp_path / "sign_on.secret"


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"issuer": "http://login.example.org"}, "is not an encrypted address"),
        ({"issuer": "login.example.org"}, "is not an encrypted address"),
        ({"issuer": 3}, "is not a text"),
        ({"client_id": " "}, "is not a text"),
        ({"client_secret": "x"}, "no place for a secret"),
        ({"role_claim": "groups"}, "unknown key role_claim"),
    ],
)
def test_what_is_unsafe_or_unknown_is_refused(
    tmp_path: Path, change: dict[str, object], said: str
) -> None:
    with pytest.raises(BadInput, match=said) as refusal:
        single_sign_on_of({"single_sign_on": {**TABLE, **change}}, tmp_path / "bridge.toml")
    assert refusal.value.remedy


def test_a_table_that_lacks_the_secret_or_is_none_is_refused(tmp_path: Path) -> None:
    lacking = {key: value for key, value in TABLE.items() if key != "client_secret_file"}
    for wrong, said in ((lacking, "client_secret_file is missing"), ("x", "must be a table")):
        with pytest.raises(BadInput, match=said):
            single_sign_on_of({"single_sign_on": wrong}, tmp_path / "bridge.toml")


def test_unencrypted_is_safe_on_this_computer_alone() -> None:
    assert is_safe("http://localhost:8080/x")
    assert is_safe("http://[::1]/x")
    for address in ("http://10.0.0.1/", "ftp://a/", "https://", "https://a:b@c/", "https://[x"):
        assert not is_safe(address)
