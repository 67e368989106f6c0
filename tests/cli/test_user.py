"""`shm user`: people who may sign in, what is refused, and how to go on from there."""

from __future__ import annotations

import io

import pytest

from shm.errors import UsageError
from shm.pipeline import utc_now
from shm.store import Workspace
from tests.cli.conftest import Ended, Shm

PASSWORD = "correct horse battery"


@pytest.fixture
def user(shm: Shm, empty: Workspace, monkeypatch: pytest.MonkeyPatch) -> Shm:
    def call(*words: object, password: str = "") -> Ended:
        monkeypatch.setattr("sys.stdin", io.StringIO(f"{password}\n"))
        return shm("--workspace", empty.folder, "user", *words)

    return call


def test_a_user_is_made_listed_without_a_secret_and_removed(user: Shm) -> None:
    made = user("add", "M. Huber", "--role", "operator", "--json", password=PASSWORD)
    assert made.document == {
        "schema": "shm.user_add/1",
        "name": "M. Huber",
        "role": "operator",
    }
    listed = user("list", "--json")
    (one,) = listed.document["users"]
    assert (one["name"], one["role"], one["removed_at"]) == ("M. Huber", "operator", None)
    assert "argon2" not in listed.out
    assert user("remove", "M. Huber").code == 0
    assert user("list", "--json").document["users"][0]["removed_at"]
    assert user("add", "M. Huber", password=PASSWORD).code == 0


def test_who_comes_by_single_sign_on_has_no_password(user: Shm, empty: Workspace) -> None:
    assert user("add", "ann@example.org").code == 2  # an empty line is none
    assert user("add", "ann@example.org", "--single-sign-on").code == 0
    with empty.store() as store:
        assert store.people.sign_in("ann@example.org", "", utc_now()) is None
        assert store.people.sign_in_as("ann@example.org", utc_now())
        assert store.people.sign_in_as("Ann@example.org", utc_now()) is None


def test_the_password_that_stdin_gives_is_the_one_that_signs_in(
    user: Shm, empty: Workspace
) -> None:
    user("add", "a", password=PASSWORD)
    assert user("password", "a", password="four other long words").code == 0
    with empty.store() as store:
        at = store.people.list_all()[0].made_at
        assert store.people.sign_in("a", PASSWORD, at) is None
        assert store.people.sign_in("a", "four other long words", at)


def test_user_changes_to_single_sign_on(user: Shm, empty: Workspace) -> None:
    user("add", "ann@example.org", password=PASSWORD)
    with empty.store() as store, pytest.raises(UsageError, match="with a password"):
        store.people.sign_in_as("ann@example.org", utc_now())
    assert user("single-sign-on", "ann@example.org").code == 0
    assert "single sign-on" in user("list").out
    assert user("list", "--json").document["users"][0]["single_sign_on"] is True
    with empty.store() as store:
        assert store.people.sign_in_as("ann@example.org", utc_now())
        for password in ("", PASSWORD):
            assert store.people.sign_in("ann@example.org", password, utc_now()) is None
    assert user("password", "ann@example.org", password=PASSWORD).code == 0
    assert user("list", "--json").document["users"][0]["single_sign_on"] is False


@pytest.mark.parametrize(
    ("words", "password", "code", "said"),
    [
        ("add b", "short", 2, "four or five words"),
        ("add a", PASSWORD, 2, "shm user remove a"),
        ("password a", "short", 2, "four or five words"),
        ("password b", PASSWORD, 4, "shm user list"),
        ("remove b", "", 4, "shm user list"),
        ("single-sign-on b", "", 4, "shm user list"),
    ],
)
def test_what_cannot_be_done_says_how_to_go_on(
    user: Shm, words: str, password: str, code: int, said: str
) -> None:
    user("add", "a", password=PASSWORD)
    refused = user(*words.split(), password=password)
    assert refused.code == code
    assert said in " ".join(refused.err.split())
