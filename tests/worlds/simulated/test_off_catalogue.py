"""Effects that no catalogue holds, each against a closed form or a limit."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import eigh

from shm.errors import UsageError
from shm.simulate import HangerState, PlantedEffect
from shm.values import FloatArray, Hanger
from tests.helpers.planted_modes import planted_modes
from tests.worlds.simulated.campaign import CampaignPlan
from tests.worlds.simulated.detectable import scaled_to, size_of
from tests.worlds.simulated.effects.base import TestConditions
from tests.worlds.simulated.effects.registry import PLANTED, UNLISTED, choices, drawn, ranges_of
from tests.worlds.simulated.elements import natural_frequencies, plane_modes

STATE = HangerState(711e3)
PLACES = (1.56, 3.48, 5.4, 7.92)
MODES = 8


def frequencies(
    hanger: Hanger, *effects: PlantedEffect, amplitude: float = 1.0, test: str = "t1"
) -> FloatArray:
    conditions = TestConditions(test, amplitude=amplitude)
    return planted_modes(hanger, STATE, effects, conditions, MODES, PLACES).frequency_hz


def effect(name: str, at: str = "everywhere", **values: float) -> PlantedEffect:
    return PlantedEffect(name, at, values)


def test_none_of_them_is_in_the_catalogue() -> None:
    assert len(UNLISTED) >= 5
    assert not set(UNLISTED) & set(PLANTED)


@pytest.mark.parametrize("name", UNLISTED)
def test_each_moves_frequencies_and_vanishes_with_its_size(hanger: Hanger, name: str) -> None:
    plain = frequencies(hanger)
    for at in choices(name, PLACES, ("t1",)):
        one = drawn(name, at, hanger, np.random.default_rng(1))
        known = ranges_of(one, hanger)
        large = {key: each.strong for key, each in known.items() if each.is_size}
        zero = {key: each.zero for key, each in known.items() if each.is_size}
        moved = frequencies(hanger, replace(one, values={**one.values, **large}))
        assert np.max(np.abs(moved / plain - 1)) > 1e-4
        still = frequencies(hanger, replace(one, values={**one.values, **zero}))
        np.testing.assert_allclose(still, plain, rtol=1e-9)


@pytest.mark.parametrize("name", UNLISTED)
def test_each_is_scaled_to_a_size(hanger: Hanger, name: str) -> None:
    plan = CampaignPlan(modes=4, temperatures_c=(0.0, 20.0), amplitudes=(0.3, 1.0), shapes=False)
    one = drawn(name, "everywhere", hanger, np.random.default_rng(4))
    found = scaled_to(5.0, hanger, STATE, one, plan)
    assert found is not None
    assert size_of(hanger, STATE, (found,), plan) == pytest.approx(5.0, rel=0.01)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        (effect("breathing_cracks"), "no effect"),
        (effect("tuned_damper", "deck end"), "does not act"),
        (effect("tuned_damper", mass_kg=1.0), "frequency_hz"),
    ],
)
def test_one_that_cannot_be_is_refused(hanger: Hanger, wrong: PlantedEffect, said: str) -> None:
    with pytest.raises(UsageError, match=said):
        frequencies(hanger, wrong)


def test_a_crack_leaves_a_mode_alone_that_does_not_open_it(hanger: Hanger) -> None:
    """Below the level at which any mode opens it, and above: half of each cycle at most."""
    crack = effect("breathing_crack", compliance_rad_n_m=2e-7, x_m=3.0, opening_level=0.5)
    plain = frequencies(hanger)
    np.testing.assert_allclose(frequencies(hanger, crack, amplitude=0.4), plain, rtol=1e-9)
    change = {level: frequencies(hanger, crack, amplitude=level) / plain - 1 for level in (1, 4)}
    assert np.all(change[4] <= change[1] + 1e-9)
    assert np.sum(np.abs(change[1]) < 1e-9) >= 2
    assert change[4].min() < -1e-4


def test_an_ever_open_crack_has_half_of_a_hinge(hanger: Hanger) -> None:
    """First order: omega^2 falls by c M^2 of the mass-normalised mode, half of it in a cycle."""
    compliance = 1e-9
    crack = effect("breathing_crack", compliance_rad_n_m=compliance, x_m=3.0, opening_level=1e-6)
    plain = frequencies(hanger)[0]
    step = 0.02
    moved = plane_modes(hanger, STATE, "transverse", MODES).at(np.array([3 - step, 3, 3 + step]))
    bent = (moved[0] - 2 * moved[1] + moved[2]) / step**2
    moment = hanger.bending_stiffness_n_m2 * bent
    fall = compliance * moment**2 / (2 * np.pi * plain) ** 2 / 2 / 2
    found = 1 - frequencies(hanger, crack)[0] / plain
    np.testing.assert_allclose(found, fall, rtol=0.02, atol=2e-9)


def test_a_guide_with_play_is_met_by_hard_hits_only(hanger: Hanger) -> None:
    guide = effect("loose_guide", stiffness_n_m=5e3, x_m=4.0, gap_level=0.5)
    plain = frequencies(hanger)
    np.testing.assert_allclose(frequencies(hanger, guide, amplitude=0.4), plain, rtol=1e-9)
    always = effect("intermediate_support", stiffness_n_m=5e3, x_m=4.0)
    harder = frequencies(hanger, guide, amplitude=1e6) / frequencies(hanger, always)
    np.testing.assert_allclose(harder, 1, atol=1e-6)


def test_a_tuned_damper_is_a_mass_on_a_spring_at_its_place(hanger: Hanger) -> None:
    """In the coordinates of the bar's 40 lowest modes and the damper's own; its mode left out."""
    mass, hertz, x_m = 8.0, 17.0, 3.0
    damper = effect("tuned_damper", mass_kg=mass, frequency_hz=hertz, x_m=x_m)
    bar = plane_modes(hanger, STATE, "transverse", 40)
    moved = bar.at(np.array([x_m]))[0]
    spring = mass * (2 * math.pi * hertz) ** 2
    apart = np.append(moved, -1.0)
    stiffness = np.diag(np.append(bar.angular_frequency_rad_s**2, 0.0))
    squares, vectors = eigh(
        stiffness + spring * np.outer(apart, apart), np.diag(np.append(np.ones(40), mass))
    )
    own = int(np.argmax(np.abs(vectors[-1])))
    expected = np.sqrt(np.delete(squares, own))[:MODES] / 2 / np.pi
    found = frequencies(hanger, damper)
    np.testing.assert_allclose(found, [expected] * 2, rtol=1e-5)


def test_a_pair_of_equal_bars_swings_in_step_or_against_the_spacer(hanger: Hanger) -> None:
    """In step nothing changes; against it each bar feels twice the spacer's spring."""
    spacer = 2e3
    pair = effect("coupled_pair", spacer_n_m=spacer, x_m=6.0, tension_ratio=1.0)
    step = frequencies(hanger)
    guide = effect("intermediate_support", stiffness_n_m=2 * spacer, x_m=6.0)
    against = frequencies(hanger, guide)
    found = frequencies(hanger, pair)
    nearest = np.minimum(np.abs(found / step - 1), np.abs(found / against - 1))
    assert nearest.max() < 2e-5


def test_the_modes_of_an_unequal_pair_repel(hanger: Hanger) -> None:
    """The slacker bar's modes lie below this bar's, which the spacer lifts therefore."""
    pair = effect("coupled_pair", spacer_n_m=5e3, x_m=5.0, tension_ratio=0.85)
    assert np.all(frequencies(hanger, pair) >= frequencies(hanger) * (1 - 1e-9))


def test_rotary_inertia_lowers_modes_by_their_slope(hanger: Hanger) -> None:
    """First order: f falls by J w'^2/2 of the mass-normalised mode."""
    heavy = effect("rotary_coupling", inertia_kg_m2=0.01, x_m=3.0)
    step = 0.02
    moved = plane_modes(hanger, STATE, "transverse", MODES).at(np.array([3 - step, 3 + step]))
    slope = (moved[1] - moved[0]) / (2 * step)
    fall = 1 - frequencies(hanger, heavy)[0] / frequencies(hanger)[0]
    np.testing.assert_allclose(fall, 0.005 * slope**2, rtol=0.02, atol=2e-9)


def test_tension_between_planes_is_that_of_the_later_plane(hanger: Hanger) -> None:
    later = effect("tension_between_planes", tension_change=0.03)
    found = frequencies(hanger, later)
    tauter = natural_frequencies(hanger, HangerState(711e3 * 1.03), MODES)
    np.testing.assert_allclose(found[0], frequencies(hanger)[0], rtol=1e-9)
    np.testing.assert_allclose(found[1], tauter[1], rtol=1e-6)


def test_a_wandering_tension_differs_from_test_to_test_and_stays_in_each(hanger: Hanger) -> None:
    load = effect("wandering_tension", tension_scatter=0.01, phase=0.3)
    by_test = np.array([frequencies(hanger, load, test=f"t{n}")[0, 0] for n in range(1, 7)])
    spread = by_test / frequencies(hanger)[0, 0] - 1
    assert 0.001 < np.std(spread) < 0.01
    again = frequencies(hanger, load, test="t2")[0, 0]
    assert again == by_test[1]
