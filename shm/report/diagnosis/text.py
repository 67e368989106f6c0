"""A gap diagnosis for a terminal."""

from __future__ import annotations

import textwrap
from dataclasses import replace

from shm.report.diagnosis.content import DiagnosisSheet
from shm.report.diagnosis.summary import headline, summary
from shm.report.diagnosis.tables import answers, evidence
from shm.report.table import WIDTH, Table, headed, laid_out

_ROWS_SHOWN = 10


def diagnosis_text(sheet: DiagnosisSheet, width: int = WIDTH) -> str:
    """The answer, what is wrong with the data, then the tables."""
    head = headed(headline(sheet), summary(sheet), width)
    return "\n".join((head, *diagnosis_body(sheet, width)))


def diagnosis_body(sheet: DiagnosisSheet, width: int) -> list[str]:
    """Remarks and tables, of long tables the first rows."""
    remarks = [_remark(remark, width) for remark in sheet.diagnosis.remarks]
    tables = [laid_out(_short(table), width) for table in (*answers(sheet), *evidence(sheet))]
    return [*remarks, *([""] if remarks else []), *tables]


def _remark(remark: str, width: int) -> str:
    return textwrap.fill(remark, width, initial_indent="! ", subsequent_indent="  ")


def _short(table: Table) -> Table:
    """The first rows; what is always said last, such as `no gap`, is kept."""
    left = len(table.rows) - _ROWS_SHOWN
    if left <= 1:
        return table
    more = f"... and {left} more rows (in HTML and JSON)."
    kept = (*table.rows[: _ROWS_SHOWN - 2], *table.rows[-2:])
    rows = kept if table.marks else table.rows[:_ROWS_SHOWN]
    return replace(table, rows=rows, note=f"{table.note} {more}".strip(), marks=())
