"""A chunk as bytes: what comes back, and what is refused in words."""

from __future__ import annotations

import json

import numpy as np
import pytest

from shm.errors import BadInput, TooLarge
from shm.read.chunk_document import (
    LARGEST_BYTES,
    chunk_document,
    parse_chunk,
    refuse_long_chunk,
)
from tests.helpers.comparing import assert_same
from tests.helpers.nouns import NOW
from tests.helpers.streams import a_chunk


def test_a_chunk_comes_back_to_the_bit() -> None:
    chunk = a_chunk(3)
    found = parse_chunk(chunk_document(chunk))
    assert_same(found, chunk)


def test_samples_may_be_json() -> None:
    header = {
        "schema": "shm.chunk/1", "stream": "h3", "sequence": 0, "time": NOW.isoformat(),
        "sampling_rate_hz": 100, "values": {"acc_1": [1, None, 3.5], "acc_2": [4, 5, float("nan")]},
    }  # fmt: skip
    for text in (json.dumps(header), json.dumps(header, indent=1)):
        found = parse_chunk(text.encode())
        assert found.channels == ("acc_1", "acc_2")
        expected = [[1, np.nan, 3.5], [4, 5, np.nan]]
        assert np.array_equal(found.values, expected, equal_nan=True)


def changed(**changes: object) -> bytes:
    head, _, body = chunk_document(a_chunk(3)).partition(b"\n")
    return json.dumps({**json.loads(head), **changes}).encode() + b"\n" + body


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"", "no header"),
        (b"\x00\xff" * 40, "no header"),
        (b"[" * 100_000, "no header"),
        (chunk_document(a_chunk(3))[:-3], "no whole samples of 2 channels"),
        (changed(schema="shm.chunk/2"), "is not shm.chunk/1"),
        (changed(stream="../../etc"), "no name of a stream"),
        (changed(unit="g"), r"its unit is 'g'.*9\.80665"),
        (changed(units={"acc_1": "mg"}), "taken in m/s2 alone"),
        (changed(sequence=-1), "is no count"),
        (changed(sequence=1.5), "not a whole number"),
        (changed(sampling_rate_hz=0), "is no sampling rate"),
        (changed(sampling_rate_hz=None), "is no sampling rate"),
        (changed(time="1999-12-31T00:00:00Z"), "clock is not set"),
        (changed(time="soon"), "not an ISO 8601 time"),
        (changed(channels=["a", "a"]), "named twice"),
        (changed(channels=[]), "channels are missing"),
        (changed(encoding="int16"), "neither"),
        (changed(sampling_rate_hz=0.5), "over ten minutes"),
        (changed(encoding="", values={"acc_1": [1], "acc_2": [1]}), "neither"),
    ],
)
def test_what_is_wrong_is_said(content: bytes, said: str) -> None:
    with pytest.raises(BadInput, match=said):
        parse_chunk(content)


def test_the_unit_of_a_chunk_may_be_said() -> None:
    assert parse_chunk(changed(unit="m/s2")).values.shape == (2, 500)


@pytest.mark.parametrize(
    "value", [3e38, -3e38, 1e99, float("inf"), 10**400, True, [1], [[1]], "x", {}]
)
def test_a_value_that_is_no_acceleration_is_refused_by_stream_channel_and_place(
    value: object,
) -> None:
    values = {"acc_1": [1, 2, 3], "acc_2": [1, None, value]}
    head = json.loads(changed(encoding="", values=values).partition(b"\n")[0])
    with pytest.raises(BadInput, match=r"chunk 3 of stream h3 .*: sample 2 is .* m/s2") as caught:
        parse_chunk(json.dumps(head).encode())
    assert caught.value.channel == "acc_2"


def test_samples_without_bound_are_refused_and_nan_is_a_missing_one() -> None:
    chunk = a_chunk(3)
    chunk.values[1, 5] = np.nan
    assert np.isnan(parse_chunk(chunk_document(chunk)).values[1, 5])
    chunk.values[0, 7] = np.inf
    with pytest.raises(BadInput, match="sample 7 is inf") as caught:
        parse_chunk(chunk_document(chunk))
    assert caught.value.channel == "acc_1"


def test_channels_of_different_lengths_are_refused() -> None:
    head = json.loads(changed(encoding="", values={"acc_1": [1], "acc_2": [1, 2]}).split(b"\n")[0])
    with pytest.raises(BadInput, match="acc_1 has 1, acc_2 has 2"):
        parse_chunk(json.dumps(head).encode())


def test_a_chunk_without_end_is_told_how_long_it_may_be() -> None:
    with pytest.raises(TooLarge) as caught:
        refuse_long_chunk(LARGEST_BYTES + 1)
    assert "at most 32 MiB and ten minutes" in caught.value.remedy
