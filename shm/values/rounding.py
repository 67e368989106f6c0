"""What messages say alike: a number with its interval, and several words in a row."""

from __future__ import annotations

import math
from collections.abc import Sequence

from shm.values.force_units import MOST_DECIMALS

NINETY_PERCENT = 1.645  # sds on either side that hold 90 % of a normal law


def rounded(value: float, half: float, sign: str = "", most_decimals: int = 6) -> str:
    """`8.2 ± 1.1`, `1040 ± 130`: both to two significant digits of the half width."""
    if not (math.isfinite(half) and half > 0):
        return f"{value:{sign}.1f}"
    places = min(most_decimals, 1 - math.floor(math.log10(half)))
    value, half = round(value, places), round(half, places)
    shown = max(places, 0)
    return f"{value:{sign}z.{shown}f} ± {half:.{shown}f}"


def to_two_digits(value: float, half: float, sign: str = "") -> str:
    """`650`, `8.2`: a value to two significant digits of its interval's half width."""
    if not (math.isfinite(half) and half > 0):
        return f"{value:{sign}z.1f}"
    places = min(MOST_DECIMALS, 1 - math.floor(math.log10(half)))
    return f"{round(value, places):{sign}z.{max(places, 0)}f}"


def rounded_percent(fraction: float, half: float, sign: str = "") -> str:
    """`8.2 ± 1.1 %` of fractions: two digits of the half width, two decimals at most."""
    return f"{rounded(100 * fraction, 100 * half, sign, most_decimals=2)} %"


def listed(words: Sequence[str]) -> str:
    """`a, b and c`."""
    return " and ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)
