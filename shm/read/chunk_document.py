"""A chunk of a stream as bytes (`shm.chunk/1`): a line of JSON, then the samples.

    {"schema": "shm.chunk/1", "stream": "h3", "sequence": 17, "time": "2026-05-01T10:00:00Z",
     "sampling_rate_hz": 200, "channels": ["acc_1", "acc_2"], "temperature_c": 11.5,
     "encoding": "float32"}

stands in one line; behind it come little-endian floats of 4 bytes in m/s^2, sample by sample, each
sample channel by channel. Or the document is JSON alone, with `"values": {"acc_1": [...], ...}`.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shm.bridge.streams import is_stream_name
from shm.documents import Misfit, compact, finite, reader, value_of
from shm.errors import BadInput, TooLarge
from shm.values import NAN
from shm.values.stream import Chunk

CHUNK_SCHEMA = "shm.chunk/1"
LONGEST = timedelta(minutes=10)
"""Of one chunk. A window is as long: none waits for a chunk that spans several."""
LARGEST_BYTES = 32 << 20
"""Judgement: ten minutes of 16 channels at 800 Hz; one is held in memory a few times over."""

BY_TIME = 2**61
"""Numbers from here on were made of the time, as of files that have none: they count nothing."""

_FASTEST_HZ = 1e5  # judgement: far beyond any mode of a hanger
_LARGEST_SEQUENCE = 2**62  # technical: kept as a number of 64 bits
_FIRST_YEAR, _LAST_YEAR = 2000, 2200  # judgement: a clock before was never set
_READER = reader(finite)


@dataclass(frozen=True)
class _Header:
    schema: str
    stream: str
    sequence: int
    time: datetime
    sampling_rate_hz: float
    channels: tuple[str, ...] = ()
    temperature_c: float = NAN
    wind_m_s: float = NAN
    encoding: str = ""
    values: dict[str, list[Any]] = field(default_factory=dict)


def chunk_document(chunk: Chunk) -> bytes:
    """A chunk as the bytes that a logger sends."""
    names = ("stream", "sequence", "sampling_rate_hz", "channels", "temperature_c", "wind_m_s")
    header = {"schema": CHUNK_SCHEMA, "time": chunk.start, "encoding": "float32"}
    header |= {name: getattr(chunk, name) for name in names}
    body = np.ascontiguousarray(chunk.values.T, dtype="<f4").tobytes()
    return compact(header).encode() + b"\n" + body


def parse_chunk(content: bytes) -> Chunk:
    """The chunk of such bytes; raises BadInput that says what is wrong."""
    if len(content) > LARGEST_BYTES:
        raise TooLarge(
            f"a chunk of {len(content)} bytes is more than the {LARGEST_BYTES} that are taken.",
            remedy="Send shorter chunks, more often.",
        )
    header, body = _header(content)
    if header.schema != CHUNK_SCHEMA:
        raise _wrong(f"schema = {header.schema!r} is not {CHUNK_SCHEMA}")
    if not is_stream_name(header.stream):
        raise _wrong(f"stream = {header.stream[:80]!r} is no name of a stream")
    if not 0 <= header.sequence < _LARGEST_SEQUENCE:
        raise _wrong(f"sequence = {header.sequence} is no count")
    if not 0 < header.sampling_rate_hz <= _FASTEST_HZ:
        raise _wrong(f"sampling_rate_hz = {header.sampling_rate_hz:g} is no sampling rate")
    if not _FIRST_YEAR <= header.time.year < _LAST_YEAR:
        raise _wrong(f"time = {header.time:%Y-%m-%d}: the logger's clock is not set")
    channels, values = _samples(header, body)
    rate = header.sampling_rate_hz
    if not 0 < values.shape[1] <= LONGEST.total_seconds() * rate:
        raise _wrong(f"it has {values.shape[1]} samples, which is none or over ten minutes")
    values[~np.isfinite(values)] = NAN
    weather = header.temperature_c, header.wind_m_s
    start = header.time
    return Chunk(header.stream, header.sequence, start, rate, channels, values, *weather)


def _header(content: bytes) -> tuple[_Header, bytes]:
    first, _, body = content.partition(b"\n")
    try:
        try:
            node = json.loads(first)
        except ValueError:
            node, body = json.loads(content), b""
        return value_of(_Header, node, by=_READER), body
    except (Misfit, ValueError, RecursionError) as error:
        raise _wrong(f"its first line is no header: {str(error)[:200]}") from error


def _samples(header: _Header, body: bytes) -> tuple[tuple[str, ...], NDArray[np.float32]]:
    channels = header.channels or tuple(header.values)
    if not channels or len(set(channels)) < len(channels) or not all(map(is_stream_name, channels)):
        raise _wrong("channels are missing, or one is named twice or not by letters and digits")
    if header.encoding == "float32":
        values = np.frombuffer(body, "<f4", len(body) // 4)
        if len(body) % (4 * len(channels)):
            raise _wrong(f"{len(body)} bytes are no whole samples of {len(channels)} channels")
        return channels, values.reshape(-1, len(channels)).T.astype(np.float32)
    if header.encoding or body or set(header.values) != set(channels):
        raise _wrong('it has neither "encoding": "float32" and samples, nor all channels in values')
    try:
        with np.errstate(over="ignore"):
            made = np.array([header.values[name] for name in channels], dtype=float)
            return channels, made.astype(np.float32).reshape(len(channels), -1)
    except (TypeError, ValueError) as error:
        raise _wrong("its values are not numbers, or not as many of each channel") from error


def _wrong(what: str) -> BadInput:
    return BadInput(
        f"the chunk cannot be used: {what}.", remedy="See docs/permanent_sensors.md for its form."
    )
