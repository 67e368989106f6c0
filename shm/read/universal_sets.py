"""The door to pyuff: data sets in and out, with nothing believed that a damaged file may hold.

pyuff reads many damaged files without a word and says little where it fails, so lengths, steps
and values are checked here. Type 58: https://www.ceas3.uc.edu/sdrluff/ (Function at nodal DOF).
"""

from __future__ import annotations

import math
import re
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from shm.errors import BadInput
from shm.read.content import bytes_of, plain_file
from shm.values import ComplexArray, FloatArray

# UC-SDRL, Universal File Formats: data sets 15, 58, 58b and 2411
TIME_RESPONSE, FREQUENCY_RESPONSE, COHERENCE = 1, 4, 6
_FUNCTION, _MODES = 58, 55
NODES = (15, 2411)
_START = re.compile(rb"\A\s*-1[ \t]*\r?\n\s*\d+")
_MARK = re.compile(rb"^ {4}-1[ \t]*\r?$", re.MULTILINE)
_EXPORT_AGAIN = "Export or send it again."
_IEEE_754 = 2  # data set 58b, record 1
_INCREMENT_DIGITS = 6  # of E13.5, data set 58, record 7
_MOST_UNEVEN = 0.01  # judgement: of a step; a clock is far better, a lost sample far worse
_LEAST_STEP, _LARGEST_STEP = 1e-9, 1e6  # judgement: s or Hz, beyond which no step is one


@dataclass(frozen=True, eq=False)
class FunctionSet:
    """A data set of type 58. `data` (points,) is None where only headers were read.

    `first` and `step` (0 where unknown) are those of the abscissa, in s or Hz; directions are 1 to
    3 for x to z, negative against the axis.
    """

    number: int
    function: int
    lines: tuple[str, ...]
    response: tuple[str, int, int]
    reference: tuple[str, int, int]
    points: int
    first: float
    step: float
    quantity: int
    label: str
    unit: str
    denominator_unit: str
    data: FloatArray | ComplexArray | None

    @property
    def title(self) -> str:
        return f"data set {self.number}"


@dataclass(frozen=True, eq=False)
class Content:
    """The functions of a file; `mode_count` counts modes that another program identified."""

    functions: tuple[FunctionSet, ...]
    node_count: int = 0
    mode_count: int = 0


def recognises(head: bytes) -> bool:
    return _START.match(head) is not None


def load(path: Path, *, headers_only: bool) -> Content:
    """Return all functions and nodes of a file; raises BadInput naming data set and line."""
    raw = bytes_of(path)
    refuse_cut_off(raw, path)
    quiet = warnings.catch_warnings()
    with quiet, np.errstate(all="ignore"), plain_file(path, raw) as plain:
        warnings.simplefilter("ignore")
        return _content(opened(plain, path), path, raw, headers_only)


def refuse_cut_off(raw: bytes, path: Path) -> None:
    """Raise BadInput where a file ends within a data set."""
    is_open = b"\x00" not in raw and len(_MARK.findall(raw)) % 2 == 1
    if is_open or not raw.rstrip().endswith(b"-1"):
        raise BadInput(
            "the file ends within a data set.",
            file=path,
            line=raw.count(b"\n") + 1,
            remedy=_EXPORT_AGAIN,
        )


def save(path: Path, sets: Sequence[dict[str, Any]]) -> None:
    """Write data sets to a new file in ASCII, as pyuff's binary sets cannot be read."""
    import pyuff  # it is slow to load, and few files are of this format

    file = pyuff.UFF(str(path))
    file.write_sets(list(sets), mode="add")


def _content(file: Any, path: Path, raw: bytes, headers_only: bool) -> Content:
    functions: list[FunctionSet] = []
    nodes: set[float] = set()
    kinds = [int(kind) for kind in file.get_set_types()]
    for index, kind in enumerate(kinds):
        if kind == _FUNCTION:
            found = read_set(file, index, path, raw, headers_only)
            functions.append(_function(found, index + 1, path, raw))
        elif kind in NODES:
            nodes.update(np.ravel(read_set(file, index, path, raw, headers_only)["node_nums"]))
    return Content(tuple(functions), len(nodes), kinds.count(_MODES))


def opened(plain: Path, path: Path) -> Any:
    """Return the file as pyuff opens it; raises BadInput where its sets cannot be separated."""
    import pyuff

    try:
        return pyuff.UFF(str(plain))
    except Exception as error:
        raise BadInput(
            "its data sets cannot be told apart.", file=path, remedy=_EXPORT_AGAIN
        ) from error


def read_set(file: Any, index: int, path: Path, raw: bytes, headers_only: bool) -> dict[str, Any]:
    """Return one data set as pyuff reads it; raises BadInput naming it."""
    try:
        found: dict[str, Any] = file.read_sets([index], header_only=headers_only)
    except Exception as error:
        what = "cannot be read: a header or a number in it is damaged"
        raise _refusal(what, index + 1, path, raw) from error
    if found.get("abscissa_spacing") == 0 and found["x"] is None:
        return read_set(file, index, path, raw, headers_only=False)
    if found.get("binary") and found["fp_format"] != _IEEE_754:
        raise _refusal("holds numbers that are not IEEE 754", index + 1, path, raw)
    return found


def _refusal(what: str, number: int, path: Path, raw: bytes) -> BadInput:
    return BadInput(
        f"data set {number} {what}.",
        file=path,
        line=_line_of_set(number, raw),
        remedy=_EXPORT_AGAIN,
    )


def _line_of_set(number: int, raw: bytes) -> int | None:
    """Return the line at which a data set starts, where the file is text."""
    marks = [match.start() for match in _MARK.finditer(raw)]
    if b"\x00" in raw or len(marks) < 2 * number - 1:
        return None
    return raw.count(b"\n", 0, marks[2 * (number - 1)]) + 1


def _function(found: dict[str, Any], number: int, path: Path, raw: bytes) -> FunctionSet:
    points, data = int(found["num_pts"]), found["data"]
    if data is not None and len(data) != points:
        what = f"holds {len(data)} values where its header says {points}"
        raise _refusal(what, number, path, raw)
    first, step = _abscissa(found, number, path, raw)
    return FunctionSet(
        number=number,
        function=_kind(found),
        lines=tuple(_plain(found[f"id{line}"]) for line in range(1, 6)),
        response=(_plain(found["rsp_ent_name"]), found["rsp_node"], found["rsp_dir"]),
        reference=(_plain(found["ref_ent_name"]), found["ref_node"], found["ref_dir"]),
        points=points,
        first=first,
        step=step,
        quantity=found["ordinate_spec_data_type"],
        label=_plain(found["ordinate_axis_lab"]),
        unit=_plain(found["ordinate_axis_units_lab"]),
        denominator_unit=_plain(found["orddenom_axis_units_lab"]),
        data=data,
    )


def _kind(found: dict[str, Any]) -> int:
    """Return the function's type; a general function over time is a time response."""
    kind = int(found["func_type"])
    return TIME_RESPONSE if kind == 0 and found["abscissa_spec_data_type"] == 17 else kind


def _plain(text: str) -> str:
    return "" if text.strip().upper() == "NONE" else text.strip()


def _abscissa(found: dict[str, Any], number: int, path: Path, raw: bytes) -> tuple[float, float]:
    """Return first value and step, checked where the file lists every value."""
    if found["abscissa_spacing"] != 0:
        return float(found["abscissa_min"]), _whole(float(found["abscissa_inc"]))
    x = np.asarray(found["x"], dtype=float)
    step = (x[-1] - x[0]) / (len(x) - 1) if len(x) > 1 else math.nan
    off = np.abs(x - x[0] - step * np.arange(len(x)))
    if not (step > 0 and off.max() < max(_MOST_UNEVEN * step, 1e-5 * abs(x[-1]))):
        raise _refusal("has an uneven abscissa", number, path, raw)
    return float(x[0]), _whole(float(step))


def _whole(step: float) -> float:
    """Return the step with an integer inverse where the file's six digits allow it, else `step`.

    Returns 0 where the value cannot be a step.
    """
    if not _LEAST_STEP < step < _LARGEST_STEP:
        return 0.0
    whole = 1 / max(1, round(1 / step))
    last_digit = 10.0 ** (math.floor(math.log10(step)) + 1 - _INCREMENT_DIGITS)
    return whole if abs(whole - step) <= 0.51 * last_digit else step
