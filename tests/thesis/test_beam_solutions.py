"""Figures 2.3 to 2.7 of the thesis, as `shm validate --figure` shows them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from shm_cli.validation.thesis_figures import LIMIT, MODES, _distance, solutions
from shm_cli.validation.thesis_figures import SOLUTIONS as FIGURES
from tests.cli.conftest import Shm

PNG = b"\x89PNG"


@pytest.mark.parametrize("number", FIGURES)
def test_the_equation_of_the_thesis_has_its_roots_there(number: str) -> None:
    found = solutions(FIGURES[number], 50)
    assert found.values.shape == (50, MODES)
    assert found.difference < LIMIT


def test_another_root_would_be_seen() -> None:
    q, xi = np.array([[4.73 * 1.01]]), np.array([[0.1]])
    assert _distance(q, xi, np.inf)[0, 0] > 1000 * LIMIT


def test_large_tension_makes_a_string_and_none_a_clamped_beam() -> None:
    assert solutions(FIGURES["2.3"], 5).values[-1, 0] == pytest.approx(1 + 2 / 200, rel=1e-3)
    assert solutions(FIGURES["2.4"], 5).values[0] == pytest.approx(1.0, abs=1e-3)


def test_a_figure_is_shown_drawn_and_given_as_a_document(shm: Shm, tmp_path: Path) -> None:
    path = tmp_path / "figure.png"
    told = shm("validate", "--figure", "2.7", "--out", path)
    assert "phi_7" in told.out
    assert "not how stiff" in told.out
    assert path.read_bytes().startswith(PNG)
    assert len(shm("validate", "--figure", "2.6", "--json").document["points"][0]["values"]) == 7


def test_a_picture_without_its_figure_is_a_usage_error(shm: Shm, tmp_path: Path) -> None:
    ended = shm("validate", "--out", tmp_path / "figure.png")
    assert ended.code == 2
    assert "--figure 2.4" in ended.err
