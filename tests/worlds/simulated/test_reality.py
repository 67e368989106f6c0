"""A campaign beyond the textbook: none by default, stated figures, laws that meet it in limits."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from shm.simulate import HangerState, PlantedEffect
from shm.values import AddedMass, FloatArray, Hanger, Scatter
from tests.helpers.planted_modes import planted_modes
from tests.worlds.simulated.bar.modes import bar_modes
from tests.worlds.simulated.campaign import CampaignPlan, bar_in_test, campaign_with_truth, realised
from tests.worlds.simulated.detectable import scaled_to, size_of
from tests.worlds.simulated.effects.base import TestConditions
from tests.worlds.simulated.effects.registry import LAWS, choices, drawn, ranges_of
from tests.worlds.simulated.reality import Reality, sd_factors

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


def test_without_a_reality_a_campaign_is_what_it_was(hanger: Hanger) -> None:
    """Numbers of the release before there was any reality."""
    plan = CampaignPlan(
        modes=2, sensors=1, temperatures_c=(10.0,), amplitudes=(1.0,), mass_share=0.0
    )
    then = replace(hanger, scatter=Scatter(0.005, 0.005, 0.005, 0.005))  # as it was usual
    made = campaign_with_truth(then, STATE, (LOSS, SLIP), plan, rng(7))
    found = [(m.frequency_hz, m.damping_ratio, m.shape[0].cross) for m in made.tests[0].modes]
    was = [
        (5.141273111817728, 0.006927590882509268, -0.005406752638809706),
        (12.289937281889646, 0.006019956402745935, -0.0011238648425666165),
        (5.142123560845117, 0.005088371892318844, -0.011137446961182237),
        (12.288818447599954, 0.00506702548799635, -0.005506286066396204),
    ]
    np.testing.assert_allclose(found, was, rtol=1e-9)
    assert made.truth.tension_n == pytest.approx(667584.2752395038, rel=1e-12)
    assert not made.truth.sensors
    assert not made.truth.deviations.section_waves
    assert size_of(then, STATE, (LOSS, SLIP), plan) == pytest.approx(8.657414726186591, rel=1e-6)
    scaled = scaled_to(9.0, then, STATE, LOSS, plan)
    assert scaled is not None
    assert scaled.values["loss"] == pytest.approx(0.51151942327146, rel=1e-6)


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


def test_what_is_realised_is_the_campaigns_truth(hanger: Hanger) -> None:
    truth = realised(hanger, STATE, (LOSS,), QUICK, rng(5))
    assert truth == campaign_with_truth(hanger, STATE, (LOSS,), QUICK, rng(5)).truth


def test_the_bar_in_a_test_has_the_frequencies_of_the_truth(hanger: Hanger) -> None:
    """With what depends on the test: known mass and level."""
    plan = replace(QUICK, amplitudes=(1.0, 2.0))
    harder = PlantedEffect("geometric_hardening", "everywhere", {"hardening": 0.01})
    truth = realised(hanger, STATE, (harder,), plan, rng())
    for test in plan.tests(hanger):
        bar = bar_in_test(hanger, STATE, truth, plan, test)
        places = [each.x_m + each.off_m for each in truth.sensors]
        found = [own.angular_frequency_rad_s / 2 / np.pi for own in bar_modes(bar, 4, places)]
        true = [each.frequency_hz for each in truth.frequencies if each.test == test.id]
        np.testing.assert_allclose(np.ravel(found), true, rtol=1e-9)


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


def test_errors_of_sensors_and_section_scatter_as_stated(hanger: Hanger) -> None:
    """Of 100 campaigns, within four standard errors."""
    plan = replace(QUICK, modes=1, planes=("transverse",), mass_share=0.0)
    truths = [realised(hanger, STATE, (), plan, rng(seed)) for seed in range(100)]
    assert plan.reality is not None
    for drawn_ones, sd in (
        ([g - 1 for t in truths for each in t.sensors for g in each.gain], 0.005),
        ([each.off_m for t in truths for each in t.sensors], 0.003),
        ([each.turn_rad for t in truths for each in t.sensors], math.radians(0.3)),
        ([a for t in truths for a in t.deviations.section_waves], 0.001 / math.sqrt(2)),
    ):
        count = len(drawn_ones)
        assert abs(np.mean(drawn_ones)) < 4 * sd / math.sqrt(count)
        assert np.std(drawn_ones) == pytest.approx(sd, rel=4 / math.sqrt(2 * count))


def test_a_wave_of_the_section_moves_the_mode_of_half_its_number(hanger: Hanger) -> None:
    """Of a string, df/f = a/4 in mode j by cos(2 j pi x/L): its mass is less where mode j moves."""
    plan = replace(QUICK, mass_share=0.0, as_made=False)
    taut = HangerState(3e7, 0, 0, 0, 0)
    truth = realised(hanger, taut, (), plan, rng())
    (test,) = plan.tests(hanger)

    def of(waves: tuple[float, ...]) -> FloatArray:
        made = replace(truth, deviations=replace(truth.deviations, section_waves=waves))
        bar = bar_in_test(hanger, taut, made, plan, test)
        return bar_modes(bar, 4, PLACES)[0].angular_frequency_rad_s

    change = of((0.0, 0.002, 0.0, 0.0)) / of((0.0,) * 4) - 1
    np.testing.assert_allclose(change, [0.0005, 0, 0, 0], atol=3e-5)


def test_standard_deviations_are_larger_where_a_mode_is_hardly_seen(hanger: Hanger) -> None:
    """A sensor at midspan sits at the node of every even mode."""
    factors = sd_factors(hanger, STATE, replace(QUICK, modes=8, sensors_x_m=(6.0,)))
    assert np.all(factors[:, 1::2] == 4.0)
    assert np.all(factors[:, 0:6:2] < 2)
    usual = sd_factors(hanger, STATE, replace(QUICK, modes=8))
    assert np.median(usual) == pytest.approx(1.0, rel=0.1)
    assert usual.min() >= 0.5
    assert np.all(sd_factors(hanger, STATE, CampaignPlan()) == 1.0)


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


def test_a_slipping_joint_is_the_stated_one_at_the_reference_level(hanger: Hanger) -> None:
    own = frequencies(hanger, SLIP)
    np.testing.assert_allclose(own, frequencies(hanger, SLIP, own_laws=False), rtol=1e-9)
    hard = frequencies(hanger, SLIP, amplitude=2.0)
    softer = replace(SLIP, values={"log10_k_at_reference_level": 7.0 - 0.8 * math.log10(2)})
    np.testing.assert_allclose(hard, frequencies(hanger, softer, own_laws=False), rtol=1e-9)


@pytest.mark.parametrize(
    ("name", "size"), [("section_loss", "loss"), ("partial_mass", "mass_change")]
)
def test_what_has_no_edges_takes_or_adds_as_much_mass(hanger: Hanger, name: str, size: str) -> None:
    """A taut string in its first mode at midspan feels the mass alone, to first order."""
    taut = HangerState(1e9, 0, 0, 0, 0)
    worn = PlantedEffect(name, "everywhere", {size: 0.1, "x_m": 6.0, "extent_m": 0.4})
    plain = frequencies(hanger, state=taut)[0, 0]
    own, text = (
        frequencies(hanger, worn, own_laws=law, state=taut)[0, 0] / plain - 1
        for law in (True, False)
    )
    assert own == pytest.approx(text, rel=0.02)


def test_a_short_taper_takes_as_much_flexibility_as_a_short_zone(hanger: Hanger) -> None:
    zone = PlantedEffect("stiff_end_zones", "both ends", {"zone_m": 0.01, "stiffness_ratio": 10.0})
    plain = frequencies(hanger)
    own, text = (frequencies(hanger, zone, own_laws=law) / plain - 1 for law in (True, False))
    np.testing.assert_allclose(own, text, rtol=0.02)


def test_a_hard_swing_lifts_high_modes_more_than_the_first(hanger: Hanger) -> None:
    """Mode n of a taut string feels n/(n + 1) of the stretch over their mean, the others' half."""
    taut = HangerState(1e9, 0, 0, 0, 0)
    harder = PlantedEffect("geometric_hardening", "everywhere", {"hardening": 1e-4})
    rise = frequencies(hanger, harder, state=taut) / frequencies(hanger, state=taut) - 1
    order = np.arange(1, 9)
    felt = order / (order + 1) / np.mean(order / (order + 1))
    np.testing.assert_allclose(rise, [0.5e-4 * felt] * 2, rtol=0.03)


def test_a_deck_with_a_second_mode_far_above_is_one_mass_on_a_spring(hanger: Hanger) -> None:
    values = {"support_mass_kg": 5e4, "support_frequency_hz": 0.5}
    deck = PlantedEffect("support_motion", "deck end, transverse", values)
    own, text = (frequencies(hanger, deck, own_laws=law) for law in (True, False))
    np.testing.assert_allclose(own[1], text[1], rtol=1e-9)
    np.testing.assert_allclose(own[0], text[0], rtol=2e-3)


@pytest.mark.parametrize("effect", [LOSS, SLIP])
def test_an_effect_is_scaled_to_a_size_that_it_can_have(
    hanger: Hanger, effect: PlantedEffect
) -> None:
    plan = replace(QUICK, shapes=False, amplitudes=(0.3, 1.0, 2.0))
    found = scaled_to(8.0, hanger, STATE, effect, plan)
    assert found is not None
    assert size_of(hanger, STATE, (found,), plan) == pytest.approx(8.0, rel=0.021)
    assert scaled_to(1e9, hanger, STATE, effect, plan) is None


def test_a_turned_sensor_counts_beside_the_turn_that_any_sensor_has(hanger: Hanger) -> None:
    """Shapes are so good that little but a sensor's usual turn hides it: 1.5 over 0.3 deg."""
    plan = replace(QUICK, mass_share=0.0, shape_sd=5e-4)
    effect = PlantedEffect("sensor_misalignment", "sensor at 5.40 m", {"angle_deg": 1.5})
    assert size_of(hanger, STATE, (effect,), plan) == pytest.approx(5.0, rel=0.1)
