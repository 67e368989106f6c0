"""Causes of a change of the modes of a stream, by its pattern and by events of its sensors.

A tension moves each mode by its sensitivity, springs the lower ones of a stiff bar more, a time
base all alike, a sensor those of its plane, each as it likes. The hypotheses are compared by their
evidence; each leaves room for one mode that goes astray by itself.

How soft the ends are, the modes of a taut bar hardly tell: they are tried from soft to stiff. With
u = (alpha^2 + xi^2)^(1/2) of a mode and xi = L sqrt(T/EI), a spring k in EI/L shortens the bar by
L/u k/(k + u), so that a decade of it moves ln f by ln(10) k/(k + u)^2; k/xi and u/xi serve.
Tension has d ln f / d ln T = s = xi^2 / (2 u^2). Soft ends move the modes as the tension does.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import timedelta

import numpy as np

from shm.values import NAN, PLANES, Alert, BoolArray, Change, FloatArray, Moved
from shm.values.stream import StreamEvent
from shm.watch.stream_reading import ModeTable, planes_of

TIME_BASE = "timebase"
SWAPPED = "swapped"
EXCHANGED = (
    "The modes of each plane lie where those of the other did: the planes are exchanged, "
    "not the tension. Check the cables of the sensors."
)
_SENSOR, _UNEXPLAINED = "sensor_mass", "unexplained"
_MEASUREMENT = (TIME_BASE, SWAPPED, _SENSOR)
# Prior sds: 3 % of ln T, 0.3 decades (`quantities`), 1 % of a time base and of single modes.
_TENSION_SD, _DECADES_SD, _BASE_SD, _MODE_SD = 0.03, 0.3, 0.01, 0.01
# Of ln f: a sensor of 0.3 kg on or off a hanger of 300 kg. What is larger is no sensor's.
_SENSOR_SD = 1e-3
_ALIKE = 20.0  # a log Bayes factor of 3, as `Moved.alike` has it
_DAY_SD = 3e-4  # of ln f: joints that slip by another level, each mode by its own. Judgement
MODEL_OFF = 0.2  # judgement: of bending's share in a sensitivity, and of springs'
_APART = 0.5  # judgement: of a loosened end, between planes
_EACH_OFF = 0.05  # judgement: likewise, of each mode by itself
_SOFTNESS = (0.1, 0.3, 1.0, 3.0, 10.0)  # technical: of springs, k/xi; half a decade each
_LEFT_SD = 1e-3  # of ln T: what the conditions leave while something else changes
_ASTRAY_SD, _ASTRAY = 0.03, 0.02  # judgement: how far and how often a single mode goes astray
# Judgement: tensions, ends in both planes, ends in one, a time base, one plane's sensors, others.
_PRIORS = {
    "tension": 0.5,
    "ends": 0.1,
    "end": 0.1,
    TIME_BASE: 0.1,
    _SENSOR: 0.1,
    SWAPPED: 0.1,
    _UNEXPLAINED: 0.1,
}


@dataclass(frozen=True, eq=False)
class _Pattern:
    """A hypothesis of what moved n modes: along columns (n, k) of prior sd 1, modes off by `sd`."""

    name: str
    columns: FloatArray
    sd: FloatArray
    plane: str = ""
    mean: FloatArray | float = 0.0


@dataclass(frozen=True, eq=False)
class Cause:
    """The most probable cause, all that may have `moved`, and how each mode did."""

    name: str
    moved: tuple[Moved, ...]
    by_mode: FloatArray
    size: float
    plane: str = ""

    @property
    def is_measurement(self) -> bool:
        """Return True if it is none of the hanger, so that nobody need go there today."""
        return self.name in _MEASUREMENT

    @property
    def takes_hours(self) -> bool:
        """Return True if two mistaken modes in a few hours look like it."""
        return self.name in (SWAPPED, _SENSOR, _UNEXPLAINED)

    @property
    def words(self) -> str:
        if self.name == TIME_BASE:
            return (
                f"All frequencies moved by one same fraction, {100 * self.size:+.2f} %: "
                "the time base, not the tension. Check the logger's clock and sampling rate."
            )
        if self.name == _SENSOR:
            return (
                f"Only the modes of the {self.plane} plane moved, each by its own fraction: the "
                "sensors, not the tension. Check which sensors are mounted, and where."
            )
        return EXCHANGED


def cause_of(moved: FloatArray, table: ModeTable, readings: FloatArray) -> Cause:
    """Find the cause of mean log frequencies that moved (n,), over so many `readings` each.

    What moved a mode is NaN where unknown; where that holds for all, nothing explains the change.
    """
    known = np.isfinite(moved) & (readings > 0)
    sub = replace(
        table,
        modes=tuple(mode for mode, its in zip(table.modes, known, strict=True) if its),
        **{name: getattr(table, name)[known] for name in ("tension", "ends", "spread", "level")},
    )
    if not known.any():
        return Cause(_UNEXPLAINED, (Moved(_UNEXPLAINED, 1.0, NAN, NAN),), moved, NAN)
    # Hours do not average out what a mode keeps for a day.
    y, variance = moved[known], sub.spread + _DAY_SD**2
    patterns, fits = _best_of_each(_patterns(sub, y), y, variance)
    log_each = np.array([fit[0] for fit in fits])
    chance = np.exp(log_each - log_each.max())
    chance = chance / chance.sum()
    best = int(chance.argmax())
    mean, sd = float(y.mean()), float(y.std()) / math.sqrt(len(y))
    by_mode_size = (mean / _DECADES_SD, sd / _DECADES_SD)  # of frequencies that no pattern ties
    sized = [
        fit if _names(pattern)[0] not in (_UNEXPLAINED, _SENSOR) else (fit[0], *by_mode_size)
        for pattern, fit in zip(patterns, fits, strict=True)
    ]
    total = _moved_quantities(
        [each for each in patterns if each.name != SWAPPED],
        [fit for each, fit in zip(patterns, sized, strict=True) if each.name != SWAPPED],
        np.array([c for each, c in zip(patterns, chance, strict=True) if each.name != SWAPPED]),
    )
    size = fits[best][1]
    if patterns[best].name == TIME_BASE:  # of all modes, those too that sleep at night
        size = float(np.median(y))
        moved = np.full(len(known), size)
    return Cause(patterns[best].name, total, moved, size, patterns[best].plane)


def _best_of_each(
    patterns: Sequence[_Pattern], y: FloatArray, variance: FloatArray
) -> tuple[list[_Pattern], list[tuple[float, float, float]]]:
    """Of variants of one hypothesis the likeliest, with the mean evidence of all."""
    found: dict[tuple[str, str], list[tuple[tuple[float, float, float], _Pattern]]] = {}
    for each in patterns:
        found.setdefault((each.name, each.plane), []).append((_fit(y, variance, each), each))
    best = []
    for variants in found.values():
        (_, *size), pattern = max(variants, key=lambda each: each[0][0])
        log = float(np.logaddexp.reduce([fit[0] for fit, _ in variants])) - math.log(len(variants))
        best.append((pattern, (log, size[0], size[1])))
    return [each for each, _ in best], [fit for _, fit in best]


def _ends(table: ModeTable) -> list[FloatArray]:
    """Return what a decade of an end's spring moves ln f by (n,), from soft to stiff."""
    s = np.clip(table.tension, 0.01, 0.499)
    order = np.array([each for _, each in table.modes])
    xi = float(np.median(math.pi * order * np.sqrt(s / (0.5 - s))))
    u = np.sqrt(0.5 / s)
    return [table.ends, *(math.log(10) / xi * k / (k + u) ** 2 for k in _SOFTNESS)]


def _patterns(table: ModeTable, y: FloatArray) -> list[_Pattern]:
    """All hypotheses; the larger a change, the more it is off by what the patterns are off."""
    s, n = table.tension, len(table.tension)
    left, none = _LEFT_SD * s[:, None], np.zeros(n)
    bent = (0.5 - s) * abs(float(s @ y) / float(s @ s))
    found = [
        _Pattern("tension", np.column_stack([_TENSION_SD * s, MODEL_OFF * bent]), _EACH_OFF * bent),
        _Pattern(TIME_BASE, np.column_stack([np.full(n, _BASE_SD), left]), none),
        _Pattern(_UNEXPLAINED, left, np.full(n, _MODE_SD)),
    ]
    planes = planes_of(table.modes)
    other = [(PLANES[PLANES[0] == plane], each) for plane, each in table.modes]
    if len(planes) > 1 and set(other) <= set(table.modes):
        swapped = table.level[[table.modes.index(each) for each in other]] - table.level
        found.append(_Pattern(SWAPPED, left, none, mean=swapped))
    for e in _ends(table):
        found += _loosened(e, y, table, planes)
    for plane, its in planes.items() if len(planes) > 1 else ():
        found.append(_Pattern(_SENSOR, left, np.where(its, _SENSOR_SD, 0.0), plane))
    return found


def _loosened(
    e: FloatArray, y: FloatArray, table: ModeTable, planes: Mapping[str, BoolArray]
) -> list[_Pattern]:
    """Ends in both planes, in each by its own, or in one, that move ln f by `e` a decade."""
    loose = e * abs(float(e @ y) / float(e @ e))
    order = np.array([each for _, each in table.modes])
    tilt = (order - order.mean()) / max(order.max() - 1, 1)
    each = _EACH_OFF * (np.abs(loose).max() - np.abs(loose))  # as of a tension: off a string
    left, off = _LEFT_SD * table.tension, MODEL_OFF * loose * tilt
    apart = [loose * (its - its.mean()) for its in planes.values()][:1]
    both = np.column_stack([_DECADES_SD * e, off, left, *(_APART * part for part in apart)])
    found = [_Pattern("ends", both, each)]
    for plane, its in planes.items() if len(planes) > 1 else ():
        of_end = np.column_stack([_DECADES_SD * e * its, off * its, left])
        found.append(_Pattern("end", of_end, each * its, plane))
    return found


def _fit(y: FloatArray, variance: FloatArray, pattern: _Pattern) -> tuple[float, float, float]:
    """Log evidence, size along the first column with its sd; a mode may have gone astray."""
    n = len(y)
    errant = [np.zeros(n), *(_ASTRAY_SD**2 * np.eye(n) if n > 2 else ())]
    both = [
        _normal(y - pattern.mean, variance + pattern.sd**2 + more, pattern.columns)
        for more in errant
    ]
    log_each = np.array([each[0] for each in both]) + np.where(
        np.arange(len(both)) > 0, math.log(_ASTRAY), 0.0
    )
    best = int(log_each.argmax())
    evidence = float(np.logaddexp.reduce(log_each))
    return evidence + math.log(_prior(pattern)), both[best][1], both[best][2]


def _prior(pattern: _Pattern) -> float:
    return _PRIORS[pattern.name] / (2 if pattern.plane else 1)


def _normal(y: FloatArray, variance: FloatArray, columns: FloatArray) -> tuple[float, float, float]:
    covariance = columns @ columns.T + np.diag(variance)
    solved = np.linalg.solve(covariance, np.column_stack([y, columns[:, 0]]))
    log = -(np.linalg.slogdet(covariance)[1] + float(y @ solved[:, 0])) / 2
    return (
        log,
        float(columns[:, 0] @ solved[:, 0]),
        math.sqrt(max(1 - float(columns[:, 0] @ solved[:, 1]), 0.0)),
    )


def _moved_quantities(
    patterns: Sequence[_Pattern], fits: Sequence[tuple[float, float, float]], chance: FloatArray
) -> tuple[Moved, ...]:
    """Return what may have moved, in the words that alerts have for it; the likeliest first."""
    order = np.argsort(-chance)
    bayes = chance / [_prior(each) for each in patterns]
    similar = tuple(
        name
        for i in order[1:]
        if bayes[i] > bayes[order[0]] / _ALIKE
        for name in _names(patterns[i])[:1]
    )
    found: dict[str, Moved] = {}
    for rank, i in enumerate(order):
        names = _names(patterns[i])
        unit = {"tension": _TENSION_SD, TIME_BASE: _BASE_SD}.get(patterns[i].name, _DECADES_SD)
        for name in names:
            together = tuple(each for each in names if each != name)
            plane = next((each for each in PLANES if name.startswith(each)), None)
            size, sd = (unit * each for each in fits[i][1:])
            each = Moved(
                name, float(chance[i]), size, sd, None, plane, () if rank else similar, together
            )
            found.setdefault(name, each)
    return tuple(found.values())


def _names(pattern: _Pattern) -> tuple[str, ...]:
    if pattern.name == "ends":
        return ("transverse_end_stiffness", "longitudinal_end_stiffness")
    return (f"{pattern.plane}_end_stiffness",) if pattern.name == "end" else (pattern.name,)


_HINTS = ("logger", "swapped", "saturated", "drifting", "dead", "lost modes", "clock step")
"""Kinds of events that may be behind frequencies that move, the likeliest first."""
BESIDE = timedelta(hours=3)
"""Judgement: before a change and behind it: who exchanges a sensor works for an hour or two, and
when a change began is known to about as much."""
_LATELY = timedelta(hours=1)  # the hour of the alert itself


def led_by(alert: Alert, events: Sequence[StreamEvent]) -> Alert:
    """The alert, led by what was noticed at the time of its change, and by that its temperature is
    not known; as it is where nothing was.
    """
    if alert.change is None:
        return alert
    words = " ".join(filter(None, (_near(alert.change, events), _unknown(alert, events))))
    if not words:
        return alert
    hanger, _, rest = alert.message.partition(": ")
    return replace(alert, message=f"{hanger}: {words} {rest[:1].upper()}{rest[1:]}")


def _near(change: Change, events: Sequence[StreamEvent]) -> str:
    first, last = change.began_after - BESIDE, change.began_by + BESIDE
    near = [
        event
        for event in events
        if event.kind in _HINTS and event.start <= last and event.end >= first
    ]
    if not near:
        return ""
    event = min(near, key=lambda each: _HINTS.index(each.kind))
    reported = f"{event.channel}: {event.detail}" if event.channel else event.detail
    whose = "the logger said" if event.kind == "logger" else f"event '{event.kind}':"
    return (
        f"check the sensors first, at {event.start:%Y-%m-%d %H:%M} {whose} {reported.rstrip('.')}."
    )


def _unknown(alert: Alert, events: Sequence[StreamEvent]) -> str:
    reported = [e for e in events if e.kind == "thermometer" and e.end > alert.time - _LATELY]
    if not reported:
        return ""
    why = reported[-1].detail.partition(": ")[0]
    return f"the temperature is not known ({why}): part of this may be the weather's."
