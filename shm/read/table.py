"""The numbers of a CSV file, fast where all is well, line by line where something is off; the
sampling rate that their times tell, and the gaps that these show.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from shm.errors import BadInput
from shm.read.comma_header import Heading
from shm.values import NAN, FloatArray, IntArray

_MISSING = {"", "nan", "na", "n/a", "null", "none", "-"}
_MOST_JITTER = 0.4  # samples: times rounded to milliseconds are off by 0.26 of one at 512 Hz
_MANY_GAPS = 0.05  # judgement: no link loses every twentieth sample, one by one and evenly
_WHOLE = 0.01  # of a sample: rounding of the sums
_MOST_GAP = 2  # a file whose gaps outweigh its data is refused, not filled up
REMEDY = "Export with an even time step, or drop the times and give sampling_rate_hz."


def parse_table(heading: Heading, path: Path) -> FloatArray:
    """All columns (columns, rows), empty cells as NaN; raises BadInput naming line and column."""
    lines = _with_points(heading)
    try:
        rows = _fast(lines, heading)
    except ValueError:
        rows = _slow(lines, heading, path)
    _refuse_infinite(rows, lines, heading, path)
    return np.ascontiguousarray(rows.T)


def rows_in(body: Sequence[str]) -> int:
    """How many lines hold numbers, by their look alone."""
    return sum(1 for line in body if _holds_numbers(line))


def _holds_numbers(line: str) -> bool:
    stripped = line.strip()
    return bool(stripped) and not stripped.startswith("#") and stripped != "\x1a"


def _with_points(heading: Heading) -> Sequence[str]:
    """The lines with decimal points: commas are decimal where they do not separate columns."""
    if heading.delimiter == ",":
        return heading.body
    return [line.replace(",", ".") for line in heading.body]


def _fast(lines: Sequence[str], heading: Heading) -> FloatArray:
    columns = len(heading.columns)
    if rows_in(lines) == 0:
        return np.zeros((0, columns))
    rows = np.loadtxt(lines, delimiter=heading.delimiter, ndmin=2)
    if rows.shape[1] != columns:
        raise ValueError(f"{rows.shape[1]} columns")
    return rows


def _slow(lines: Sequence[str], heading: Heading, path: Path) -> FloatArray:
    rows = [
        _row(line, number, heading, path)
        for number, line in enumerate(lines, start=heading.body_line)
        if _holds_numbers(line)
    ]
    return np.array(rows, dtype=float)


def _row(line: str, number: int, heading: Heading, path: Path) -> list[float]:
    cells = line.split("#")[0].split(heading.delimiter)
    if len(cells) != len(heading.columns):
        raise BadInput(
            f"{len(cells)} values where the names of the columns are {len(heading.columns)}.",
            file=path,
            line=number,
            remedy="Complete or remove the line; a bad value may be left empty.",
        )
    return [
        _cell(cell, name, number, path) for cell, name in zip(cells, heading.columns, strict=True)
    ]


def _cell(text: str, name: str, line: int, path: Path) -> float:
    plain = text.strip().strip('"').strip()
    if plain.lower() in _MISSING:
        return NAN
    try:
        return float(plain)
    except ValueError:
        raise BadInput(
            f"{plain[:40]!r} is not a number.",
            file=path,
            channel=name,
            line=line,
            remedy="Correct it, or leave it empty.",
        ) from None


def _refuse_infinite(rows: FloatArray, lines: Sequence[str], heading: Heading, path: Path) -> None:
    found = np.argwhere(np.isinf(rows))
    if len(found):
        row, column = found[0]
        numbers = [i for i, line in enumerate(lines) if _holds_numbers(line)]
        raise BadInput(
            "the value is infinite.",
            file=path,
            channel=heading.columns[column],
            line=heading.body_line + numbers[row],
            remedy="Leave the cell empty where the logger failed.",
        )


def evened(
    times_s: FloatArray, values: FloatArray, refusal: Callable[[int, str], BadInput]
) -> tuple[FloatArray, float]:
    """Values (channels, samples) on an even grid, and the rate in Hz (NaN for a single time).

    Samples that the times skip become NaN. Where times do not run evenly it raises the `refusal`
    of that sample (from 0) for that reason.
    """
    if len(times_s) < 2:
        return values, NAN
    places, rate = _places(times_s, refusal)
    filled = np.full((len(values), places[-1] + 1), NAN)
    filled[:, places] = values
    return filled, rate


def rate_of(times_s: FloatArray, refusal: Callable[[int, str], BadInput]) -> float:
    """The rate that times tell, in Hz; raises the `refusal` where they do not run evenly."""
    return _places(times_s, refusal)[1] if len(times_s) > 1 else NAN


def _are_rounded(times: FloatArray, multiples: FloatArray, deviations: FloatArray) -> bool:
    """Whether times without gaps, rounded to the clock's last digit, look as if they had gaps.

    At 800 Hz in ms the steps are 1, 1, 1, 2 ms: gaps at a clock of 1000 Hz would not come in so
    many and such even places.
    """
    if np.mean(multiples != 1) <= _MANY_GAPS:
        return False
    step = (times[-1] - times[0]) / (len(times) - 1)
    since = times - times[0]
    digits = (10.0**-power for power in range(7))
    last = next((d for d in digits if np.abs(since / d - np.rint(since / d)).max() < 1e-3), 0.0)
    # Half a digit of a time itself, and half of the first and the last that the others are held to.
    return bool(np.abs(deviations).max() <= last / step + _WHOLE)


def _places(times: FloatArray, refusal: Callable[[int, str], BadInput]) -> tuple[IntArray, float]:
    """The sample that each time belongs to, and the rate in Hz.

    Two readings compete: times rounded but without gaps, and times exact but with gaps.
    """
    steps = np.diff(times)
    wrong = np.flatnonzero(~(steps > 0))
    if len(wrong):
        raise refusal(int(wrong[0]) + 1, "the time does not increase")
    multiples = np.rint(steps / np.median(steps))
    readings = [np.arange(len(times)), np.append(0, np.cumsum(np.maximum(multiples, 1)))]
    deviations = [
        (times - times[0]) * places[-1] / (times[-1] - times[0]) - places for places in readings
    ]
    best = min((0, 1), key=lambda reading: float(np.abs(deviations[reading]).max()))
    rounded = best == 1 and _are_rounded(times, multiples, deviations[0])
    best = 0 if rounded else best
    if not (rounded or np.abs(deviations[best]).max() <= _MOST_JITTER):
        oddest = int(np.argmax(np.abs(steps - np.median(steps))))
        raise refusal(oddest + 1, "the times are uneven")
    places = readings[best].astype(np.int64)
    if places[-1] >= _MOST_GAP * len(places):
        raise refusal(int(np.argmax(np.diff(places))) + 1, "there is a long gap")
    return places, float(places[-1] / (times[-1] - times[0]))
