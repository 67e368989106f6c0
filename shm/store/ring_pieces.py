"""Chunks laid out in time and joined: to pieces without a gap, and these to one recording.

Whatever stamps say to the millisecond. Where two chunks are of one time, the samples of the one
that came first count: what comes later never takes their place, but of one that came before its own
time. Where it contradicts them, its clock is wrong, and none of it is mixed with them, nor fills
gaps between them, unless it is the next chunk and runs on behind them.
"""

from __future__ import annotations

import math
from bisect import bisect_left, insort
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from shm.documents import format_time
from shm.errors import BadInput, NothingThere, UsageError
from shm.read.chunk_document import BY_TIME
from shm.read.ring_segment import ChunkKey, microseconds
from shm.values import NAN, Channel, Recording, outdoor_c
from shm.values.stream import Chunk, Piece, Stream

if TYPE_CHECKING:
    from shm.store.ring import Ring

_JITTER_S = 0.05  # judgement: of a logger's stamps; a radio clock or NTP is within 10 ms
_DRIFT = 1e-3  # judgement: no crystal is further off; a long chunk differs by that from its stamps
_AHEAD_US = 60_000_000  # judgement: of the server's clock, which may be off as well
_OF_A_SAMPLE = 0.501  # derived: up to half a sample, and a stamp's microsecond, is the same sample


@dataclass(frozen=True, eq=False)
class Layout:
    """`parts` are the samples that count, by time, each with the chunk that it is of; `covered` is
    how many samples of a chunk do not count, for those that have any.
    """

    parts: tuple[tuple[ChunkKey, Chunk], ...]
    covered: Mapping[ChunkKey, int]


def slack_s(before: int, sequence: int, sampling_rate_hz: float, length_s: float) -> float:
    """Return the largest offset between stamps of two chunks that follow without a gap, in s.

    Where their numbers follow, no sample is missing between them: then it is a matter of stamps.
    Numbers that were made of the time cannot tell; there as much as jitter may be missing unseen.
    """
    sample_s = 1 / sampling_rate_hz
    if sequence == before + 1 or min(before, sequence) >= BY_TIME:
        return max(_JITTER_S, 1.5 * sample_s) + _DRIFT * length_s
    return _OF_A_SAMPLE * sample_s


def lay_out(found: Mapping[ChunkKey, Chunk]) -> Layout:
    """Chunks of one stream, each without what came before it.

    Whether a chunk counts depends on those of its time, and these on those of theirs: take some
    more than you look at.
    """
    parts: list[tuple[ChunkKey, Chunk]] = []
    covered: dict[ChunkKey, int] = {}
    earlier: list[tuple[datetime, int, Chunk]] = []
    longest = timedelta(0)
    for key, chunk in sorted(found.items(), key=_rank):
        low = bisect_left(earlier, (chunk.start - longest,))
        high = bisect_left(earlier, (chunk.end,))
        free = _free(chunk, [before for _, _, before in earlier[low:high]])
        if not free.all():
            covered[key] = int((~free).sum())
        for part in _parts(chunk, free):
            parts.append((key, part))
            insort(earlier, (part.start, len(parts), part))
        longest = max(longest, chunk.end - chunk.start)
    by_time = sorted(parts, key=lambda part: (part[1].start, part[1].sequence))
    return Layout(tuple(by_time), covered)


def joined(found: Mapping[ChunkKey, Chunk], start: datetime, end: datetime) -> tuple[Piece, ...]:
    """The samples from `start` on and before `end` that count, of chunks of one stream."""
    runs: list[list[Chunk]] = []
    for _, chunk in lay_out(found).parts:
        last = runs[-1][-1] if runs else None
        if last is not None and _is_alike(last, chunk):
            numbers = last.sequence, chunk.sequence
            slack = slack_s(*numbers, chunk.sampling_rate_hz, _seconds(last))
            if (chunk.start - last.end).total_seconds() <= slack:
                runs[-1].append(chunk)
                continue
        runs.append([chunk])
    pieces = (_cut(_piece(run), start, end) for run in runs)
    return tuple(piece for piece in pieces if piece.values.shape[1])


def agree(one: Chunk, other: Chunk) -> bool:
    """Return True if two chunks have the same samples, as far as both have any."""
    samples = min(one.values.shape[1], other.values.shape[1])
    first, second = one.values[:, :samples], other.values[:, :samples]
    return _is_alike(one, other) and np.array_equal(first, second, equal_nan=True)


def contradicts(before: Chunk, chunk: Chunk) -> bool:
    """Return True if two chunks have half of the shorter one's time in common, but not its samples.

    Less in common is a correction of the clock by seconds.
    """
    common = min(before.end, chunk.end) - max(before.start, chunk.start)
    if 2 * common < min(before.end - before.start, chunk.end - chunk.start):
        return False
    taken = _taken(before, chunk)
    return bool(taken.stop) and not _repeats(before, chunk, taken)


def came_early(key: ChunkKey, chunk: Chunk) -> bool:
    """Return True if a chunk came before it ends by its stamps: its clock was ahead."""
    return microseconds(chunk.end) - key.arrived_us > _AHEAD_US


def _rank(item: tuple[ChunkKey, Chunk]) -> tuple[bool, int, int, int, str]:
    """By when they came; what came at once, by number. Those last that came before they were: their
    clock was ahead, and the time is that of others."""
    key, chunk = item
    return came_early(key, chunk), key.arrived_us, key.sequence, key.start_us, key.checksum


def _free(chunk: Chunk, earlier: Sequence[Chunk]) -> NDArray[np.bool_]:
    """Return a mask of the samples of a chunk whose time is free.

    None is free where the chunk contradicts what counts already.
    """
    free = np.ones(chunk.values.shape[1], bool)
    for before in earlier:
        taken = _taken(before, chunk)
        free[taken] = False
        if taken.stop and not (_runs_on(before, chunk) or _repeats(before, chunk, taken)):
            return np.zeros(len(free), bool)
    return free


def _runs_on(before: Chunk, chunk: Chunk) -> bool:
    """Return True if it is the next one, of a clock that was set back a little.

    Files are not counted.
    """
    numbers = before.sequence, chunk.sequence
    is_next = numbers[1] == numbers[0] + 1 or min(numbers) >= BY_TIME
    return is_next and before.start <= chunk.start


def _repeats(before: Chunk, chunk: Chunk, taken: slice) -> bool:
    """Return True if what is there twice is the same.

    So it is of a logger that sends again in other chunks.
    """
    first = round((chunk.start - before.start).total_seconds() * chunk.sampling_rate_hz)
    there = before.values[:, first + taken.start : first + taken.stop]
    return _is_alike(before, chunk) and np.array_equal(
        there, chunk.values[:, taken], equal_nan=True
    )


def _taken(before: Chunk, chunk: Chunk) -> slice:
    """Return which samples of a chunk are of the time of one that came before it."""
    rate = chunk.sampling_rate_hz
    begin, end = max(before.start, chunk.start), min(before.end, chunk.end)
    common_s = (end - begin).total_seconds()
    first, second = (before, chunk) if before.start <= chunk.start else (chunk, before)
    slack = slack_s(first.sequence, second.sequence, rate, _seconds(first))
    is_jitter = common_s <= slack and not _ends_as_begins(first, second, round(common_s * rate))
    if common_s <= 0 or is_jitter:
        return slice(0)
    return slice(*(round((time - chunk.start).total_seconds() * rate) for time in (begin, end)))


def _ends_as_begins(first: Chunk, second: Chunk, samples: int) -> bool:
    """Return True if so many samples at a seam are there twice, to the bit."""
    if samples < 1 or not _is_alike(first, second):
        return False
    tail, head = first.values[:, -samples:], second.values[:, :samples]
    is_telling = len(np.unique(tail)) > tail.size / 2
    return is_telling and np.array_equal(tail, head, equal_nan=True)


def _parts(chunk: Chunk, free: NDArray[np.bool_]) -> list[Chunk]:
    """The stretches of a chunk that are free, the whole of it where all is."""
    if free.all():
        return [chunk]
    edges = np.flatnonzero(np.diff(free, prepend=False, append=False))
    return [_part(chunk, *pair) for pair in edges.reshape(-1, 2).tolist()]


def _part(chunk: Chunk, first: int, last: int) -> Chunk:
    later = chunk.start + timedelta(seconds=first / chunk.sampling_rate_hz)
    return replace(chunk, start=later, values=chunk.values[:, first:last])


def _seconds(chunk: Chunk) -> float:
    return (chunk.end - chunk.start).total_seconds()


def _is_alike(one: Chunk, other: Chunk) -> bool:
    rates = one.sampling_rate_hz, other.sampling_rate_hz
    return one.channels == other.channels and rates[0] == rates[1]


def _piece(run: list[Chunk]) -> Piece:
    first = run[0]
    values = np.concatenate([chunk.values for chunk in run], axis=1, dtype=float)
    weather = (_middle_c(run), _mean(run, "wind_m_s"))
    rate, start = first.sampling_rate_hz, first.start
    return Piece(first.stream, start, rate, first.channels, values, *weather)


def _middle_c(run: list[Chunk]) -> float:
    """Return the median: a mean would make a likely temperature of 10 °C and a broken -127."""
    known = sorted(c.temperature_c for c in run if not math.isnan(c.temperature_c))
    return known[len(known) // 2] if known else NAN


def _mean(run: list[Chunk], name: str) -> float:
    """Over the chunks that say it, each by its length."""
    told = [(getattr(chunk, name), chunk.values.shape[1]) for chunk in run]
    known = [(value, weight) for value, weight in told if not math.isnan(value)]
    weights = sum(weight for _, weight in known)
    return sum(value * weight for value, weight in known) / weights if weights else NAN


def _cut(piece: Piece, start: datetime, end: datetime) -> Piece:
    rate, samples = piece.sampling_rate_hz, piece.values.shape[1]
    first, last = (_place((time - piece.start).total_seconds() * rate) for time in (start, end))
    first, last = max(first, 0), max(min(last, samples), 0)
    later = piece.start + timedelta(seconds=first / rate)
    return replace(piece, start=later, values=piece.values[:, first:last])


def _place(samples: float) -> int:
    """Of the first sample from a time on; a microsecond of rounding is no sample."""
    return math.ceil(samples - 1e-3)


def recording_of(
    ring: Ring, stream: Stream, start: datetime, end: datetime, most_samples: int
) -> Recording:
    """The samples of a stream within a time; raises NothingThere, UsageError or BadInput."""
    if (end - start).total_seconds() * stream.sampling_rate_hz > most_samples:
        longest = timedelta(seconds=most_samples // stream.sampling_rate_hz)
        raise UsageError(
            f"that is more than the {most_samples} samples of a recording.",
            remedy=f"Take {longest} at most, or raise the setting max_samples.",
        )
    pieces = ring.read(stream.name, start, end)
    if not pieces:
        raise NothingThere(
            f"the ring has no sample of stream {stream.name} from {format_time(start)} to "
            f"{format_time(end)}.",
            remedy="See `shm stream` for what there is.",
        )
    layouts = {(piece.sampling_rate_hz, piece.channels) for piece in pieces}
    if len(layouts) > 1:
        first = pieces[0].sampling_rate_hz, pieces[0].channels
        other = next(each for each in pieces if (each.sampling_rate_hz, each.channels) != first)
        raise BadInput(
            f"stream {stream.name} was sampled in {len(layouts)} ways in that time: at "
            f"{first[0]:.10g} Hz, from {format_time(other.start)} on at "
            f"{other.sampling_rate_hz:.10g} Hz with the channels {', '.join(other.channels)}.",
            remedy="Export each of both times alone.",
        )
    return _joined(pieces, stream)


def _joined(pieces: Sequence[Piece], stream: Stream) -> Recording:
    first, rate = pieces[0], pieces[0].sampling_rate_hz
    begins = [round((piece.start - first.start).total_seconds() * rate) for piece in pieces]
    samples = max(b + p.values.shape[1] for b, p in zip(begins, pieces, strict=True))
    values = np.full((len(first.channels), samples), NAN)
    for begin, piece in zip(begins, pieces, strict=True):
        values[:, begin : begin + piece.values.shape[1]] = piece.values
    described = {channel.name: channel for channel in stream.channels}
    channels = []
    for name, row in zip(first.channels, values, strict=True):
        known = described.get(name)
        place = (known.plane, known.x_m, known.full_scale) if known else ()
        channels.append(Channel(name, "acceleration", row, *place))
    temperatures = [p.temperature_c for p in pieces if not math.isnan(outdoor_c(p.temperature_c))]
    mean_c = float(np.mean(temperatures)) if temperatures else NAN
    return Recording(stream.name, tuple(channels), rate, stream.hanger, first.start, mean_c)
