"""The heading of a CSV file: `# key: value` lines and the names of its columns.

The numbers of a CSV file, fast where all is well, line by line where something is off; the
sampling rate that their times tell, and the gaps that these show.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from shm.errors import BadInput
from shm.read.header import CHANNEL_KEYS, KEYS, Entry, Header, spread
from shm.read.limits import refuse_long_header
from shm.values import NAN, FloatArray, IntArray

_TIME = re.compile(r"t|time([ _]?[\[(]?s[\])]?)?", re.IGNORECASE)
_SAMPLE = "a line of names such as force,acc_1,acc_2"
LINE_BREAK = re.compile(r"\r\n|\r|\n")


@dataclass(frozen=True)
class Heading:
    """A parsed heading: `columns` as in the file, `header` without the column of times.

    `body` are the lines after the names, the first of which is line `body_line`.
    """

    header: Header
    columns: tuple[str, ...]
    delimiter: str
    body: Sequence[str]
    body_line: int
    remarks: tuple[str, ...]

    @property
    def has_time(self) -> bool:
        return _TIME.fullmatch(self.columns[0]) is not None


def parse_heading(text: str, path: Path) -> Heading:
    """The heading of a CSV file; raises BadInput naming line and column."""
    lines = LINE_BREAK.split(text)
    at = next((i for i, line in enumerate(lines) if line.strip() and not _is_remark(line)), None)
    if at is None:
        raise BadInput(
            "there are no columns in it.", file=path, remedy=f"Begin with {_SAMPLE}, then numbers."
        )
    refuse_long_heading(lines[: at + 1], path)
    delimiter = mark_between(lines[at])
    columns = tuple(cells_of(lines[at], delimiter))
    _refuse_columns(columns, at + 1, path)
    header, unknown = header_of(lines[:at], columns, delimiter, path)
    return Heading(header, columns, delimiter, lines[at + 1 :], at + 2, unknown)


def header_of(
    lines: Sequence[str], columns: Sequence[str], delimiter: str, path: Path
) -> tuple[Header, tuple[str, ...]]:
    """What the remarks before the names of the columns say, and remarks on keys not known."""
    remarks = [
        (Entry(line, path, number), *_key_and_value(line))
        for number, line in enumerate(lines, start=1)
        if ":" in line and _is_remark(line)
    ]
    return _header(remarks, columns, delimiter, path)


def refuse_long_heading(lines: Sequence[str], path: Path) -> None:
    """Raises BadInput where the lines up to the names of the columns are too long."""
    refuse_long_header(sum(map(len, lines)), path)


def cells_of(line: str, delimiter: str) -> list[str]:
    """The cells of a line without blanks and quotes around them."""
    return [cell.strip().strip('"').strip() for cell in line.split(delimiter)]


def _is_remark(line: str) -> bool:
    return line.strip().strip('"').startswith("#")


def _key_and_value(line: str) -> tuple[str, str]:
    key, _, value = line.strip().strip('"').lstrip("# \t").partition(":")
    return key.strip().lower(), value.strip()


def mark_between(line: str) -> str:
    """The mark that separates the columns of a line."""
    return next((mark for mark in "\t;" if mark in line), ",")


def _refuse_columns(columns: tuple[str, ...], line: int, path: Path) -> None:
    if all(is_number(name) for name in columns if name):
        raise BadInput(
            "the names of the columns are missing.",
            file=path,
            line=line,
            remedy=f"Put {_SAMPLE} before the numbers.",
        )
    often = Counter(columns)
    for name in columns:
        if not name or often[name] > 1:
            what = f"the column name {name!r} stands twice." if name else "a column has no name."
            raise BadInput(
                what, file=path, channel=name, line=line, remedy="Give each column its own name."
            )


def is_number(text: str) -> bool:
    """Whether a cell is one, with a point or a decimal comma."""
    try:
        float(text.replace(",", "."))
    except ValueError:
        return False
    return True


def _header(
    remarks: Sequence[tuple[Entry, str, str]],
    columns: Sequence[str],
    delimiter: str,
    path: Path,
) -> tuple[Header, tuple[str, ...]]:
    timed = _TIME.fullmatch(columns[0]) is not None
    names = columns[1:] if timed else columns
    channels: dict[str, dict[str, Entry]] = {name: {} for name in names}
    entries: dict[str, Entry] = {}
    unknown: list[str] = []
    for line, key, value in remarks:
        if key in KEYS:
            entries[key] = Entry(value.strip(f"{delimiter},; "), path, line.line)
        elif key in CHANNEL_KEYS:
            for name, entry in _listed(key, value, names, timed, delimiter, line).items():
                channels[name][key] = entry
        elif (found := _own_key(key, names)) is not None:
            name, own = found
            channels[name][own] = Entry(value.strip(f"{delimiter},; "), path, line.line)
        else:
            unknown.append(f"line {line.line}: {key!r} is not a key of recordings; left out.")
    return Header(path, channels, entries), tuple(unknown)


def _listed(
    key: str, value: str, names: Sequence[str], timed: bool, delimiter: str, line: Entry
) -> dict[str, Entry]:
    """The values of a list by channel; the column of times may have a value of its own."""
    mark = delimiter if delimiter in value else ","
    values = [Entry(one.strip(), line.file, line.line) for one in value.split(mark)]
    if timed and len(values) == len(names) + 1:
        values = values[1:]
    return spread(key, values, names, line)


def _own_key(key: str, names: Sequence[str]) -> tuple[str, str] | None:
    """Channel and key of `acc_1.unit` or `unit.acc_1`."""
    for name in names:
        lowered = name.lower()
        for own in CHANNEL_KEYS:
            if any(key in (f"{lowered}{dot}{own}", f"{own}{dot}{lowered}") for dot in "._ "):
                return name, own
    return None


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
