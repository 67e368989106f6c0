"""Who may sign in and until when; tokens of programs; and what of it the audit log says."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta

import pytest

from shm.errors import NothingThere, UsageError
from shm.store import Store
from shm.store.people import SIGNED_IN_FOR
from shm.store.rows import Role, Scope

NOW = datetime(2026, 5, 1, 12, 0, tzinfo=UTC)
SECOND, DAY = timedelta(seconds=1), timedelta(days=1)
WORDS = "correct horse battery"
OTHER = "four other quiet words"


@pytest.fixture
def store(file_store: Store) -> Store:
    return file_store


@pytest.fixture
def people(store: Store) -> Store:
    store.people.add("Ada", Role.ENGINEER, WORDS, NOW)
    store.people.add("Ben", Role.OPERATOR, OTHER, NOW)
    return store


def test_who_signs_in_is_known_by_the_secret_until_it_ends(people: Store) -> None:
    secret = people.people.sign_in("Ben", OTHER, NOW)
    assert secret is not None
    assert secret.startswith("session_")
    assert len(secret) == len("session_") + 43  # 32 bytes in base64
    user = people.people.user_of(secret, NOW)
    assert user is not None
    assert (user.name, user.role, user.made_at, user.removed_at) == ("Ben", "operator", NOW, None)
    assert people.people.user_of(secret, NOW + SIGNED_IN_FOR - SECOND) == user
    assert people.people.user_of(secret, NOW + SIGNED_IN_FOR) is None
    assert people.people.user_of(secret + "x", NOW) is None
    assert SIGNED_IN_FOR == 30 * DAY
    second = people.people.sign_in("Ben", OTHER, NOW)
    people.people.sign_out(secret, NOW)
    assert people.people.user_of(secret, NOW) is None
    assert people.people.user_of(second or "", NOW) == user


@pytest.mark.parametrize("change", ["remove", "password", "role"])
def test_whatever_changes_of_a_person_ends_the_own_sessions_alone(
    people: Store, change: str
) -> None:
    own, others = (people.people.sign_in(*who, NOW) for who in (("Ben", OTHER), ("Ada", WORDS)))
    {
        "remove": lambda: people.people.remove("Ben", NOW + DAY),
        "password": lambda: people.people.set_password("Ben", WORDS, NOW + DAY),
        "role": lambda: people.people.set_role("Ben", Role.READER, NOW + DAY),
    }[change]()
    assert people.people.user_of(own or "", NOW) is None
    assert people.people.user_of(others or "", NOW) is not None
    by_words = people.people.sign_in("Ben", WORDS, NOW), people.people.sign_in("Ben", OTHER, NOW)
    assert [each is not None for each in by_words] == [change == "password", change == "role"]
    ada, ben = people.people.list_all()
    assert (ada.name, ada.role, ada.removed_at) == ("Ada", "engineer", None)
    assert ben.removed_at == (NOW + DAY if change == "remove" else None)
    assert ben.role == ("reader" if change == "role" else "operator")


def test_the_last_engineer_stays_one(people: Store) -> None:
    with pytest.raises(UsageError, match="the last engineer"):
        people.people.remove("Ada", NOW)
    with pytest.raises(UsageError, match="the last engineer"):
        people.people.set_role("Ada", Role.OPERATOR, NOW)
    people.people.set_role("Ada", Role.ENGINEER, NOW)
    people.people.set_password("Ada", OTHER, NOW)
    people.people.set_role("Ben", Role.ENGINEER, NOW)
    people.people.remove("Ada", NOW)
    with pytest.raises(UsageError, match="the last engineer"):
        people.people.remove("Ben", NOW)
    with pytest.raises(NothingThere, match="no user Ada"):
        people.people.remove("Ada", NOW)


def test_the_bounds_of_names_and_passwords_belong_to_them(store: Store) -> None:
    store.people.add("a" * 255, Role.READER, "p" * 15, NOW)
    store.people.add("b", Role.READER, "p" * 1024, NOW)
    store.upkeep.create_token("a" * 255, Scope.READ, NOW)
    assert store.people.sign_in("b", "p" * 1024, NOW)
    for password in ("p" * 14, "p" * 1025):
        with pytest.raises(UsageError, match="15 to 1024 characters"):
            store.people.add("c", Role.READER, password, NOW)


def test_the_use_of_a_token_is_noted_now_and_then(store: Store) -> None:
    from shm.store.people import _NOTED_AGAIN_AFTER as PAUSE

    def used_at() -> datetime | None:
        return store.upkeep.list_tokens()[0].last_used_at

    secret = store.upkeep.create_token("logger", Scope.READ, NOW)
    assert used_at() is None
    for after, noted in ((0 * DAY, NOW), (PAUSE - SECOND, NOW), (PAUSE, NOW + PAUSE)):
        store.upkeep.token_of(secret, NOW + after)
        assert used_at() == noted
