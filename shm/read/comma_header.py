"""The heading of a CSV file: `# key: value` lines and the names of its columns."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from shm.errors import BadInput
from shm.read.header import CHANNEL_KEYS, KEYS, Entry, Header, spread
from shm.read.limits import refuse_long_header

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
    if all(_is_number(name) for name in columns if name):
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


def _is_number(text: str) -> bool:
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
