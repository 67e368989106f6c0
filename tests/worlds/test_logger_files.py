"""Read exports of many loggers, written by somebody who had not read the readers."""

import hashlib
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import shm.read
from shm.errors import BadInput
from tests.worlds.logger_files import FORMATS, write
from tests.worlds.recordings import Recording, case

# What these files do not say: which channel is what, or what a count is worth.
SILENT = {"signal_express", "quickdaq", "digiducer", "wav_float"}
RECORDS = [name for name, each in FORMATS.items() if each.holds == "record"]
OTHERS = [name for name, each in FORMATS.items() if each.holds != "record"]


@cache
def sample() -> Recording:
    """Return half a second of a recording with lost samples, with its first hit."""
    recording = case("dropout_nan", 3)
    hit = int(np.nanargmax(np.abs(recording.data[:, 0])))
    begin = max(hit - int(0.1 * recording.rate_hz), 0)
    data = recording.data[begin : begin + int(0.5 * recording.rate_hz)].copy()
    data[-20:-10, 1] = np.nan
    return replace(recording, data=data)


@pytest.mark.parametrize("name", RECORDS)
def test_a_file_is_read_as_its_writer_says(name: str, tmp_path: Path) -> None:
    path = tmp_path / f"test{FORMATS[name].suffix}"
    held = write(name, path, sample())
    assert held is not None
    assert held.rate_hz is not None
    look = shm.read.peek(path)
    span_s = len(held.values) / held.rate_hz  # of times that may be rounded to a microsecond
    within = held.rate_within + 1.1e-6 / span_s
    assert look.sampling_rate_hz == pytest.approx(held.rate_hz, rel=within)
    if name in SILENT:
        with pytest.raises(BadInput):
            shm.read.read(path)
        return
    found = np.array([channel.values for channel in shm.read.read(path).channels]).T
    assert found.shape == held.values.shape
    assert np.array_equal(np.isnan(found), np.isnan(held.values))
    off = np.nanmax(np.abs(found - held.values), axis=0)
    assert np.all(off <= 1.0001 * held.tolerance + 1e-12)


@pytest.mark.parametrize("name", OTHERS)
def test_what_is_no_record_is_refused(name: str, tmp_path: Path) -> None:
    path = tmp_path / f"test{FORMATS[name].suffix}"
    write(name, path, sample())
    with pytest.raises(BadInput):
        shm.read.read(path)


@pytest.mark.parametrize("name", sorted(FORMATS))
def test_the_same_bytes_each_time(name: str, tmp_path: Path) -> None:
    paths = [tmp_path / number / f"test{FORMATS[name].suffix}" for number in "12"]
    for path in paths:
        path.parent.mkdir()
        write(name, path, sample())
    one, other = (hashlib.sha256(path.read_bytes()).hexdigest() for path in paths)
    assert one == other
