"""The surface of a solid model in one of its modes, which figures in space draw."""

from __future__ import annotations

import numpy as np
import pytest

from shm.models import THESIS, build
from shm.models.solid.classes import SolidModel
from shm.values import PLANES
from tests.helpers.hangers import HANGER_3 as HANGER


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
