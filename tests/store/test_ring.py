"""The raw ring: what was acknowledged is there, once, in its place, whatever came in between."""

from __future__ import annotations

import random
import sqlite3
from collections.abc import Sequence
from dataclasses import replace
from datetime import datetime, timedelta
from itertools import pairwise
from pathlib import Path

import h5py
import numpy as np
import pytest

from shm.errors import BadInput, DoubledChunk, StoreError
from shm.read import read
from shm.read.chunk_document import chunk_document
from shm.store.ring import Ring
from shm.store.ring_days import close_days, writing
from shm.values import Recording
from shm.values.stream import Chunk, Stream, StreamChannel, StreamEvent, microseconds
from tests.helpers.nouns import NOW
from tests.helpers.stream_killing import assert_none_lost_none_doubled, killed_again_and_again
from tests.helpers.streams import STREAM, a_chunk, list_excluded

HOUR, MINUTE = timedelta(hours=1), timedelta(minutes=1)
FOR_EVER = timedelta(days=3650)


class Logger:
    """A ring, its clock, and what was noticed."""

    def __init__(self, folder: Path):
        self.now = NOW
        self.events: list[StreamEvent] = []
        self.ring = Ring(folder, [STREAM], lambda: self.now, note=self.events.append)

    def send(self, *chunks: Chunk, seals: bool = True) -> None:
        """As they are recorded, or at once where the clock is ahead of them."""
        for chunk in chunks:
            self.now = max(self.now, chunk.end)
            self.ring.append(chunk_document(chunk))
        if seals:
            self.seal()

    def seal(self) -> list[tuple[str, datetime]]:
        return self.ring.seal(self.now + timedelta(minutes=11))

    @property
    def received(self) -> tuple[float, float]:
        """Return how many seconds of samples count and do not."""
        found = self.ring.received("h3", NOW - HOUR).values()
        return sum(each.received_s for each in found), sum(each.apart_s for each in found)

    @property
    def kinds(self) -> list[str]:
        return [event.kind for event in self.events]


@pytest.fixture
def logger(tmp_path: Path) -> Logger:
    return Logger(tmp_path / "ring")


def minutes(*numbers: int) -> list[Chunk]:
    """Chunks of a minute each."""
    return [a_chunk(number, samples=6000) for number in numbers]


def samples(chunks: Sequence[Chunk]) -> np.ndarray:
    return np.concatenate([chunk.values for chunk in chunks], axis=1)


def test_chunks_are_joined_whether_they_are_sealed_or_not(logger: Logger) -> None:
    chunks = minutes(*range(25))
    logger.send(*chunks, seals=False)
    before = logger.ring.read("h3", NOW, NOW + HOUR)
    assert logger.ring.seal(NOW + timedelta(minutes=25)) == [
        ("h3", NOW), ("h3", NOW + timedelta(minutes=10))
    ]  # fmt: skip
    assert logger.ring.unsealed_periods("h3") == {NOW + timedelta(minutes=20)}
    for (piece,) in (before, logger.ring.read("h3", NOW, NOW + HOUR)):
        assert np.array_equal(piece.values, samples(chunks))
        assert (piece.start, piece.channels) == (NOW, ("acc_1", "acc_2"))
        assert piece.temperature_c == pytest.approx(11.5)
        assert np.isnan(piece.wind_m_s)
    assert logger.ring.latest() == {"h3": NOW + timedelta(minutes=25)}
    assert logger.ring.periods("h3", NOW + timedelta(minutes=5)) == (NOW + timedelta(minutes=10),)
    assert logger.events == []


def test_a_chunk_that_comes_again_is_kept_once(logger: Logger) -> None:
    (chunk,) = minutes(0)
    content = chunk_document(chunk)
    assert [logger.ring.append(content).is_new for _ in range(2)] == [True, False]
    logger.now += timedelta(minutes=1)
    logger.seal()
    assert not logger.ring.append(content).is_new
    assert not Ring(logger.ring.folder).append(content).is_new
    (piece,) = logger.ring.read("h3", NOW, NOW + HOUR)
    assert piece.values.shape == (2, 6000)


@pytest.mark.parametrize("is_sealed", [False, True])
def test_another_chunk_of_the_same_number_and_time_is_refused(
    logger: Logger, is_sealed: bool
) -> None:
    first, second = a_chunk(0), replace(a_chunk(0), values=a_chunk(1).values)
    logger.send(first, seals=is_sealed)
    with pytest.raises(DoubledChunk, match="with other samples, which stay"):
        logger.send(second)
    said_otherwise = replace(first, temperature_c=12.0)
    assert not logger.ring.append(chunk_document(said_otherwise)).is_new
    (piece,) = logger.ring.read("h3", NOW, NOW + HOUR)
    assert np.array_equal(piece.values, first.values)


def test_a_file_that_has_grown_adds_what_is_new(logger: Logger) -> None:
    whole = a_chunk(0)
    logger.send(replace(whole, values=whole.values[:, :200]), whole)
    (piece,) = logger.ring.read("h3", NOW, NOW + HOUR)
    assert np.array_equal(piece.values, whole.values)
    assert logger.received == (5.0, 0.0)


@pytest.mark.parametrize("is_sealed", [False, True])
def test_a_clock_that_is_set_back_replaces_no_sample_and_fills_no_gap(
    logger: Logger, is_sealed: bool
) -> None:
    """After 20 minutes it falls back by 13 minutes and 3 s, and runs on for 15; the tenth minute
    was not sent yet.
    """
    good, back = minutes(*range(10), *range(11, 20)), timedelta(minutes=13, seconds=3)
    stepped = [replace(each, start=each.start - back) for each in minutes(*range(20, 35))]
    logger.send(*good, seals=is_sealed)
    logger.now += timedelta(seconds=1)
    for each in stepped:
        logger.now += timedelta(minutes=1)
        logger.ring.append(chunk_document(each))
    expected = [good[:10], good[10:], stepped[-1:]]  # the last begins behind all that was there
    for _ in range(2):
        pieces = logger.ring.read("h3", NOW, NOW + HOUR)
        assert len(pieces) == 3
        for piece, chunks in zip(pieces, expected, strict=True):
            assert np.array_equal(piece.values, samples(chunks))
        logger.seal()
    assert "overlap" in logger.kinds
    assert logger.received == (20 * 60, 14 * 60)
    assert len(list_excluded(logger.ring)) == 14  # those that do not count lie there too
    logger.send(*minutes(10))
    (piece, _) = logger.ring.read("h3", NOW, NOW + HOUR)
    assert np.array_equal(piece.values, samples(minutes(*range(20))))


@pytest.mark.parametrize("is_sealed", [True, False])
def test_a_clock_that_was_set_ahead_takes_no_time_from_the_true_samples(
    logger: Logger, is_sealed: bool
) -> None:
    """After 10 minutes it is 5 minutes and 3 s ahead for ten, then right again."""
    ahead, true = timedelta(minutes=5, seconds=3), minutes(*range(30))
    for number, each in enumerate(true):
        logger.now = each.end
        is_off = 10 <= number < 20
        sent = replace(each, start=each.start + ahead) if is_off else each
        logger.ring.append(chunk_document(sent))
        if is_sealed:
            logger.ring.seal(logger.now)
    logger.seal()
    logger.now += HOUR
    logger.seal()
    pieces = logger.ring.read("h3", NOW, NOW + HOUR)
    assert "clock step" in logger.kinds
    assert np.array_equal(pieces[0].values, samples(true[:10]))
    assert np.array_equal(pieces[-1].values, samples(true[20:]))


@pytest.mark.parametrize("is_same", [True, False])
def test_a_late_chunk_that_overlaps_fills_the_gap_where_it_contradicts_nothing(
    logger: Logger, is_same: bool
) -> None:
    before, within, after = minutes(0, 1, 2)
    ends = [before.values[:, -1000:], after.values[:, :1000]]
    values = np.concatenate([ends[not is_same], within.values, ends[is_same]], axis=1)
    start = within.start - timedelta(seconds=10)
    logger.send(before, after)
    logger.send(replace(within, sequence=77, start=start, values=values))
    assert logger.kinds == ["gap", "overlap"]
    assert f"{2000 if is_same else 8000} samples of chunk 77" in logger.events[1].detail
    found = np.concatenate([p.values for p in logger.ring.read("h3", NOW, NOW + HOUR)], axis=1)
    count = [before, within, after] if is_same else [before, after]
    assert np.array_equal(found, samples(count))
    assert logger.received[0] == 60.0 * len(count)


def test_values_beyond_what_the_sensor_measures_are_refused(logger: Logger) -> None:
    chunk = a_chunk(0)
    chunk.values[:, 3] = 39.0  # acc_2 clips at 20: a converter may go on for a while
    logger.send(chunk)
    chunk = a_chunk(1)
    chunk.values[:, 3] = -41.0
    with pytest.raises(BadInput, match="sample 3 is 41 m/s2 where full_scale is 20") as caught:
        logger.send(chunk)
    assert caught.value.channel == "acc_2"


def test_a_gap_is_noted_and_filled_by_what_comes_late(logger: Logger) -> None:
    logger.send(*minutes(0, 1, *range(5, 30)))
    assert logger.kinds == ["gap"]
    gap = logger.events[0]
    assert (gap.start, gap.end) == (NOW + timedelta(minutes=2), NOW + timedelta(minutes=5))
    assert "18000 samples" in gap.detail
    assert len(logger.ring.read("h3", NOW, NOW + HOUR)) == 2
    for chunk in minutes(2, 3, 4):
        logger.ring.append(chunk_document(chunk))
    assert logger.seal() == [("h3", NOW)]
    assert logger.kinds == ["gap", "late"]
    assert logger.events[1].start == gap.start
    (piece,) = logger.ring.read("h3", NOW, NOW + HOUR)
    assert np.array_equal(piece.values, samples(minutes(*range(30))))


def test_an_hour_that_comes_days_late_is_kept_counted_and_read(logger: Logger) -> None:
    """A logger kept it while it was offline; its windows were sealed and left long ago."""
    before, offline, after = minutes(0, 1), minutes(*range(2, 62)), minutes(*range(62, 75))
    logger.send(*before, *after)
    logger.now += timedelta(days=3)
    assert all(logger.ring.append(chunk_document(each)).is_new for each in offline)
    assert [start for _, start in logger.seal()] == [
        NOW + n * timedelta(minutes=10) for n in range(7)
    ]
    late = [event for event in logger.events if event.kind == "late"]
    assert sum(int(event.detail.split()[0]) for event in late) == 60
    assert "72.2 hours late" in late[-1].detail
    (piece,) = logger.ring.read("h3", NOW, NOW + 2 * HOUR)
    assert np.array_equal(piece.values, samples([*before, *offline, *after]))
    with pytest.raises(BadInput, match="late_hours"):
        logger.ring.append(chunk_document(a_chunk(99, NOW - timedelta(days=2))))


def test_the_next_chunk_of_a_clock_that_was_set_back_runs_on_behind(logger: Logger) -> None:
    first, second = minutes(0, 1)
    shifted = replace(second, start=second.start - timedelta(seconds=10))
    logger.send(first, shifted)
    assert logger.kinds == ["clock step", "overlap"]
    (piece,) = logger.ring.read("h3", NOW, NOW + HOUR)
    assert np.array_equal(piece.values[:, :6000], first.values)
    assert np.array_equal(piece.values[:, 6000:], shifted.values[:, 1000:])


def test_a_clock_that_jumps_is_noted_and_jitter_is_not(logger: Logger) -> None:
    shifts_s = (0.0, 0.02, -0.02, 7.0, 7.02)
    chunks = [
        replace(chunk, start=chunk.start + timedelta(seconds=shift))
        for chunk, shift in zip(minutes(*range(5)), shifts_s, strict=True)
    ]
    logger.send(*chunks)
    assert logger.kinds == ["clock step"]
    assert "+7.020 s before chunk 3" in logger.events[0].detail
    lengths = [piece.values.shape[1] for piece in logger.ring.read("h3", NOW, NOW + HOUR)]
    assert lengths == [18_000, 12_000]


def test_damaged_days_and_samples_are_set_aside_and_others_go_on(logger: Logger) -> None:
    days = [NOW + timedelta(days=n) for n in range(3)]
    logger.send(*(a_chunk(n, day, samples=6000) for n, day in enumerate(days)))
    first, second, _ = sorted(logger.ring.folder.glob("h3/*.db"))
    with sqlite3.connect(second) as connection:
        connection.execute("UPDATE contents SET samples = substr(samples, 1, 9000)")
    connection.close()
    close_days()
    content = bytearray(first.read_bytes())
    content[:100] = bytes(100)
    first.write_bytes(content)
    pieces = logger.ring.read("h3", NOW, NOW + timedelta(days=4))
    assert [piece.start for piece in pieces] == days[2:]
    assert "is not a database" in (first.parent / "aside" / f"{first.name}.reason.json").read_text()
    ((at, reason),) = list_excluded(logger.ring)
    assert at == days[1]
    assert "damaged" in reason
    logger.ring.append(chunk_document(a_chunk(1, days[1], samples=6000)))
    assert len(logger.ring.read("h3", NOW, NOW + timedelta(days=4))) == 2


def test_kills_lose_and_double_nothing(tmp_path: Path) -> None:
    acknowledged = killed_again_and_again(tmp_path / "ring", 3, random.Random(3))
    assert acknowledged > 3
    assert_none_lost_none_doubled(tmp_path / "ring", acknowledged)


def test_a_full_disk_acknowledges_nothing(logger: Logger) -> None:
    (first, second) = minutes(0, 1)
    logger.send(first, seals=False)
    (day,) = logger.ring.folder.glob("h3/*.db")
    with writing([day]) as (connection,):
        connection.execute("PRAGMA max_page_count = 1")  # it stays as large as it is
    with pytest.raises(StoreError, match="disk is full") as caught:
        logger.ring.append_all([chunk_document(each) for each in minutes(*range(1, 9))])
    assert caught.value.retry_after_s == 60.0
    close_days()
    (piece,) = logger.ring.read("h3", NOW, NOW + HOUR)
    assert piece.values.shape == (2, 6000)
    logger.send(second)
    (piece,) = logger.ring.read("h3", NOW, NOW + HOUR)
    assert piece.values.shape == (2, 12_000)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"stream": replace(STREAM, name="h9")}, "is not described"),
        ({"channels": ("acc_1", "acc_9")}, r"not the channels of bridge.toml: acc_2, acc_9"),
        ({"sampling_rate_hz": 128.0}, "128 Hz where bridge.toml says 100"),
        ({"start": NOW - timedelta(hours=97)}, "the 96 hours of late_hours"),
        ({"start": NOW + timedelta(hours=25)}, "is to come"),
    ],
)
def test_what_does_not_fit_is_refused(
    logger: Logger, changes: dict[str, object], said: str
) -> None:
    with pytest.raises(BadInput, match=said):
        logger.ring.append(chunk_document(a_chunk(0, **changes)))  # type: ignore[arg-type]
    assert not logger.ring.folder.exists()


@pytest.fixture
def days(logger: Logger) -> Logger:
    """Ten minutes of each of four days."""
    for day in range(4):
        start = NOW + timedelta(days=day)
        logger.send(*(a_chunk(n, start + n * MINUTE, samples=6000) for n in range(10)))
    return logger


def left_days(logger: Logger) -> list[int]:
    return sorted({(start - NOW).days for start in logger.ring.periods("h3", NOW)})


def test_old_samples_go_but_for_those_that_are_kept(days: Logger) -> None:
    days.ring.keep("h3", NOW + 2 * MINUTE, NOW + 3 * MINUTE, "a train")
    assert days.ring.sweep(NOW + timedelta(days=32), 30) == 2
    assert left_days(days) == [0, 2, 3]
    (piece,) = days.ring.read("h3", NOW, NOW + HOUR)
    assert (piece.start, piece.values.shape[1]) == (NOW + 2 * MINUTE, 6000)
    assert days.ring.sweep(NOW + timedelta(days=32), 30) == 0
    days.ring.sweep(NOW + FOR_EVER, 30)
    assert left_days(days) == [0]


def test_sweep_removes_oldest_beyond_limit(days: Logger) -> None:
    most = days.ring.size_bytes("h3") // 2
    unread = {"h3": [NOW + timedelta(days=1)]}
    assert days.ring.sweep(NOW + timedelta(days=9), 30, most, unread) == 0
    assert days.ring.sweep(NOW + timedelta(days=9), 30, most) == 2
    assert left_days(days) == [2, 3]
    assert days.ring.size_bytes("h3") <= most
    days.ring.sweep(NOW + FOR_EVER, 30)
    assert not list(days.ring.folder.glob("h3/2*"))


def test_a_real_recording_in_chunks_is_the_same_recording(
    shared_data: Path, tmp_path: Path
) -> None:
    whole = read(shared_data / "pyuff_uff58" / "MPSTD_Set001_2024_10_08_10_27_07.uff")
    assert isinstance(whole, Recording)
    assert whole.time is not None
    rate, names = whole.sampling_rate_hz, tuple(c.name for c in whole.accelerations)
    stream = Stream("real", 3, rate, tuple(StreamChannel(n, "transverse", 1.0) for n in names))
    values = np.array([c.values for c in whole.accelerations])
    ring, rng = Ring(tmp_path / "ring", [stream]), random.Random(1)
    edges = [0, *sorted(rng.sample(range(1, values.shape[1]), 30)), values.shape[1]]
    contents = []
    for number, (begin, end) in enumerate(pairwise(edges)):
        start = whole.time + timedelta(seconds=begin / rate)
        part = values[:, begin:end].astype(np.float32)
        contents.append(chunk_document(Chunk("real", number, start, rate, names, part)))
    rng.shuffle(contents)
    ring.append_all(contents)
    ring.seal(whole.time + FOR_EVER)
    (piece,) = ring.read("real", whole.time, whole.time + HOUR)
    assert np.array_equal(piece.values, values.astype(np.float32))


def write_former_segment(
    folder: Path, chunks: Sequence[Chunk], arrived: Sequence[datetime]
) -> None:
    """Write ten minutes as 1.0.0 did."""
    numbers = ("start_us", "end_us", "sequence", "first", "samples", "arrived_us")
    kinds = [(name, "<i8") for name in numbers]
    kinds += [("checksum", "S16"), ("temperature_c", "<f8"), ("wind_m_s", "<f8")]
    first, rows = 0, []
    for chunk, at in zip(chunks, arrived, strict=True):
        edges, count = (microseconds(chunk.start), microseconds(chunk.end)), chunk.values.shape[1]
        rows.append((*edges, chunk.sequence, first, count, microseconds(at), b"", 11.5, np.nan))
        first += count
    path = folder / f"{NOW:%Y%m%d}" / f"{NOW:%Y%m%dT%H%MZ}-512c8786.h5"
    path.parent.mkdir(parents=True)
    with h5py.File(path, "w") as file:
        file.attrs.update({"stream": "h3", "sampling_rate_hz": 100.0})
        file.attrs["channels"] = list(chunks[0].channels)
        for name, values in zip(chunks[0].channels, samples(chunks), strict=True):
            file[name] = values
        file["_chunks"] = np.array(rows, kinds)


def test_the_ring_of_1_0_0_is_converted(logger: Logger) -> None:
    chunks, other = minutes(*range(9)), replace(a_chunk(99, samples=6000), start=NOW + HOUR / 40)
    folder = logger.ring.folder / "h3"
    write_former_segment(folder, [*chunks, other], [NOW, *[NOW + MINUTE] * 8, NOW + HOUR])
    (folder / "incoming").mkdir()
    for chunk, name in zip(minutes(9, 10), ("1-2-9-a.chunk", "1-2-10-b.chunk"), strict=True):
        (folder / "incoming" / name).write_bytes(chunk_document(chunk))
    (folder / "incoming" / "1-2-11-c.chunk").write_bytes(b"torn")
    (folder / "state.json").write_text("{}")
    assert [start for _, start in logger.seal()] == [NOW]
    close_days()
    assert sorted(path.name for path in folder.glob("*")) == ["20260501.db", "aside"]
    (piece,) = logger.ring.read("h3", NOW, NOW + HOUR)
    assert np.array_equal(piece.values, samples(minutes(*range(11))))
    assert logger.received == (60.0 * 10, 60.0)
    assert logger.ring.unsealed_periods("h3") == {NOW + 10 * MINUTE}
    assert (folder / "aside" / "1-2-11-c.chunk.reason.json").exists()
