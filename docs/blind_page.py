"""Fills docs/trials/blind_trial.md from a trial that was made and solved.

python docs/blind_page.py DIR KEY

Its figures stand beside it as PNG, its tables as CSV. The whole as one HTML page, which is not kept
in the repository, is written to docs/trials/blind_trial.html; `make docs` takes it into the manual.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

from docs.filling import fill_in, write_csv
from shm.blind.scoring import opened
from shm.report.as_html import as_html
from shm.report.figures.every_figure import trial_figures
from shm.report.figures.specification import Illustration
from shm.report.paper import Table
from shm.report.trial_report import answers, evidence, summary, trial_paper
from shm.values import TrialScore

DOCS = Path(__file__).parent
TRIALS = DOCS / "trials"
PAGE, FIGURES, TABLES = TRIALS / "blind_trial.md", TRIALS / "figures", TRIALS / "blind_trial"
_HTML, _IN_WORDS = "blind_trial.html", "figures_in_words.txt"
_DOTS_PER_INCH = 110


def fragment(score: TrialScore, drawn: Sequence[Illustration]) -> str:
    """What came out, for people: words and figures; the tables, marks first, are linked to."""
    parts = [summary(score), f"Seed {score.seed}; SHA-256 of the key `{score.key_sha256}`."]
    parts += [f"![{item.title}](figures/{item.name}.png)" for item in drawn]
    listed = [f"- [{each.title}](blind_trial/{file_name(each)})" for each in tables(score)]
    listed.append(f"- [The figures explained, and in words](blind_trial/{_IN_WORDS})")
    return "\n\n".join([*parts, "\n".join(["All numbers, as tables:\n", *listed])])


def tables(score: TrialScore) -> list[Table]:
    return [*answers(score), *evidence(score)]


def file_name(table: Table) -> str:
    """The title in lower case, up to its first comma: what the sizes are may change."""
    return table.title.partition(",")[0].lower().replace(" ", "_") + ".csv"


def _write_csv(table: Table, folder: Path) -> None:
    note = [(table.note,)] if table.note else []
    write_csv(folder / file_name(table), [table.headings, *table.rows, *note])


def write(
    score: TrialScore, page: Path = PAGE, figures: Path = FIGURES, folder: Path = TABLES
) -> None:
    """The fragment into the page, figures as PNG, tables as CSV, and the whole as HTML beside."""
    figures.mkdir(exist_ok=True)
    folder.mkdir(exist_ok=True)
    for table in tables(score):
        _write_csv(table, folder)
    drawn = trial_figures(score)
    in_words = "\n\n".join(f"{item.title}\n{item.caption}\n{item.alt}" for item in drawn)
    (folder / _IN_WORDS).write_text(f"{in_words}\n", encoding="utf-8")
    for item in drawn:
        (figures / f"{item.name}.png").write_bytes(item.png(_DOTS_PER_INCH))
    page.with_name(_HTML).write_text(as_html(trial_paper(score)), encoding="utf-8")
    fill_in(page, "blind trial", fragment(score, drawn))


if __name__ == "__main__":
    write(opened(Path(sys.argv[1]), Path(sys.argv[2])))
