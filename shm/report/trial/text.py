"""A blind trial for a terminal."""

from __future__ import annotations

import textwrap
from dataclasses import replace

from shm.report.table import WIDTH, Table, headed, laid_out
from shm.report.trial.summary import TITLE, misses, summary, verdict
from shm.report.trial.tables import evidence, marks
from shm.values import TrialScore

_ROWS_SHOWN = 20


def trial_text(score: TrialScore, width: int = WIDTH) -> str:
    """The summary, what is missed, the marks, the first of the wrong answers."""
    told = [
        textwrap.fill(each, width, initial_indent="! ", subsequent_indent="  ")
        for each in misses(score)
    ]
    tables = [marks(score), *(_short(table) for table in evidence(score))]
    head = headed(f"{TITLE}: {verdict(score)}", summary(score), width)
    numbers = (laid_out(table, width) for table in tables)
    return "\n".join((head, *told, *([""] if told else []), *numbers, _seal(score)))


def _short(table: Table) -> Table:
    left = len(table.rows) - _ROWS_SHOWN
    if left <= 1:
        return table
    more = f"... and {left} more rows (in HTML and JSON)."
    return replace(table, rows=table.rows[:_ROWS_SHOWN], note=f"{table.note} {more}".strip())


def _seal(score: TrialScore) -> str:
    return (
        f"Seed {score.seed}. SHA-256 of the key:\n{score.key_sha256}\n"
        f"and of the answers:\n{score.answers_sha256}\n"
    )
