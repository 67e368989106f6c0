"""Figures 5.1 to 5.37 and B.1 to B.14 of the thesis, as `shm validate --figure` shows them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from shm.bridge import load_hanger
from shm.inference import UpdateOptions, update
from shm.models import THESIS, build
from shm.models.solid.classes import SolidModel
from shm.modes_document import load_modes
from shm.report.figures.specification import Points
from shm.values import PLANES, Posterior
from shm_cli import thesis
from shm_cli.validation import thesis_figures
from tests.cli.conftest import Shm

HANGER = load_hanger(thesis.HANGER_FILE)


def _quiet(label: str, fraction: float) -> None:
    pass


@pytest.fixture(scope="module")
def posterior() -> Posterior:
    tests = load_modes(thesis.PRINTINGS["table 1.1"])
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


@pytest.mark.parametrize("plane", PLANES)
def test_the_surface_of_a_plain_rod_s_mode_moves_as_the_clamped_beam(plane) -> None:
    """Problem: a clamped rod of 12 m under tension; solution: the Euler-Bernoulli beam's second
    mode in closed form, which shear changes by less than 0.01 of its largest deflection."""
    model, one = build("s1", HANGER, THESIS), np.array([1.0])
    assert isinstance(model, SolidModel)
    corners, moved = model.surface(one, plane, 2)
    axis, at_m = PLANES.index(plane), corners[..., 2].ravel()
    held = (at_m < 1e-9) | (at_m > HANGER.length_m - 1e-9)
    assert np.abs(moved.reshape(-1, 3)[held]).max() < 1e-9
    at_m, along = at_m.round(6), np.argsort(at_m)
    places = np.unique(at_m)
    ours = np.interp(places, at_m[along], moved[..., axis].ravel()[along])
    beam = build("beam1", HANGER, THESIS).shape(np.array([1.0, 1.0]), plane, 2, places)
    beam *= np.sign(beam @ ours)
    assert ours == pytest.approx(beam, abs=0.02)


def test_the_plates_of_a_solid_are_on_its_surface() -> None:
    """The deck-end plate is wide along the bridge, the arch-end plate across it."""
    model = build("solid0", HANGER, THESIS)
    assert isinstance(model, SolidModel)
    assert HANGER.plate is not None
    for plane in PLANES:
        corners, _ = model.surface(np.array([1.0]), plane, 1)
        width = HANGER.plate.end_width_m / 2
        at_m = corners[..., 2]
        assert at_m[corners[..., 1] > 0.99 * width].max() < 1e-9
        assert at_m[corners[..., 0] > 0.99 * width].min() == pytest.approx(HANGER.length_m)


def test_every_figure_of_appendix_b_is_a_mode_of_both_planes() -> None:
    assert thesis_figures.MODE_SHAPES["B.1"] == (1, "transverse")
    assert thesis_figures.MODE_SHAPES["B.14"] == (7, "longitudinal")
    assert len(thesis_figures.MODE_SHAPES) == 14


def test_predict_draws_a_mode_of_a_solid_and_refuses_a_beam_s(shm: Shm, tmp_path: Path) -> None:
    path = tmp_path / "mode.png"
    given = ("--hanger-file", thesis.HANGER_FILE, "--shape", "longitudinal:1", "--figure", path)
    ended = shm("predict", "s1", *given)
    assert (ended.code, ended.err) == (0, "")
    assert f"is drawn in {path}" in ended.out.replace("\n", " ")
    assert path.read_bytes().startswith(b"\x89PNG")
    assert "is no solid" in shm("predict", "beam1", *given).err
