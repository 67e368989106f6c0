"""One table of what is assumed of hangers, sensors and measurements before any data.

Every physical default, prior and scatter is a row of `assumptions.csv`: `DEFAULTS` holds them, and
a hanger has those of its bridge (`Hanger.assumptions`), where `[assumptions]` of `bridge.toml` may
replace rows.
Steps, tolerances and counts of draws are no assumptions and stay with the code that needs them.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

DEFAULT = "default"
FILE = "bridge.toml"
_TEXTS = ("name", "unit", "source", "reason")


@dataclass(frozen=True)
class Assumption:
    """One row: a value with its standard deviation, or a range of values.

    A row has a `value`, or a range from `lower` to `upper`, or both; `sd` is the standard deviation
    of the value, and NaN where the value itself is one. What a row does not have is NaN. `least`
    and `most` bound what an owner may write, `least_sd` the standard deviation. `least_beta` is the
    smallest parameter that a Beta distributed row may have, NaN where it is not Beta distributed.
    `origin` says who stated it.
    """

    name: str
    value: float
    unit: str
    source: str
    reason: str
    sd: float = math.nan
    lower: float = math.nan
    upper: float = math.nan
    least: float = 0.0
    most: float = math.inf
    origin: str = DEFAULT
    least_sd: float = 0.0
    least_beta: float = math.nan

    @property
    def has_value(self) -> bool:
        """Return True where the row is a number, not only a range."""
        return not math.isnan(self.value)

    @property
    def has_sd(self) -> bool:
        """Return True where the value has a standard deviation."""
        return not math.isnan(self.sd)

    @property
    def most_sd(self) -> float:
        """Return the largest standard deviation that goes with the value."""
        if math.isnan(self.least_beta):
            return math.inf
        smaller = min(self.value, 1 - self.value)
        return math.sqrt(self.value * (1 - self.value) / (1 + self.least_beta / smaller))

    @property
    def has_range(self) -> bool:
        """Return True where the row has a lower and an upper end."""
        return not math.isnan(self.lower)

    @property
    def bounds(self) -> tuple[float, float]:
        """Return the lower and the upper end of the range."""
        return self.lower, self.upper

    @property
    def rms(self) -> float:
        """Return the root mean square of what the value may be."""
        return math.hypot(self.value, self.sd)

    @property
    def decades(self) -> float:
        """Return the width of the range in powers of ten."""
        return math.log10(self.upper / self.lower)


@dataclass(frozen=True, repr=False)
class Assumptions(Mapping[str, Assumption]):
    """The table, frozen: rows by name (`table["poissons_ratio"]`) or as attributes.

    `overridden` are the rows that differ from the defaults, in the table's order.
    """

    overridden: tuple[Assumption, ...] = ()

    def __getitem__(self, name: str) -> Assumption:
        return _table(self.overridden)[name]

    def __getattr__(self, name: str) -> Assumption:
        if name in _NAMES:
            return self[name]
        raise AttributeError(f"there is no assumption {name!r}")

    def __iter__(self) -> Iterator[str]:
        return iter(_NAMES)

    def __len__(self) -> int:
        return len(_NAMES)

    def __repr__(self) -> str:
        stated = ", ".join(f"{row.name}={number_text(row)}" for row in self.overridden)
        return f"<Assumptions: {stated or 'the defaults'}>"

    def with_rows(self, *rows: Assumption) -> Assumptions:
        """Return the table with rows replaced by those of the same name.

        A row that is equal to the default but for its reason still counts as overridden.
        Raises KeyError for a name that the table does not have.
        """
        stated = {row.name: row for row in (*self.overridden, *rows)}
        for name in stated:
            _table(())[name]
        return Assumptions(tuple(stated[name] for name in _NAMES if name in stated))

    def with_numbers(self, origin: str = "code", **numbers: Any) -> Assumptions:
        """Return the table with values (a number) or ranges (a pair) replaced, by name.

        Example:
            >>> DEFAULTS.with_numbers(accelerometer_mass_kg=0.2).accelerometer_mass_kg.value
            0.2
        """
        rows = []
        for name, number in numbers.items():
            if isinstance(number, tuple):
                lower, upper = number
                rows.append(replace(self[name], lower=lower, upper=upper, origin=origin))
            else:
                rows.append(replace(self[name], value=float(number), origin=origin))
        return self.with_rows(*rows)

    def document(self) -> dict[str, dict[str, Any]]:
        """Return the overridden rows as a JSON document holds them, by name; often empty."""
        return {row.name: row_document(row) for row in self.overridden}


def row_document(row: Assumption) -> dict[str, Any]:
    """Return what a JSON document says of a row; numbers that it does not have are absent."""
    numbers = {"value": row.value, "sd": row.sd, "lower": row.lower, "upper": row.upper}
    return {
        **{key: number for key, number in numbers.items() if not math.isnan(number)},
        "unit": row.unit,
        "from": row.origin,
        "source": row.source,
        "reason": row.reason,
    }


def number_text(row: Assumption) -> str:
    """Return the numbers of a row in words: `0.05 ± 0.05`, `0.03 to 1000`."""
    words = []
    if row.has_value:
        words.append(f"{row.value:g}" + (f" ± {row.sd:g}" if row.has_sd else ""))
    if row.has_range:
        words.append(f"{row.lower:g} to {row.upper:g}")
    return ", ".join(words)


def _read_rows() -> Iterator[Assumption]:
    """Yield the rows of `assumptions.csv`; an empty cell is what a row does not have."""
    with Path(__file__).with_suffix(".csv").open(newline="", encoding="utf-8") as file:
        for cells in csv.DictReader(file):
            row: dict[str, Any] = {"value": math.nan}
            for key, cell in cells.items():
                if cell:
                    row[key] = cell if key in _TEXTS else float(cell)
            yield Assumption(**row)


_ROWS = tuple(_read_rows())
_NAMES = tuple(row.name for row in _ROWS)


@cache
def _table(overridden: tuple[Assumption, ...]) -> dict[str, Assumption]:
    return {row.name: row for row in (*_ROWS, *overridden)}


DEFAULTS = Assumptions()
