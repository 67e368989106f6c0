"""Tension and stiffness of a hanger over time and with the temperature, as its report shows them.

The period that a report looks at: since when, what lies in it, how one writes it.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from typing import TYPE_CHECKING

import numpy as np

from shm.errors import UsageError
from shm.values import (
    NAN,
    TENSION,
    BoolArray,
    FloatArray,
    Hanger,
    TemperatureCoefficient,
    WatchedQuantity,
)
from shm.watch.engine.state import Band, StateHistory, StateOptions, set_free, states
from shm.watch.words.alert_text import called_words, quantity_words
from shm.watch.words.notices import off_the_baseline

if TYPE_CHECKING:
    from shm.watch import Watched

_SPAN = re.compile(r"(\d{1,5})\s*([dwmy])", re.IGNORECASE)
_DAYS = {"d": 1.0, "w": 7.0, "m": 365.25 / 12, "y": 365.25}  # a Julian year and its twelfth
_REMEDY = "Give a date such as 2026-03-01, or a span such as 90d, 12w, 6m or 1y."


@dataclass(frozen=True)
class Period:
    """From `since` on, up to the moment `until` at which the report is made; both are aware."""

    since: datetime
    until: datetime

    def holds(self, time: datetime | None) -> bool:
        """Return True if `time` is in it or ahead of it; an unknown one is not."""
        return time is not None and time >= self.since

    def __str__(self) -> str:
        """Return `2026-03-01 to 2026-05-25`."""
        return f"{_day(self.since)} to {_day(self.until)}"


def period_since(wording: str, now: datetime) -> Period:
    """Parse the period that a person writes: `2026-03-01`, `2026-03-01T10:00`, `90d`, `12w`, `6m`.

    A date is taken in UTC, a month as the twelfth of a year (`1y`). Raises UsageError where it
    is neither, or is after `now`.
    """
    since = _since(wording.strip(), now)
    if since >= now:
        raise UsageError(f"a period since {_day(since)} has not begun yet.", remedy=_REMEDY)
    return Period(since, now)


def period_json(period: Period | None) -> dict[str, datetime] | None:
    """Return the period in a JSON document."""
    return {"since": period.since, "until": period.until} if period else None


def _since(wording: str, now: datetime) -> datetime:
    try:
        if found := _SPAN.fullmatch(wording):
            return now - timedelta(days=int(found[1]) * _DAYS[found[2].lower()])
        since = datetime.fromisoformat(wording)
    except (ValueError, OverflowError):
        raise UsageError(
            f"{wording!r} is neither a date nor a span of time.", remedy=_REMEDY
        ) from None
    return since.replace(tzinfo=UTC) if since.tzinfo is None else since


def _day(time: datetime) -> str:
    return f"{time.astimezone(UTC):%Y-%m-%d}"


@dataclass(frozen=True, eq=False)
class QuantityOverTime:
    """One quantity at n tests: what each says by itself, filtered and smoothed, each (n,).

    The tension is in N, a stiffness the log10 of it in its `unit`. `title` is what people call it.
    """

    name: str
    title: str
    read: Band
    filtered: Band
    smoothed: Band
    baseline: float
    unit: str = ""

    @property
    def is_tension(self) -> bool:
        return self.name == TENSION

    def at(self, chosen: BoolArray) -> QuantityOverTime:
        """Return the same at the `chosen` tests, shape (n,)."""
        bands = (self.read, self.filtered, self.smoothed)
        read, filtered, smoothed = (
            Band(band.low[chosen], band.middle[chosen], band.high[chosen]) for band in bands
        )
        return replace(self, read=read, filtered=filtered, smoothed=smoothed)

    def where(self, known: BoolArray) -> QuantityOverTime:
        """Return the same with NaN at tests that are not `known` (n,)."""
        bands = (self.read, self.filtered, self.smoothed)
        read, filtered, smoothed = (
            Band(*(np.where(known, each, np.nan) for each in (band.low, band.middle, band.high)))
            for band in bands
        )
        return replace(self, read=read, filtered=filtered, smoothed=smoothed)


@dataclass(frozen=True)
class CalledChange:
    """A change that was called: when it began, with 90 % probability, and a few words for it."""

    began_after: datetime
    began_by: datetime
    words: str


@dataclass(frozen=True, eq=False)
class StatesOverTime:
    """All that the figure shows of a hanger's n tests, oldest first.

    `outlier` (n,) marks readings taken as blunders. Of a test that no state explains nothing is
    known: its bands are NaN. `temperatures_c` (n,) is NaN where unknown; levels hold at
    `reference_temperature_c`, NaN where no temperature is known.
    `temperature_coefficients` are per kelvin, beside what the softening of steel explains.
    """

    times: tuple[datetime, ...]
    temperatures_c: FloatArray
    reference_temperature_c: float
    outlier: BoolArray
    quantities: tuple[QuantityOverTime, ...]
    changes: tuple[CalledChange, ...] = ()
    temperature_coefficients: tuple[TemperatureCoefficient, ...] = ()

    def within(self, period: Period | None) -> StatesOverTime:
        """Return the states at the tests of a period, and the changes that may have begun in it."""
        if period is None:
            return self
        inside = np.array([period.holds(time) for time in self.times], bool)
        return replace(
            self,
            times=tuple(time for time in self.times if period.holds(time)),
            temperatures_c=self.temperatures_c[inside],
            outlier=self.outlier[inside],
            quantities=tuple(each.at(inside) for each in self.quantities),
            changes=tuple(each for each in self.changes if each.began_by >= period.since),
        )


NOTHING_WATCHED = StatesOverTime((), np.empty(0), NAN, np.empty(0, bool), ())


def states_over_time(watched: Watched, hanger: Hanger) -> StatesOverTime:
    """Return the states of a hanger at all tests, at the baseline's mean temperature."""
    outlier = np.array([each.change.outlier_probability for each in watched.watch.tests])
    columns = watched.reader.columns
    explained = np.array([not off_the_baseline(each, columns).any() for each in watched.readings])
    calls = [call.change for call in watched.watch.calls]
    reference_c = watched.reader.reference_temperature_c
    options = StateOptions.of(hanger.assumptions, reference_temperature_c=reference_c)
    changes = set_free(calls, watched.readings)
    weights = np.where(explained, outlier, 1.0)
    history = states(watched.readings, watched.reader.quantities, weights, changes, options)
    return StatesOverTime(
        history.times,
        history.temperatures_c,
        history.reference_temperature_c,
        outlier > 0.5,
        tuple(_over_time(each, history).where(explained) for each in watched.reader.quantities),
        tuple(CalledChange(call.began_after, call.began_by, called_words(call)) for call in calls),
        history.temperature_coefficients(),
    )


def _over_time(quantity: WatchedQuantity, history: StateHistory) -> QuantityOverTime:
    return QuantityOverTime(
        quantity.name,
        quantity_words(quantity.name, quantity.end, quantity.plane),
        history.read(quantity.name),
        history.filtered(quantity.name),
        history.smoothed(quantity.name),
        quantity.baseline,
        quantity.unit,
    )
