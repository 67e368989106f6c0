"""A share of cases with its interval."""

from __future__ import annotations

from scipy.stats import beta


def interval(hits: int, count: int) -> tuple[float, float]:
    """Return the 90 % interval of a share (Clopper and Pearson)."""
    low = float(beta.ppf(0.05, hits, count - hits + 1)) if hits else 0.0
    high = float(beta.ppf(0.95, hits + 1, count - hits)) if hits < count else 1.0
    return low, high


def share(hits: int, count: int) -> str:
    """Return a share with its 90 % interval."""
    if not count:
        return "of no case"
    low, high = interval(hits, count)
    return f"{hits / count:.2f} ({low:.2f} to {high:.2f})"
