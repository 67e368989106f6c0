"""A logger's clock that was ahead: the true samples count, the wrongly dated ones are excluded."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from shm.store import Workspace
from shm.store.ring import ring_of
from shm.store.ring_chunks import EARLY
from shm.store.streams import list_stream_events
from shm.values import Channel, Recording
from shm.values.stream import StreamEvent
from shm_daemon.streams import StreamKeeper
from tests.helpers.flows import Clock
from tests.helpers.nouns import NOW
from tests.helpers.streams import with_stream
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
def keeper(bridge: Workspace, clock: Clock) -> Iterator[StreamKeeper]:
    keeper = StreamKeeper(bridge, clock)
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


@pytest.mark.parametrize("ahead", [HOUR, 20 * MINUTE])
def test_take_true_files_after_clock_ahead(
    bridge: Workspace, keeper: StreamKeeper, clock: Clock, ahead: timedelta
) -> None:
    """A file each ten minutes: three right ones, six dated too late, then right ones again."""
    for number in range(15):
        recorded = BEGIN + number * 10 * MINUTE
        is_off = 3 <= number < 9
        write_file(bridge, recorded + ahead if is_off else recorded, number)
        clock.now = recorded + 5 * MINUTE
        keeper.turn()
    clock.pass_by(3600)
    keeper.turn()
    assert not list(bridge.quarantine.folder.glob("*"))
    pieces = ring_of(bridge).read("h3", BEGIN + 90 * MINUTE, BEGIN + 3 * HOUR)
    for number, piece in enumerate(pieces[:6], 9):
        assert piece.start == BEGIN + number * 10 * MINUTE
        assert np.allclose(piece.values, make_values(number), atol=1e-3)
    assert list_events(bridge, "doubled") == []
    assert {step.detail for step in list_events(bridge, "clock step")} == {EARLY}
    write_file(bridge, BEGIN + 90 * MINUTE, 3)  # a wrong one comes again: the true one stays
    keeper.turn()
    (again, *_) = ring_of(bridge).read("h3", BEGIN + 90 * MINUTE, BEGIN + 3 * HOUR)
    assert np.array_equal(again.values, pieces[0].values)


def test_keep_first_files_where_arrival_tells_nothing(
    bridge: Workspace, keeper: StreamKeeper, clock: Clock
) -> None:
    """All come a day late: what came first counts, what contradicts it is laid out."""
    clock.now = BEGIN + timedelta(days=1)
    for number in (1, 2):
        write_file(bridge, BEGIN, number)
        keeper.turn()
    (piece,) = ring_of(bridge).read("h3", BEGIN, BEGIN + HOUR)
    assert np.allclose(piece.values, make_values(1), atol=1e-3)
    (reason,) = bridge.quarantine.folder.glob("*.reason.json")
    assert "with other samples, which stay" in reason.read_text()
    assert len(list_events(bridge, "doubled")) == 1
