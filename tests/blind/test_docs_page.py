"""The page of the docs is filled from a trial's score."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from docs.blind_page import PAGE, write
from shm.blind.scoring import trial_score
from tests.helpers.trial_answers import plausible, some_truths


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the page, filled from a small trial."""
    tmp_path = tmp_path_factory.mktemp("docs")
    truths, rng = some_truths(96), np.random.default_rng(1)
    answers = [plausible(truth, rng) for truth in truths]
    score = trial_score(truths, answers, [], ("a" * 64, "b" * 64), 7, rng)
    copy = tmp_path / "blind_trial.md"
    copy.write_text(PAGE.read_text(encoding="utf-8"), encoding="utf-8")
    write(score, copy, tmp_path / "figures")
    return copy


def test_the_page_holds_words_marks_and_figures_that_exist(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    filled = text.split("<!-- blind trial -->")[1].split("<!-- /blind trial -->")[0]
    assert "96 simulated hangers were put before the diagnosis" in filled
    assert "| mark | outcome | of | asked | found |" in filled
    assert not re.search(r"\b(nan|inf)\b", filled)
    shown = re.findall(r"\]\((figures/[^)]+)\)", filled)
    assert len(shown) >= 6
    assert all((page.parent / name).stat().st_size > 5000 for name in shown)
    assert page.with_suffix(".html").exists()
    assert text.startswith(PAGE.read_text(encoding="utf-8").split("<!-- blind trial -->")[0])


def test_tables_have_as_many_cells_in_every_row(page: Path) -> None:
    widths: list[int] = []
    for line in page.read_text(encoding="utf-8").splitlines():
        if not line.startswith("|"):
            widths = []
            continue
        widths.append(line.count("|"))
        assert widths[-1] == widths[0], line
