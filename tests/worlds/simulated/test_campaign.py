"""A campaign's tests are what its plan says, with the noise it states; sizes are chi-squares."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from shm.simulate import HangerState, PlantedEffect
from shm.values import FloatArray, Hanger, ModalTest
from tests.helpers.planted_modes import planted_modes
from tests.worlds.simulated.campaign import CampaignPlan, campaign, campaign_with_truth
from tests.worlds.simulated.effects.base import TestConditions

pytestmark = pytest.mark.trial  # of the simulated world alone, not of the product

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
