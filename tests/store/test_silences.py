"""Silences: from when until when nobody is told, by whom made and ended."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta

import pytest

from shm.errors import NothingThere, UsageError
from shm.store import Store
from shm.store.rows import Silence

NOW = datetime(2026, 5, 1, 12, 0, tzinfo=UTC)
HOUR = timedelta(hours=1)


def one(first: int, last: int, hanger: int | None = 3, ended: int | None = None) -> Silence:
    ended_at = None if ended is None else NOW + ended * HOUR
    return Silence(
        1, hanger, NOW + first * HOUR, NOW + last * HOUR, False, "Ada", "paint", NOW, ended_at
    )


def test_what_is_over_is_neither_made_nor_ended(file_store: Store) -> None:
    silences = file_store.silences
    for period in ((NOW, NOW), (NOW - 2 * HOUR, NOW), (NOW + HOUR, NOW + HOUR)):
        with pytest.raises(UsageError, match="must end after it begins"):
            silences.make(3, period, "Ada", "", NOW)
    made = silences.make(3, (NOW - HOUR, NOW + HOUR), "Ada", "", NOW)
    with pytest.raises(UsageError, match=f"silence {made.id} is over"):
        silences.end(made.id, "Ada", NOW + HOUR)
    silences.end(made.id, "Ada", NOW + HOUR / 2)
    with pytest.raises(UsageError, match="is over"):
        silences.end(made.id, "Ada", NOW)
    with pytest.raises(NothingThere, match="no silence 99"):
        silences.end(99, "Ada", NOW)


@pytest.mark.parametrize(
    ("silence", "hour", "covers", "over"),
    [
        (one(0, 2), -1, False, False),
        (one(0, 2), 0, True, False),
        (one(0, 2), 1, True, False),
        (one(0, 2), 2, False, True),
        (one(0, 2, hanger=4), 1, False, False),
        (one(0, 2, hanger=None), 1, True, False),
        (one(0, 2, ended=1), 1, False, True),
        (one(0, 2, ended=1), 0, True, False),
        (one(0, 2, ended=3), 2, False, True),
        (one(1, 2, ended=0), 0, False, True),
    ],
)
def test_a_silence_holds_from_its_begin_to_before_its_end(
    silence: Silence, hour: int, covers: bool, over: bool
) -> None:
    at = NOW + hour * HOUR
    assert (silence.covers(3, at), silence.is_over(at)) == (covers, over)
