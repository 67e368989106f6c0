"""The report as plain text for a terminal."""

from __future__ import annotations

from dataclasses import replace

from shm.report import words
from shm.report.content import HangerReport
from shm.report.diagnosis.part import diagnosis_part
from shm.report.summary import status, summary
from shm.report.table import WIDTH, Table, headed, laid_out
from shm.report.tables import tables

_ROWS_SHOWN = 12


def text(data: HangerReport, width: int = WIDTH) -> str:
    """The report of one hanger: the summary, the tables, the gap diagnosis."""
    numbers = [_table(table, width) for table in tables(data)]
    return "\n".join((_head(data, width), *numbers, *diagnosis_part(data, width)))


def _head(data: HangerReport, width: int) -> str:
    name = words.hanger_name(data.hanger.id, data.hanger.name)
    within = f", {data.period}" if data.period else ""
    return headed(f"{name}, {data.bridge}{within}: {status(data).value}", summary(data), width)


def _table(table: Table, width: int) -> str:
    """The table; of many tests or alerts only the latest."""
    left = len(table.rows) - _ROWS_SHOWN
    if table.headings[0] != "time" or left <= 0:
        return laid_out(table, width)
    note = f"... and {left} earlier ones (in HTML and JSON)"
    return laid_out(replace(table, rows=table.rows[:_ROWS_SHOWN], note=note), width)
