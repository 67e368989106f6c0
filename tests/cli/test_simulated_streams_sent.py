"""Chunks of simulated sensors are sent in batches, or as the bridge's clock runs."""

from __future__ import annotations

from datetime import datetime, timedelta

import pytest

from shm_cli import planting
from tests.helpers.nouns import NOW
from tests.helpers.streams import a_chunk


class Clock:
    """A clock that only sleeping moves, and half a second a batch."""

    def __init__(self) -> None:
        self.now, self.slept = 1000.0, list[float]()

    def monotonic(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.slept.append(seconds)
        self.now += seconds


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    clock = Clock()
    monkeypatch.setattr(planting, "time", clock)
    return clock


def test_a_chunk_is_sent_when_the_clock_of_the_bridge_has_come_to_its_end(clock: Clock) -> None:
    """Ten times as fast: ten seconds of the bridge each second, less what sending takes."""
    chunks = [a_chunk(n) for n in range(3)]
    length = (chunks[0].end - chunks[0].start).total_seconds()
    told: list[datetime] = []

    def take(_: object) -> None:
        clock.now += 0.25

    assert planting.send(iter(chunks), take, length / 2, told.append) == 3
    assert clock.slept == pytest.approx([2.0, 1.75, 1.75])
    assert told == [chunk.end for chunk in chunks]


def test_without_a_speed_chunks_go_in_batches_and_nobody_waits(clock: Clock) -> None:
    chunks = [a_chunk(n) for n in range(8)]
    batches: list[int] = []
    take = lambda batch: batches.append(len(batch))  # noqa: E731
    assert planting.send(iter(chunks), take, 0.0, lambda _: None) == 8
    assert (batches, clock.slept) == ([6, 2], [])


def test_a_loss_is_read_by_hanger_percent_and_day() -> None:
    loss = planting._loss("7:2:1.5", NOW)
    assert list(vars(loss).values()) == [7, 0.02, NOW + timedelta(days=1.5)]
    with pytest.raises(Exception, match="is not HANGER:PERCENT:DAY"):
        planting._loss("7:2", NOW)
    assert planting._whole_hour(NOW + timedelta(minutes=59, seconds=3)) == NOW
