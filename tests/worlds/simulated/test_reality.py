"""A campaign beyond the textbook: none by default, stated figures, laws that meet it in limits."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from shm.simulate import HangerState, PlantedEffect
from shm.values import AddedMass, FloatArray, Hanger
from tests.helpers.planted_modes import planted_modes
from tests.worlds.simulated.campaign import CampaignPlan, campaign_with_truth
from tests.worlds.simulated.effects.base import TestConditions
from tests.worlds.simulated.effects.registry import LAWS, choices, drawn, ranges_of
from tests.worlds.simulated.reality import Reality, sd_factors

pytestmark = pytest.mark.trial  # of the simulated world alone, not of the product

STATE = HangerState(711e3)
PLACES = (1.56, 3.48, 5.4, 7.92)
QUICK = CampaignPlan(
    modes=4, temperatures_c=(10.0,), amplitudes=(1.0,), tension_spread=0.0, reality=Reality()
)
PERFECT = Reality(
    own_laws=False,
    section_sd=0.0,
    gain_sd=0.0,
    place_sd_m=0.0,
    turn_sd_deg=0.0,
    sd_freedom=10**9,
    plane_correlation=0.0,
)
LOSS = PlantedEffect("section_loss", "everywhere", {"loss": 0.2, "x_m": 4.0, "extent_m": 1.0})
SLIP = PlantedEffect("joint_softening", "both ends", {"log10_k_at_reference_level": 7.0})


def rng(seed: int = 1) -> np.random.Generator:
    return np.random.default_rng(seed)


def frequencies(
    hanger: Hanger,
    *effects: PlantedEffect,
    own_laws: bool = True,
    amplitude: float = 1.0,
    state: HangerState = STATE,
) -> FloatArray:
    conditions = TestConditions("t1", 10.0, amplitude, AddedMass(25.0, 3.6))
    return planted_modes(
        hanger, state, effects, conditions, 8, PLACES, own_laws=own_laws
    ).frequency_hz


def test_a_reality_without_any_departure_differs_in_noise_alone(hanger: Hanger) -> None:
    plain = replace(QUICK, reality=None, as_made=False)
    ideal = replace(plain, reality=PERFECT)
    one, other = (
        campaign_with_truth(hanger, STATE, (LOSS,), plan, rng()).truth.frequencies
        for plan in (plain, ideal)
    )
    found, expected = ([each.frequency_hz for each in modes] for modes in (one, other))
    np.testing.assert_allclose(found, expected, rtol=1e-9)
    assert [replace(each, frequency_hz=0.0) for each in one] == [
        replace(each, frequency_hz=0.0) for each in other
    ]


def test_the_truth_holds_the_noise_free_frequencies_of_every_test(hanger: Hanger) -> None:
    plan = replace(QUICK, planes=("longitudinal",), frequency_sd=1e-12, amplitudes=(1.0, 2.0))
    made = campaign_with_truth(hanger, STATE, (SLIP,), plan, rng())
    true = {(e.test, e.plane, e.order): e.frequency_hz for e in made.truth.frequencies}
    said = {(t.id, m.plane, m.order): m.frequency_hz for t in made.tests for m in t.modes}
    assert true.keys() == said.keys()
    np.testing.assert_allclose(list(true.values()), list(said.values()), rtol=1e-10)


def test_sensors_err_alike_in_all_tests_of_a_campaign(hanger: Hanger) -> None:
    """Without noise: a ratio of two channels in one mode is off by the same in every test."""
    plan = replace(QUICK, temperatures_c=(0.0, 20.0, 30.0), shape_sd=0.0, mass_share=0.0)
    made = campaign_with_truth(hanger, STATE, (), plan, rng())
    seen = np.array(
        [[(p.value, p.cross) for p in m.shape] for test in made.tests for m in test.modes]
    ).reshape(3, 2, 4, 4, 2)
    np.testing.assert_allclose(seen[1:], seen[:1].repeat(2, 0), atol=1e-9)
    turn = np.array([each.turn_rad for each in made.truth.sensors])
    gain = np.array([each.gain for each in made.truth.sensors])
    crossed = seen[0, 0, :, :, 1] / seen[0, 0, :, :, 0]
    np.testing.assert_allclose(crossed, [-np.tan(turn) * gain[:, 1] / gain[:, 0]] * 4, rtol=1e-6)


def test_noise_is_what_the_tests_state_in_the_mean_and_planes_err_alike(hanger: Hanger) -> None:
    """400 tests of a round bar: errors over true sds, sds over true ones, planes' correlation."""
    plan = replace(QUICK, modes=2, temperatures_c=(10.0,) * 100, mass_share=0.0, as_made=False)
    true_sd = 1e-4 * sd_factors(hanger, STATE, plan)
    errors, stated = [], []
    for seed in range(4):
        made = campaign_with_truth(hanger, STATE, (), plan, rng(seed))
        exact = np.array([each.frequency_hz for each in made.truth.frequencies]).reshape(-1, 2, 2)
        said = np.array([[m.frequency_hz for m in t.modes] for t in made.tests]).reshape(-1, 2, 2)
        sds = np.array([[m.frequency_sd_hz for m in t.modes] for t in made.tests])
        errors.append((said / exact - 1) / true_sd)
        stated.append(sds.reshape(-1, 2, 2) / said / true_sd)
    error, ratio = np.concatenate(errors), np.concatenate(stated)
    assert error.std() == pytest.approx(1, rel=4 / math.sqrt(2 * error.size))
    assert np.mean(ratio**2) == pytest.approx(1, rel=4 * math.sqrt(2 / 20 / ratio.size))
    assert np.std(ratio**2) == pytest.approx(math.sqrt(2 / 20), rel=0.15)
    together = np.mean(error[:, 0] * error[:, 1])
    assert together == pytest.approx(0.3, abs=4 / math.sqrt(error.size / 2))


@pytest.mark.parametrize("name", LAWS)
def test_an_own_law_without_size_is_no_effect_and_a_usual_one_resembles_the_catalogues(
    hanger: Hanger, name: str
) -> None:
    plain = frequencies(hanger)
    for at in choices(name, PLACES, ("t1",)):
        effect = drawn(name, at, hanger, rng(3))
        known = ranges_of(effect, hanger)
        zero = {key: each.zero for key, each in known.items() if each.is_size}
        none = replace(effect, values={**effect.values, **zero})
        np.testing.assert_allclose(frequencies(hanger, none), plain, rtol=1e-9)
        sizes = {key: each.value(0.4) for key, each in known.items() if each.is_size}
        usual = replace(effect, values={**effect.values, **sizes})
        own = np.log(frequencies(hanger, usual) / plain)
        text = np.log(frequencies(hanger, usual, own_laws=False) / plain)
        assert np.linalg.norm(own - text) < 0.5 * np.linalg.norm(text) + 1e-7
