"""Write the size of an effect: value and interval with the unit, prefix and digits that suit it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from shm.report.formatting import Interval
from shm.values import EffectEstimate
from shm.values.parameter_names import base_name, is_logarithm, quantity_name

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
        return self.in_words(self.interval)

    @property
    def sure_sign(self) -> int:
        """1 or -1 where the whole interval has that sign, else 0."""
        if self.interval.low > 0:
            return 1
        return -1 if self.interval.high < 0 else 0

    def directed(self, up: str, down: str) -> str:
        """Return `0.12 m (0.10 to 0.14) longer`; signed numbers if both directions are possible."""
        if self.sure_sign > 0:
            return f"{self} {up}"
        if self.sure_sign < 0:
            turned = Interval(-self.interval.mean, -self.interval.high, -self.interval.low)
            return f"{self.in_words(turned)} {down}"
        return f"{self.in_words(self.interval, '+')} {up}"

    def __format__(self, directions: str) -> str:
        """Return the size as text; `up|down` as for `directed`."""
        up, bar, down = directions.partition("|")
        return self.directed(up, down) if bar else str(self)

    def in_words(self, interval: Interval, sign: str = "") -> str:
        """Return an interval in this size's unit and digits."""
        mean, low, high = _texts(interval, sign, self.logarithmic)
        unit = f" {self.unit}" if self.unit else ""
        return f"{mean}{unit} ({low} to {high})" if low and high else f"{mean}{unit}"


def size(estimate: EffectEstimate) -> Size:
    """Return an estimate in the unit and prefix that suit it; a logarithm as what it is of."""
    interval = Interval(estimate.mean, estimate.q05, estimate.q95)
    return size_of(estimate.name, estimate.unit, interval)


def size_of(name: str, unit: str, interval: Interval) -> Size:
    """Return the size of a parameter by its name, `unit` and 90 % interval.

    Of a log10 the unit is that of the quantity; it is given as the quantity.
    """
    if logarithmic := is_logarithm(name):
        interval = Interval(*(10.0**each for each in (interval.mean, interval.low, interval.high)))
    scale, unit = _FACTORS.get(unit, (1.0, unit))
    if unit in _SCALED_UNITS:
        sizes = (pair for pair in _PREFIXES if abs(interval.mean) >= pair[0])
        divisor, prefix = next(sizes, (1.0, ""))
        scale, unit = 1 / divisor, prefix + unit
    return Size(interval.scaled(scale), unit, logarithmic)


def _texts(interval: Interval, sign: str, logarithmic: bool) -> tuple[str, str, str]:
    """Return mean and bounds with the digits of the width; empty bounds where unknown."""
    half = interval.width / 2
    if logarithmic or _lopsided(interval) or not (math.isfinite(half) and half > 0):
        mean, low, high = (_significant(v, sign) for v in _three(interval))
        return (mean, low, high) if half > 0 else (mean, "", "")
    places = min(math.ceil(-math.log10(half / 2.95)), _most_places(interval.mean))
    mean, low, high = (f"{round(v, places):{sign}z.{max(0, places)}f}" for v in _three(interval))
    return mean, low, high


def _lopsided(interval: Interval) -> bool:
    """Return True where both bounds have one sign and lie too far apart to share digits."""
    near, far = sorted((abs(interval.low), abs(interval.high)))
    return interval.low * interval.high > 0 and far > _LOPSIDED * near


def _most_places(mean: float) -> int:
    """Return the decimals of four significant digits, more than anybody measures."""
    return 3 - math.floor(math.log10(abs(mean))) if mean else 6


def _three(interval: Interval) -> tuple[float, float, float]:
    return interval.mean, interval.low, interval.high


def _significant(value: float, sign: str) -> str:
    """Return two significant digits, never as a power of ten."""
    if not math.isfinite(value):
        return "of unknown size" if math.isnan(value) else "unbounded"
    if value == 0:
        return "0"
    places = 1 - math.floor(math.log10(abs(value)))
    return f"{round(value, places):{sign}z.{max(0, places)}f}"


def quantity(estimate: EffectEstimate) -> str:
    """Return the name of an estimate's quantity without its unit, which its size has."""
    return quantity_name(estimate.name, estimate.unit)


class Sizes(dict[str, "Size | str"]):
    """The sizes of one effect by the catalogue's names of its parameters, for its phrase."""

    def __init__(self, estimates: Sequence[EffectEstimate]):
        super().__init__({base_name(e.name): size(e) for e in estimates})

    def __missing__(self, stem: str) -> str:
        """Return the end springs `stem` 1 to 4, with their planes where there are several."""
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
