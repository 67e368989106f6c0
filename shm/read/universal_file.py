"""UFF: force and accelerations over time, or frequency responses, as data sets of type 58.

Read in ASCII and binary (58b), written in ASCII. Places, planes and hanger stand in the sidecar;
our own files also say them in id lines and nodes.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from shm.errors import UsageError
from shm.read import universal_frf, universal_time
from shm.read.atomic import replace_file
from shm.read.base import Format, Peek, PeekChannel
from shm.read.sidecar import write_sidecar
from shm.read.units import SI
from shm.read.universal_sets import Content, load, recognises, save
from shm.values import NAN, FrequencyResponse, Recording


def _read(path: Path) -> Recording | FrequencyResponse:
    content = load(path, headers_only=False)
    if _holds_responses(content):
        return universal_frf.frequency_response(content, path)
    return universal_time.recording(content, path)


def _peek(path: Path) -> Peek:
    content = load(path, headers_only=True)
    if _holds_responses(content):
        return universal_frf.peek(content, FORMAT.name, path)
    return universal_time.peek(content, FORMAT.name, path)


def _holds_responses(content: Content) -> bool:
    """Whether frequency responses are what the file is for: time histories go first if whole."""
    measured = {universal_time.quantity(found) for found in universal_time.time_sets(content)}
    return bool(universal_frf.response_sets(content)) and len(measured) < 2


def _write(described: Recording | FrequencyResponse, path: Path) -> None:
    if isinstance(described, Recording):
        sets = universal_time.sets_of(described)
        channels = [
            PeekChannel(c.name, c.quantity, SI[c.quantity], c.plane, c.x_m, NAN, c.full_scale)
            for c in described.channels
        ]
        rate = described.sampling_rate_hz
    else:
        sets = universal_frf.sets_of(described)
        channels = [PeekChannel(p.name, None, "", p.plane, p.x_m) for p in described.points]
        rate = NAN
    for found in sets:
        if "data" in found and np.isnan(found["data"]).any():
            raise UsageError(
                f"UFF files cannot hold the gaps (NaN) of {found['id1']}.",
                remedy="Write a .csv file.",
            )
    write_sidecar(described, channels, rate, path)
    replace_file(path, lambda temporary: save(temporary, sets))


FORMAT = Format(
    name="UFF",
    suffixes=(".uff", ".unv", ".uf"),
    recognises=recognises,
    peek=_peek,
    read=_read,
    write=_write,
    holds_gaps=False,
    holds_frequency_responses=True,
    needs_sidecar=True,
    may_be_gzipped=True,
)
