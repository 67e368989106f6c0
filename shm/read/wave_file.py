"""WAV: a recorder's channels as shares of its full scale; what each is, the sidecar says.

Its `calibration` is what the full scale is worth, in `unit`: a recorder of 10 V with an
accelerometer of 100 mV/g gives 100 g. Files of floating point may hold units already.
"""

from __future__ import annotations

import io
import warnings
from functools import partial
from pathlib import Path
from typing import Literal

import numpy as np

from shm.errors import BadInput
from shm.read.base import Format, at_once
from shm.read.header import Entry
from shm.read.limits import guarded, limits, refuse_large, refuse_many_samples, too_large
from shm.read.table import Column, Table

FULL_SCALE = "full scale"
_FORMS = (b"RIFF", b"RIFX", b"RF64")
_OPEN_SIZES = (0, 0xFFFFFFFF)  # what recorders write before they know
_MOST_CHANNELS = 64  # judgement: four times what is read of a recording


def recognises(head: bytes) -> bool:
    """Return whether the first bytes of a file are those of a WAV file."""
    return head[:4] in _FORMS and head[8:12] == b"WAVE"


def open_tables(path: Path) -> tuple[Table, ...]:
    """Return the channels of a file, `channel_1` and so on; raises BadInput where it is damaged."""
    from scipy.io import wavfile

    if path.stat().st_size > limits().bytes_at_once:
        raise too_large(path)
    with guarded(path):
        warnings.simplefilter("ignore", wavfile.WavFileWarning)  # of notes that recorders add
        rate, data = wavfile.read(io.BytesIO(_closed(path.read_bytes())))
    if data.ndim == 1:
        data = data[:, np.newaxis]
    if rate <= 0 or data.shape[1] > _MOST_CHANNELS or not len(data):
        raise BadInput(
            "no channel holds a sample.", file=path, remedy="The file is damaged: record again."
        )
    refuse_many_samples(len(data), path)
    refuse_large(data.shape, 8, "", path)
    unit = FULL_SCALE if data.dtype.kind in "iu" else ""
    names = [f"channel_{place}" for place in range(1, data.shape[1] + 1)]
    columns = tuple(
        Column(name, len(data), partial(_shares, data[:, place]), unit)
        for place, name in enumerate(names)
    )
    entries = {"sampling_rate_hz": Entry(float(rate), path)}
    return (Table(path, columns, entries, ("WAV", str(data.dtype), *names)),)


def _closed(content: bytes) -> bytes:
    """Return a streamed file, whose recorder never wrote how long it is, with its sizes put in."""
    order: Literal["little", "big"] = "big" if content.startswith(b"RIFX") else "little"
    place = 12
    while place + 8 <= len(content) and content[:4] != b"RF64":
        size = int.from_bytes(content[place + 4 : place + 8], order)
        if content[place : place + 4] == b"data" and size in _OPEN_SIZES:
            left = len(content) - place - 8
            whole = left - left % max(1, int.from_bytes(content[32:34], order))
            sizes = [(len(content) - 8).to_bytes(4, order), whole.to_bytes(4, order)]
            return b"".join([content[:4], sizes[0], content[8 : place + 4], sizes[1],
                             content[place + 8 : place + 8 + whole]])  # fmt: skip
        place += 8 + size + size % 2
    return content


def _shares(values: np.ndarray) -> np.ndarray:
    """Return integers as fractions of the largest that the file can hold; others unchanged."""
    with np.errstate(invalid="ignore"):  # signalling NaNs of damaged files
        found = values.astype(np.float64)
    if values.dtype.kind == "u":
        return (found - 128.0) / 128.0
    return found / -float(np.iinfo(values.dtype).min) if values.dtype.kind == "i" else found


FORMAT = Format(
    "WAV",
    (".wav",),
    recognises,
    at_once(open_tables),
)
