"""What goes through the pipe of the sandbox comes back as it was, or is refused."""

from __future__ import annotations

import json
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta, timezone
from typing import Any, Literal

import numpy as np
import pytest

from shm.errors import BadInput
from shm.read.sandbox import protocol
from shm.read.sandbox.protocol import Answer, Refused, encoded, refusal_as_value, refusal_of
from shm.values import ComplexArray, FloatArray

NOON = datetime(2026, 5, 1, 12, tzinfo=UTC)


@dataclass(frozen=True, eq=False)
class Part:
    name: str
    values: FloatArray


@dataclass(frozen=True, eq=False)
class Whole:
    count: int
    share: float
    is_so: bool
    at: datetime | None
    plane: Literal["left", "right"]
    parts: tuple[Part, ...]
    lines: ComplexArray


def a_whole(**changes: Any) -> Whole:
    parts = (Part("a", np.arange(3.0)), Part("b", np.arange(4.0)))
    lines = np.array([[1 + 2j, 3], [4, 5j]])
    return Whole(**{**vars(Whole(7, 0.5, True, NOON, "left", parts, lines)), **changes})


def received(value: object) -> tuple[dict[str, Any], bytearray]:
    sent, arrays = encoded(value, refused=False)
    size = int.from_bytes(sent[: protocol.LENGTH_BYTES], "little")
    assert len(sent) == protocol.LENGTH_BYTES + size
    return protocol.header_of(sent[protocol.LENGTH_BYTES :]), bytearray(
        b"".join(array.tobytes() for array in arrays)
    )


def test_a_value_comes_back_as_it_was_sent() -> None:
    """Numbers and times of numpy and of other zones too."""
    east = NOON.astimezone(timezone(timedelta(hours=2)))
    sent = a_whole(count=np.int64(7), share=np.float32(0.5), is_so=np.bool_(True), at=east)
    header, raw = received(sent)
    assert header["refused"] is False
    assert protocol.bytes_of_arrays(header) == len(raw) == 8 * (3 + 4) + 16 * 4
    arrays = protocol.arrays_of(header, raw)
    found = protocol.value_of(Whole, header["found"], arrays)
    assert (found.count, found.share, found.is_so, found.at) == (7, 0.5, True, NOON)
    assert found.at is not None
    assert found.at.tzinfo is UTC
    assert [part.name for part in found.parts] == ["a", "b"]
    for part, size in zip(found.parts, (3, 4), strict=True):
        np.testing.assert_array_equal(part.values, np.arange(size))
    np.testing.assert_array_equal(found.lines, sent.lines)
    assert protocol.value_of(Whole, {**header["found"], "at": None}, arrays).at is None


def test_whole_numbers_and_narrow_floats_of_arrays_are_widened() -> None:
    header, raw = received([np.arange(3, dtype=np.int16), np.arange(2, dtype=np.complex64)])
    assert header["arrays"] == [["<f8", [3]], ["<c16", [2]]]
    assert header["found"] == [{"array": 0}, {"array": 1}]
    assert [list(each) for each in protocol.arrays_of(header, raw)] == [[0, 1, 2], [0, 1]]
    mapping, _ = received({3: (NOON,)})
    assert mapping["found"] == {"3": [NOON.isoformat()]}


@pytest.mark.parametrize(
    ("name", "wrong"),
    [
        ("count", True), ("count", 1.0), ("count", 2**53 + 1), ("count", -(2**53) - 1),
        ("share", True), ("share", "1"), ("share", 1.1e300), ("share", float("inf")),
        ("is_so", 1), ("at", "2026-05-01T12:00:00"), ("at", 5), ("at", "now"),
        ("plane", "up"), ("plane", 3), ("parts", {}), ("parts", [3]),
        ("parts", [{"name": "a"}]), ("parts", [{"name": "a", "values": {"array": 0}, "b": 1}]),
        ("parts", [{"name": 3, "values": {"array": 0}}]),
        ("parts", [{"name": "x" * 100_001, "values": {"array": 0}}]),
        ("lines", {"array": 0}), ("lines", {"array": 3}), ("lines", {"array": -1}),
        ("lines", {"array": True}), ("lines", {}), ("lines", [2]),
    ],
)  # fmt: skip
def test_a_part_of_another_type_is_refused(name: str, wrong: object) -> None:
    header, raw = received(a_whole())
    arrays = protocol.arrays_of(header, raw)
    with pytest.raises(ValueError, match=r"\w"):
        protocol.value_of(Whole, {**header["found"], name: wrong}, arrays)


@pytest.mark.parametrize(
    ("name", "bound"),
    [("count", 2**53), ("count", -(2**53)), ("share", 1e300), ("share", -3)],
)
def test_the_bounds_of_numbers_belong_to_them(name: str, bound: float) -> None:
    header, raw = received(a_whole())
    arrays = protocol.arrays_of(header, raw)
    found = protocol.value_of(Whole, {**header["found"], name: bound}, arrays)
    assert getattr(found, name) == bound
    longest = [{"name": "x" * 100_000, "values": {"array": 0}}]
    assert protocol.value_of(Whole, {**header["found"], "parts": longest}, arrays).parts[0].name


@pytest.mark.parametrize(
    "array",
    [
        ["<f4", [3]], ["<f8"], ["<f8", [3], 1], "<f8", ["<f8", 3], ["<f8", []],
        ["<f8", [1, 2, 3]], ["<f8", [0]], ["<f8", [-1]], ["<f8", [2.0]], ["<f8", [True]],
        ["<f8", [2**53]],
    ],
)  # fmt: skip
def test_an_array_that_cannot_be_is_refused(array: object) -> None:
    header = {"refused": False, "found": None, "arrays": [array]}
    with pytest.raises(ValueError, match="an array"):
        protocol.bytes_of_arrays(header)


@pytest.mark.parametrize(
    "header",
    [
        [], {}, {"refused": 1, "found": 0, "arrays": []}, {"refused": True, "found": 0},
        {"refused": True, "found": 0, "arrays": {}},
        {"refused": True, "found": 0, "arrays": [], "more": 1},
    ],
)  # fmt: skip
def test_what_is_no_header_is_refused(header: object) -> None:
    with pytest.raises(ValueError, match="its header is none"):
        protocol.header_of(json.dumps(header).encode())


def test_a_header_nested_too_deeply_is_refused() -> None:
    with pytest.raises(ValueError, match="nested too deeply"):
        protocol.header_of(b"[" * 100_000)


@pytest.mark.parametrize("found", [None, [], {"a": 1}, 3])
def test_an_answer_that_lists_nothing_is_refused(found: object) -> None:
    with pytest.raises(ValueError, match="lists nothing"):
        Answer(False, found, ()).listed()
    assert Answer(False, [3], ()).listed() == [3]


def test_a_refusal_comes_back_with_its_texts_cut_and_readable() -> None:
    error = BadInput("a\x00b\nc" + "x" * 3000, file="/a/b.csv", channel="y" * 600, line=3,
                     remedy="Do\x1b.")  # fmt: skip
    sent = refusal_as_value(error)
    assert sent == Refused("a?b\nc" + "x" * (2000 - 5), error.file, "y" * 500, 3, "Do?.")
    header, raw = received(sent)
    back = refusal_of(protocol.value_of(Refused, header["found"], protocol.arrays_of(header, raw)))
    assert (back.message.rstrip("."), back.line, back.channel, back.remedy) == (
        sent.message.rstrip("."), 3, sent.channel, sent.remedy,
    )  # fmt: skip
