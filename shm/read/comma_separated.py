"""CSV: `# key: value` lines, the names of the columns, then numbers.

    # hanger: 3
    # time: 2026-05-01T10:00:00Z
    # temperature_c: 12
    # sampling_rate_hz: 512
    # plane: , transverse, longitudinal
    # unit: N, m/s2, m/s2
    # x_m: 1.92, 2.52, 2.52
    force,acc_1,acc_2
    0.12,0.003,-0.001

What belongs to a column may also stand alone: `# acc_1.unit: g`, a unit in its name, `acc_1 [g]`.
Columns may be separated by
commas, semicolons (then with decimal commas, if need be) or tabs. A first column `time`, in
seconds, is checked against the sampling rate, or gives it. Any other heading is understood as
`logger_text` says.

A first column `frequency` makes it frequency responses, with real and imaginary parts:

    frequency,low_real,low_imaginary,low_coherence,high_real,high_imaginary,high_coherence
    0,0.12,0,0.99,0.05,0,0.98

Columns of coherence may be missing. An analyser's export is read too: free lines before the names
(Frequency, Real, Imaginary), and one of units between names and numbers.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from datetime import datetime
from functools import cache, partial
from pathlib import Path

import numpy as np

from shm.errors import BadInput, UsageError
from shm.read.atomic import replace_text
from shm.read.base import names_in
from shm.read.content import LINE_BREAK, cells_of, mark_between
from shm.read.header import CHANNEL_KEYS, KEYS, Entry, Header, condition_entries, spread
from shm.read.limits import refuse_long_header
from shm.read.logger_words import ACCELERANCE, SI, name_and_unit, plain_unit, seconds_of
from shm.read.table import Column, Role, Table
from shm.values import NAN, Channel, FloatArray, FrequencyResponse, Recording, ResponsePoint

_TIME = re.compile(r"t|time([ _]?s)?", re.IGNORECASE)
_PLAIN = re.compile(r"[^,;\t\r\n#\"]+")
_MISSING = {"", "nan", "na", "n/a", "null", "none", "-"}
_SAMPLE = "a line of names such as force,acc_1,acc_2"
_FREE_LINES = 60  # before the names of an analyser's export
_PARTS = {
    "real": "real", "re": "real", "imaginary": "imaginary", "imag": "imaginary", "im": "imaginary",
    "coherence": "coherence", "coh": "coherence",
}  # fmt: skip
_PART = re.compile(rf"(?:(.*?)[ _.])?({'|'.join(_PARTS)})( part)?(\s*[\[(][^\])]*[\])]\s*)?", re.I)


def response_in(text: str, path: Path) -> Table | None:
    """Return the frequency responses in a text; None where no line names frequencies."""
    lines = LINE_BREAK.split(text)
    at = next((i for i, line in enumerate(lines[:_FREE_LINES]) if _names_frequency(line)), None)
    return None if at is None else _Text(lines, path, at).responses()


def record_in(text: str, path: Path) -> Table:
    """Return the time record that a text of ours holds; raises BadInput."""
    return _Text(LINE_BREAK.split(text), path).record()


def _names_frequency(line: str) -> bool:
    cells = cells_of(line, mark_between(line))
    return len(cells) > 2 and cells[0].lower().startswith("freq")


class _Text:
    """A text whose columns are named in line `at` (from 0), by default the first that is filled."""

    def __init__(self, lines: Sequence[str], path: Path, at: int | None = None):
        self.lines, self.path = lines, path
        if at is None:
            filled = (i for i, line in enumerate(lines) if line.strip() and not _is_remark(line))
            at = next(filled, None)
        if at is None:
            raise self._refusal("there are no columns in it", f"Begin with {_SAMPLE}, then numbers")
        refuse_long_header(sum(map(len, lines[: at + 1])), path)
        self.at, self.mark = at, mark_between(lines[at])
        self.names = cells_of(lines[at], self.mark)
        self.units: dict[str, str] = {}

    def record(self) -> Table:
        for at, text in enumerate(self.names):
            if text.endswith(("]", ")")):
                self.names[at], unit = name_and_unit(text)
                self.units[self.names[at]] = unit
        self._refuse_names()
        first = self.names[0]
        in_seconds = seconds_of(self.units.get(first, "s")) is not None
        timed = in_seconds and _TIME.fullmatch(first) is not None
        names = self.names[timed:]
        header, remarks = self._header(names)
        body = self._body(self.at + 1)
        rows = cache(partial(self._numbers, body))  # a peek does without, but for times
        columns = []
        for at, name in enumerate(self.names):
            stated = header.channels.get(name, {})
            unit = stated["unit"].text if "unit" in stated else self.units.get(name, "")
            role: Role = "times" if timed and at == 0 else "channel"
            load = partial(lambda at: rows()[at], at)
            columns.append(Column(name, len(body), load, unit, role, stated))
        return Table(
            self.path,
            tuple(columns),
            header.entries,
            ("shm", *names),
            problems=remarks,
            remarks=remarks,
            line_of=lambda row: body[row][0],
        )

    def responses(self) -> Table:
        self.names = [name for name in self.names if name]
        places = self._points()
        below = range(self.at + 1, len(self.lines))
        body = next((i for i in below if self._is_numbers(i)), len(self.lines))
        header, remarks = self._header(list(places))
        for i in range(self.at + 1, body):  # an analyser's line of units
            cells = [cell for cell in cells_of(self.lines[i], self.mark) if cell]
            if len(cells) > 1 and cells[0] == "Hz":
                unit = {"unit": Entry(cells[1], self.path, i + 1)}
                channels = {name: {**unit, **stated} for name, stated in header.channels.items()}
                header = Header(self.path, channels, header.entries)
        rows = self._numbers(self._body(body))
        columns = [Column(self.names[0], rows[0].size, rows[0].copy, "Hz", "frequencies")]
        for name, parts in places.items():
            values = rows[parts["real"]] + 1j * rows[parts["imaginary"]]
            stated = header.channels[name]
            columns.append(
                Column(name, values.size, values.copy, "", "response", stated, is_complex=True)
            )
            if "coherence" in parts:
                share, both = rows[parts["coherence"]], f"{name}_coherence"
                columns.append(Column(both, share.size, share.copy, "", "coherence"))
        return Table(
            self.path, tuple(columns), header.entries, tuple(places), problems=remarks,
            remarks=remarks,
        )  # fmt: skip

    def _points(self) -> dict[str, dict[str, int]]:
        """Return the columns of each point; a point without a name is point_1, point_2, ..."""
        places: dict[str, dict[str, int]] = {}
        for place, column in enumerate(self.names[1:], start=1):
            found = _PART.fullmatch(column)
            if found is None:
                raise self._no_response(f"the column {column!r} is no part of a response")
            part = _PARTS[found[2].lower()]
            nameless = sum(name.startswith("point_") for name in places) + (part == "real")
            parts = places.setdefault(found[1] or f"point_{nameless}", {})
            if part in parts:
                raise self._no_response(f"the column {column!r} occurs twice")
            parts[part] = place
        if not all({"real", "imaginary"} <= set(parts) for parts in places.values()):
            raise self._no_response("a real or an imaginary part is missing")
        return places

    def _refuse_names(self) -> None:
        if all(_number(name) is not None for name in self.names if name):
            remedy = f"Put {_SAMPLE} before the numbers"
            raise self._refusal("the names of the columns are missing", remedy, self.at)
        for name in self.names:
            if not name or self.names.count(name) > 1:
                what = f"the column name {name!r} occurs twice" if name else "a column has no name"
                raise self._refusal(what, "Give each column its own name", self.at, name)

    def _header(self, names: Sequence[str]) -> tuple[Header, tuple[str, ...]]:
        """Return the header of the lines above the names, and remarks on unknown keys."""
        channels: dict[str, dict[str, Entry]] = {name: {} for name in names}
        keys = {f"{a}{dot}{b}": (n, k) for n in names for k in CHANNEL_KEYS for dot in "._ "
                for a, b in ((n.lower(), k), (k, n.lower()))}  # fmt: skip
        entries: dict[str, Entry] = {}
        remarks = []
        for line, text in enumerate(self.lines[: self.at], start=1):
            if ":" not in text or not _is_remark(text):
                continue
            key, _, value = text.strip().strip('"').lstrip("# \t").partition(":")
            key, value = key.strip().lower(), value.strip()
            entry = Entry(value.strip(f"{self.mark},; "), self.path, line)
            if key in KEYS:
                _state(entries, key, entry)
            elif key in CHANNEL_KEYS:
                cells = value.split(self.mark if self.mark in value else ",")
                if len(cells) == len(names) + 1 == len(self.names):
                    del cells[0]  # of the column of times
                listed = [Entry(cell.strip(), self.path, line) for cell in cells]
                for name, each in spread(key, listed, names, entry).items():
                    _state(channels[name], key, each, name)
            elif key in keys:
                name, channel_key = keys[key]
                _state(channels[name], channel_key, entry, name)
            else:
                remarks.append(f"line {line}: {key!r} is not a key of recordings; left out.")
        for name, unit in self.units.items():
            stated = channels.get(name, {})
            if unit and name in channels and not ("unit" in stated and "calibration" in stated):
                _state(stated, "unit", Entry(unit, self.path, self.at + 1), name)
        return Header(self.path, channels, entries), tuple(remarks)

    def _body(self, start: int) -> list[tuple[int, str]]:
        """Return the lines with numbers, each with its number."""
        body = [(i + 1, self.lines[i]) for i in range(start, len(self.lines))]
        return [(i, line) for i, line in body if line.strip(" \t\x1a") and not _is_remark(line)]

    def _numbers(self, body: list[tuple[int, str]]) -> FloatArray:
        """Return all columns (columns, rows), empty cells as NaN."""
        if self.mark != ",":
            body = [(i, line.replace(",", ".")) for i, line in body]
        lines = [line for _, line in body]
        try:
            rows = np.loadtxt(lines, delimiter=self.mark, ndmin=2) if lines else np.zeros((0, 0))
            is_plain = rows.shape[1] == len(self.names) and not np.isinf(rows).any()
        except ValueError:
            is_plain = False
        if not is_plain:  # find the fault, or the empty cells
            rows = np.array([self._row(line, i) for i, line in body]).reshape(-1, len(self.names))
        return np.ascontiguousarray(rows.T)

    def _row(self, line: str, number: int) -> list[float]:
        cells = cells_of(line.split("#")[0], self.mark)
        if len(cells) != len(self.names):
            what = f"{len(cells)} values where the names of the columns are {len(self.names)}"
            remedy = "Complete or remove the line; a bad value may be left empty"
            raise self._refusal(what, remedy, number - 1)
        values = [NAN if cell.lower() in _MISSING else _number(cell) for cell in cells]
        for cell, value, name in zip(cells, values, self.names, strict=True):
            if value is None or math.isinf(value):
                what = "the value is infinite" if value else f"{cell[:40]!r} is not a number"
                remedy = "Leave the cell empty where the logger failed"
                remedy = remedy if value else "Correct it, or leave it empty"
                raise self._refusal(what, remedy, number - 1, name)
        return [value for value in values if value is not None]

    def _is_numbers(self, at: int) -> bool:
        cells = [cell for cell in cells_of(self.lines[at], self.mark) if cell]
        return len(cells) > 2 and all(_number(cell.replace(",", ".")) is not None for cell in cells)

    def _no_response(self, what: str) -> BadInput:
        remedy = "Head the columns frequency, acc_1_real, acc_1_imaginary, acc_2_real, ..."
        return self._refusal(what, remedy, self.at)

    def _refusal(
        self, what: str, remedy: str, at: int | None = None, channel: str = ""
    ) -> BadInput:
        line = None if at is None else at + 1
        return BadInput(f"{what}.", file=self.path, channel=channel, line=line, remedy=f"{remedy}.")


def _state(entries: dict[str, Entry], key: str, entry: Entry, channel: str = "") -> None:
    """Add an entry; raises BadInput where an earlier line states another value of its key."""
    before = entries.get(key, entry)
    if before.text and entry.text and not _agree(before.text, entry.text):
        raise entry.refusal(
            f"{key} = {entry.text}, but line {before.line} states {before.text}.",
            "Remove the line that is wrong.",
            channel,
        )
    entries[key] = entry if entry.text else before


def _agree(one: str, other: str) -> bool:
    """Return True for the same unit, number or time, however it is written."""
    if plain_unit(one) == plain_unit(other):
        return True
    (first, *unit), (second, *other_unit) = one.split(maxsplit=1), other.split(maxsplit=1)
    numbers = _number(first), _number(second)
    if None not in numbers:
        return numbers[0] == numbers[1] and (unit == other_unit or not (unit and other_unit))
    try:
        return datetime.fromisoformat(one) == datetime.fromisoformat(other)
    except ValueError:
        return False


def _is_remark(line: str) -> bool:
    return line.strip().strip('"').startswith("#")


def _number(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None


# ---------------------------------------------------------------- writing


def write(described: Recording | FrequencyResponse, path: Path) -> None:
    for name in names_in(described):
        if not _PLAIN.fullmatch(name):
            raise UsageError(
                f"the channel name {name!r} cannot head a column.",
                remedy="Leave out commas, semicolons, quotes, # and line breaks.",
            )
    if isinstance(described, FrequencyResponse):
        replace_text(path, response_text(described))
    else:
        replace_text(path, recording_text(described))


def recording_text(recording: Recording) -> str:
    """Return rows of nine digits, one more than a 24-bit converter gives."""
    channels = recording.channels
    facts = {
        "sampling_rate_hz": recording.sampling_rate_hz,
        **_places(channels),
        "unit": [SI[c.quantity] if c.states_unit else "" for c in channels],
        "full_scale": [channel.full_scale for channel in channels],
    }
    return _text(recording, facts, {c.name: c.values for c in channels}, "%.9g")


def response_text(response: FrequencyResponse) -> str:
    """Return a column of frequencies, then of each point real and imaginary part and coherence."""
    columns = {"frequency": response.frequency_hz}
    for row, point in enumerate(response.points):
        columns[f"{point.name}_real"] = response.accelerance[row].real
        columns[f"{point.name}_imaginary"] = response.accelerance[row].imag
        if response.coherence is not None:
            columns[f"{point.name}_coherence"] = response.coherence[row]
    facts = {**_places(response.points), "unit": [ACCELERANCE] * len(response.points)}
    return _text(response, facts, columns, "%.15g")


def _text(
    described: Recording | FrequencyResponse,
    facts: Mapping[str, object],
    columns: Mapping[str, FloatArray],
    digits: str,
) -> str:
    whole = {
        **condition_entries(described),
        **facts,
    }
    head = [
        f"# {key}: {text}\n"
        for key, value in whole.items()
        if (text := _as_text(value)).strip(", ")
    ]
    rows = np.column_stack(list(columns.values()))
    row = ",".join([digits] * len(columns)) + "\n"
    body = (row * len(rows)) % tuple(rows.ravel().tolist())
    return "".join([*head, ",".join(columns), "\n", body])


def _places(points: Sequence[Channel] | Sequence[ResponsePoint]) -> dict[str, object]:
    return {"plane": [point.plane for point in points], "x_m": [point.x_m for point in points]}


def _as_text(value: object) -> str:
    """Return a value, or a list of one for each column, as text; empty where unknown."""
    if isinstance(value, list):
        return ", ".join(map(_as_text, value))
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return ""
    return repr(float(value)) if isinstance(value, float) else str(value)
