"""The tables of docs/trials/validation.md: whole as CSV beside the page, in short in the page."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from itertools import groupby
from pathlib import Path

from docs.filling import fill_in, write_csv
from shm_cli.common import markdown
from tests.benchmarks.thesis import frequencies, selection

PAGE = Path(__file__).parent / "trials" / "validation.md"
Cells = Sequence[str]


def write(tables: Sequence[Cells], chosen: Sequence[Cells], page: Path = PAGE) -> None:
    """Both tables, the thesis's frequencies and the choice among the classes, into CSV and page."""
    whole = {"frequencies": (frequencies.HEADS, *tables), "selection": (selection.HEADS, *chosen)}
    for name, rows in whole.items():
        write_csv(_csv_of(name, page), rows)
    fill_in(page, "frequencies", largest_differences(tables))
    fill_in(page, "selection", counted_ten_times(chosen))


def kept(name: str, page: Path = PAGE) -> list[Cells]:
    """Return the rows of a table as it was last computed, without its head."""
    with _csv_of(name, page).open(newline="", encoding="utf-8") as file:
        return list(csv.reader(file))[1:]


def _csv_of(name: str, page: Path) -> Path:
    return page.with_suffix("") / f"{name}.csv"


def largest_differences(tables: Sequence[Cells]) -> str:
    """One row for each table, class and mark; of stiffness after stiffness the worst difference."""
    rows = []
    for _, group in groupby(tables, key=_series):
        each = list(group)
        table, model, condition, *_, mark = each[0]
        if len(each) > 1:
            condition = f"{condition} to {each[-1][2].removeprefix('k = ')}"
        worst = max((row[5] for row in each), key=lambda cell: float(cell.split()[0]))
        rows.append((table, model, condition, worst, mark))
    return markdown(("table", "class", "condition", "largest difference", "mark"), rows)


def _series(row: Cells) -> tuple[str, ...]:
    table, model, condition, *_, mark = row
    return table, model, mark, "" if condition.startswith("k = ") else condition


def counted_ten_times(chosen: Sequence[Cells]) -> str:
    """Without the rows of N_D = 1 and the column of the most probable parameters."""
    return markdown(selection.HEADS[:-1], [row[:-1] for row in chosen if row[1] != "1"])
