"""Sizes of effects as an engineer writes them: `12 kg (9 to 15)`, `6.3 MN m/rad (4.1 to 9.8)`."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from shm.report.intervals import Interval
from shm.values import EffectEstimate

_LOGARITHM = "log10_"
_SPRING_PLANES = {1: "transverse", 2: "longitudinal", 3: "transverse", 4: "longitudinal"}
_PREFIXES = ((1e9, "G"), (1e6, "M"), (1e3, "k"), (1.0, ""))
_LOPSIDED = 3.0
_UNIT_ENDINGS = ("_n_m", "_n_k", "_kg", "_deg", "_hz", "_m")
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

    def told(self, interval: Interval, sign: str = "") -> str:
        """An interval in this size's unit and digits."""
        mean, low, high = _texts(interval, sign, self.logarithmic)
        unit = f" {self.unit}" if self.unit else ""
        return f"{mean}{unit} ({low} to {high})" if low and high else f"{mean}{unit}"


def size(estimate: EffectEstimate) -> Size:
    """An estimate in the unit and prefix that suit it; logarithms as what they are of."""
    interval = Interval(estimate.mean, estimate.q05, estimate.q95)
    if logarithmic := estimate.name.startswith(_LOGARITHM):
        interval = Interval(
            *(10.0**value for value in (interval.mean, interval.low, interval.high))
        )
    scale, unit = _FACTORS.get(estimate.unit, (1.0, estimate.unit))
    if unit in _SCALED_UNITS:
        divisor, prefix = _prefix(interval.mean)
        scale, unit = 1 / divisor, prefix + unit
    return Size(interval.scaled(scale), unit, logarithmic)


def _prefix(value: float) -> tuple[float, str]:
    return next((pair for pair in _PREFIXES if abs(value) >= pair[0]), (1.0, ""))


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


def quantity(name: str) -> str:
    """`mass_kg` as `mass`, `log10_k1` as `k1`, `x_m` as `place`: its unit stands with its size."""
    plain = base_name(name).removeprefix(_LOGARITHM)
    ending = next((each for each in _UNIT_ENDINGS if plain.endswith(each)), "")
    plain = plain.removesuffix(ending)
    return "place" if plain == "x" else plain.replace("_", " ")


def base_name(name: str) -> str:
    """A parameter's name in the catalogue; in a pair it may carry its effect before a dot."""
    return name.rpartition(".")[2]


class Sizes:
    """The sizes of one effect by the catalogue's names of its parameters."""

    def __init__(self, estimates: Sequence[EffectEstimate]):
        self._sizes: Mapping[str, Size] = {base_name(e.name): size(e) for e in estimates}

    def __getitem__(self, name: str) -> Size:
        return self._sizes[name]

    def springs(self, letter: str) -> str:
        """The end springs log10_`letter`1 to 4, with their planes where there are several."""
        found = {
            plane: self._sizes[name]
            for number, plane in _SPRING_PLANES.items()
            if (name := f"{_LOGARITHM}{letter}{number}") in self._sizes
        }
        if not found:
            raise KeyError(letter)
        if len(found) == 1:
            return str(next(iter(found.values())))
        return " and ".join(f"{size} {plane}" for plane, size in found.items())
