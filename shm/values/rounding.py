"""What messages say alike: a number with its interval, and several words in a row."""

from __future__ import annotations

from collections.abc import Sequence

NINETY_PERCENT = 1.645  # sds on either side that hold 90 % of a normal law


def rounded_percent(fraction: float, half: float, sign: str = "") -> str:
    """`8.2 ± 1.1 %` of fractions: two digits of the half width, two decimals at most."""
    percent = 100 * half
    places = 0 if percent >= 10 else 1 if percent >= 1 else 2
    return f"{100 * fraction:{sign}.{places}f} ± {percent:.{places}f} %"


def listed(words: Sequence[str]) -> str:
    """`a, b and c`."""
    return " and ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)
