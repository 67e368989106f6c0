"""A segment of the ring: ten minutes of a stream as HDF5, for others to read as well.

    stream, time, end, sampling_rate_hz, channels    attributes of the file
    /acc_1  unit="m/s2"                               the samples of a channel, chunk after chunk
    /_chunks                                          a row a chunk: what came, when, where it is

`first` of a row is the number of the chunk's first sample; where its `start_us`, microseconds since
1970, is not the `end_us` of the row before, samples are missing or there twice: then those of the
row with the smallest `arrived_us` count, and the others only lie here.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from pathlib import Path

import h5py
import numpy as np
from numpy.typing import NDArray

from shm.documents import format_time
from shm.errors import BadInput
from shm.read.limits import guarded
from shm.values.stream import Chunk

_NUMBERS = ("start_us", "end_us", "sequence", "first", "samples", "arrived_us")
_ROW = np.dtype(
    [(name, "<i8") for name in _NUMBERS]
    + [("checksum", "S16"), ("temperature_c", "<f8"), ("wind_m_s", "<f8")]
)
_TABLE = "_chunks"  # channels begin with a letter or a digit
_LEVEL = 1  # of gzip: 4 saves 1 % more of noise at twice the time
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_MICROSECOND = timedelta(microseconds=1)


@dataclass(frozen=True, order=True)
class ChunkKey:
    """Identify a chunk of a stream: its start, its number, its contents.

    `arrived_us` is the time of receipt: of two with one start, the first counts. 0 in old
    segments.
    """

    start_us: int
    sequence: int
    checksum: str
    arrived_us: int = field(default=0, compare=False)


def microseconds(time: datetime) -> int:
    """Return the microseconds since 1970."""
    return (time - _EPOCH) // _MICROSECOND


def time_of(microseconds: int) -> datetime:
    """Return the time so many microseconds after 1970."""
    return _EPOCH + microseconds * _MICROSECOND


def write_segment(path: Path, chunks: Sequence[tuple[ChunkKey, Chunk]]) -> None:
    """Write chunks of one stream with equal channels to a file, and force it to disk.

    HDF5 makes the file in memory: a full disk would kill the process.
    """
    image = _image(chunks)
    with path.open("wb") as file:
        file.write(image)
        file.flush()
        os.fsync(file.fileno())


def _image(chunks: Sequence[tuple[ChunkKey, Chunk]]) -> bytes:
    """Return the contents of the file."""
    first = chunks[0][1]
    packed = {"compression": "gzip", "compression_opts": _LEVEL, "shuffle": True}
    with h5py.File(first.stream, "w", driver="core", backing_store=False) as file:
        file.attrs["stream"], file.attrs["sampling_rate_hz"] = first.stream, first.sampling_rate_hz
        file.attrs["time"] = format_time(first.start)
        file.attrs["end"] = format_time(max(chunk.end for _, chunk in chunks))
        file.attrs["channels"] = list(first.channels)
        for place, name in enumerate(first.channels):
            values = np.concatenate([chunk.values[place] for _, chunk in chunks])
            made = file.create_dataset(name, data=values, fletcher32=True, **packed)
            made.attrs["unit"] = "m/s2"
        file.create_dataset(_TABLE, data=_rows(chunks), fletcher32=True, chunks=True)
        file.flush()
        image: bytes = file.id.get_file_image()
    return image


def _rows(chunks: Sequence[tuple[ChunkKey, Chunk]]) -> NDArray[np.void]:
    rows, first = [], 0
    for key, chunk in chunks:
        samples = chunk.values.shape[1]
        times = key.start_us, microseconds(chunk.end)
        numbers = (*times, key.sequence, first, samples, key.arrived_us)
        rows.append((*numbers, key.checksum.encode(), chunk.temperature_c, chunk.wind_m_s))
        first += samples
    return np.array(rows, _ROW)


def read_spans(path: Path) -> dict[ChunkKey, int]:
    """Return the chunks of a segment, each with its end in microseconds; raises BadInput."""
    with guarded(path, "the segment"), h5py.File(path, "r", locking=False) as file:
        return {_key(row): int(row["end_us"]) for row in file[_TABLE][()]}


def read_segment(path: Path) -> dict[ChunkKey, Chunk]:
    """Return the chunks of a segment; raises BadInput where it is damaged."""
    with guarded(path, "the segment"), h5py.File(path, "r", locking=False) as file:
        stream, rate = str(file.attrs["stream"]), float(file.attrs["sampling_rate_hz"])
        channels = tuple(str(name) for name in file.attrs["channels"])
        values = np.array([file[name][()] for name in channels], np.float32)
        rows = file[_TABLE][()]
    if values.shape != (len(channels), rows["samples"].sum()):
        raise BadInput("the segment has not the samples that it names.", file=path)
    found = {}
    for row in rows:
        part = values[:, row["first"] : row["first"] + row["samples"]]
        weather = float(row["temperature_c"]), float(row["wind_m_s"])
        key = _key(row)
        start = time_of(key.start_us)
        found[key] = Chunk(stream, key.sequence, start, rate, channels, part, *weather)
    return found


def _key(row: np.void) -> ChunkKey:
    arrived_us = int(row["arrived_us"]) if "arrived_us" in (row.dtype.names or ()) else 0
    checksum = row["checksum"].decode()
    return ChunkKey(int(row["start_us"]), int(row["sequence"]), checksum, arrived_us)
