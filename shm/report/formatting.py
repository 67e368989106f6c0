"""Numbers in words: units, intervals, signs, times; what is unknown is said, never printed.

Beside them a mean with its central 90 % interval, and how intervals combine.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime

import numpy as np

from shm.values import (
    Averaged,
    FloatArray,
    Posterior,
    Summary,
    stated_tension,
)
from shm.values.diagnosis import joined
from shm.values.parameter_names import quantity_name
from shm.values.rounding import ForceUnit, rounded, to_two_digits

NORMAL_90 = 1.6448536269514722
"""Half width of the central 90 % of a normal distribution, in standard deviations."""


_WIDE = 0.5  # judgement: an interval of half the value decides little


@dataclass(frozen=True)
class Interval:
    """A mean with its central 90 % interval.

    `repeatability_sd` is the standard deviation with which the same test would give it again, less
    than the interval says where part of that is the same in all tests; None: not known.
    """

    mean: float
    low: float
    high: float
    repeatability_sd: float | None = None

    @classmethod
    def of_samples(cls, samples: FloatArray) -> Interval:
        """Return the interval of equally weighted draws, shape (samples,)."""
        low, high = np.quantile(samples, [0.05, 0.95])
        return cls(float(samples.mean()), float(low), float(high))

    @classmethod
    def normal(cls, mean: float, sd: float) -> Interval:
        """Return the interval of a normal distribution."""
        return cls(mean, mean - NORMAL_90 * sd, mean + NORMAL_90 * sd)

    @classmethod
    def of_summary(cls, summary: Summary) -> Interval:
        """Return the interval of a summary of samples."""
        return cls(summary.mean, summary.q05, summary.q95)

    @classmethod
    def of_averaged(cls, averaged: Averaged) -> Interval:
        """Return the interval of a tension over all model classes, in N."""
        return cls.of_summary(averaged.tension_n).repeating(averaged.repeatability_sd_n)

    def repeating(self, sd: float) -> Interval:
        """Return the same with the standard deviation of a repetition; NaN is not known."""
        return replace(self, repeatability_sd=sd if math.isfinite(sd) else None)

    def scaled(self, factor: float) -> Interval:
        """Return the same quantity in a unit 1/`factor` as large."""
        this = self.repeatability_sd
        repeats = None if this is None else this * factor
        return Interval(self.mean * factor, self.low * factor, self.high * factor, repeats)

    def in_unit(self, unit: ForceUnit) -> Interval:
        """Return a force in N in another unit."""
        return self.scaled(1 / unit.newtons)

    @property
    def width(self) -> float:
        return self.high - self.low

    @property
    def is_wide(self) -> bool:
        """Return True if it is wider than half its mean: then it determines nothing."""
        return self.width > _WIDE * abs(self.mean)

    def since(self, then: Interval) -> Interval:
        """Return the relative change from `then`: repeatabilities in squares.

        Where one is not known, of two independent estimates: widths in squares.
        """
        ratio = self.mean / then.mean
        widths = [each.width / 2 for each in (self, then)]
        if self.repeatability_sd is not None and then.repeatability_sd is not None:
            widths = [NORMAL_90 * self.repeatability_sd, NORMAL_90 * then.repeatability_sd]
        half = math.hypot(widths[0], ratio * widths[1]) / abs(then.mean)
        return Interval(ratio - 1, ratio - 1 - half, ratio - 1 + half)


_LONGEST_NAME = 24  # layout: what a column of a table holds
_ROTATIONAL_SPRINGS = {
    "k1": "transverse, deck end",
    "k2": "longitudinal, deck end",
    "k3": "transverse, arch end",
    "k4": "longitudinal, arch end",
}
_FACE_SPRINGS = {
    "k1": "large edges, deck end",
    "k2": "small edges, deck end",
    "k3": "small edges, arch end",
    "k4": "large edges, arch end",
    "krx": "across the bridge, deck end",
    "kry": "along the bridge, deck end",
    "klx": "across the bridge, arch end",
    "kly": "along the bridge, arch end",
}
_MEANINGS = {
    "theta_F": "tension over nominal tension",
    "theta_L": "effective over given length",
    "sigma": "model error, as a fraction of a frequency",
    "section": "section area, as built against described",
    "density": "density, as built against described",
    "length": "length, as built against described",
    "modulus": "elastic modulus, as built against described",
    "bending_factor": "bending stiffness over the solid section's",
    "shear_share": "shear over a solid bar's",
    "fitting_stiffness_transverse": "bending stiffness of fittings over the bar's, transverse",
    "fitting_stiffness_longitudinal": "bending stiffness of fittings over the bar's, longitudinal",
    "fitting_mass": "mass of fittings over the bar's, per length",
    "turnbuckle_stiffness": "bending stiffness of turnbuckles over the described one",
    "turnbuckle_mass": "mass of turnbuckles over the described one",
    "inclination": "inclination from the horizontal in degrees (90 is vertical)",
    "sag_shape": "sag shape (0 like a beam, 1 like a cable)",
    "sag_stiffness": "stiffness against a change of sag over EA/L",
}


def decimals(width: float) -> int:
    """Return decimals that show two significant digits of half an interval's `width`."""
    return stated_tension.decimals(width / 2)


def with_interval(interval: Interval, unit: str) -> str:
    """Return `655 kN (90 % interval 640 to 671 kN)`."""
    space = unit and f" {unit}"
    return f"{mean(interval)}{space} (90 % interval {span(interval)}{space})"


def tension(tension_n: Interval, unit: ForceUnit) -> str:
    """Return `655 kN (90 % interval 640 to 671 kN)` of a tension in N."""
    return with_interval(tension_n.in_unit(unit), unit.name)


_LOPSIDED = 2.5  # judgement: a half width then says neither end


def with_half(interval: Interval, unit: ForceUnit) -> str:
    """Return `655 ± 16 kN` of a tension in N: the half width of its 90 % interval.

    Where that is much farther on one side: `13 to 490 kN`.
    """
    this = interval.in_unit(unit)
    above, below = this.high - this.mean, this.mean - this.low
    if max(above, below) > _LOPSIDED * min(above, below):
        return f"{span(this)} {unit.name}"
    return f"{rounded(this.mean, this.width / 2)} {unit.name}"


def rounded_tension(tension_n: float, unit: ForceUnit) -> str:
    """Return `711 kN` of a tension in N without an interval: at least three digits."""
    return f"{plain(unit.of(tension_n))} {unit.name}"


def tension_headings(unit: ForceUnit) -> tuple[str, str]:
    """Return the headings of the columns with `mean` and `span` of tensions."""
    return f"tension, {unit.name}", f"90 % credible interval, {unit.name}"


def span(interval: Interval, signed: bool = False) -> str:
    """Return `640 to 671`, for a table whose heading names the unit."""
    how = interval.width / 2, "+" if signed else ""
    return f"{to_two_digits(interval.low, *how)} to {to_two_digits(interval.high, *how)}"


def mean(interval: Interval, signed: bool = False) -> str:
    """Return the mean to two significant digits of its interval's half width."""
    return to_two_digits(interval.mean, interval.width / 2, "+" if signed else "")


def with_span(interval: Interval, signed: bool = False) -> str:
    """Return `650 (640 to 671)`, for a table whose heading names unit and interval."""
    return f"{mean(interval, signed)} ({span(interval, signed)})"


def signed_percent(fraction: Interval) -> str:
    """Return `-8.0 % (90 % interval -9.9 to -6.1 %)`."""
    percent = fraction.scaled(100)
    return f"{mean(percent, signed=True)} % (90 % interval {span(percent, signed=True)} %)"


def number(value: float, form: str, absent: str = "not known") -> str:
    """Return `value` in format `form`; the words `absent` where it is NaN."""
    return format(value, form) if math.isfinite(value) else absent


def plain(value: float, digits: int = 3, absent: str = "not known") -> str:
    """Return `value` with so many significant digits, never as a power of ten: `0.00021`."""
    if not math.isfinite(value):
        return absent
    rounded = float(f"{value:.{digits}g}")
    if abs(rounded) >= 10 ** (digits - 1):
        return f"{value:.0f}"
    return np.format_float_positional(rounded, trim="-")


def probability(value: float) -> str:
    """Return two decimals, as alerts do, with no certainty pretended."""
    if not math.isfinite(value):
        return "not known"
    if value > 0.995:
        return "> 0.99"
    return "< 0.01" if value < 0.01 else f"{value:.2f}"


def spoken_probability(value: float) -> str:
    """Return the same in a sentence: `above 0.99`, `0.97`."""
    return probability(value).replace("> ", "above ").replace("< ", "below ")


def temperature(celsius: float, absent: str = "temperature not recorded") -> str:
    return f"{celsius:.1f} °C" if math.isfinite(celsius) else absent


def moment(time: datetime | None) -> str:
    """Return `2026-05-01 10:00 UTC`."""
    return f"{time.astimezone(UTC):%Y-%m-%d %H:%M} UTC" if time else "time not recorded"


def hanger_name(hanger_id: int, name: str) -> str:
    return f"Hanger {hanger_id} ({name})" if name else f"Hanger {hanger_id}"


def quantity(name: str) -> str:
    """Return `transverse_end_stiffness` as `transverse end stiffness`."""
    return name.replace("_", " ")


def meaning(posterior: Posterior, name: str) -> str:
    """Return what a parameter is; its unit stands with its value.

    A parameter of an adopted effect has the name that the catalogue gives it.
    """
    if name in _MEANINGS:
        return _MEANINGS[name]
    unit = posterior.unit(name)
    called = quantity_name(name, unit)
    if unit == "N m/rad" and called in _ROTATIONAL_SPRINGS:
        called = f"end stiffness {called} ({_ROTATIONAL_SPRINGS[called]})"
    elif unit == "N/m" and called in _FACE_SPRINGS:
        called = f"spring {called} per node ({_FACE_SPRINGS[called]})"
    effect = name.rpartition(".")[0].replace("_", " ")
    return f"{effect}: {called}" if effect else called


def model_class(name: str) -> str:
    """Return `beam1 + point mass (deck end)` for an adopted class, without its ranges."""
    baseline, *effects = name.split("+")
    return joined([baseline, *(_adopted(effect.partition(":")[0]) for effect in effects)])


def _adopted(effect: str) -> str:
    what, _, where = (part.replace("_", " ") for part in effect.partition("@"))
    return what if where in ("", "everywhere") else f"{what} ({where.replace('.', ', ')})"


def place(name: str, plane: str | None, x_m: float) -> str:
    """Return `acc_1, transverse, 2.52 m` of a sensor, as far as it is known."""
    known = (_shortened(name), plane or "", f"{x_m:.2f} m" if math.isfinite(x_m) else "")
    return ", ".join(word for word in known if word)


def _shortened(name: str) -> str:
    """Return both ends of a long name, since serial numbers are at the end."""
    half = _LONGEST_NAME // 2
    return name if len(name) <= _LONGEST_NAME else f"{name[:half]}…{name[-half + 1 :]}"


def some(shown: int, there: int, what: str) -> str:
    """Return ` 4 of 16 measured points are drawn.`; empty where all are."""
    return f" {shown} of {there} {what} are drawn." if shown < there else ""


def counted(count: int, what: str) -> str:
    """Return `1 hit`, `5 hits`, `no hit`."""
    if count == 0:
        return f"no {what}"
    return f"{count} {what}" if count == 1 else f"{count} {what}s"


def listed(items: Sequence[str]) -> str:
    """Return `a, b and c`."""
    return items[0] if len(items) == 1 else f"{', '.join(items[:-1])} and {items[-1]}"


def counted_tests(tests: tuple[str, ...]) -> str:
    """Return `test t001`, `5 tests`."""
    return f"test {tests[0]}" if len(tests) == 1 else f"{len(tests)} tests"
