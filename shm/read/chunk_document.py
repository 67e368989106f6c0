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
from shm.documents import ValidationError, compact, finite, reader, value_of
from shm.errors import BadInput, TooLarge
from shm.values import NAN, FloatArray
from shm.values.stream import Chunk

CHUNK_SCHEMA = "shm.chunk/1"
LONGEST = timedelta(minutes=10)
"""Of one chunk. A window is as long: none waits for a chunk that spans several."""
LARGEST_BYTES = 32 << 20
"""Judgement: ten minutes of 16 channels at 800 Hz; one is held in memory a few times over."""

BY_TIME = 2**61
"""Numbers from here on were made of the time, as of files that have none: they count nothing."""

_LARGEST_M_S2 = 2e6
"""Judgement: the toughest shock sensors end at 200 000 g (Endevco 7270A); more is no reading."""

_FASTEST_HZ = 1e5  # judgement: far beyond any mode of a hanger
_LARGEST_SEQUENCE = 2**62  # technical: kept as a number of 64 bits
_FIRST_YEAR, _LAST_YEAR = 2000, 2200  # judgement: a clock before was never set
_LONGEST_EVENT = 200  # judgement: what a line of a message bears
_UNITS = ("m/s2", "m/s^2", "m/s²")
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
    event: str = ""
    encoding: str = ""
    values: dict[str, list[Any]] = field(default_factory=dict)
    unit: Any = ""
    units: Any = ""


def chunk_document(chunk: Chunk) -> bytes:
    """Return a chunk as the bytes that a logger sends."""
    names = ("stream", "sequence", "sampling_rate_hz", "channels", "temperature_c", "wind_m_s")
    header = {"schema": CHUNK_SCHEMA, "time": chunk.start, "encoding": "float32"}
    header |= {name: getattr(chunk, name) for name in names}
    header |= {"event": chunk.event} if chunk.event else {}
    body = np.ascontiguousarray(chunk.values.T, dtype="<f4").tobytes()
    return compact(header).encode() + b"\n" + body


def numbered(sequence: int) -> str:
    """Return a chunk as people know it: by its number, if a logger gave it one."""
    return "a file's chunk" if sequence >= BY_TIME else f"chunk {sequence}"


def refuse_long_chunk(size_bytes: int, most_bytes: int = LARGEST_BYTES) -> None:
    """Raise TooLarge for a chunk of more bytes than are taken."""
    if size_bytes > most_bytes:
        raise TooLarge(
            f"a chunk of {size_bytes} bytes is more than the {most_bytes} that are taken.",
            remedy=f"Send shorter chunks, more often: each at most {most_bytes >> 20} MiB and "
            "ten minutes; one of ten seconds to a minute is best.",
        )


def parse_chunk(content: bytes) -> Chunk:
    """Return the chunk that such bytes encode; raises BadInput with the error."""
    header, body = _header(content)
    _refuse_header(header)
    channels, values = _samples(header, body)
    rate = header.sampling_rate_hz
    if not 0 < values.shape[1] <= LONGEST.total_seconds() * rate:
        raise _wrong(
            f"it has {values.shape[1]} samples, which is none or over ten minutes",
            f"Send 1 to {LONGEST.total_seconds() * rate:.0f} samples of each channel.",
        )
    conditions = header.temperature_c, header.wind_m_s, header.event[:_LONGEST_EVENT]
    start = header.time
    return Chunk(header.stream, header.sequence, start, rate, channels, values, *conditions)


def _refuse_header(header: _Header) -> None:
    if header.schema != CHUNK_SCHEMA:
        raise _wrong(
            f"schema = {header.schema[:80]!r} is not {CHUNK_SCHEMA}",
            f'Write "schema": "{CHUNK_SCHEMA}".',
        )
    if odd := [each for each in (header.unit, header.units) if each and each not in _UNITS]:
        raise _wrong(
            f"its unit is {str(odd[0])[:80]!r}: chunks are taken in m/s2 alone",
            "Send m/s2 (9.80665 times what is in g) and leave the unit out.",
        )
    if not is_stream_name(header.stream):
        raise _wrong(
            f"stream = {header.stream[:80]!r} is no name of a stream",
            "Write the name of a [[stream]] of bridge.toml.",
        )
    if not 0 <= header.sequence < _LARGEST_SEQUENCE:
        raise _wrong(
            f"sequence = {header.sequence} is no count", "Count the chunks 0, 1, 2 and so on."
        )
    if not 0 < header.sampling_rate_hz <= _FASTEST_HZ:
        raise _wrong(
            f"sampling_rate_hz = {header.sampling_rate_hz:g} is no sampling rate",
            f"Give it in Hz, at most {_FASTEST_HZ:.0f}.",
        )
    if not _FIRST_YEAR <= header.time.year < _LAST_YEAR:
        raise _wrong(
            f"time = {header.time:%Y-%m-%d}: the logger's clock is not set",
            "Set it by GPS or NTP, and send the chunk with its true time.",
        )


def _header(content: bytes) -> tuple[_Header, bytes]:
    first, _, body = content.partition(b"\n")
    try:
        try:
            node = json.loads(first)
        except ValueError:
            node, body = json.loads(content), b""
        return value_of(_Header, node, by=_READER), body
    except (ValidationError, ValueError, RecursionError) as error:
        raise _wrong(
            f"its first line is no header: {str(error)[:200]}",
            'Begin it with a line of JSON as {"schema": "shm.chunk/1", "stream": "h3", ...}.',
        ) from error


def _samples(header: _Header, body: bytes) -> tuple[tuple[str, ...], NDArray[np.float32]]:
    channels = header.channels or tuple(header.values)
    if not channels or len(set(channels)) < len(channels) or not all(map(is_stream_name, channels)):
        raise _wrong(
            "channels are missing, or one is named twice or not by letters and digits",
            "Name them as the [[stream.channel]] of bridge.toml.",
        )
    if header.encoding == "float32":
        values = _of_body(body, len(channels))
    elif header.encoding or body or set(header.values) != set(channels):
        raise _wrong(
            'it has neither "encoding": "float32" and samples, nor all channels in values',
            "Give one of the two.",
        )
    else:
        rows = [_of_list(header, name) for name in channels]
        if len({len(row) for row in rows}) > 1:
            counts = ", ".join(f"{n} has {len(r)}" for n, r in zip(channels, rows, strict=True))
            raise _wrong(
                f"its values are not as many of each channel: {counts}",
                "Write null for a missing one.",
            )
        values = np.array(rows)
    for name, row in zip(channels, values, strict=True):
        absurd = np.flatnonzero(np.abs(row) > _LARGEST_M_S2)  # a missing one is NaN
        if len(absurd):
            raise _no_reading(header, name, int(absurd[0]), f"{row[absurd[0]]:g} m/s2")
    return channels, values.astype(np.float32)


def _of_body(body: bytes, channels: int) -> NDArray[np.float32]:
    if len(body) % (4 * channels):
        raise _wrong(
            f"{len(body)} bytes are no whole samples of {channels} channels",
            "Send 4 bytes for each channel of each sample, behind one line of JSON.",
        )
    return np.frombuffer(body, "<f4").reshape(-1, channels).T


def _of_list(header: _Header, channel: str) -> FloatArray:
    """Return the numbers of a channel; null and NaN are missing ones."""
    found = header.values[channel]
    for place, value in enumerate(found):
        if not (value is None or (isinstance(value, int | float) and not isinstance(value, bool))):
            raise _no_reading(header, channel, place, json.dumps(value)[:40])
    try:
        return np.array(found, dtype=float)  # None is NaN
    except OverflowError:
        place = next(n for n, v in enumerate(found) if v is not None and abs(v) > _LARGEST_M_S2)
        raise _no_reading(header, channel, place, "a number without end") from None


def _no_reading(header: _Header, channel: str, place: int, what: str) -> BadInput:
    return BadInput(
        f"{numbered(header.sequence)} of stream {header.stream} cannot be used: sample {place} is "
        f"{what}, which is no acceleration in m/s2.",
        channel=channel,
        remedy="Send numbers in m/s2, and null or NaN for what is missing.",
    )


def _wrong(what: str, remedy: str) -> BadInput:
    return BadInput(
        f"the chunk cannot be used: {what}.",
        remedy=f"{remedy} docs/permanent_sensors.md shows its form.",
    )
