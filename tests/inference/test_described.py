"""Check posteriors of the bar as made: sampled and drawn parameters, and readings."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shm.assumptions import DEFAULTS
from shm.inference import UpdateOptions, select, update
from shm.inference.options import Calibration, silent
from shm.inference.problem.described import DescribedCoordinates
from shm.inference.problem.hanger_problem import Problem
from shm.inference.problem.priors import TensionPrior, calibration_of
from shm.models import build
from shm.models.classes.base import Conditions
from shm.values import (
    NAN,
    PLANES,
    AddedMass,
    Hanger,
    ModalTest,
    Plane,
    Posterior,
    Scatter,
    Turnbuckle,
)
from tests.helpers.classes_as_made import as_made
from tests.helpers.given_modes import with_modes
from tests.helpers.hangers import HANGER_3, ROD

STRAND = replace(ROD, kind="strand", bending_stiffness_factor=0.7)
STATED = replace(STRAND, scatter=Scatter(bending_factor=0.1))
FITTED = replace(ROD, fittings_m=(0.3, 0.2))
COUPLED = replace(ROD, turnbuckles=(Turnbuckle(1.5, 0.6, 150.0, 1e7),))
CLAMP = AddedMass(25.0, 3.6)
SPRINGS = ("log10_k1", "log10_k2", "log10_k3", "log10_k4")


def a_test(
    hanger: Hanger = ROD,
    planes: tuple[Plane, ...] = PLANES,
    modes: int = 5,
    mass: AddedMass | None = None,
    log10_k: float = NAN,
    **reading: float,
) -> ModalTest:
    """Return frequencies to 0.01 % of the described bar, clamped or on four equal springs."""
    model = build("beam1" if np.isnan(log10_k) else "beam2", hanger)
    known = dict.fromkeys(SPRINGS, log10_k) | {"theta_F": 1.0, "theta_L": 1.0}
    known |= {"bending_factor": 0.7, "inclination": 90.0}
    theta = model.pack({name: known.get(name, 0.0) for name in model.parameter_names})
    exact = model.frequencies_at(theta[None], modes, Conditions(added_mass=mass))[0]
    exact = exact[[PLANES.index(plane) for plane in planes]]
    noise = np.expm1(1e-4 * np.random.default_rng(3).standard_normal(exact.shape))
    return with_modes(exact, 1e-4, noise, planes=planes, added_mass=mass, **reading)


def coordinates_of(
    name: str, hanger: Hanger, *tests: ModalTest, calibration: Calibration | None = None
) -> DescribedCoordinates:
    known = tests or (a_test(hanger),)
    return DescribedCoordinates(as_made(name, hanger), known, 3e6, calibration)


CASES = {
    "rod beam1": ("beam1", ROD, ()),
    "rod beam2": ("beam2", ROD, ()),
    "rod beam3": ("beam3", ROD, ()),
    "strand beam2": ("beam2", STRAND, ()),
    "strand beam3": ("beam3", STRAND, ()),
    "strand of a stated factor": ("beam2", STATED, ()),
    "with a known mass": ("beam3", ROD, (a_test(ROD, mass=CLAMP), a_test(ROD))),
    "with plates": ("beam2", HANGER_3, ()),
    "with plates and a known mass": ("beam2", HANGER_3, (a_test(HANGER_3, mass=CLAMP),)),
    "one plane": ("beam2", ROD, (a_test(planes=("transverse",)),)),
    "with fittings": ("beam2", FITTED, ()),
    "with fittings beam1": ("beam1", FITTED, ()),
    "strand with sockets": ("beam2", replace(STRAND, fittings_m=(0.3, 0.3)), ()),
    "with a turnbuckle": ("beam2", COUPLED, ()),
    "vertical": ("beam2", replace(ROD, inclination_deg=90.0), ()),
    "inclined": ("beam2", replace(ROD, inclination_deg=60.0, fittings_m=(0.3, 0.3)), ()),
    "fittings, one plane": ("beam2", FITTED, (a_test(planes=("transverse",)),)),
}
"""Classes, hangers and tests: the frequencies of each depend on other parameters."""
ADOPTED = {
    "adopted mass": ("beam1+point_mass@everywhere", ROD, ()),
    "adopted springs": ("beam2+rotational_end_flexibility@deck_end", FITTED, ()),
    "adopted stiffness of a strand": ("beam2+bending_stiffness@everywhere", STRAND, ()),
    "adopted zones, with plates": ("beam3+stiff_end_zones@both_ends", HANGER_3, ()),
}


@pytest.mark.parametrize("case", CASES)
def test_what_is_drawn_afterwards_moves_no_frequency(case: str) -> None:
    """Check the invariance on which the absolute interval rests.

    Of a strand that shears only nearly: its own share of shear is as open as a percent of area.
    """
    # Lean, which the longitudinal plane determines, changes the tension's gradient in both.
    # The last two by the reduced basis.
    less_exact = {"strand beam3": 5e-4, "fittings, one plane": 5e-5}
    less_exact |= {"rod beam3": 1e-5, "with a known mass": 2e-6}
    within = less_exact.get(case, 1e-6)
    name, hanger, tests = CASES[case]
    coordinates = coordinates_of(name, hanger, *tests)
    z = coordinates.draw_prior(200, np.random.default_rng(1))
    middle, drawn = coordinates.theta(z), coordinates.finished(z, np.random.default_rng(2))
    assert np.abs(drawn - middle).max() > (0.004 if case == "with a known mass" else 0.005)
    columns = [0] if "one plane" in case else [0, 1]
    for conditions in {coordinates.model.conditions(test) for test in tests} or {Conditions()}:
        both = [
            coordinates.model.frequencies_at(theta, 6, conditions)[:, columns]
            for theta in (middle, drawn)
        ]
        far = np.abs(both[1] / both[0] - 1).max(axis=(1, 2))
        # The bar's weight tells a little of which end is which, in three quarters of the draws.
        weighs = coordinates.model.has_terms and coordinates.model.swaps
        assert (np.quantile(far, 0.2) if weighs else far.max()) < within
        assert far.max() < 5e-3


@pytest.mark.parametrize("case", ADOPTED)
def test_effects_leave_no_deviation_unseen(case: str) -> None:
    """Effects are in N, kg and m: they tell of the bar's mass and length.

    The modulus of a strand is part of its open bending factor.
    """
    name, hanger, tests = ADOPTED[case]
    coordinates = coordinates_of(name, hanger, *tests)
    model, z = coordinates.model, coordinates.draw_prior(200, np.random.default_rng(1))
    assert set(model.effect_names) <= set(coordinates.names)
    middle, drawn = coordinates.theta(z), coordinates.finished(z, np.random.default_rng(2))
    both = [model.frequencies_hz(theta, 6) for theta in (middle, drawn)]
    np.testing.assert_allclose(both[1], both[0], rtol=1e-6)
    for name in ("section", "density", "theta_L"):
        column = model.parameter_names.index(name)
        np.testing.assert_allclose(drawn[:, column], middle[:, column], atol=1e-9)
        assert np.ptp(drawn[:, column]) > 1e-3


# ------------------------------------------------ what the tension rests on


@pytest.mark.parametrize(
    "hanger", [ROD, FITTED, STATED, HANGER_3], ids=["rod", "fit", "strand", "plate"]
)
def test_the_tension_is_as_uncertain_beyond_the_apparent_one_as_mass_and_length(
    hanger: Hanger,
) -> None:
    """Compare with ln T = ln a + ln(mu l^2): area, density and twice a taped length."""
    coordinates = coordinates_of("beam2", hanger)
    rng = np.random.default_rng(1)
    z = coordinates.draw_prior(20_000, rng)
    apparent = TensionPrior(DEFAULTS.tension_ratio.bounds).value(z[:, 0])
    beyond = np.log(coordinates.finished(z, rng)[:, 0]) - apparent
    length = float(np.linalg.norm(coordinates.deviations.row(theta_L=1.0)))
    expected = np.sqrt(0.01**2 + 0.003**2 + (2 * length) ** 2)
    assert beyond.std() == pytest.approx(expected, rel=0.03)
    mean = 2 * coordinates.deviations.mean_of("theta_L")
    assert beyond.mean() == pytest.approx(mean, abs=5 * expected / np.sqrt(20_000))
    assert abs(np.corrcoef(apparent, beyond)[0, 1]) < 0.03


@pytest.fixture(scope="module")
def unread() -> Posterior:
    return update([a_test()], build("beam1", ROD), UpdateOptions(4000))


@pytest.fixture(scope="module")
def on_springs() -> Posterior:
    return update([a_test(log10_k=7.0)], build("beam2", ROD), UpdateOptions(200, seed=4))


def test_without_a_reading_the_tension_has_the_spread_of_what_no_frequency_sees(
    unread: Posterior,
) -> None:
    """Leave a percent by frequencies to 0.01 %: what c does not tell of mu l^2."""
    relative = unread.tension_n.std() / unread.tension_n.mean()
    assert 0.8 * 0.0077 < relative < 1.2 * np.hypot(0.01, 0.003)


# ------------------------------------------------ what a reading teaches of later tests


@pytest.fixture(scope="module")
def taught() -> Calibration:
    """Return what a reading to 0.2 % teaches that is 2 % above the frequencies' tension."""
    read = 1.02 * ROD.nominal_tension_n
    test = a_test(tension_read_n=read, tension_read_sd_n=2e-3 * read)
    found = update([test], build("beam1", ROD), UpdateOptions(2000))
    return calibration_of(found.names, found.samples, ROD)


def test_a_calibration_narrows_the_tension_of_the_next_test_and_moves_it(
    unread: Posterior, taught: Calibration
) -> None:
    options = UpdateOptions(2000, calibration=taught)
    found = update([a_test()], build("beam1", ROD), options)
    assert found.tension_n.std() < 0.35 * unread.tension_n.std()
    assert found.tension_n.mean() / ROD.nominal_tension_n == pytest.approx(1.02, abs=0.005)


def test_a_calibration_is_the_mean_and_covariance_of_the_deviations_drawn() -> None:
    coordinates = coordinates_of("beam2", STATED)
    rng = np.random.default_rng(1)
    drawn = coordinates.finished(coordinates.draw_prior(20_000, rng), rng)
    found = calibration_of(coordinates.parameters, drawn, STATED)
    assert found.names == ("section", "density", "modulus", "theta_L", "bending_factor")
    sd = np.sqrt(np.diag(found.covariance))
    np.testing.assert_allclose(sd, [0.01, 0.003, 0.015, 0.0005, 0.1], rtol=0.04)
    np.testing.assert_allclose(found.mean / sd, 0.0, atol=0.04)
    again = coordinates_of("beam2", STATED, calibration=found)
    same = again.deviations
    np.testing.assert_allclose(same.factor @ same.factor.T, found.covariance, atol=1e-12)


# ------------------------------------------------ the engine on these coordinates


def log_evidence_by_quadrature(test: ModalTest) -> float:
    """Integrate over the apparent tension and c of beam1 as made, on a grid about the best."""
    problem = Problem.of([test], build("beam1", ROD), silent)
    tension = TensionPrior(DEFAULTS.tension_ratio.bounds)
    first, second = tension.score(np.linspace(-0.06, 0.06, 300)), np.linspace(-5, 5, 300)
    z = np.stack(np.meshgrid(first, second, indexing="ij"), -1).reshape(-1, 2)
    problem.settle(z[problem.log_posterior(problem.evaluate(z)).argmax()])
    log = problem.log_posterior(problem.evaluate(z)).reshape(300, 300)
    inner = np.trapezoid(np.exp(log - log.max()), second, axis=1)
    return float(log.max() + np.log(np.trapezoid(inner, first)))


def test_the_evidence_of_a_bar_as_made_is_that_of_quadrature() -> None:
    """Of the transverse plane alone, in which nothing sags."""
    test = a_test(planes=("transverse",))
    expected = log_evidence_by_quadrature(test)
    unread = update([test], build("beam1", ROD), UpdateOptions(4000))
    assert unread.log_evidence == pytest.approx(expected, abs=4 * unread.log_evidence_sd + 0.02)
    assert unread.log_evidence_sd < 0.05


def test_an_update_of_the_bar_as_made_holds_the_tension_and_repeats_with_its_seed(
    on_springs: Posterior,
) -> None:
    again = update([a_test(log10_k=7.0)], build("beam2", ROD), UpdateOptions(200, seed=4))
    np.testing.assert_array_equal(on_springs.samples, again.samples)
    low, high = np.quantile(again.tension_n, [0.005, 0.995])
    assert low < ROD.nominal_tension_n < high
    assert again.effective_sample_size > 100


def test_a_bar_on_springs_is_told_from_a_clamped_one() -> None:
    models = [build(name, ROD) for name in ("beam1", "beam2")]
    found = select([a_test(log10_k=6.5)], models, UpdateOptions(200))
    assert sum(found.probabilities) == pytest.approx(1.0)
    assert {each.priors for each in found.posteriors} == {"description"}
    assert found.selected.model == "beam2"
    assert found.probabilities[0] > 0.999
