"""Figures 5.1 to 5.37 and B.1 to B.14 of the thesis, as `validate.py --figure` shows them."""

from __future__ import annotations

from pathlib import Path

import pytest

from shm.bridge import load_hanger
from shm.inference import UpdateOptions, update
from shm.models import THESIS, build
from shm.report.figures.specification import Points
from shm.values import Posterior
from shm_cli.example import HANGER_FILE
from tests.benchmarks.thesis import thesis_data, thesis_figures

HANGER = load_hanger(HANGER_FILE)


def _quiet(label: str, fraction: float) -> None:
    pass


@pytest.fixture(scope="module")
def posterior() -> Posterior:
    tests = thesis_data.measured_tests("table 1.1")
    return update(tests, build("beam2", HANGER, THESIS), UpdateOptions(samples=200))


def test_every_figure_of_chapter_5_is_of_parameters_that_its_class_has() -> None:
    assert [*thesis_figures.POSTERIORS] == [f"5.{number}" for number in range(1, 38)]
    for model, names in thesis_figures.POSTERIORS.values():
        known = {*build(model, HANGER, THESIS).parameter_names, "sigma"}
        parts = [part for name in names for part in name.split("/")]
        assert {thesis_figures._name(part) for part in parts} <= known


@pytest.mark.parametrize("number", ["5.4", "5.6", "5.18"])
def test_a_figure_of_each_kind_is_drawn(
    number: str, posterior: Posterior, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(thesis_figures, "_posterior", lambda *_: posterior)
    found = thesis_figures.posterior(HANGER, _quiet, number)
    found.write(tmp_path / "figure.png")
    assert (tmp_path / "figure.png").read_bytes().startswith(b"\x89PNG")
    assert len(found.cells) == len(found.document)


def test_the_densest_draws_of_a_pair_are_the_likeliest(
    posterior: Posterior, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(thesis_figures, "_posterior", lambda *_: posterior)
    drawn = thesis_figures.posterior(HANGER, _quiet, "5.6").specification
    assert drawn is not None
    clouds = [mark for mark in drawn.panels[0].marks if isinstance(mark, Points)][:-1]
    assert sum(len(cloud.x) for cloud in clouds) == len(posterior.samples)
    likeliest = posterior.parameter("theta_L")[posterior.log_likelihood.argmax()]
    assert likeliest in clouds[-1].x


def test_every_figure_of_appendix_b_is_a_mode_of_both_planes() -> None:
    assert thesis_figures.MODE_SHAPES["B.1"] == (1, "transverse")
    assert thesis_figures.MODE_SHAPES["B.14"] == (7, "longitudinal")
    assert len(thesis_figures.MODE_SHAPES) == 14


def test_a_figure_of_frequencies_has_each_measured_mode_once(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The data count ten times; the figure shows twelve modes, not 120."""
    monkeypatch.setattr(thesis_figures, "_SAMPLES", 100)
    found = thesis_figures.posterior(HANGER, _quiet, "5.3")
    modes = [(row[0], row[1]) for row in found.cells]
    assert len(modes) == len(set(modes)) == 12
