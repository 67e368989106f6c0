"""Which files of the spool are whole, told by looks and a clock that the test moves."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from shm_daemon.spool import FileStabilityTracker, Look, scan

A, B = Path("a.csv"), Path("b.csv")


class Seconds:
    """A clock that only goes on when told to."""

    now = 100.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock() -> Seconds:
    return Seconds()


@pytest.fixture
def tracker(clock: Seconds) -> FileStabilityTracker:
    return FileStabilityTracker(2.0, clock)


def test_a_file_is_whole_once_unchanged_for_long_enough(
    tracker: FileStabilityTracker, clock: Seconds
) -> None:
    looks = {A: Look(1, 10)}
    assert tracker.whole(looks) == []
    clock.now += 1.9
    assert tracker.whole(looks) == []
    clock.now += 0.1
    assert tracker.whole(looks) == [A]


@pytest.mark.parametrize(
    "change", [Look(2, 10), Look(1, 11), Look(1, 10, 1, 5)], ids=["date", "size", "sidecar"]
)
def test_a_change_of_the_file_or_its_sidecar_starts_the_wait_anew(
    tracker: FileStabilityTracker, clock: Seconds, change: Look
) -> None:
    tracker.whole({A: Look(1, 10)})
    clock.now += 1.9
    assert tracker.whole({A: change}) == []
    clock.now += 1.9
    assert tracker.whole({A: change}) == []
    clock.now += 0.1
    assert tracker.whole({A: change}) == [A]


def test_an_empty_file_is_given_ten_times_as_long(
    tracker: FileStabilityTracker, clock: Seconds
) -> None:
    looks = {A: Look(1, 0)}
    tracker.whole(looks)
    clock.now += 19.9
    assert tracker.whole(looks) == []
    clock.now += 0.2
    assert tracker.whole(looks) == [A]


def test_what_is_no_file_to_be_read_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "logger" / "deep").mkdir(parents=True)
    (tmp_path / ".cache").mkdir()
    for name in (
        "h3.csv",
        "h3.toml",
        "logger/deep/h4.CSV",
        ".hidden.csv",
        ".cache/h5.csv",
        "h6.csv.part",
        "h7.TMP",
        "h8.csv.filepart",
        "only.toml",
    ):
        (tmp_path / name).write_text("x")
    (tmp_path / "link.csv").symlink_to(tmp_path / "h3.csv")
    os.mkfifo(tmp_path / "pipe.csv")
    found = scan(tmp_path)
    assert sorted(path.relative_to(tmp_path).as_posix() for path in found) == [
        "h3.csv",
        "logger/deep/h4.CSV",
    ]
    assert found[tmp_path / "h3.csv"].sidecar_size_bytes == 1
    assert found[tmp_path / "logger/deep/h4.CSV"].sidecar_size_bytes == 0
