"""Fills docs/blind_trial.md from a trial that was made and solved, with its figures and its page.

python docs/blind_page.py DIR KEY
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

from docs.filling import fill_in
from shm.blind.scoring import opened
from shm.report import Illustration, Table, trial_figures, trial_page
from shm.report.trial.summary import misses, summary
from shm.report.trial.tables import answers, evidence
from shm.values import TrialScore

DOCS = Path(__file__).parent
PAGE, FIGURES = DOCS / "blind_trial.md", DOCS / "figures"
_HTML = "blind_trial.html"
_DOTS_PER_INCH = 110


def _sentence(title: str) -> str:
    return title if title.endswith("?") else f"{title}."


def fragment(score: TrialScore, drawn: Sequence[Illustration]) -> str:
    """What came out, for people: words, what is missed, figures, tables."""
    seal = f"Seed {score.seed}; SHA-256 of the key `{score.key_sha256}`."
    parts = [summary(score), f"{seal} The same as a page of its own: [blind_trial.html]({_HTML})."]
    if lost := misses(score):
        parts.append("\n".join(["Missed:\n", *(f"- {each}" for each in lost)]))
    parts += [
        f"![{item.alt}](figures/{item.name}.png)\n\n*{_sentence(item.title)}* {item.caption}"
        for item in drawn
    ]
    return "\n\n".join([*parts, *map(_markdown, (*answers(score), *evidence(score)))])


def _markdown(table: Table) -> str:
    rows = (table.headings, ("---",) * len(table.headings), *table.rows)
    lines = [f"| {' | '.join(cell.replace('|', '/') for cell in row)} |" for row in rows]
    note = ["", table.note] if table.note else []
    return "\n".join([f"**{table.title}**", "", *lines, *note])


def write(score: TrialScore, page: Path = PAGE, figures: Path = FIGURES) -> None:
    """The fragment into the page, the figures as PNG, and the whole as HTML beside the page."""
    figures.mkdir(exist_ok=True)
    drawn = trial_figures(score)
    for item in drawn:
        (figures / f"{item.name}.png").write_bytes(item.png(_DOTS_PER_INCH))
    page.with_name(_HTML).write_text(trial_page(score), encoding="utf-8")
    fill_in(page, "blind trial", fragment(score, drawn))


if __name__ == "__main__":
    write(opened(Path(sys.argv[1]), Path(sys.argv[2])))
