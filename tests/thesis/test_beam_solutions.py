"""Figures 2.3 to 2.7 of the thesis, as `validate.py --figure` shows them."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from tests.benchmarks import validate
from tests.benchmarks.thesis.thesis_figures import LIMIT, MODES, _distance, solutions
from tests.benchmarks.thesis.thesis_figures import SOLUTIONS as FIGURES

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


def test_a_figure_is_shown_and_drawn(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "figure.png"
    assert validate.main(["--figure", "2.7", "--out", str(path)]) == 0
    told = capsys.readouterr().out
    assert "phi_7" in told
    assert "not how stiff" in told
    assert path.read_bytes().startswith(PNG)


def test_a_figure_is_given_as_a_document(capsys: pytest.CaptureFixture[str]) -> None:
    assert validate.main(["--figure", "2.6", "--json"]) == 0
    assert len(json.loads(capsys.readouterr().out)["points"][0]["values"]) == 7
