"""A campaign's tests are what its plan says, with the noise it states; sizes are chi-squares."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares

from shm.documents import dump
from shm.errors import UsageError
from shm.modes_document import modes_document, parse_modes
from shm.simulate import HangerState, PlantedEffect
from shm.values import AddedMass, FloatArray, Hanger, ModalTest
from tests.helpers.planted_modes import planted_modes
from tests.worlds.simulated.campaign import CampaignPlan, campaign, campaign_with_truth
from tests.worlds.simulated.detectable import at_share, scaled_to, size_of
from tests.worlds.simulated.effects.base import TestConditions
from tests.worlds.simulated.reality import Deviations

STATE = HangerState(711e3)
CLAMP = PlantedEffect("point_mass", "everywhere", {"mass_kg": 12.0, "x_m": 3.4})
EXACT = CampaignPlan(tension_spread=0.0, as_made=False)
QUICK = CampaignPlan(
    modes=2, shapes=False, temperatures_c=(10.0,), amplitudes=(1.0,), mass_share=0.0
)


def rng(seed: int = 1) -> np.random.Generator:
    return np.random.default_rng(seed)


def frequencies(test: ModalTest) -> FloatArray:
    return np.array([mode.frequency_hz for mode in test.modes])


def test_the_usual_campaign_varies_temperature_level_and_mass(hanger: Hanger) -> None:
    tests = campaign(hanger, STATE, (), CampaignPlan(), rng())
    found = [(each.id, each.temperature_c, each.amplitude) for each in tests]
    assert found == [
        ("t1", -5.0, 1.0),
        ("t2", 10.0, 1.0),
        ("t3", 25.0, 1.0),
        ("t4", 10.0, 0.3),
        ("t5", 10.0, 2.0),
        ("t6", 10.0, 1.0),
    ]
    assert [each.added_mass for each in tests[:5]] == [None] * 5
    share = hanger.mass_per_length_kg_m * hanger.length_m
    assert tests[5].added_mass == AddedMass(0.02 * share, 0.3 * 12.0)
    for test in tests:
        planes = [(mode.plane, mode.order) for mode in test.modes]
        assert planes == [(p, n) for p in ("transverse", "longitudinal") for n in range(1, 9)]
        assert all(len(mode.shape) == 4 for mode in test.modes)


def test_a_campaign_is_a_modal_tests_document(hanger: Hanger) -> None:
    tests = campaign(hanger, STATE, (CLAMP,), CampaignPlan(), rng())
    document = json.loads(dump(modes_document(tests)))
    assert json.loads(dump(modes_document(parse_modes(document)))) == document


def test_the_same_seed_gives_the_same_campaign(hanger: Hanger) -> None:
    one, same, other = (
        campaign_with_truth(hanger, STATE, (CLAMP,), QUICK, rng(seed)) for seed in (1, 1, 2)
    )
    assert one == same
    assert one.truth.tension_n != other.truth.tension_n
    assert frequencies(one.tests[0])[0] != frequencies(other.tests[0])[0]


def test_tension_scatter_and_noise_do_not_depend_on_what_is_planted(hanger: Hanger) -> None:
    plain, clamped = (
        campaign_with_truth(hanger, STATE, effects, QUICK, rng()) for effects in ((), (CLAMP,))
    )
    assert plain.truth == replace(clamped.truth, effects=(), frequencies=plain.truth.frequencies)
    exact = [
        planted_modes(
            hanger,
            replace(STATE, tension_n=plain.truth.tension_n),
            effects,
            TestConditions("t1"),
            2,
            QUICK.places_m(hanger),
            deviations=plain.truth.deviations,
        ).frequency_hz.ravel()
        for effects in ((), (CLAMP,))
    ]
    errors = [
        frequencies(each.tests[0]) / true - 1
        for each, true in zip((plain, clamped), exact, strict=True)
    ]
    np.testing.assert_allclose(errors[0], errors[1], atol=1e-9)


def test_noise_has_the_standard_deviations_that_the_tests_state(hanger: Hanger) -> None:
    """Of 2,000 frequencies and 16,000 components, within four standard errors."""
    frequency, shape, damping = [], [], []
    places = EXACT.places_m(hanger)
    for seed in range(21):
        for test in campaign(hanger, STATE, (), EXACT, rng(seed)):
            conditions = TestConditions(added_mass=test.added_mass)
            true = planted_modes(hanger, STATE, (), conditions, 8, places)
            exact = true.frequency_hz.ravel()
            sd = np.array([mode.frequency_sd_hz for mode in test.modes])
            frequency.append((frequencies(test) - exact) / sd)
            seen = np.array([[(p.value, p.cross) for p in mode.shape] for mode in test.modes])
            sides = true.shape.reshape(16, 4, 2)
            sides = np.concatenate([sides[:8], sides[8:, :, ::-1]])
            shape.append((seen - sides) / test.modes[0].shape[0].sd)
            damping.append(np.log([mode.damping_ratio / 0.001 for mode in test.modes]) / 0.1)
    for errors in (frequency, shape, damping):
        together = np.concatenate([each.ravel() for each in errors])
        error = 4 / math.sqrt(len(together))
        assert abs(together.mean()) < error
        assert abs(together.std() - 1) < error


def test_tension_and_deviations_scatter_as_stated(hanger: Hanger) -> None:
    truths = [campaign_with_truth(hanger, STATE, (), QUICK, rng(n)).truth for n in range(150)]
    spread = np.log([each.tension_n / 711e3 for each in truths]).std()
    assert spread == pytest.approx(0.1, rel=4 / math.sqrt(300))
    for name in ("section", "density", "length", "modulus"):
        drawn = np.array([getattr(each.deviations, name) for each in truths])
        stated = getattr(hanger.scatter, name)
        assert drawn.std() == pytest.approx(stated, rel=4 / math.sqrt(300))
        assert abs(drawn.mean()) < 4 * stated / math.sqrt(150)


def test_poorer_campaigns_leave_out_what_they_do_not_measure(hanger: Hanger) -> None:
    plan = CampaignPlan(planes=("longitudinal",), shapes=False, mass_share=0.0, amplitudes=(1.0,))
    tests = campaign(hanger, STATE, (), plan, rng())
    assert [each.temperature_c for each in tests] == [-5.0, 10.0, 25.0]
    assert {mode.plane for mode in tests[0].modes} == {"longitudinal"}
    assert all(mode.shape == () for mode in tests[0].modes)
    (test, *_) = campaign(hanger, STATE, (), CampaignPlan(biaxial=False, sensors=2), rng())
    assert all(math.isnan(point.cross) for point in test.modes[0].shape)
    assert [point.x_m for point in test.modes[0].shape] == [1.56, 3.48]


def test_an_unknown_temperature_is_no_shift(hanger: Hanger) -> None:
    plan = replace(QUICK, temperatures_c=(math.nan,), frequency_sd=0.0, as_made=False)
    warmth = PlantedEffect("temperature_tension", "everywhere", {"tension_per_kelvin_n_k": -1000.0})
    plain, warm = (campaign(hanger, STATE, effects, plan, rng()) for effects in ((), (warmth,)))
    np.testing.assert_allclose(frequencies(plain[0]), frequencies(warm[0]), rtol=1e-9)
    assert math.isnan(plain[0].modes[0].frequency_sd_hz)


@pytest.mark.parametrize(
    "plan",
    [CampaignPlan(modes=0), CampaignPlan(sensors=5), CampaignPlan(temperatures_c=())],
)
def test_a_plan_that_cannot_be_is_refused(hanger: Hanger, plan: CampaignPlan) -> None:
    with pytest.raises(UsageError):
        campaign(hanger, STATE, (), plan, rng())


def test_the_size_of_a_turned_sensor_counts_its_cross_components(hanger: Hanger) -> None:
    """Nothing else can explain them: sin(angle) times what it sees of each mode, over the sd."""
    angle = math.radians(0.3)
    effect = PlantedEffect("sensor_misalignment", "sensor at 5.40 m", {"angle_deg": 0.3})
    plan = replace(EXACT, mass_share=0.0, temperatures_c=(10.0,), amplitudes=(1.0,))
    seen = planted_modes(hanger, STATE, (), TestConditions(), 8, plan.places_m(hanger)).shape
    exact = math.sin(angle) / 0.005 * math.sqrt(np.sum(seen[..., 2, :] ** 2))
    assert size_of(hanger, STATE, (effect,), plan) == pytest.approx(exact, rel=1e-3)


def test_the_size_is_the_square_root_of_the_least_chi_square(hanger: Hanger) -> None:
    """Frequencies only, the mass fitted by tension and deviations without linearisation."""
    clamp = replace(CLAMP, values={"mass_kg": 0.8, "x_m": 3.4})
    plan = replace(EXACT, shapes=False, temperatures_c=(10.0,), amplitudes=(1.0,))
    conditions = [TestConditions(added_mass=each.added_mass) for each in plan.tests(hanger)]
    places = plan.places_m(hanger)

    def logs(effects: tuple[PlantedEffect, ...], tension: float, made: Deviations) -> FloatArray:
        state = HangerState(711e3 * (1 + tension))
        found = [
            planted_modes(hanger, state, effects, each, 8, places, deviations=made)
            for each in conditions
        ]
        return np.log([each.frequency_hz for each in found]).ravel()

    data = logs((clamp,), 0.0, Deviations())

    def misfit(z: FloatArray) -> FloatArray:
        scatter = hanger.scatter
        sds = np.array([scatter.section, scatter.density, scatter.length, scatter.modulus])
        plain = logs((), 0.01 * z[0], Deviations(*(sds * z[1:])))
        return np.concatenate([(plain - data) / 1e-4, z[1:]])

    best = least_squares(misfit, np.zeros(5), diff_step=np.full(5, 1e-3), max_nfev=6)
    exact = math.sqrt(2 * best.cost)
    assert 3 < exact < 30
    assert size_of(hanger, STATE, (clamp,), plan) == pytest.approx(exact, rel=0.02)


@pytest.mark.parametrize("deviations", [-1.0, 2.0])
def test_a_longer_bar_is_as_large_as_its_scatter_makes_it(
    hanger: Hanger, deviations: float
) -> None:
    """At the arch end the change of length is the very deviation of the bar as made."""
    change = deviations * hanger.scatter.length * hanger.length_m
    longer = PlantedEffect("effective_length", "arch end", {"length_change_m": change})
    assert size_of(hanger, STATE, (longer,), EXACT) == pytest.approx(abs(deviations), rel=0.02)


def test_nothing_planted_has_no_size(hanger: Hanger) -> None:
    assert size_of(hanger, STATE, (), EXACT) == 0


@pytest.mark.slow
def test_an_effect_is_scaled_to_a_size(hanger: Hanger) -> None:
    for effect in (
        CLAMP,
        PlantedEffect("temperature_tension", "everywhere", {"tension_per_kelvin_n_k": -1.0}),
        PlantedEffect(
            "rotational_end_flexibility", "both ends", {"log10_k1": 7.0, "log10_k2": 7.0}
        ),
    ):
        found = scaled_to(4.0, hanger, STATE, effect, EXACT)
        assert found is not None
        assert size_of(hanger, STATE, (found,), EXACT) == pytest.approx(4.0, rel=0.01)
        assert np.sign(next(iter(found.values.values()))) == np.sign(
            next(iter(effect.values.values()))
        )


def test_a_size_out_of_the_physical_range_is_not_reached(hanger: Hanger) -> None:
    """A clock that errs in all tests passes for other tension and section; shear is always seen."""
    clock = PlantedEffect("timebase", "all tests", {"clock_error": 0.001})
    assert scaled_to(100.0, hanger, STATE, clock, EXACT) is None
    shear = PlantedEffect("shear_and_rotary_inertia", "everywhere", {"share": 1.0})
    assert scaled_to(4.0, hanger, STATE, shear, EXACT) == at_share(0.0, hanger, shear)
