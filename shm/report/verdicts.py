"""Verdicts of quality checks by word, symbol and colour, and what a whole test deserves."""

from __future__ import annotations

import math
from collections.abc import Sequence

from shm.report import words
from shm.values import QualityCheck, Verdict

SYMBOLS: dict[Verdict, str] = {"good": "✓", "warning": "!", "refused": "✗", "unknown": "?"}
_GRAVEST: tuple[Verdict, ...] = ("refused", "warning", "unknown", "good")


def label(verdict: Verdict) -> str:
    """`✓ good`."""
    return f"{SYMBOLS[verdict]} {verdict}"


def overall(checks: Sequence[QualityCheck]) -> Verdict:
    """The gravest of the verdicts; one good check outweighs any number that say nothing."""
    given = {check.verdict for check in checks}
    if given <= {"unknown"}:
        return "unknown"
    return next(verdict for verdict in _GRAVEST if verdict in given - {"unknown"})


def quantity(value: float, unit: str) -> str:
    """A figure with its unit as one reads it, `not known` where it is NaN."""
    known = math.isfinite(value)
    return f"{words.plain(value)} {unit}".rstrip() if known else words.plain(value)
