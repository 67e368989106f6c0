"""A bar with turnbuckles in the beam elements: closed forms, counting, what cannot be."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from shm.errors import UsageError
from shm.simulate import HammerPlan, HangerState
from shm.values import Hanger, Turnbuckle
from tests.worlds.simulated.bar.description import pieces_of
from tests.worlds.simulated.elements import modes_below, natural_frequencies
from tests.worlds.simulated.hammer import hammer_test

MIDDLE = Turnbuckle(x_m=6.0, length_m=0.5, mass_kg=400.0, bending_stiffness_n_m2=5e7)


def test_a_turnbuckle_like_the_bar_changes_nothing(hanger: Hanger) -> None:
    same = Turnbuckle(3.0, 0.6, 0.6 * hanger.mass_per_length_kg_m, hanger.bending_stiffness_n_m2)
    state = HangerState(711e3, 1e7, 1e6, 1e8, 0, length_m=10.0)
    np.testing.assert_allclose(
        natural_frequencies(replace(hanger, turnbuckles=(same,)), state, 8),
        natural_frequencies(hanger, state, 8),
        rtol=1e-6,
    )


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


def test_all_modes_below_a_frequency_are_counted_with_turnbuckles(hanger: Hanger) -> None:
    both = replace(hanger, turnbuckles=(replace(MIDDLE, x_m=1.0), MIDDLE))
    for state in (HangerState(711e3, 0, 0, 0, 0), HangerState(1e8, 1e6)):
        count = modes_below(both, state, 500.0)
        assert natural_frequencies(both, state, count + 1)[0, -1] > 500.0


def test_an_effective_length_without_room_for_the_turnbuckles_is_refused(hanger: Hanger) -> None:
    state = HangerState(711e3, length_m=0.4)
    plan = HammerPlan(sensors_x_m=(0.1,), hammer_x_m=0.2)
    with pytest.raises(UsageError, match="exceed that of the turnbuckles"):
        hammer_test(replace(hanger, turnbuckles=(MIDDLE,)), state, plan, np.random.default_rng(1))
