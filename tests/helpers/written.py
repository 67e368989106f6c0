"""Files of every format that is read, also of those that `shm` does not write itself."""

from __future__ import annotations

import io
import json
import math
import zipfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import csiio
import numpy as np
import openpyxl
import pandas as pd
import pytest
import scipy.io
import scipy.io.wavfile
from nptdms import ChannelObject, GroupObject, RootObject, TdmsWriter
from pymseed import MS3TraceList, nslc2sourceid

from shm.errors import BadInput
from shm.read import FORMATS, Format, read
from shm.read import write as write_ours
from shm.read.array_reading import facts_about
from shm.read.base import PeekChannel
from shm.read.comma_separated import recording_text, response_text
from shm.read.header import condition_entries
from shm.read.logger_words import SI
from shm.read.numpy_file import arrays_of
from shm.read.sidecar import sidecar_path, write_sidecar
from shm.values import FrequencyResponse, Recording


def write(described: Recording | FrequencyResponse, path: Path) -> None:
    """Writes as `shm.read.write` does, and MATLAB and TDMS in the same layout.

    A format that `shm` only reads needs a line of `_WRITERS`.
    """
    if path.suffix in _WRITERS:
        _WRITERS[path.suffix](described, path)
        return
    known = [each for each in FORMATS if path.suffix in each.suffixes]
    if known and all(each.write is None for each in known):
        pytest.fail(f"shm only reads {path.suffix}: add a writer to _WRITERS of {__file__}.")
    write_ours(described, path)


def recorded(path: Path) -> Recording:
    """Return the time record that a file holds."""
    found = read(path)
    assert isinstance(found, Recording)
    return found


def responded(path: Path) -> FrequencyResponse:
    """Return the frequency responses that a file holds."""
    found = read(path)
    assert isinstance(found, FrequencyResponse)
    return found


def refused(path: Path, words: str, *verbs: Callable[[Path], object]) -> BadInput:
    """Return the refusal of a file by each of the verbs, `read` by default, in these words."""
    for verb in verbs or (read,):
        with pytest.raises(BadInput, match=words) as caught:
            verb(path)
        assert caught.value.remedy
    return caught.value


NUMBERED = ("WAV", "miniSEED", "Campbell")
"""Formats whose channels have numbers, or names of their own; they hold time records alone."""


def holds_responses(file_format: Format) -> bool:
    """Whether a format holds frequency responses, too."""
    return file_format.name not in (*NUMBERED, "SEP005")


def needs_responses(file_format: Format) -> None:
    """Skips a test of frequency responses where the format holds time records alone."""
    if not holds_responses(file_format):
        pytest.skip(f"{file_format.name} holds time records alone")


@dataclass
class Layout:
    """Named arrays, the facts about each by name, and those about the whole."""

    arrays: dict[str, Any]
    facts: dict[str, dict[str, Any]]
    attributes: dict[str, Any]

    @classmethod
    def of(cls, described: Recording | FrequencyResponse) -> Layout:
        flat = arrays_of(described)
        arrays = {name: value for name, value in flat.items() if isinstance(value, np.ndarray)}
        facts = {name: facts_about(name, flat) for name in arrays}
        taken = {*arrays, *(f"{name}_{key}" for name, about in facts.items() for key in about)}
        for name, about in facts.items():
            facts[name] = {k: v for k, v in about.items() if f"{name}_{k}" not in arrays}
        return cls(arrays, facts, {k: v for k, v in flat.items() if k not in taken})


def _matlab(described: Recording | FrequencyResponse, path: Path) -> None:
    scipy.io.savemat(str(path), arrays_of(described), long_field_names=True, oned_as="column")


def _tdms(layout: Layout, path: Path) -> None:
    """With what National Instruments' own programs say of a channel: increment and unit."""
    rate = layout.attributes.get("sampling_rate_hz")
    timed = {"wf_increment": 1 / rate, "sampling_rate_hz": rate} if isinstance(rate, float) else {}
    channels = [
        ChannelObject("test", name, values, {
            **{"unit_string" if k == "unit" else k: v for k, v in layout.facts[name].items()},
            **timed,
        })
        for name, values in layout.arrays.items()
    ]  # fmt: skip
    with path.open("wb") as stream, TdmsWriter(stream) as writer:
        writer.write_segment([RootObject(layout.attributes), GroupObject("test"), *channels])


def _excel(described: Recording | FrequencyResponse, path: Path) -> None:
    """Our own text in cells: remarks in the first column, numbers as numbers."""
    text = (
        recording_text(described) if isinstance(described, Recording) else response_text(described)
    )
    book = openpyxl.Workbook(write_only=True)
    sheet = book.create_sheet("test")
    for line in text.splitlines():
        sheet.append([line] if line.startswith("#") else [_number(c) for c in line.split(",")])
    packed = io.BytesIO()
    book.save(packed)
    _repack(packed, path)


def _repack(packed: io.BytesIO, path: Path) -> None:
    """Without compression and dates, so that equal cells make files of equal length."""
    with zipfile.ZipFile(packed) as made, zipfile.ZipFile(path, "w") as archive:
        for member in made.namelist():
            archive.writestr(zipfile.ZipInfo(member), made.read(member))


def _wave(described: Recording | FrequencyResponse, path: Path) -> None:
    """Channels by number, in floating point; the sidecar says all else."""
    assert isinstance(described, Recording)
    values = np.column_stack([channel.values for channel in described.channels])
    scipy.io.wavfile.write(path, round(described.sampling_rate_hz), values)
    channels = [
        PeekChannel(f"channel_{place}", c.quantity, SI[c.quantity], c.plane, c.x_m)
        for place, c in enumerate(described.channels, start=1)
    ]
    write_sidecar(described, channels, described.sampling_rate_hz, path)


def _mini_seed(described: Recording | FrequencyResponse, path: Path) -> None:
    """Counts of a thousand-millionth of the largest value; the sidecar says what they are worth."""
    assert isinstance(described, Recording)
    largest = [np.nanmax(np.abs(c.values), initial=1.0) / 1e9 for c in described.channels]
    rows = [c.values / one for c, one in zip(described.channels, largest, strict=True)]
    write_counts(path, rows, described)
    channels = [
        PeekChannel(name, c.quantity, SI[c.quantity], c.plane, c.x_m)
        for name, c in zip(mini_seed_names(len(rows)), described.channels, strict=True)
    ]
    write_sidecar(described, channels, described.sampling_rate_hz, path)
    text = sidecar_path(path).read_text()
    sidecar_path(path).write_text(f"calibration = {[float(one) for one in largest]}\n{text}")


def _sep005(described: Recording | FrequencyResponse, path: Path) -> None:
    """Channels as JSON; what SEP005 does not know in keys of ours."""
    assert isinstance(described, Recording)
    whole = {key: value for key, value in condition_entries(described).items() if key != "time"}
    channels = [
        {
            **each,
            "data": each["data"].tolist(),
            "unit_str": SI[c.quantity],
            **_known({"plane": c.plane, "x_m": c.x_m, "full_scale": c.full_scale, **whole}),
        }
        for each, c in zip(described.to_sep005(), described.channels, strict=True)
    ]
    path.write_text(json.dumps(channels))


def _known(said: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in said.items() if value not in (None, "") and value == value}


def _campbell(described: Recording | FrequencyResponse, path: Path) -> None:
    """Single precision, as a logger has it; names and units stand in the file."""
    assert isinstance(described, Recording)
    step_ns = round(1e9 / described.sampling_rate_hz)
    start = pd.Timestamp(described.time or datetime(2026, 1, 1, tzinfo=UTC)).tz_localize(None)
    index = start + pd.to_timedelta(step_ns * np.arange(described.samples), unit="ns")
    columns = {f"{c.name} ({SI[c.quantity]})": c.values for c in described.channels}
    frame = pd.DataFrame(columns, index=pd.DatetimeIndex(index, name="TIMESTAMP"))
    csiio.write_csi_tob3(str(path), frame.astype("float32"))
    channels = [
        PeekChannel(c.name, c.quantity, SI[c.quantity], c.plane, c.x_m) for c in described.channels
    ]
    write_sidecar(described, channels, math.nan, path)


def mini_seed_names(channels: int) -> list[str]:
    return [f"XX_HGR3_00_HN{place}" for place in range(1, channels + 1)]


def write_counts(
    path: Path, rows: Sequence[np.ndarray], described: Recording, version: int = 2
) -> None:
    """Rows as whole numbers; where they are NaN, the file has a gap."""
    traces = MS3TraceList()
    epoch = datetime(1970, 1, 1, tzinfo=UTC)
    start_ns = ((described.time or epoch) - epoch) // timedelta(microseconds=1) * 1000
    for name, row in zip(mini_seed_names(len(rows)), rows, strict=True):
        known = np.flatnonzero(np.isfinite(row))
        for part in np.split(known, np.flatnonzero(np.diff(known) > 1) + 1):
            traces.add_data(
                sourceid=nslc2sourceid(*name.split("_")),
                data_samples=np.round(row[part]).astype(np.int32),
                sample_type="i",
                sample_rate=described.sampling_rate_hz,
                starttime=start_ns + round(part[0] / described.sampling_rate_hz * 1e9),
            )
    traces.to_file(path, overwrite=True, format_version=version, max_record_length=512)


def _number(cell: str) -> float | str | None:
    try:
        value = float(cell)
    except ValueError:
        return cell
    return value if math.isfinite(value) else str(value)


def _of_layout(
    write_layout: Callable[[Layout, Path], None],
) -> Callable[[Recording | FrequencyResponse, Path], None]:
    """Return a writer that is given the named arrays of what it writes."""
    return lambda described, path: write_layout(Layout.of(described), path)


_WRITERS: dict[str, Callable[[Recording | FrequencyResponse, Path], None]] = {
    ".mat": _matlab,
    ".tdms": _of_layout(_tdms),
    ".xlsx": _excel,
    ".wav": _wave,
    ".mseed": _mini_seed,
    ".json": _sep005,
    ".tob3": _campbell,
}
