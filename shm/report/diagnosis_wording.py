"""Write causes of a gap as names and clauses, with their sizes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from shm.models.effects import EFFECTS
from shm.report import formatting
from shm.report.formatting import Interval
from shm.values import Cause, Claim, Diagnosis, EffectEstimate, TensionEstimate, effect_label
from shm.values.diagnosis import joined
from shm.values.parameter_names import base_name, is_logarithm, quantity_name
from shm.values.rounding import ForceUnit, force_unit

_PLACES = {
    "everywhere": "",
    "deck end": "at the deck end",
    "arch end": "at the arch end",
    "both ends": "at both ends",
    "all sensors": "of all sensors",
    "all tests": "in all tests",
    "transverse": "in the transverse plane",
    "longitudinal": "in the longitudinal plane",
    "both planes alike": "in both planes alike",
}
_MOST_PLACES = 2  # what a sentence bears
_PLACE_STARTS = {"sensor": "of the", "test": "in"}


def is_of_the_measurement(claim: Claim) -> bool:
    """Return whether all that is named are faults of sensors, clock or what was clamped on."""
    names = {effect for cause in claim.causes for effect in cause.effects}
    known = [EFFECTS.get(name) for name in names if name != "timebase"]
    return all(effect is not None and not effect.of_the_hanger for effect in known)


def label(cause: Cause) -> str:
    """`rotational end flexibility (both ends)`, for tables and figures."""
    parts = zip(cause.effects, cause.places, strict=True)
    return joined(effect_label(effect, at) for effect, at in parts)


def phrase(cause: Cause) -> str:
    """`a point mass of 12 kg (9 to 15) at 3.4 m (3.1 to 3.7)`; a pair joined by `and`."""
    clauses = [
        effect_phrase(effect, at, own_estimates(cause, number))
        for number, (effect, at) in enumerate(zip(cause.effects, cause.places, strict=True))
    ]
    return " together with ".join(clauses) + _also(cause)


def _also(cause: Cause) -> str:
    """Where else it may act as well."""
    if not cause.also_at:
        return ""
    places = [
        " and ".join(_place(part) or "everywhere" for part in cause.each_at(at))
        for at in cause.also_at[:_MOST_PLACES]
    ]
    return f" (about as likely: {formatting.listed(places)})"


def effect_phrase(effect: str, at: str, estimates: Sequence[EffectEstimate]) -> str:
    """What the effect is, how large, where; the bare name where its size is not known."""
    where = _place(at)
    try:
        told = EFFECTS[effect].phrase.format_map(Sizes(estimates))
    except KeyError:
        told = formatting.quantity(effect)
    return f"{told} {where}".rstrip()


def _place(at: str) -> str:
    """`deck end, transverse` as `at the deck end in the transverse plane`."""
    return " ".join(filter(None, (_place_part(part) for part in at.split(", "))))


def _place_part(part: str) -> str:
    start = _PLACE_STARTS.get(part.partition(" ")[0])
    return _PLACES.get(part, f"{start} {part}" if start else part)


def own_estimates(cause: Cause, number: int) -> tuple[EffectEstimate, ...]:
    """The estimates of effect `number` of the cause.

    In a pair a name that both have carries its effect before a dot.
    """
    prefixed = {e.name: e.name.partition(".")[0] for e in cause.parameters if "." in e.name}
    own = cause.effects[number]
    return tuple(e for e in cause.parameters if prefixed.get(e.name, own) == own)


_SPRING_PLANES = {1: "transverse", 2: "longitudinal", 3: "transverse", 4: "longitudinal"}
_PREFIXES = ((1e9, "G"), (1e6, "M"), (1e3, "k"), (1.0, ""))
_LOPSIDED = 3.0
_SCALED_UNITS = ("N", "N m/rad", "N/m", "N/K")
_FACTORS = {"fraction": (100.0, "%"), "lambda^2": (1.0, "")}
"""Units of the catalogue that read better otherwise: a factor and the unit it gives."""


@dataclass(frozen=True)
class Size:
    """A quantity with its 90 % interval in `unit`; logarithmic ones go by significant digits."""

    interval: Interval
    unit: str
    logarithmic: bool = False

    def __str__(self) -> str:
        return self.told(self.interval)

    @property
    def sure_sign(self) -> int:
        """1 or -1 where the whole interval has that sign, else 0."""
        if self.interval.low > 0:
            return 1
        return -1 if self.interval.high < 0 else 0

    def directed(self, up: str, down: str) -> str:
        """`0.12 m (0.10 to 0.14) longer`; signed numbers where either direction is possible."""
        if self.sure_sign > 0:
            return f"{self} {up}"
        if self.sure_sign < 0:
            turned = Interval(-self.interval.mean, -self.interval.high, -self.interval.low)
            return f"{self.told(turned)} {down}"
        return f"{self.told(self.interval, '+')} {up}"

    def __format__(self, directions: str) -> str:
        """As text; with `up|down` as `directed` says it."""
        up, bar, down = directions.partition("|")
        return self.directed(up, down) if bar else str(self)

    def told(self, interval: Interval, sign: str = "") -> str:
        """An interval in this size's unit and digits."""
        mean, low, high = _texts(interval, sign, self.logarithmic)
        unit = f" {self.unit}" if self.unit else ""
        return f"{mean}{unit} ({low} to {high})" if low and high else f"{mean}{unit}"


def size(estimate: EffectEstimate) -> Size:
    """An estimate in the unit and prefix that suit it; logarithms as what they are of."""
    interval = Interval(estimate.mean, estimate.q05, estimate.q95)
    if logarithmic := is_logarithm(estimate.name):
        interval = Interval(
            *(10.0**value for value in (interval.mean, interval.low, interval.high))
        )
    scale, unit = _FACTORS.get(estimate.unit, (1.0, estimate.unit))
    if unit in _SCALED_UNITS:
        sizes = (pair for pair in _PREFIXES if abs(interval.mean) >= pair[0])
        divisor, prefix = next(sizes, (1.0, ""))
        scale, unit = 1 / divisor, prefix + unit
    return Size(interval.scaled(scale), unit, logarithmic)


def _texts(interval: Interval, sign: str, logarithmic: bool) -> tuple[str, str, str]:
    """Mean and bounds with digits that the width deserves; empty bounds where they are unknown."""
    half = interval.width / 2
    if logarithmic or _lopsided(interval) or not (math.isfinite(half) and half > 0):
        mean, low, high = (_significant(v, sign) for v in _three(interval))
        return (mean, low, high) if half > 0 else (mean, "", "")
    places = min(math.ceil(-math.log10(half / 2.95)), _most_places(interval.mean))
    mean, low, high = (f"{round(v, places):{sign}.{max(0, places)}f}" for v in _three(interval))
    return mean, low, high


def _lopsided(interval: Interval) -> bool:
    """Whether both bounds have one sign and lie so far apart that each needs its own digits."""
    near, far = sorted((abs(interval.low), abs(interval.high)))
    return interval.low * interval.high > 0 and far > _LOPSIDED * near


def _most_places(mean: float) -> int:
    """Decimals beyond which nobody measures: four significant digits."""
    return 3 - math.floor(math.log10(abs(mean))) if mean else 6


def _three(interval: Interval) -> tuple[float, float, float]:
    return interval.mean, interval.low, interval.high


def _significant(value: float, sign: str) -> str:
    """Two significant digits, never as a power of ten."""
    if not math.isfinite(value):
        return "of unknown size" if math.isnan(value) else "unbounded"
    if value == 0:
        return "0"
    places = 1 - math.floor(math.log10(abs(value)))
    return f"{round(value, places):{sign}.{max(0, places)}f}"


def quantity(estimate: EffectEstimate) -> str:
    """Return the name of an estimate's quantity without its unit, which its size has."""
    return quantity_name(estimate.name, estimate.unit)


class Sizes(dict[str, "Size | str"]):
    """The sizes of one effect by the catalogue's names of its parameters, for its phrase."""

    def __init__(self, estimates: Sequence[EffectEstimate]):
        super().__init__({base_name(e.name): size(e) for e in estimates})

    def __missing__(self, stem: str) -> str:
        """The end springs `stem` 1 to 4, with their planes where there are several."""
        found = {
            plane: self[name]
            for number, plane in _SPRING_PLANES.items()
            if (name := f"{stem}{number}") in self
        }
        if not found:
            raise KeyError(stem)
        if len(found) == 1:
            return str(next(iter(found.values())))
        return " and ".join(f"{size} {plane}" for plane, size in found.items())


AFTER = "weighed over all that may be"
"""What the tension after the diagnosis stands for: no gap, every cause and the unknown count by
their probabilities."""


def tension_unit(diagnosis: Diagnosis) -> ForceUnit:
    """One unit for both tensions, so that they can be compared at a glance."""
    return force_unit(diagnosis.tension_before_n.mean, diagnosis.tension_after_n.mean)


def tension_of(estimate: TensionEstimate) -> Interval:
    """Mean and 90 % interval in N."""
    return Interval(estimate.mean, estimate.q05, estimate.q95)


def tension_words(estimate: TensionEstimate, unit: ForceUnit) -> str:
    """`702 kN (90 % interval 690 to 714 kN)`; the mean alone where nothing else is known."""
    tension_n = tension_of(estimate)
    if math.isnan(tension_n.width):
        return formatting.rounded_tension(estimate.mean, unit)
    if not tension_n.low <= tension_n.mean <= tension_n.high:  # most draws at a bound, few far off
        return f"{formatting.span(tension_n.in_unit(unit))} {unit.name} (90 % interval)"
    return formatting.tension(tension_n, unit)
