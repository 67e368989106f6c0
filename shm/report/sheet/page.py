"""A test's sheet as one HTML file: style, figures and words inside, nothing fetched."""

from __future__ import annotations

from markupsafe import Markup

from shm.report import words
from shm.report.sheet.content import TestSheet
from shm.report.sheet.figures import page_figures
from shm.report.sheet.summary import HEADLINES, name, summary
from shm.report.sheet.tables import details, results
from shm.report.template import ENVIRONMENT
from shm.report.verdicts import overall
from shm.values import Verdict

CLOSING = "Intervals are central 90 %; standard deviations are of one test; times are UTC."
STYLES: dict[Verdict, str] = {
    "good": "steady",
    "warning": "watch",
    "refused": "alert",
    "unknown": "first",
}


def test_page(sheet: TestSheet) -> str:
    """The sheet of one test: readable on screen (light or dark), on paper, by ear."""
    verdict = overall(sheet.identification.quality)
    figures = page_figures(sheet)
    return ENVIRONMENT.get_template("sheet.html.j2").render(
        title=name(sheet),
        verdict=HEADLINES[verdict],
        style=STYLES[verdict],
        summary=summary(sheet),
        facts=facts(sheet),
        illustrations=[(item, Markup(item.svg())) for item in figures],  # noqa: S704
        results=results(sheet),
        details=details(sheet),
        bridge=sheet.bridge,
        made=f"Made {words.moment(sheet.generated_at)} by shm {sheet.version}. "
        if sheet.generated_at
        else "",
        closing=CLOSING,
    )


def facts(sheet: TestSheet) -> tuple[tuple[str, str, str], ...]:
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
