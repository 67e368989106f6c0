"""Parse the heading above the numbers of a logger's text: names, units, rate, time, hanger.

Names and units may be in one row (`Kraft [N]`), in two, or in rows that begin with a label
(`Einheit;s;N;g`). All other lines are a key and its value.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from shm.errors import BadInput
from shm.read import logger_words as words
from shm.read.logger_rows import Dialect, is_number, number_of
from shm.read.stamps import is_stamp
from shm.values import NAN

_NAME_LABELS = {
    "name", "names", "channel", "channels", "channelname", "kanal", "kanalname", "kanäle", "signal",
    "signalname", "sensor", "messstelle", "bezeichnung", "label", "channellabel",
}  # fmt: skip
_UNIT_LABELS = {"unit", "units", "einheit", "einheiten", "yunitlabel", "physicalunit", "dim",
    "dimension", "engineeringunits", "eu", "phyeinheit"}  # fmt: skip
_KEY = re.compile(r"\s*[:=]\s+|\s*=\s*|:\s*(?=\D|\d+(?:[.,]\d+)?\s*$)")
_RATE_IN_WORDS = re.compile(
    r"(?:rate|frequen|sampl|abtast|mess)\D{0,40}?(\d[\d.,]*)\s*(k?)(?:hz|s/s|sps|samples?/s)", re.I
)
_HERTZ = re.compile(r"(k?)(hz|s/s|sps|1/s|samples?/s(ec(ond)?)?|samples? ?per ?second)?", re.I)
_VALUE = re.compile(r"([+-]?\d[\d.,'eE+-]*)\s*(.*)")
_WITH_UNIT = re.compile(r"[^\s\[(]+(?:\s*[\[(][^\])]*[\])])?")
_MOSTLY = 0.6  # judgement: of a row of units, of which one may be spelt as nobody else does
_PLAIN_COUNTER = "column"


@dataclass(frozen=True)
class Heading:
    """`names` and `units` by column, "" where nothing says one.

    `facts` are keys and values of the preamble, `names_line` counts from 1, 0 without names.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    facts: tuple[tuple[str, str], ...]
    names_line: int


def heading_of(above: Sequence[str], dialect: Dialect) -> Heading:
    """Return the heading that the lines above the numbers give."""
    rows = {
        place: cells
        for place, line in enumerate(above)
        if (cells := _cells(line, dialect)) and len(cells) <= len(dialect.kinds) + 1
    }
    wide = {
        place: _padded(_axes_named(cells), dialect)
        for place, cells in rows.items()
        if len(cells) > 1
    }
    at = _names_at(wide, dialect)
    split = [words.name_and_unit(cell) for cell in wide.get(at, [""] * len(dialect.kinds))]
    if at in wide and words.key_of(wide[at][0]) in _NAME_LABELS:
        split[0] = ("", "")
    others = {place: cells for place, cells in wide.items() if place != at}
    units_at = _units_at(others, at, dialect)
    below = [_no_label(cell, place == 0) for place, cell in enumerate(others.get(units_at, []))]
    units = [(below[i] if below else "") or in_name for i, (_, in_name) in enumerate(split)]
    taken = {at, units_at}
    facts = [
        fact
        for place, line in enumerate(above)
        if place not in taken and (fact := _fact_at(place, above, dialect)) is not None
    ]
    names = distinct_names(tuple(name for name, _ in split))
    return Heading(names, tuple(units), tuple(facts), at + 1)


def _axes_named(cells: list[str]) -> list[str]:
    """Return cells in which `Acc [m/s2], 1, 2` are Acc, Acc 1 and Acc 2, all in that unit."""
    named: list[str] = []
    first, count = ("", ""), 0
    for cell in cells:
        count += 1
        if not (first[1] and cell == str(count)):
            first, count = words.name_and_unit(cell), 0
            named.append(cell)
        else:
            named.append(f"{first[0]} {cell} [{first[1]}]")
    return named


def _cells(line: str, dialect: Dialect) -> list[str]:
    """Return the cells of a line without empty ones at its end, and without a sign of remarks."""
    plain = line.lstrip("\ufeff#%! ") if line.strip() else ""
    cells = _blank_parted(plain, dialect) if dialect.mark == " " else dialect.cells(plain)
    while cells and not cells[-1]:
        cells.pop()
    return [cell.strip().strip('"').strip() for cell in cells]


def _blank_parted(line: str, dialect: Dialect) -> list[str]:
    """Return the names above columns that blanks part: a name may hold one, before its unit."""
    wide = [cell for cell in re.split(r"\s{2,}|\t", line.strip()) if cell]
    if len(wide) == len(dialect.kinds):
        return wide
    return [cell.strip() for cell in _WITH_UNIT.findall(line)]


def _padded(cells: list[str], dialect: Dialect) -> list[str]:
    return (cells + [""] * len(dialect.kinds))[: max(len(dialect.kinds), 1)]


def _no_label(text: str, is_first: bool) -> str:
    return "" if is_first and words.key_of(text) in _UNIT_LABELS else text.strip("[]() ")


def _names_at(rows: dict[int, list[str]], dialect: Dialect) -> int:
    """Return the index of the row that names the columns, the last of the best; -1 for none."""
    scored = {place: _score(cells, dialect) for place, cells in rows.items()}
    best = max(scored, key=lambda place: (scored[place], place), default=-1)
    return best if best >= 0 and scored[best] > 0 else -1


def _score(cells: Sequence[str], dialect: Dialect) -> float:
    """Return the score of a row as column names; 0 where it leaves numbers without a name."""
    needed = [c for c, kind in zip(cells, dialect.kinds, strict=True) if kind == "number"]
    named = [cell for cell in needed if cell and not is_number(cell, dialect.decimal)]
    if not named or all(map(words.is_unit, named)) or cells[0].endswith(":"):
        return 0.0
    if any(not cell or is_number(cell, dialect.decimal) for cell in needed[1:]):
        return 0.0
    labelled = words.key_of(cells[0]) in _NAME_LABELS
    if not labelled and (words.key_of(cells[0]) in _UNIT_LABELS or any(map(is_stamp, named))):
        return 0.0
    understood = sum(_is_understood(cell) for cell in cells if cell)
    return 1.0 + understood + 0.5 * labelled


def _is_understood(cell: str) -> bool:
    name, unit = words.name_and_unit(cell)
    return bool(unit) or words.means_time(name) or words.quantity_meant(name) is not None


def _units_at(rows: dict[int, list[str]], names_at: int, dialect: Dialect) -> int:
    """Return the row of units nearest to the names, -1 where there is none."""
    fitting = [place for place, cells in rows.items() if _are_units(cells, dialect)]
    return min(fitting, key=lambda place: abs(place - names_at), default=-1)


def _are_units(cells: Sequence[str], dialect: Dialect) -> bool:
    labelled = words.key_of(cells[0]) in _UNIT_LABELS
    texts = [_no_label(cell, place == 0) for place, cell in enumerate(cells) if cell]
    texts = [cell for cell in texts if cell]
    measured = [cell for cell in texts if words.unit_of(cell) or words.volts_of(cell)]
    if labelled:
        return bool(measured)
    known = sum(map(words.is_unit, texts))
    return (
        bool(measured) and len(texts) > 1 and (known == len(texts) or _MOSTLY * len(texts) <= known)
    )


_CHANNEL_UNIT = re.compile(
    r"\b(?:channel|kanal|ch|sensor)\W{0,3}(\d+)\W+(?:units?|einheit)\W+([^\s,;|]+)", re.IGNORECASE
)
_CHANNEL = re.compile(r"(?:channel|kanal|ch|sensor)\W{0,3}(\d+)", re.IGNORECASE)


def with_channel_units(heading: Heading, above: Sequence[str]) -> Heading:
    """Return a heading with the units that lines such as `,Channel,1,Units,G` give by number."""
    by_number = {f[1]: f[2] for line in above for f in _CHANNEL_UNIT.finditer(line)}
    units = []
    for name, unit in zip(heading.names, heading.units, strict=True):
        found = _CHANNEL.fullmatch(name.strip())
        units.append(unit or (by_number.get(found[1], "") if found is not None else ""))
    return replace(heading, units=tuple(units))


def distinct_names(names: Sequence[str]) -> tuple[str, ...]:
    """Return names of printable characters, each once; a column without one by its number."""
    taken: list[str] = []
    for place, name in enumerate(names, start=1):
        plain = "".join(c for c in name if c.isprintable() and ord(c) < 0x10000)[:60].strip()
        plain = plain or f"{_PLAIN_COUNTER}_{place}"
        twin, count = plain, 2
        while twin in taken:
            twin, count = f"{plain}_{count}", count + 1
        taken.append(twin)
    return tuple(taken)


def _fact_at(place: int, above: Sequence[str], dialect: Dialect) -> tuple[str, str] | None:
    """Return the fact of a line; where that is a key alone, `dt:`, its value is the line below."""
    plain = above[place].strip()
    if plain.endswith(":") and plain.count(":") == 1 and place + 1 < len(above):
        below = _cells(above[place + 1], dialect)
        return (plain[:-1], below[0]) if below else None
    return _fact(above[place], dialect)


def _fact(line: str, dialect: Dialect) -> tuple[str, str] | None:
    """Return key and value of a line of the preamble; a unit of the key is put after the value."""
    plain = line.strip().lstrip("\ufeff#%!* ").strip()
    cells = [cell for cell in _cells(line, dialect) if cell] if dialect.mark != " " else [plain]
    if len(cells) > 1 and not cells[0].rstrip().endswith(("=",)):
        key, value = cells[0].rstrip(":= "), _joined(cells[1:], dialect)
        if ":" not in key and "=" not in key:
            return _with_unit(key, value)
    parts = _KEY.split(plain.strip('"'), maxsplit=1)
    if len(parts) == 2 and parts[0].strip() and parts[1].strip():
        return _with_unit(parts[0].strip(), parts[1].strip(' "'))
    return ("", plain) if plain else None


def _joined(cells: Sequence[str], dialect: Dialect) -> str:
    """Return a value with its unit, or the first of several."""
    more = cells[1] if len(cells) > 1 and not is_number(cells[1], dialect.decimal) else ""
    return (
        f"{cells[0]} {more}".strip() if words.is_unit(more) or _HERTZ.fullmatch(more) else cells[0]
    )


def _with_unit(key: str, value: str) -> tuple[str, str]:
    name, unit = words.name_and_unit(key)
    return (name, f"{value} {unit}") if unit and _VALUE.fullmatch(value) else (key, value)


# ---------------------------------------------------------------- what the facts say


def _stated_rates(facts: Sequence[tuple[str, str]], decimal: str) -> dict[float, str]:
    """Return the sampling rates (Hz) that lines of a preamble state, each with its line."""
    stated: dict[float, str] = {}
    for key, value in facts:
        number, unit = leading_quantity(value, decimal)
        if not number > 0:
            continue
        hertz = _HERTZ.fullmatch(unit)
        seconds = words.seconds_of(unit) if unit else 1.0
        if words.means_rate(key) and hertz:
            stated.setdefault(number * (1e3 if hertz[1] else 1.0), f"{key}: {value}")
        elif words.means_interval(key) and seconds:
            stated.setdefault(1 / (number * seconds), f"{key}: {value}")
    return stated


def refuse_several_rates(facts: Sequence[tuple[str, str]], decimal: str, path: Path) -> None:
    """Raise BadInput where lines of a preamble state two rates that no rounded step explains."""
    stated = _stated_rates(facts, decimal)
    if stated and max(stated) > 1.05 * min(stated):
        raise BadInput(
            f"its heading states several sampling rates: {'; '.join(stated.values())}.",
            file=path,
            remedy="Remove the lines that are wrong.",
        )


def stated_rate(facts: Sequence[tuple[str, str]], decimal: str) -> float:
    """Return the sampling rate of a preamble in Hz; NaN where it gives none."""
    if stated := _stated_rates(facts, decimal):
        return next(iter(stated))
    for key, value in facts:
        found = _RATE_IN_WORDS.search(f"{key} {value}")
        if found is not None and "filter" not in f"{key} {value}".lower():
            number, _ = leading_quantity(found[1], decimal)
            return number * (1e3 if found[2] else 1.0)
    return NAN


def unrounded(
    rate_hz: float, times_hz: float, facts: Sequence[tuple[str, str]], decimal: str
) -> float:
    """Return `rate_hz`, or `times_hz` where the rounded step of the preamble means both."""
    for key, value in facts:
        number, unit = leading_quantity(value, decimal)
        seconds = (words.seconds_of(unit) if unit else 1.0) or math.nan
        found = _VALUE.fullmatch(value.strip())
        if words.means_interval(key) and found and abs(number * seconds * rate_hz - 1) < 1e-9:
            mantissa, _, exponent = found[1].lower().partition("e")
            decimals = len(re.split("[.,]", mantissa)[1]) if re.search("[.,]", mantissa) else 0
            digit_s = 10.0 ** (int(exponent or 0) - decimals) * seconds
            return times_hz if abs(1 / times_hz - 1 / rate_hz) <= digit_s else rate_hz
    return rate_hz


def leading_quantity(text: str, decimal: str) -> tuple[float, str]:
    """Return the number at the beginning of a text, and the text after it; NaN where there is none.

    A preamble does not always keep to the decimal mark of the numbers: 0.001 is a thousandth.
    """
    found = _VALUE.fullmatch(text.strip())
    if found is None:
        return NAN, ""
    broken = re.match(r"[+-]?0([.,])", found[1])
    marks = broken[1] if broken else (decimal, "," if decimal == "." else ".")
    for mark in marks:
        if is_number(found[1], mark):
            return number_of(found[1], mark), found[2].strip(" []()")
    return NAN, ""
