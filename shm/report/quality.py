"""The quality checks of a test as a table."""

from __future__ import annotations

from collections.abc import Sequence

from shm.report import verdicts
from shm.report.paper import Table
from shm.values import QualityCheck


def quality_table(checks: Sequence[QualityCheck], title: str = "Quality") -> Table:
    """Each check in its order: verdict by symbol and word, figure beside limit, what to do."""
    return Table(
        title,
        ("check", "verdict", "figure", "limit", "what was found", "what to do"),
        tuple(_row(check) for check in checks),
        marks=tuple(check.verdict for check in checks),
        note="Figures without a unit are counts or ratios. Limits are given: they have no interval."
        if checks
        else "",
    )


def _row(check: QualityCheck) -> tuple[str, ...]:
    return (
        check.name,
        verdicts.label(check.verdict),
        verdicts.quantity(check.value, check.unit),
        verdicts.quantity(check.limit, check.unit),
        check.found,
        check.remedy or "nothing",
    )
