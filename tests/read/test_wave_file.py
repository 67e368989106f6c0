"""WAV files of every kind, the streamed ones that never say how long they are too."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest
from scipy.io import wavfile

from shm.errors import BadInput
from shm.read import wave_file

ROWS = np.array([[0, 1], [-2, 3], [5, -8]])


@pytest.mark.parametrize(
    ("kind", "zero", "full"),
    [("int16", 0, 2**15), ("int32", 0, 2**31), ("uint8", 128, 128)],
)
def test_whole_numbers_are_shares_of_the_largest(
    kind: str, zero: int, full: int, tmp_path: Path
) -> None:
    path = tmp_path / "hanger7_a.wav"
    wavfile.write(path, 500, (ROWS + zero).astype(kind))
    (table,) = wave_file.open_tables(path)
    assert [column.name for column in table.columns] == ["channel_1", "channel_2"]
    assert {column.unit for column in table.columns} == {"full scale"}
    np.testing.assert_array_equal([c.load() for c in table.columns], ROWS.T / full)
    assert (table.file_header.sampling_rate_hz, table.file_header.hanger) == (500.0, 7)


def test_floats_are_as_they_are_and_one_channel_is_one(tmp_path: Path) -> None:
    path = tmp_path / "a.wav"
    wavfile.write(path, 250, np.array([0.5, -2.0], np.float32))
    ((column,),) = (table.columns for table in wave_file.open_tables(path))
    assert (column.unit, list(column.load())) == ("", [0.5, -2.0])


def streamed(order: str, size: int, before: bytes = b"", after: bytes = b"") -> bytes:
    """Three frames of two channels of 16 bits whose sizes a recorder never wrote."""
    form = {"<": b"RIFF", ">": b"RIFX"}[order]
    head = struct.pack(f"{order}4sIHHIIHH", b"fmt ", 16, 1, 2, 500, 2000, 4, 16)
    data = struct.pack(f"{order}4sI6h", b"data", size, *ROWS.ravel())
    return form + struct.pack(f"{order}I", size) + b"WAVE" + head + before + data + after


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("size", [0, 0xFFFFFFFF])
@pytest.mark.parametrize("note", [b"", b"abcd", b"abc"])
@pytest.mark.parametrize("torn", [b"", b"\x01", b"\x01\x02\x03"])
def test_a_streamed_file_is_read_to_its_last_whole_frame(
    order: str, size: int, note: bytes, torn: bytes, tmp_path: Path
) -> None:
    """Notes of an odd length have a byte more than they say."""
    before = struct.pack(f"{order}4sI", b"note", len(note)) + note + b"\0" * (len(note) % 2)
    content = streamed(order, size, before if note else b"", torn)
    path = tmp_path / "a.wav"
    path.write_bytes(content)
    (table,) = wave_file.open_tables(path)
    np.testing.assert_array_equal([c.load() for c in table.columns], ROWS.T / 2**15)


def test_what_holds_no_sample_or_too_many_channels_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.wav"
    for channels, is_read in ((64, True), (65, False)):
        wavfile.write(path, 500, np.zeros((2, channels), np.int16))
        if is_read:
            assert len(wave_file.open_tables(path)[0].columns) == channels
        else:
            with pytest.raises(BadInput, match="no channel holds a sample"):
                wave_file.open_tables(path)
    path.write_bytes(streamed("<", 12)[:44])
    with pytest.raises(BadInput):
        wave_file.open_tables(path)
