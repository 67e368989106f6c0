"""A stream of permanent sensors over time: spectrum, tracked frequencies, tension, health."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta

import numpy as np

from shm.report import formatting
from shm.report.figures import specification as spec
from shm.values import FloatArray
from shm.values.rounding import NINETY_PERCENT
from shm.values.stream import PERIODS, Period, StreamEvent
from shm.watch.engine.state import Band as Bounds

_HUES = ("blue", "orange", "green", "purple")
_SHOWN_MODES = len(_HUES)
_BREAK = 3  # judgement: after three missing hours, or days, a line would be a guess
_PACE = {"hour": "from hour to hour", "six hours": "every six hours", "day": "from day to day"}
_OF_HEALTH = ("dead", "drifting", "swapped", "saturated", "clock step", "lost modes", "thermometer")


@dataclass(frozen=True, eq=False)
class StreamHistory:
    """`spectrum_db` (windows, lines) over `line_hz` (lines,), empty where none was kept.

    `hours` are the middles of hours, or of what they are pooled to (`period`). `modes` are their
    frequencies (hours,) and sds by name, NaN where a mode was not followed; `tension` is the change
    since the beginning in per cent with its 90 % interval.
    """

    stream: str
    window_times: Sequence[datetime]
    line_hz: FloatArray
    spectrum_db: FloatArray
    hours: Sequence[datetime]
    modes: Mapping[str, tuple[FloatArray, FloatArray]]
    tension: Bounds
    events: Sequence[StreamEvent] = ()
    period: Period = "hour"

    @property
    def has_tension(self) -> bool:
        """Return True if the watch has learnt enough to state a tension of any hour."""
        return bool(np.isfinite(self.tension.middle).any())

    @property
    def followed(self) -> dict[str, tuple[FloatArray, FloatArray]]:
        """The modes that were followed longest, the lowest of these."""
        seen = {name: int(np.isfinite(hz).sum()) for name, (hz, _) in self.modes.items()}
        names = sorted(sorted(seen, key=lambda name: -seen[name])[:_SHOWN_MODES])
        return {name: self.modes[name] for name in names if seen[name]}


def specify(course: StreamHistory) -> spec.Specification:
    """Return panels over one time axis: spectrum, frequencies, tension with sensor events."""
    when = [*course.window_times, *course.hours]
    time = spec.Axis(label="time (UTC)", scale="date", range=(min(when), max(when)))
    panels = [_spectrogram(course)] if course.spectrum_db.size else []
    panels += [_frequencies(course)]
    panels += [_tension(course)] if course.has_tension else []
    panels[-1] = spec.Panel(**{**vars(panels[-1]), "x": time})
    return spec.stacked(panels, 6.4)


def _spectrogram(course: StreamHistory) -> spec.Panel:
    z = course.spectrum_db.T
    floor, top = np.nanquantile(z, [0.1, 0.995])
    heat = spec.Heat(
        x=course.window_times, y=course.line_hz, z=np.clip(z, floor, top), colour="ink"
    )
    return spec.Panel(
        y=spec.Axis(label="frequency (Hz)", grid=False), marks=[heat], height=1.4,
        title_side="left", title="Spectrum",
    )  # fmt: skip


def _frequencies(course: StreamHistory) -> spec.Panel:
    marks: list[spec.Mark] = []
    for (name, (hz, sd)), hue in zip(course.followed.items(), _HUES, strict=False):
        middle = float(np.nanmedian(hz))
        shift, reach = 100 * (hz / middle - 1), 100 * NINETY_PERCENT * sd / middle
        times, shift, reach = _broken(course, shift, reach)
        marks.append(
            spec.Band(x=times, low=shift - reach, high=shift + reach, colour=hue, opacity=0.2)
        )
        texts = [f"{name}: {middle * (1 + each / 100):.4f} Hz" for each in shift]
        label = f"{name} ({middle:.3g} Hz)"
        marks.append(spec.Line(x=times, y=shift, colour=hue, name=label, texts=texts))
    return spec.Panel(
        y=spec.Axis(label="change (%)"), marks=marks, title="Tracked frequencies", title_side="left"
    )


def _tension(course: StreamHistory) -> spec.Panel:
    low, middle, high = course.tension.low, course.tension.middle, course.tension.high
    times, middle, reach = _broken(course, middle, (high - low) / 2)
    texts = [f"{each:+.2f} %" for each in middle]
    marks: list[spec.Mark] = [
        spec.Rule(at=0.0, colour="quiet", dash="dash"),
        spec.Band(x=times, low=middle - reach, high=middle + reach, colour="ink", opacity=0.15),
        spec.Line(x=times, y=middle, colour="ink", width=1.3, name="tension", texts=texts),
        *_health(course.events),
    ]
    return spec.Panel(
        y=spec.Axis(label="change (%)", range=spec.limits(low, high, [-0.5, 0.5])), marks=marks,
        title="Tension since the beginning, 90 % interval", title_side="left", height=1.2,
    )  # fmt: skip


def _health(events: Sequence[StreamEvent]) -> list[spec.Span]:
    wording = [each for each in events if each.kind in _OF_HEALTH]
    return [
        spec.Span(
            low=each.start, high=max(each.end, each.start + timedelta(minutes=10)), opacity=0.15,
            colour="red", name="sensor or clock at fault",
        )
        for each in wording
    ]  # fmt: skip


def _broken(
    course: StreamHistory, *values: FloatArray
) -> tuple[list[datetime], FloatArray, FloatArray]:
    """Return two courses with a NaN in each long gap, so that no line bridges it."""
    hours, longest = course.hours, _BREAK * PERIODS[course.period]
    places = [n for n in range(1, len(hours)) if hours[n] - hours[n - 1] > longest]
    times = list(hours)
    for n in reversed(places):
        times.insert(n, hours[n - 1] + longest / 2)
    first, second = (np.insert(each, places, np.nan) for each in values)
    return times, first, second


def caption(course: StreamHistory) -> str:
    """Explain what is seen, panel by panel."""
    below = (
        "Below: the change of tension that they mean, and when a sensor or the clock was at fault."
        if course.has_tension
        else "No tension yet: the watch learns first how the hanger moves with the weather."
    )
    return (
        "Above: the power of all channels, dark where it is strong. Then the frequencies followed "
        f"{_PACE[course.period]}, as changes of their medians, with 90 % intervals. {below}"
    )


def alt(course: StreamHistory) -> str:
    """Return how many modes are followed and the last tension, for a blind reader."""
    known = np.flatnonzero(np.isfinite(course.tension.middle))
    modes = formatting.counted(len(course.followed), "mode")
    if not len(known):
        return f"Stream {course.stream}: {modes} followed; no tension yet."
    last = int(known[-1])
    low, high = course.tension.low[last], course.tension.high[last]
    return (
        f"Stream {course.stream}: {modes} followed; tension at last "
        f"{course.tension.middle[last]:+.2f} % (90 %: {low:+.2f} to {high:+.2f} %)."
    )
