"""Check warnings of other ends and orders, of a wrong reading and of a wrong description."""

from __future__ import annotations

import numpy as np
import pytest

import shm
from shm.inference import UpdateOptions, update
from shm.inference.answer.other_answers import _description_off_sd
from shm.models import THESIS, build
from shm.values import Hanger, ModalTest, Posterior
from tests.helpers.given_modes import with_modes
from tests.helpers.slow import few_of

STEEL = {"elastic_modulus_pa": 200e9, "density_kg_m3": 7850.0, "nominal_tension_n": 180e3}
BAR = shm.round_bar(3, diameter_m=0.05, length_m=9.0, **STEEL)
TENSION_N = 171e3
OPTIONS = UpdateOptions(samples=200)
CLASS = "beam2"


def a_test(
    orders: range,
    hanger: Hanger = BAR,
    tension_n: float = TENSION_N,
    springs: tuple[float, ...] = (30, 30, 30, 30),
    sd: float = 1e-4,
) -> ModalTest:
    """Return exact modes of both planes, ends of k L/EI of `springs`, known to `sd`."""
    model = build(CLASS, hanger, THESIS)
    unit = hanger.bending_stiffness_n_m2 / hanger.length_m
    theta = np.array(
        [[tension_n / hanger.nominal_tension_n, 1.0, *np.log10(np.multiply(springs, unit))]]
    )
    found = model.frequencies_hz(theta, max(orders))[0, :, min(orders) - 1 :]
    return with_modes(found, sd, first_order=min(orders))


def posterior(test: ModalTest, hanger: Hanger = BAR) -> Posterior:
    return update([test], build(CLASS, hanger), OPTIONS)


@pytest.mark.parametrize("orders", few_of([range(1, 6), range(4, 7)], 1))
def test_right_orders_are_left_alone(orders: range) -> None:
    found = posterior(a_test(orders))
    assert np.isnan(found.tension_of_other_orders_n)
    assert found.description_off_sd < 3
    assert found.faults == ()


def test_few_modes_of_a_short_stiff_bar_leave_its_tension_open() -> None:
    """Fit stiffer ends with next to no tension as well as soft ends with all of it."""
    stiff = shm.round_bar(3, diameter_m=0.113, length_m=5.0, **STEEL | {"nominal_tension_n": 187e3})
    found = posterior(a_test(range(1, 3), stiff, 187e3, (3, 3, 3, 3), sd=1e-3), stiff)
    low, high = np.quantile(found.tension_n, [0.05, 0.95])
    assert low < 187e3 < high
    assert any(each.startswith("The ends decide") for each in found.caveats)


def test_modes_that_a_class_meets_are_not_missed_by_it() -> None:
    """Expect a short thick bar's supports to give way, without a misfit where they do not."""
    thick = shm.round_bar(3, diameter_m=0.08, length_m=5.0, **STEEL | {"nominal_tension_n": 277e3})
    found = posterior(a_test(range(1, 9), thick, tension_n=264e3), thick)
    assert found.misfit_percent < 0.1
    assert found.faults == ()


def test_the_description_is_off_by_what_a_sound_bar_would_scatter() -> None:
    """Compare with the mean over the root of the variance that normal data take off 1."""
    rng = np.random.default_rng(1)
    # Two deviates, seen through errors of 0.5 and 1; the bar is off by 4 and by 0.
    left = np.array([0.5, 1.0]) ** 2 / (1 + np.array([0.5, 1.0]) ** 2)
    draws = np.array([4.0, 0.0]) * (1 - left) + np.sqrt(left) * rng.standard_normal((4000, 2))
    turned = draws @ np.array([[0.8, 0.6], [-0.6, 0.8]])
    assert _description_off_sd(turned) == pytest.approx(4 / np.sqrt(1 + 0.5**2), rel=0.03)
    unseen = rng.standard_normal((4000, 1)) - 1.5
    assert _description_off_sd(unseen) == pytest.approx(1.5, rel=0.05)


@pytest.mark.slow
def test_a_diameter_that_is_wrong_by_ten_of_its_standard_deviations_is_told() -> None:
    thicker = shm.round_bar(3, diameter_m=1.05 * BAR.diameter_m, length_m=9.0, **STEEL)
    found = posterior(a_test(range(1, 7)), thicker)
    assert found.description_off_sd > 3
    assert any("`shm gap diagnose`" in each for each in found.faults)
