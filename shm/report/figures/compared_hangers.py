"""Several hangers over one time axis: how far the tension of each is from its own baseline."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime

from shm.report import formatting
from shm.report.figures import specification as spec
from shm.report.figures.time_axes import bounds_of, level, part, places, thinned_words, time_axis
from shm.report.formatting import Interval
from shm.values.rounding import rounded_percent

_MARKS: tuple[tuple[str, spec.Symbol], ...] = (
    ("blue", "circle"),
    ("orange", "square"),
    ("green", "diamond"),
    ("purple", "triangle"),
    ("red", "triangle down"),
    ("ink", "cross"),
)
MOST = len(_MARKS)
"""Hangers in one figure: more could not be told apart by colour and symbol."""


@dataclass(frozen=True)
class TensionShifts:
    """A hanger's n tests: shifts of the tension as fractions, with 90 % of their repeatability."""

    name: str
    times: Sequence[datetime]
    tests: Sequence[str]
    shifts: Sequence[Interval]


def specify(courses: Sequence[TensionShifts]) -> spec.Specification:
    """Return one panel in which each hanger has its colour and symbol."""
    marks: list[spec.Mark] = [level(0.0, "baseline", "quiet", "dot")]
    for course, (colour, symbol) in zip(courses, _MARKS, strict=False):
        marks += _marks(course, colour, symbol)
    axis = spec.Axis(label="tension since the baseline (%)")
    times = [time for course in courses for time in course.times]
    return spec.stacked([spec.Panel(y=axis, marks=marks, x=time_axis(times))], 3.8, MOST + 1)


def _marks(course: TensionShifts, colour: str, symbol: spec.Symbol) -> list[spec.Mark]:
    bounds = bounds_of(course.shifts)
    chosen = places(bounds.middle, bounds.low, bounds.high)
    shown = part(bounds, chosen, 100)  # in percent
    when = [course.times[place] for place in chosen.tolist()]
    texts = [
        f"{course.name}, {course.tests[place]}: {_words(course.shifts[place])}"
        for place in chosen.tolist()
    ]
    return [
        spec.Line(x=when, y=shown.middle, colour=colour, width=0.9, opacity=0.5),
        spec.Points(
            x=when, y=shown.middle, low=shown.low, high=shown.high, caps=False, colour=colour,
            symbol=symbol, name=course.name, texts=texts,
        ),
    ]  # fmt: skip


def _words(shift: Interval) -> str:
    return rounded_percent(shift.mean, shift.width / 2, "+")


def caption(courses: Sequence[TensionShifts]) -> str:
    """Explain what is seen."""
    return (
        "Tension of each test since the hanger's own baseline; bars: 90 % repeatability. "
        "The temperature is not compensated here: what all hangers do together is the weather, "
        "the deck's load or the logger's clock; what one does alone is its own."
        f"{thinned_words(max(len(course.times) for course in courses))}"
    )


def alt(courses: Sequence[TensionShifts]) -> str:
    """Return the latest value of each hanger for a blind reader."""
    latest = [
        f"{each.name} {_words(each.shifts[-1])} over {formatting.counted(len(each.times), 'test')}"
        for each in courses
    ]
    return f"Tension since the baseline, latest test: {'; '.join(latest)}."
