"""The page of the docs is filled from a trial's score."""

from __future__ import annotations

import csv
import re
from pathlib import Path

import numpy as np
import pytest

from docs.blind_page import PAGE, TABLES, write
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
    write(score, copy, tmp_path / "figures", tmp_path / "blind_trial")
    return copy


@pytest.mark.slow
def test_the_page_holds_words_marks_and_figures_that_exist(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    filled = text.split("<!-- blind trial -->")[1].split("<!-- /blind trial -->")[0]
    assert "96 simulated hangers were put before the diagnosis" in filled
    assert not re.search(r"\b(nan|inf)\b", filled)
    shown = re.findall(r"\]\((figures/[^)]+)\)", filled)
    assert len(shown) >= 6
    assert all((page.parent / name).stat().st_size > 5000 for name in shown)
    assert page.with_suffix(".html").exists()
    assert text.startswith(PAGE.read_text(encoding="utf-8").split("<!-- blind trial -->")[0])


@pytest.mark.slow
def test_every_table_of_the_page_is_a_file_of_whole_rows(page: Path) -> None:
    named = re.findall(r"\]\((blind_trial/[^)]+)\)", page.read_text(encoding="utf-8"))
    files = page.with_suffix("").iterdir()
    assert set(named) == {f"blind_trial/{file.name}" for file in files}
    assert len(named) > 4
    for name in [name for name in named if name.endswith(".csv")]:
        text = (page.parent / name).read_text(encoding="utf-8")
        head, *rows = csv.reader(text.splitlines())
        assert {len(row) for row in rows} <= {len(head), 1}, name


def test_the_tables_in_the_repository_are_those_that_the_page_names() -> None:
    named = re.findall(r"\]\(blind_trial/([^)]+)\)", PAGE.read_text(encoding="utf-8"))
    assert set(named) == {file.name for file in TABLES.iterdir()}
    assert len((TABLES / "marks.csv").read_text(encoding="utf-8").splitlines()) > 40
