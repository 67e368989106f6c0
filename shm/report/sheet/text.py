"""A test's sheet for a terminal of 100 columns: short, the rest is on the page."""

from __future__ import annotations

import textwrap

from shm.report.sheet.content import TestSheet
from shm.report.sheet.summary import headline, summary
from shm.report.sheet.tables import dropped, modes, set_aside
from shm.report.table import WIDTH, headed, laid_out
from shm.report.verdicts import SYMBOLS, label, quantity
from shm.values import QualityCheck

_INDENT = 11


def test_text(sheet: TestSheet) -> str:
    """Paragraph, modes, what was set aside or left out, what the quality checks warn of."""
    tables = [table for table in (modes(sheet), set_aside(sheet), dropped(sheet)) if table.rows]
    parts = [headed(headline(sheet), summary(sheet)), *(laid_out(table) for table in tables)]
    return "\n".join([*parts, *_quality(sheet), *_notes(sheet)])


def _quality(sheet: TestSheet) -> list[str]:
    checks = sheet.identification.quality
    if not checks:
        return []
    good = [check.name for check in checks if check.verdict == "good"]
    lines = [_told(check) for check in checks if check.verdict != "good"]
    if good:
        lines.append(_wrapped(label("good"), ", ".join(good)))
    return ["QUALITY", *lines, ""]


def _told(check: QualityCheck) -> str:
    figure = f"{quantity(check.value, check.unit)}, limit {quantity(check.limit, check.unit)}"
    what = f"{check.name} ({figure}): {check.found.rstrip('.')}"
    return _wrapped(label(check.verdict), f"{what}. → {check.remedy}" if check.remedy else what)


def _wrapped(mark: str, words: str) -> str:
    return textwrap.fill(
        words, WIDTH, initial_indent=mark.ljust(_INDENT), subsequent_indent=" " * _INDENT
    )


def _notes(sheet: TestSheet) -> list[str]:
    return [_wrapped(f"{SYMBOLS['warning']} note", note) for note in sheet.identification.notes]
