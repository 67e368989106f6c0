"""A logger's clock that was ahead: the true samples count, the wrongly dated ones are excluded."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from shm.read.chunk_document import chunk_document
from shm.store import Workspace
from shm.store.queries.streams import list_stream_events
from shm.store.ring import Ring, ring_of
from shm.values import Channel, Recording
from shm.values.stream import Chunk, StreamEvent
from shm_daemon.streams import StreamKeeper
from tests.helpers.flows import Clock
from tests.helpers.nouns import NOW
from tests.helpers.streams import STREAM, a_chunk, list_excluded, with_stream
from tests.helpers.workspaces import make_workspace
from tests.helpers.written import write

HOUR = timedelta(hours=1)
MINUTE = timedelta(minutes=1)
BEGIN = NOW.replace(hour=8, minute=30)


@pytest.fixture
def clock() -> Clock:
    return Clock(BEGIN)


@pytest.fixture
def bridge(tmp_path: Path) -> Workspace:
    settings = {"spool_stable_seconds": 0.0, "workers": 1}
    return with_stream(make_workspace(tmp_path / "bridge", settings=settings))


@pytest.fixture
def sealed() -> list[tuple[str, datetime]]:
    return []


@pytest.fixture
def keeper(
    bridge: Workspace, clock: Clock, sealed: list[tuple[str, datetime]]
) -> Iterator[StreamKeeper]:
    keeper = StreamKeeper(bridge, clock, sealed.extend)
    yield keeper
    keeper.close()


def make_values(number: int) -> np.ndarray:
    return np.random.default_rng(number).normal(size=(2, 500))


def write_file(bridge: Workspace, dated: datetime, number: int) -> None:
    """Write a rolling file of five seconds, dated in its name."""
    names = ("acc_1", "acc_2")
    channels = tuple(
        Channel(name, "acceleration", row, "transverse", 3.0)
        for name, row in zip(names, make_values(number), strict=True)
    )
    folder = bridge.spool / "streams" / "h3"
    folder.mkdir(parents=True, exist_ok=True)
    write(Recording("", channels, 100.0, 3), folder / f"h3_{dated:%Y%m%d_%H%M%S}.csv")


def list_events(bridge: Workspace, kind: str) -> list[StreamEvent]:
    with bridge.store() as store:
        found = list_stream_events(store, "h3", BEGIN - HOUR)
    return [event for event in found if event.kind == kind]


@pytest.mark.parametrize(
    ("ahead", "delay"),
    [(HOUR, timedelta(0)), (HOUR, timedelta(days=1)), (20 * MINUTE, timedelta(0))],
    ids=["live", "a_day_late", "minutes_ahead"],
)
def test_take_true_files_after_clock_ahead(
    bridge: Workspace, keeper: StreamKeeper, clock: Clock, ahead: timedelta, delay: timedelta
) -> None:
    """A file each ten minutes: three right ones, six dated too late, then right ones again."""
    for number in range(15):
        recorded = BEGIN + number * 10 * MINUTE
        is_off = 3 <= number < 9
        write_file(bridge, recorded + ahead if is_off else recorded, number)
        clock.now = recorded + 5 * MINUTE + delay
        keeper.turn()
    clock.pass_by(3600)
    keeper.turn()
    assert not list(bridge.quarantine.folder.glob("*"))
    pieces = ring_of(bridge).read("h3", BEGIN + 90 * MINUTE, BEGIN + 3 * HOUR)
    for number, piece in enumerate(pieces[:6], 9):
        assert piece.start == BEGIN + number * 10 * MINUTE
        assert np.allclose(piece.values, make_values(number), atol=1e-3)
    assert list_events(bridge, "doubled") == []
    steps = list_events(bridge, "clock step")
    if ahead != HOUR:
        assert {step.detail for step in steps} == {
            "the clock was ahead: samples came before the time they are dated; those that came in "
            "time count"
        }
    else:
        (step,) = steps
        assert step.detail.startswith("the clock was 1 hour ahead (daylight saving?): 6 chunks")
        assert (step.start, step.end) == (
            BEGIN + 90 * MINUTE,
            BEGIN + 140 * MINUTE + timedelta(seconds=5),
        )
        assert len(list_excluded(ring_of(bridge))) == 6
    write_file(bridge, BEGIN + 90 * MINUTE, 3)  # a wrong one comes again: the true one stays
    keeper.turn()
    (again, *_) = ring_of(bridge).read("h3", BEGIN + 90 * MINUTE, BEGIN + 3 * HOUR)
    assert np.array_equal(again.values, pieces[0].values)


@pytest.mark.parametrize("together", [True, False])
def test_take_true_files_after_short_step(
    bridge: Workspace, keeper: StreamKeeper, clock: Clock, together: bool
) -> None:
    """An hour ahead for half an hour: right files follow, and only then the true ones come."""
    clock.now = BEGIN + timedelta(days=1)
    for number in range(18):
        recorded = BEGIN + number * 10 * MINUTE
        write_file(bridge, recorded + HOUR if 6 <= number < 9 else recorded, number)
        if not (together and 12 < number < 15):
            keeper.turn()
        clock.pass_by(60)
    clock.pass_by(600)
    keeper.turn()
    assert not list(bridge.quarantine.folder.glob("*"))
    pieces = ring_of(bridge).read("h3", BEGIN, BEGIN + 3 * HOUR)
    right = [number for number in range(18) if not 6 <= number < 9]
    assert [piece.start for piece in pieces] == [BEGIN + n * 10 * MINUTE for n in right]
    for number, piece in zip(right, pieces, strict=True):
        assert np.allclose(piece.values, make_values(number), atol=1e-3)
    assert list_events(bridge, "doubled") == []
    (step,) = list_events(bridge, "clock step")
    assert step.detail.startswith("the clock was 1 hour ahead (daylight saving?): 3 chunks")
    assert step.start == BEGIN + 2 * HOUR
    assert len(list_excluded(ring_of(bridge))) == 3
    write_file(bridge, BEGIN + 2 * HOUR, 6)  # a wrong one comes again: the true one stays
    keeper.turn()
    (again, *_) = ring_of(bridge).read("h3", BEGIN + 2 * HOUR, BEGIN + 3 * HOUR)
    assert np.allclose(again.values, make_values(12), atol=1e-3)


def test_seal_reports_periods_of_excluded_samples(
    bridge: Workspace,
    keeper: StreamKeeper,
    clock: Clock,
    sealed: list[tuple[str, datetime]],
) -> None:
    """After two hours ahead for two and a half, half an hour is contradicted; all are excluded."""
    clock.now = BEGIN + timedelta(days=1)
    for number in range(3):
        write_file(bridge, BEGIN + number * 10 * MINUTE, number)
    off = [BEGIN + 30 * MINUTE + 2 * HOUR + number * 10 * MINUTE for number in range(15)]
    for number, dated in enumerate(off, 3):
        write_file(bridge, dated, number)
    keeper.turn()
    clock.pass_by(600)
    keeper.turn()
    sealed.clear()
    clock.pass_by(60)
    for number in range(3):
        write_file(bridge, BEGIN + 3 * HOUR + number * 10 * MINUTE, number + 18)
    keeper.turn()
    clock.pass_by(600)
    keeper.turn()
    assert {start for _, start in sealed} == set(off)
    ring = ring_of(bridge)
    assert set(ring.periods("h3", BEGIN)) == {
        *(BEGIN + number * 10 * MINUTE for number in range(3)),
        *(BEGIN + 3 * HOUR + number * 10 * MINUTE for number in range(3)),
    }


# ---------------------------------------------------------------- numbered chunks


@pytest.fixture
def ring(tmp_path: Path, clock: Clock) -> Ring:
    clock.now = BEGIN + timedelta(days=1)
    return Ring(tmp_path / "ring", [STREAM], clock)


def make_minutes(numbers: Sequence[int], off: timedelta = timedelta(0)) -> list[Chunk]:
    return [a_chunk(n, BEGIN + n * MINUTE + off, samples=6000) for n in numbers]


def send(ring: Ring, clock: Clock, chunks: Sequence[Chunk]) -> None:
    for chunk in chunks:
        clock.pass_by(1)
        ring.append(chunk_document(chunk))
    clock.pass_by(60)
    ring.seal(clock())


def join_values(chunks: Sequence[Chunk]) -> np.ndarray:
    return np.concatenate([chunk.values for chunk in chunks], axis=1)


@pytest.mark.parametrize("hours", [1, 2])
@pytest.mark.parametrize("off", [timedelta(0), timedelta(seconds=20)])
def test_seal_excludes_numbered_chunks_ahead(
    ring: Ring, clock: Clock, hours: int, off: timedelta
) -> None:
    """All are sent a day later, so that their arrival does not show it."""
    ahead = range(20, 20 + 60 * hours)
    true = [*make_minutes(range(20)), *make_minutes(range(ahead.stop, ahead.stop + 90), off)]
    wrong = make_minutes(ahead, hours * HOUR)
    events: list[StreamEvent] = []
    ring = Ring(ring.folder, [STREAM], clock, note=events.append)
    send(ring, clock, [*true[:20], *wrong])
    (step,) = [event for event in events if event.kind == "clock step"]
    assert step.detail.endswith(": whole hours (daylight saving?)")
    send(ring, clock, true[20:])
    pieces = ring.read("h3", BEGIN, BEGIN + 12 * HOUR)
    assert np.array_equal(np.concatenate([p.values for p in pieces], axis=1), join_values(true))
    send(ring, clock, wrong[:3])  # they come again, and change nothing
    assert len(ring.read("h3", BEGIN, BEGIN + 12 * HOUR)) == len(pieces)
    received_s = sum(each.received_s for each in ring.received("h3", BEGIN).values())
    assert received_s == pytest.approx(60 * len(true))


@pytest.mark.parametrize("back", [timedelta(seconds=40), timedelta(minutes=10)])
def test_seal_keeps_samples_after_true_pause(ring: Ring, clock: Clock, back: timedelta) -> None:
    """An hour's power cut, and later a clock that is set back by another amount."""
    before, after = make_minutes(range(20)), make_minutes(range(80, 110))
    send(ring, clock, [*before, *after])
    send(ring, clock, make_minutes(range(110, 130), -back))
    pieces = ring.read("h3", BEGIN, BEGIN + 110 * MINUTE)
    found = np.concatenate([piece.values for piece in pieces], axis=1)
    assert np.array_equal(found, join_values([*before, *after]))
    assert not any("ahead" in reason for _, reason in list_excluded(ring))


@pytest.mark.parametrize("hours", [1, 2])
@pytest.mark.parametrize("off", [timedelta(0), timedelta(seconds=20)])
def test_seal_excludes_numbered_chunks_short_step(
    ring: Ring, clock: Clock, hours: int, off: timedelta
) -> None:
    """The clock is ahead for 25 minutes; right samples come up to where it was set back."""
    wrong = make_minutes(range(20, 45), hours * HOUR)
    true = [*make_minutes(range(20)), *make_minutes(range(45, 60 * hours + 90), off)]
    events: list[StreamEvent] = []
    ring = Ring(ring.folder, [STREAM], clock, note=events.append)
    send(ring, clock, [*true[:20], *wrong])
    send(ring, clock, true[20:])
    pieces = ring.read("h3", BEGIN, BEGIN + 12 * HOUR)
    assert np.array_equal(np.concatenate([p.values for p in pieces], axis=1), join_values(true))
    assert len(list_excluded(ring)) == len(wrong)
    assert any("daylight saving?" in each.detail for each in events if each.kind == "clock step")


def test_seal_keeps_live_samples_before_backlog(ring: Ring, clock: Clock) -> None:
    """After an hour without a line, live samples come before those of the hour itself.

    The same times come again with other samples: what came first stays, as no clock was ahead.
    """
    before, late, live = (make_minutes(range(*each)) for each in ((0, 20), (20, 80), (80, 100)))
    send(ring, clock, [*before, *live, *late])
    other = [replace(each, sequence=each.sequence + 500, values=-each.values) for each in live]
    send(ring, clock, other)
    pieces = ring.read("h3", BEGIN, BEGIN + 12 * HOUR)
    found = np.concatenate([piece.values for piece in pieces], axis=1)
    assert np.array_equal(found, join_values([*before, *late, *live]))
    assert not any("ahead" in reason for _, reason in list_excluded(ring))


def test_seal_keeps_samples_sent_again(ring: Ring, clock: Clock) -> None:
    """After an hour's power cut an hour is sent again, in chunks cut otherwise."""
    before, after = make_minutes(range(20)), make_minutes(range(80, 140))
    values = join_values(after)
    again = [
        replace(each, start=each.start + 20 * MINUTE / 60, values=values[:, n : n + 6000])
        for n, each in zip(range(2000, 350_000, 6000), after, strict=False)
    ]
    send(ring, clock, [*before, *after])
    send(ring, clock, [replace(each, sequence=each.sequence + 60) for each in again])
    assert not any("ahead" in reason for _, reason in list_excluded(ring))
    pieces = ring.read("h3", BEGIN, BEGIN + 12 * HOUR)
    found = np.concatenate([piece.values for piece in pieces], axis=1)
    assert np.array_equal(found, join_values([*before, *after]))
