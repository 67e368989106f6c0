"""A test's sheet for a terminal: short, the rest is on the page."""

from __future__ import annotations

import textwrap

from shm.report.sheet.content import TestSheet
from shm.report.sheet.summary import headline, summary
from shm.report.sheet.tables import dropped, modes, set_aside
from shm.report.table import WIDTH, headed, laid_out
from shm.report.verdicts import SYMBOLS, label, quantity
from shm.values import QualityCheck

_INDENT = 11


def test_text(sheet: TestSheet, width: int = WIDTH) -> str:  # noqa: PT028  it is no test
    """Paragraph, modes, what was set aside or left out, what the quality checks warn of."""
    tables = [table for table in (modes(sheet), set_aside(sheet), dropped(sheet)) if table.rows]
    head = headed(headline(sheet), summary(sheet), width)
    numbers = (laid_out(table, width) for table in tables)
    return "\n".join([head, *numbers, *_quality(sheet, width), *_notes(sheet, width)])


def _quality(sheet: TestSheet, width: int) -> list[str]:
    checks = sheet.identification.quality
    if not checks:
        return []
    good = [check.name for check in checks if check.verdict == "good"]
    lines = [_told(check, width) for check in checks if check.verdict != "good"]
    if good:
        lines.append(_wrapped(label("good"), ", ".join(good), width))
    return ["QUALITY", *lines, ""]


def _told(check: QualityCheck, width: int) -> str:
    figure = f"{quantity(check.value, check.unit)}, limit {quantity(check.limit, check.unit)}"
    what = f"{check.name} ({figure}): {check.found.rstrip('.')}"
    told = f"{what}. → {check.remedy}" if check.remedy else what
    return _wrapped(label(check.verdict), told, width)


def _wrapped(mark: str, words: str, width: int) -> str:
    return textwrap.fill(
        words, width, initial_indent=mark.ljust(_INDENT), subsequent_indent=" " * _INDENT
    )


def _notes(sheet: TestSheet, width: int) -> list[str]:
    mark = f"{SYMBOLS['warning']} note"
    return [_wrapped(mark, note, width) for note in sheet.identification.notes]
