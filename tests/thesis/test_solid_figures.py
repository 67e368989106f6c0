"""Figures 3.5 to 3.20 of the thesis, as `validate.py --figure` shows them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from shm.bridge import load_hanger
from shm.report.figures.specification import Line, Points, Rule
from shm_cli.example import HANGER_FILE
from tests.benchmarks.thesis import frequencies, solid_figures
from tests.benchmarks.thesis.frequencies import FrequencyRow
from tests.helpers.slow import few_of

HANGER = load_hanger(HANGER_FILE)
HZ = tuple(np.arange(1.0, 7.0))
ROW = FrequencyRow("A.1", "s1", "", HZ, HZ, 0.0, np.nan)


def _quiet(label: str, fraction: float) -> None:
    pass


@pytest.fixture
def solved(monkeypatch: pytest.MonkeyPatch) -> None:
    """Replace the meshes, which take half a minute and are solved in test_frequency_tables."""
    rows = [
        replace(ROW, unknowns=100.0 * size, plane=plane, spring_n_m=10.0**size)
        for plane in ("transverse", "longitudinal")
        for size in (1, 2)
    ]
    monkeypatch.setattr(frequencies, "compared", lambda *_: rows)
    held = np.stack([np.array(HZ), np.array(HZ)])
    monkeypatch.setattr(solid_figures, "_held_hz", lambda *_: held * 1.25)


@pytest.mark.parametrize("number", few_of(solid_figures.FIGURES, 3))
def test_a_figure_has_its_panels_and_says_the_same_in_numbers(
    number: str, solved: None, tmp_path: Path
) -> None:
    found = solid_figures.FIGURES[number](HANGER, _quiet, number)
    path = tmp_path / "figure.png"
    found.write(path)
    assert path.read_bytes().startswith(b"\x89PNG")
    assert found.specification is not None
    above, _ = found.specification.rows
    drawn = [
        hz
        for panel in above
        for mark in panel.marks
        if isinstance(mark, Line) or (isinstance(mark, Points) and mark.filled)
        for hz in mark.y
    ]
    assert sorted(drawn) == sorted(each["hz"] for each in found.document)
    assert len(found.cells) == len(found.document)


def test_springs_are_drawn_over_class_0_beside_the_measured(solved: None) -> None:
    found = solid_figures.FIGURES["3.16"](HANGER, _quiet, "3.16")
    assert found.specification is not None
    below = found.specification.rows[1][0]
    rules = [mark.at for mark in below.marks if isinstance(mark, Rule)]
    lines = [mark for mark in below.marks if isinstance(mark, Line)]
    assert rules[0] == pytest.approx(100 * (5.82 / 1.25 - 1))
    assert np.allclose([line.y for line in lines], -20.0)


def test_the_time_of_a_mesh_stands_beside_the_thesis_s() -> None:
    row = replace(ROW, seconds=1.23, thesis_time="4 to 125 s")
    assert frequencies.timed_cells(row)[-2:] == ("1.2 s", "4 to 125 s")
    assert frequencies.timed_cells(ROW)[-2:] == ("", "")
