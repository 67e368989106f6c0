"""Where a hanger was hit, by the header of the test's archived file."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from shm.errors import NothingThere
from shm.pipeline.reporting import _hit_places
from shm.read import write
from shm.settings import Settings
from shm.values import Channel, Recording, ResponsePoint


def places(path: Path | None) -> tuple[ResponsePoint, ...]:
    @contextmanager
    def opened(_: object) -> Iterator[Path]:
        if path is None:
            raise NothingThere("the file was dropped.")
        yield path

    workspace: Any = SimpleNamespace(archive=SimpleNamespace(opened=opened), settings=Settings())
    recording = SimpleNamespace(file=None)
    store: Any = SimpleNamespace(recordings=SimpleNamespace(get=lambda _: recording))
    test: Any = SimpleNamespace(recording_id=1, test=SimpleNamespace(id="t1"))
    return _hit_places(workspace, store, test)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    values = [0.0, 1.0, 0.0, 2.0]
    channels = (
        Channel("force", "force", values, "transverse", 1.9),  # type: ignore[arg-type]
        Channel("acc_1", "acceleration", values, "transverse", 2.5),  # type: ignore[arg-type]
    )
    file = tmp_path / "t1.csv"
    write(Recording("t1.csv", channels, 256.0, 3), file)
    return file


def test_the_force_channel_says_where(path: Path) -> None:
    assert places(path) == (ResponsePoint("hit", "transverse", 1.9),)


def test_a_file_that_was_dropped_leaves_it_unknown() -> None:
    assert places(None) == ()
