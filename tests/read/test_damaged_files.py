"""Damage of any kind: whatever comes of a file, it is a whole value or a BadInput."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from shm.errors import BadInput
from shm.read import FORMATS, Format, peek, read
from shm.read.registry import survey
from shm.values import FrequencyResponse, Recording
from tests.helpers.logger_texts import SHAPES
from tests.helpers.written import write

formats = pytest.mark.parametrize("file_format", FORMATS, ids=lambda f: f.name)
examples = settings(
    max_examples=50,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)


def path_for(file_format: Format, folder: Path) -> Path:
    return folder / f"test{file_format.suffixes[0]}"


@formats
@pytest.mark.parametrize("kept", [0.02, 0.3, 0.9, 0.99])
def test_a_file_that_is_cut_off_gives_a_refusal_or_whole_channels(
    file_format: Format, recording: Recording, tmp_path: Path, kept: float
) -> None:
    path = path_for(file_format, tmp_path)
    write(recording, path)
    content = path.read_bytes()
    path.write_bytes(content[: int(kept * len(content))])
    assert is_read_well_or_refused(path)


@formats
@examples
@given(data=st.data())
def test_damaged_files_raise_nothing_but_bad_input(
    file_format: Format,
    recording: Recording,
    response: FrequencyResponse,
    tmp_path: Path,
    data: st.DataObject,
) -> None:
    """Cut off, overwritten, inserted, repeated: read well or refused, never a crash."""
    path = path_for(file_format, tmp_path)
    both = file_format.holds_responses and data.draw(st.booleans(), label="response")
    write(response if both else recording, path)
    path.write_bytes(damaged(path.read_bytes(), data))
    assert is_read_well_or_refused(path)


@pytest.mark.parametrize("shape", SHAPES)
@settings(examples, max_examples=12)
@given(data=st.data())
def test_damaged_exports_raise_nothing_but_bad_input(
    shape: str, tmp_path: Path, data: st.DataObject
) -> None:
    content, path = SHAPES[shape], tmp_path / "export.csv"
    whole = content if isinstance(content, bytes) else content.encode()
    path.write_bytes(damaged(whole, data))
    assert is_read_well_or_refused(path)


def damaged(whole: bytes, data: st.DataObject) -> bytes:
    content = bytearray(whole)
    head = data.draw(st.booleans(), label="in the head")
    place = data.draw(st.integers(0, min(len(content), 1200) if head else len(content) - 1))
    telling = [b"\n", b",", b"NaN", b"-1", b"    -1\n", b"\x00", b"9" * 30, b"#", b"1e999", b"\xff"]
    chunk = data.draw(st.binary(max_size=8) | st.sampled_from(telling))
    damage = data.draw(st.sampled_from(["cut", "overwrite", "insert", "repeat", "drop"]))
    if damage == "cut":
        del content[place:]
    elif damage == "overwrite":
        content[place : place + len(chunk)] = chunk
    elif damage == "insert":
        content[place:place] = chunk
    elif damage == "repeat":
        content[place:place] = content[place : place + 500]
    else:
        del content[place : place + 1 + len(chunk)]
    return bytes(content)


def is_read_well_or_refused(path: Path) -> bool:
    """Whether each verb gives a whole value or a BadInput with a remedy; all else is raised."""
    for verb in (peek, survey):
        try:
            verb(path)
        except BadInput as refusal:
            if not (refusal.message and refusal.remedy):
                return False
    try:
        found = read(path)
    except BadInput as refusal:
        return bool(refusal.message and refusal.remedy)
    return is_whole(found)


def is_whole(found: Recording | FrequencyResponse) -> bool:
    if isinstance(found, FrequencyResponse):
        lines = (len(found.points), len(found.frequency_hz))
        even = np.allclose(np.diff(found.frequency_hz), found.frequency_hz[1])
        return found.accelerance.shape == lines and bool(even) and found.frequency_hz[0] == 0
    return (
        0 < found.sampling_rate_hz < math.inf
        and {len(channel.values) for channel in found.channels} == {found.samples}
        and found.samples >= 16
        and 1 <= len(found.accelerations) <= 16
        and not any(np.isinf(channel.values).any() for channel in found.channels)
    )
