"""Numbers with intervals, words in a row, and forces in N, kN or MN, as all messages write them."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from shm.values.kinds import FloatArray

Force = TypeVar("Force", float, FloatArray)

_DIGITS = 4  # an interval's half width is some percent: two digits of it are four of the force
MOST_DECIMALS = 6  # technical: what is smaller is written as 0


@dataclass(frozen=True)
class ForceUnit:
    """A unit of force: its name and how many N it is."""

    name: str
    newtons: float

    def of(self, force_n: Force) -> Force:
        """Return forces in N, a number or an array of any shape, in this unit."""
        return force_n / self.newtons

    def decimals(self, force_n: float) -> int:
        """Return decimals that show four significant digits of a force in N, one at the least."""
        size = abs(self.of(force_n))
        if not (math.isfinite(size) and size > 0):
            return 1
        return min(MOST_DECIMALS, max(1, _DIGITS - 1 - math.floor(math.log10(size))))

    def with_unit(self, force_n: float) -> str:
        """Return `654.1 kN` of a force in N: four significant digits, never as a power of ten."""
        value = self.of(force_n)
        digits = np.format_float_positional(
            value, precision=_DIGITS, fractional=False, unique=False, trim="-"
        )
        return f"{digits} {self.name}"


_NEWTON = ForceUnit("N", 1.0)
_KILONEWTON = ForceUnit("kN", 1e3)  # SI prefixes
_MEGANEWTON = ForceUnit("MN", 1e6)
# Engineers write 1200 kN, not 1.2 MN: only main cables and the like are told in MN.
_KILONEWTON_FROM_N, _MEGANEWTON_FROM_N = 1e3, 1e7


def force_unit(*forces_n: float) -> ForceUnit:
    """Return the one unit for all these forces in N, by the largest; kN where none is known."""
    known = [abs(each) for each in forces_n if math.isfinite(each)]
    if not known or _KILONEWTON_FROM_N <= max(known) < _MEGANEWTON_FROM_N:
        return _KILONEWTON
    return _NEWTON if max(known) < _KILONEWTON_FROM_N else _MEGANEWTON


def tension_and_interval(
    mean_n: float, low_n: float, high_n: float, unit: ForceUnit | None = None
) -> tuple[str, str]:
    """Return `654 kN` and `640 to 671 kN`: two digits of the interval's half width."""
    unit = unit or force_unit(mean_n)
    low, mean, high = (unit.of(n) for n in (low_n, mean_n, high_n))
    low_text, text, high_text = (
        to_two_digits(each, (high - low) / 2) for each in (low, mean, high)
    )
    return f"{text} {unit.name}", f"{low_text} to {high_text} {unit.name}"


def tension_words(mean_n: float, low_n: float, high_n: float) -> str:
    """Return `654 kN (90 % credible interval 640 to 671 kN)`; the mean without an interval."""
    if not math.isfinite(mean_n):
        return "tension not known"
    if not math.isfinite(high_n - low_n):
        return force_unit(mean_n).with_unit(mean_n)
    return with_interval(*tension_and_interval(mean_n, low_n, high_n))


def with_interval(tension: str, interval: str) -> str:
    """Return `654 kN (90 % credible interval 640 to 671 kN)`."""
    return f"{tension} (90 % credible interval {interval})"


NINETY_PERCENT = 1.645  # sds on either side that hold 90 % of a normal law


def rounded(value: float, half: float, sign: str = "", most_decimals: int = 6) -> str:
    """Return `8.2 ± 1.1`, `1040 ± 130`: both to two significant digits of the half width."""
    if not (math.isfinite(half) and half > 0):
        return f"{value:{sign}.1f}"
    places = min(most_decimals, 1 - math.floor(math.log10(half)))
    value, half = round(value, places), round(half, places)
    shown = max(places, 0)
    return f"{value:{sign}z.{shown}f} ± {half:.{shown}f}"


_ERROR = re.compile(r"± ([\d.,]+) ")


def unbroken(text: str) -> str:
    """Return a text whose `± 2.7 %` stays on one line; a page may break before the `±`."""
    return _ERROR.sub("±\N{NO-BREAK SPACE}\\1\N{NO-BREAK SPACE}", text)


def to_two_digits(value: float, half: float, sign: str = "") -> str:
    """Return `650`, `8.2`: a value to two significant digits of its interval's half width."""
    if not (math.isfinite(half) and half > 0):
        return f"{value:{sign}z.1f}"
    places = min(MOST_DECIMALS, 1 - math.floor(math.log10(half)))
    return f"{round(value, places):{sign}z.{max(places, 0)}f}"


def two_digits(value: float) -> str:
    """Return `120`, `6.3` or `0.001`: two significant digits, never as a power of ten."""
    return np.format_float_positional(value, precision=2, fractional=False, unique=False, trim="-")


def rounded_percent(fraction: float, half: float, sign: str = "") -> str:
    """Return `8.2 ± 1.1 %` of fractions: two digits of the half width, at most two decimals."""
    return f"{rounded(100 * fraction, 100 * half, sign, most_decimals=2)} %"


def listed(words: Sequence[str]) -> str:
    """Join words as `a, b and c`."""
    return " and ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)
