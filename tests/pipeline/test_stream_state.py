"""What is said of a stream's losses, by what its ring counted."""

from __future__ import annotations

from datetime import datetime, timedelta

import numpy as np
import pytest

from shm.documents import format_time
from shm.pipeline.stream_state import _received
from shm.store.ring_notices import StreamState
from tests.helpers.nouns import NOW

TEN = timedelta(minutes=10)


def ring_state(off: timedelta, chunks: int, missing: tuple[int, ...] = ()) -> StreamState:
    """Of chunks of ten minutes that begin so long after full ten minutes, without some."""
    starts = [NOW + n * TEN for n in range(chunks) if n not in missing]
    spans = {format_time(each) or "": (each + off, each + off + TEN) for each in starts}
    return StreamState(received_s=dict.fromkeys(spans, 600.0), spans=spans)


def now_after(chunks: int, minutes: float) -> datetime:
    return NOW + chunks * TEN + timedelta(minutes=minutes)


@pytest.mark.parametrize("off_s", [0.0, 1.0, 300.0, 599.0])
@pytest.mark.parametrize("chunks", [1, 2, 100, 144, 200])
def test_where_nothing_is_missing_nothing_is_lost_whenever_it_is_asked(
    off_s: float, chunks: int
) -> None:
    state = ring_state(timedelta(seconds=off_s), chunks)
    for minutes in np.arange(0.0, 30.0, 1.7):
        came, lost = _received(state, now_after(chunks, minutes))
        assert (came, lost) == (1.0, pytest.approx(0.0, abs=1e-9))


def test_what_is_missing_is_lost_from_the_first_sample_on_and_of_a_day_at_most() -> None:
    half = timedelta(minutes=5)
    assert _received(ring_state(half, 20, missing=(7,)), now_after(20, 1))[1] == pytest.approx(0.05)
    day = _received(ring_state(half, 300, missing=(200, 201)), now_after(300, 5))[1]
    assert day == pytest.approx(2 / 144, rel=0.01)
    assert np.isnan(_received(ring_state(half, 3), now_after(300, 1))).all()
