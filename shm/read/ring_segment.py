"""Read ten minutes of a ring of 1.0.0: an HDF5 file with the chunks of a stream.

stream, sampling_rate_hz, channels                attributes of the file
/acc_1                                            the samples of a channel, chunk after chunk
/_chunks                                          a row a chunk: what came, when, where it is
"""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np

from shm.errors import BadInput
from shm.read.limits import guarded
from shm.values.stream import Chunk, time_of


def read_segment(path: Path) -> list[tuple[Chunk, int]]:
    """Return the chunks of a segment as they came, each with when, in microseconds since 1970.

    0 in segments of before that was written. Raises BadInput where it is damaged.
    """
    with guarded(path, "the segment"), h5py.File(path, "r", locking=False) as file:
        stream, rate = str(file.attrs["stream"]), float(file.attrs["sampling_rate_hz"])
        channels = tuple(str(name) for name in file.attrs["channels"])
        values = np.array([file[name][()] for name in channels], np.float32)
        rows = file["_chunks"][()]
    if values.shape != (len(channels), rows["samples"].sum()):
        raise BadInput("the segment has not the samples that it names.", file=path)
    arrived = rows["arrived_us"] if "arrived_us" in rows.dtype.names else np.zeros(len(rows), int)
    found = []
    for place in np.argsort(arrived, kind="stable"):
        row = rows[place]
        part = values[:, row["first"] : row["first"] + row["samples"]]
        weather = float(row["temperature_c"]), float(row["wind_m_s"])
        start, number = time_of(int(row["start_us"])), int(row["sequence"])
        found.append(
            (Chunk(stream, number, start, rate, channels, part, *weather), int(arrived[place]))
        )
    return found
