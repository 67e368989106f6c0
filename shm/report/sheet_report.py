"""The sheet of one hammer test, by which a person checks how it was identified."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from shm.report import words
from shm.report.colours import VERDICT_STYLES
from shm.report.paper import Fact, Paper, Part
from shm.report.sheet.content import TestSheet
from shm.report.sheet.summary import HEADLINES, name, summary
from shm.report.sheet.tables import details, results
from shm.report.verdicts import overall

if TYPE_CHECKING:
    from shm.report.figures.member import Illustration


def sheet_paper(sheet: TestSheet) -> Paper:
    """Summary, modes and quality, figures, how it came about."""
    verdict = overall(sheet.identification.quality)
    return Paper(
        title=name(sheet),
        bridge=sheet.bridge,
        status=HEADLINES[verdict],
        style=VERDICT_STYLES[verdict],
        parts=(
            Part("In short", summary=summary(sheet), facts=facts(sheet)),
            Part("Modes and quality", tables=results(sheet)),
            Part("Figures", figures=lambda: _figures(sheet)),
            Part("How it came about", tables=details(sheet)),
        ),
        generated_at=sheet.generated_at,
        version=sheet.version,
        closing="Intervals are central 90 %; standard deviations are of one test; times are UTC.",
    )


def _figures(sheet: TestSheet) -> Sequence[Illustration]:
    from shm.report.sheet.figures import page_figures

    return page_figures(sheet)


def facts(sheet: TestSheet) -> tuple[Fact, ...]:
    """The figures on top: what, value, what stands beside it."""
    test, hits = sheet.identification.test, sheet.hits
    planes = {mode.plane for mode in sheet.modes}
    return (
        ("Modes", str(len(sheet.modes)), f"in {words.counted(len(planes), 'plane')}"),
        ("Hits used", f"{len(sheet.used_hits)} of {len(hits)}" if hits else "none", _force(sheet)),
        ("Tested", words.moment(test.time), words.temperature(test.temperature_c)),
        ("Set aside", str(len(sheet.identification.set_aside)), "resonances not of the hanger"),
    )


def _force(sheet: TestSheet) -> str:
    forces = [hit.peak_force_n for hit in sheet.used_hits]
    if not forces:
        return "no force was recorded"
    return f"peak force {words.plain(min(forces))} to {words.plain(max(forces))} N"
