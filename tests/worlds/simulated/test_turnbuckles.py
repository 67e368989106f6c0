"""A bar with turnbuckles in the beam elements: closed forms, counting, what cannot be."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from shm.simulate import HangerState
from shm.values import Hanger, Turnbuckle
from tests.worlds.simulated.bar.description import pieces_of
from tests.worlds.simulated.elements import natural_frequencies

pytestmark = pytest.mark.trial  # of the simulated world alone, not of the product

MIDDLE = Turnbuckle(x_m=6.0, length_m=0.5, mass_kg=400.0, bending_stiffness_n_m2=5e7)


def test_a_heavy_turnbuckle_in_a_slack_bar_is_a_point_mass_on_a_string(hanger: Hanger) -> None:
    """Half-length h, wave number k, mass M: cot(k h) = k M/(2 m) in the first mode of a string."""
    short = replace(MIDDLE, length_m=0.01, bending_stiffness_n_m2=1.0)
    limp = replace(hanger, elastic_modulus_pa=1e5, turnbuckles=(short,))
    m, h = hanger.mass_per_length_kg_m, (hanger.length_m - short.length_m) / 2

    def fault(k: float) -> float:
        return float(np.cos(k * h) - k * short.mass_kg / (2 * m) * np.sin(k * h))

    k = brentq(fault, 1e-9, np.pi / (2 * h))
    found = natural_frequencies(limp, HangerState(711e3, 0, 0, 0, 0), 1)[0, 0]
    assert found == pytest.approx(k * np.sqrt(711e3 / m) / (2 * np.pi), rel=1e-4)


def test_the_pieces_fill_the_effective_length_and_turnbuckles_keep_theirs(hanger: Hanger) -> None:
    at_the_end = replace(MIDDLE, x_m=11.75)
    pieces = pieces_of(replace(hanger, turnbuckles=(at_the_end, MIDDLE)), 9.0)
    assert sum(piece.length_m for piece in pieces) == pytest.approx(9.0)
    assert [piece.length_m for piece in pieces][1::2] == [0.5, 0.5]
    assert pieces[0].length_m / pieces[2].length_m == pytest.approx(5.75 / 5.25)
    assert pieces[1].mass_per_length_kg_m == 800.0
