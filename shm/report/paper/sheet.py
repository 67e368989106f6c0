"""The sheet of one test, on paper."""

from __future__ import annotations

from shm.report.paper.content import Paper, Part
from shm.report.sheet.content import TestSheet
from shm.report.sheet.figures import page_figures
from shm.report.sheet.page import CLOSING, STYLES, facts
from shm.report.sheet.summary import HEADLINES, name, summary
from shm.report.sheet.tables import details, results
from shm.report.verdicts import overall


def test_paper(sheet: TestSheet) -> Paper:
    """Summary, modes and quality, figures, how it came about."""
    verdict = overall(sheet.identification.quality)
    return Paper(
        title=name(sheet),
        bridge=sheet.bridge,
        status=HEADLINES[verdict],
        style=STYLES[verdict],
        parts=(
            Part("In short", summary(sheet), facts(sheet)),
            Part("Modes and quality", tables=results(sheet)),
            Part("Figures", illustrations=page_figures(sheet)),
            Part("How it came about", tables=details(sheet)),
        ),
        generated_at=sheet.generated_at,
        version=sheet.version,
        closing=CLOSING,
    )
