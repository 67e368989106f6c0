"""Chunks joined to pieces without a gap, whatever their stamps say to the millisecond."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from datetime import datetime, timedelta

import numpy as np

from shm.read.chunk_document import BY_TIME
from shm.values import NAN
from shm.values.stream import Chunk, Piece

_JITTER_S = 0.05  # judgement: of a logger's stamps; a radio clock or NTP is within 10 ms
_DRIFT = 1e-3  # judgement: no crystal is further off; a long chunk differs by that from its stamps
_OF_A_SAMPLE = 0.5  # derived: less than half a sample is the same sample


def slack_s(before: int, sequence: int, sampling_rate_hz: float, length_s: float) -> float:
    """How far a chunk may begin from where the one before, so long, ended and follow without a gap.

    Where their numbers follow, no sample is missing between them: then it is a matter of stamps.
    Numbers that were made of the time cannot tell; there as much as jitter may be missing unseen.
    """
    sample_s = 1 / sampling_rate_hz
    if sequence == before + 1 or min(before, sequence) >= BY_TIME:
        return max(_JITTER_S, 1.5 * sample_s) + _DRIFT * length_s
    return _OF_A_SAMPLE * sample_s


def joined(chunks: Iterable[Chunk], start: datetime, end: datetime) -> tuple[Piece, ...]:
    """The samples from `start` on and before `end`, of chunks of one stream that are in order.

    What is there twice is taken from the chunk that began first.
    """
    runs: list[list[Chunk]] = []
    until: datetime | None = None
    for chunk in chunks:
        last = runs[-1][-1] if runs else None
        rest = chunk
        if last is not None and until is not None:
            off_s = (chunk.start - until).total_seconds()
            numbers = last.sequence, chunk.sequence
            slack = slack_s(*numbers, chunk.sampling_rate_hz, _seconds(last))
            if off_s < -slack:
                rest = _without(chunk, round(-off_s * chunk.sampling_rate_hz))
                if not rest.values.shape[1]:
                    continue
            if off_s <= slack and _is_alike(last, chunk):
                runs[-1].append(rest)
                until = rest.end
                continue
        runs.append([rest])
        until = rest.end
    pieces = (_cut(_piece(run), start, end) for run in runs)
    return tuple(piece for piece in pieces if piece.values.shape[1])


def _seconds(chunk: Chunk) -> float:
    return (chunk.end - chunk.start).total_seconds()


def _is_alike(one: Chunk, other: Chunk) -> bool:
    rates = one.sampling_rate_hz, other.sampling_rate_hz
    return one.channels == other.channels and rates[0] == rates[1]


def _without(chunk: Chunk, samples: int) -> Chunk:
    later = chunk.start + timedelta(seconds=samples / chunk.sampling_rate_hz)
    return replace(chunk, start=later, values=chunk.values[:, samples:])


def _piece(run: list[Chunk]) -> Piece:
    first = run[0]
    values = np.concatenate([chunk.values for chunk in run], axis=1, dtype=float)
    weather = (_mean(run, "temperature_c"), _mean(run, "wind_m_s"))
    rate, start = first.sampling_rate_hz, first.start
    return Piece(first.stream, start, rate, first.channels, values, *weather)


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
