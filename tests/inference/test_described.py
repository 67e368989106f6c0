"""The space of the bar as made: what is sampled, what is only drawn, and what a reading teaches."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import kstest, norm

from shm.assumptions import DEFAULTS
from shm.inference import UpdateOptions, refresh, select, update
from shm.inference.described import DescribedCoordinates
from shm.inference.options import silent
from shm.inference.priors import Calibration, EndDetails, TensionPrior, calibration_of, reading_of
from shm.inference.problem import Problem
from shm.models import AsMade, build
from shm.models.base import Conditions
from shm.values import (
    NAN,
    PLANES,
    AddedMass,
    FloatArray,
    Hanger,
    ModalTest,
    Mode,
    Plane,
    Posterior,
    Scatter,
)
from tests.helpers.hangers import HANGER_3

ROD = replace(HANGER_3, plate=None)
STRAND = replace(ROD, kind="strand", bending_stiffness_factor=0.7)
STATED = replace(STRAND, scatter=Scatter(bending_factor=0.1))
FITTED = replace(ROD, fittings_m=(0.3, 0.2))
CLAMP = AddedMass(25.0, 3.6)
STIFFEST = 1 / DEFAULTS.end_restraint.decades
SPRINGS = ("log10_k1", "log10_k2", "log10_k3", "log10_k4")


def a_test(
    hanger: Hanger = ROD,
    planes: tuple[Plane, ...] = PLANES,
    modes: int = 5,
    mass: AddedMass | None = None,
    log10_k: float = NAN,
    tension_read_n: float = NAN,
    tension_read_sd_n: float = NAN,
) -> ModalTest:
    """Frequencies to 0.01 % of a bar as it is described, clamped or on springs all alike."""
    model = build("beam1" if np.isnan(log10_k) else "beam2", hanger)
    known = dict.fromkeys(SPRINGS, log10_k) | {"theta_F": 1.0, "theta_L": 1.0}
    known["bending_factor"] = 0.7
    theta = model.pack({name: known.get(name, 0.0) for name in model.parameter_names})
    exact = model.frequencies_at(theta[None], modes, Conditions(added_mass=mass))[0]
    rng = np.random.default_rng(3)
    rows = tuple(
        Mode(plane, order + 1, float(f * np.exp(1e-4 * rng.standard_normal())), float(1e-4 * f))
        for plane in planes
        for order, f in enumerate(exact[PLANES.index(plane)])
    )
    return ModalTest(
        "t1",
        rows,
        hanger=3,
        added_mass=mass,
        tension_read_n=tension_read_n,
        tension_read_sd_n=tension_read_sd_n,
    )


def coordinates_of(
    name: str, hanger: Hanger, *tests: ModalTest, calibration: Calibration | None = None
) -> DescribedCoordinates:
    model = build(name, hanger)
    assert isinstance(model, AsMade)
    return DescribedCoordinates(model, tests or (a_test(hanger),), 3e6, calibration)


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
    "with fittings": ("beam2", FITTED, ()),
    "one plane": ("beam2", ROD, (a_test(planes=("transverse",)),)),
}
"""Classes, hangers and tests: of each what is seen is another."""


@pytest.mark.parametrize("case", CASES)
def test_parameters_lead_back_to_their_place_inside_the_fold(case: str) -> None:
    name, hanger, tests = CASES[case]
    coordinates = coordinates_of(name, hanger, *tests)
    z = coordinates.draw_prior(500, np.random.default_rng(1))
    assert z.shape == (500, coordinates.dimension)
    np.testing.assert_allclose(coordinates.places(coordinates.theta(z)), z, atol=1e-5)
    np.testing.assert_allclose(coordinates.fold(z), z, atol=1e-9)
    assert np.isfinite(coordinates.log_prior(z)).all()


@pytest.mark.parametrize("case", CASES)
def test_what_is_drawn_afterwards_moves_no_frequency(case: str) -> None:
    """Or it would be seen: the invariance on which the absolute interval rests.

    Of a strand that shears only nearly: its own share of shear is as open as a percent of area.
    """
    within = 5e-4 if case == "strand beam3" else 1e-7
    name, hanger, tests = CASES[case]
    coordinates = coordinates_of(name, hanger, *tests)
    z = coordinates.draw_prior(200, np.random.default_rng(1))
    middle, drawn = coordinates.theta(z), coordinates.finished(z, np.random.default_rng(2))
    assert np.abs(drawn - middle).max() > 0.005
    columns = [0] if case == "one plane" else [0, 1]
    for conditions in {coordinates.model.conditions(test) for test in tests} or {Conditions()}:
        both = [
            coordinates.model.frequencies_at(theta, 6, conditions)[:, columns]
            for theta in (middle, drawn)
        ]
        # A known mass tells ends that were exchanged apart: in three quarters of the draws.
        far = np.abs(both[1] / both[0] - 1).max(axis=(1, 2))
        kept = np.quantile(far, 0.2) if conditions.added_mass is not None else far.max()
        assert kept < within


def test_what_is_seen_is_as_much_as_the_class_and_the_tests_show() -> None:
    plain = coordinates_of("beam2", ROD)
    assert plain.dimension == 1 + 4 + 1  # tension, springs, c
    assert coordinates_of("beam1", ROD).dimension == 1 + 1
    assert coordinates_of("beam3", ROD).dimension == plain.dimension + 1  # the area by its shear
    laden = coordinates_of("beam2", ROD, a_test(mass=CLAMP))
    assert laden.dimension == plain.dimension + 1  # the mass
    one_plane = coordinates_of("beam2", ROD, a_test(planes=("longitudinal",)))
    assert one_plane.dimension == plain.dimension - 2
    assert one_plane.box.names == ("theta_F", "log10_k2", "log10_k4")
    assert coordinates_of("beam2", HANGER_3).dimension == plain.dimension + 1  # the length
    strand = coordinates_of("beam3", STRAND)
    assert strand.box.names[-2:] == ("bending_factor", "shear_share")
    assert strand.dimension == 1 + 4 + 2  # the factor takes all of c


# ------------------------------------------------ the prior of ends


@pytest.mark.slow
@pytest.mark.parametrize("springs", [SPRINGS, ("log10_k1", "log10_k3"), ("log10_k2", "log10_k4")])
def test_the_prior_of_ends_integrates_to_one_and_is_that_of_its_draws(
    springs: tuple[str, ...],
) -> None:
    """The mean of 1/density under draws is the whole of the unit cube."""
    details, rng = EndDetails(("theta_F", *springs), springs), np.random.default_rng(1)
    np.testing.assert_array_equal(details.columns, np.arange(1, len(springs) + 1))
    drawn = details.draw(30_000, rng)
    assert drawn.min() >= 0 <= 1 >= drawn.max()
    inverse = np.exp(-details.log_density(drawn))
    assert inverse.mean() == pytest.approx(1, abs=5 * inverse.std() / np.sqrt(len(drawn)))
    density = np.exp(details.log_density(rng.random((60_000, len(springs)))))
    assert density.mean() == pytest.approx(1, abs=5 * density.std() / np.sqrt(len(density)))


def test_the_prior_of_the_tension_integrates_to_one_and_is_that_of_its_draws() -> None:
    ratio = DEFAULTS.tension_ratio.bounds
    prior, bounds = TensionPrior(ratio), np.log(ratio)
    x = np.linspace(*bounds, 20001)
    density = np.exp(prior.log_density(x)) / (bounds[1] - bounds[0])
    cumulative = np.append(0.0, np.cumsum((density[1:] + density[:-1]) / 2 * np.diff(x)))
    assert cumulative[-1] == pytest.approx(1, abs=1e-6)
    draws = prior.draw(20_000, np.random.default_rng(1))
    assert kstest(draws, lambda at: np.interp(at, x, cumulative)).pvalue > 0.01


@pytest.mark.slow
def test_two_modes_a_plane_of_a_short_thick_bar_leave_its_tension_open() -> None:
    """Clamped ends with next to no tension fit as well as the planted springs and 752 kN do."""
    short = replace(ROD, length_m=4.44, nominal_tension_n=711e3)
    hz = {"transverse": (29.0057, 78.0443), "longitudinal": (28.7476, 77.4957)}
    modes = tuple(
        Mode(plane, order, value, 1e-4 * value)
        for plane, both in hz.items()
        for order, value in enumerate(both, start=1)
    )
    found = update([ModalTest("t", modes)], AsMade(build("beam2", short)), UpdateOptions())
    low, high = np.quantile(found.tension_n, [0.05, 0.95])
    assert low < 300e3
    assert high > 752e3


def test_every_spring_is_uniform_but_for_the_share_of_ends_made_to_clamp() -> None:
    drawn = EndDetails(SPRINGS, SPRINGS).draw(40_000, np.random.default_rng(2))
    for shares in drawn.T:
        soft = shares[shares < 1 - STIFFEST] / (1 - STIFFEST)
        stiff = (shares[shares >= 1 - STIFFEST] - 1 + STIFFEST) / STIFFEST
        assert kstest(soft, "uniform").pvalue > 1e-4
        assert kstest(stiff, "uniform").pvalue > 1e-4
        assert len(stiff) / len(shares) == pytest.approx(5 / 6 * STIFFEST + 1 / 6, abs=0.01)


def test_ends_alike_are_likelier_than_ends_of_different_kind() -> None:
    details = EndDetails(SPRINGS, SPRINGS)
    alike, round_ends, by_plane, mixed, stiff = np.array(
        [
            [0.4] * 4,
            [0.3, 0.3, 0.7, 0.7],
            [0.3, 0.7, 0.3, 0.7],
            [0.1, 0.3, 0.5, 0.7],
            [0.99] * 4,
        ]
    )
    log = details.log_density(np.array([alike, round_ends, by_plane, mixed, stiff]))
    assert log[4] > log[0] > log[1] > log[2] > log[3] == pytest.approx(np.log(1 / 6), abs=0.1)
    plates = EndDetails(SPRINGS, SPRINGS, may_be_round=False).log_density(np.array([round_ends]))
    assert plates[0] < log[2] - np.log(4 / 6) + 1


def test_frequencies_do_not_tell_which_end_of_a_plane_is_which_but_unlike_fittings_do() -> None:
    straight, crossed = np.array([[0.3, 0.3, 0.7, 0.7], [0.3, 0.7, 0.7, 0.3]])
    either, own = (EndDetails(SPRINGS, SPRINGS, exchanged=each) for each in (True, False))
    both = np.array([straight, crossed])
    one, other = either.log_density(both)
    assert one == pytest.approx(other)
    assert own.log_density(both)[0] > own.log_density(both)[1] + 5


# ------------------------------------------------ what the tension rests on


def test_plates_leave_the_length_open_and_a_tape_knows_it() -> None:
    both = [coordinates_of("beam2", each).deviations for each in (ROD, FITTED, HANGER_3)]
    sd = [float(np.linalg.norm(each.row(theta_L=1.0))) for each in both]
    assert sd == pytest.approx([0.0005, 0.0005, 0.0])


@pytest.mark.parametrize(
    "hanger", [ROD, FITTED, STATED, HANGER_3], ids=["rod", "fit", "strand", "plate"]
)
def test_the_tension_is_as_uncertain_beyond_the_apparent_one_as_mass_and_length(
    hanger: Hanger,
) -> None:
    """ln T = ln a + ln(mu l^2): by area, density and twice the length, where that is taped."""
    coordinates = coordinates_of("beam2", hanger)
    rng = np.random.default_rng(1)
    z = coordinates.draw_prior(20_000, rng)
    shares, _ = coordinates.smooth(z)
    low, high = np.log((0.02, 5.0))
    apparent = low + (high - low) * shares[:, 0]
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
    return update([a_test()], build("beam2", ROD), UpdateOptions(200, seed=4))


def test_without_a_reading_the_tension_has_the_spread_of_what_no_frequency_sees(
    unread: Posterior,
) -> None:
    """Frequencies to 0.01 % leave a percent: what c does not tell of mu l^2."""
    relative = unread.tension_n.std() / unread.tension_n.mean()
    assert 0.8 * 0.0077 < relative < 1.2 * np.hypot(0.01, 0.003)


@pytest.mark.slow
@pytest.mark.parametrize("off", [-0.02, pytest.param(0.01, marks=pytest.mark.trial)])
def test_a_reading_makes_of_it_the_product_of_both_normals(unread: Posterior, off: float) -> None:
    """1/v = 1/v0 + 1/r, m = v (m0/v0 + read/r)."""
    log = np.log(unread.tension_n)
    read = float(np.exp(log.mean() + off))
    test = a_test(tension_read_n=read, tension_read_sd_n=0.01 * read)
    found = np.log(update([test], build("beam1", ROD), UpdateOptions(4000)).tension_n)
    precision = 1 / log.var() + 1 / 0.01**2
    mean = (log.mean() / log.var() + np.log(read) / 0.01**2) / precision
    assert found.std() == pytest.approx(precision**-0.5, rel=0.08)
    assert found.mean() == pytest.approx(mean, abs=5 * found.std() / np.sqrt(1000))


@pytest.mark.slow
def test_a_reading_to_a_thousandth_is_the_tension_whatever_the_class() -> None:
    read = 1.01 * ROD.nominal_tension_n
    test = a_test(tension_read_n=read, tension_read_sd_n=1e-3 * read)
    for name in ("beam1", "beam2"):
        found = update([test], build(name, ROD), UpdateOptions(300)).tension_n
        assert found.mean() == pytest.approx(read, rel=6e-4)
        assert found.std() == pytest.approx(1e-3 * read, rel=0.25)


def test_several_readings_count_by_their_precision_and_one_without_error_by_a_lift_offs() -> None:
    tests = [
        a_test(tension_read_n=700e3, tension_read_sd_n=7e3),
        a_test(tension_read_n=714e3, tension_read_sd_n=14e3),
        a_test(),
    ]
    found = reading_of(tests)
    assert found is not None
    assert found.tension_n == pytest.approx((4 * 700e3 + 714e3) / 5)
    assert found.sd * found.tension_n == pytest.approx(7e3 * np.sqrt(4 / 5))
    alone = reading_of([a_test(tension_read_n=700e3, tension_read_sd_n=NAN)])
    assert alone is not None
    assert alone.sd == pytest.approx(0.03)
    assert reading_of(tests[2:]) is None


# ------------------------------------------------ what a reading teaches of later tests


@pytest.fixture(scope="module")
def taught() -> Calibration:
    """A bar whose tension was read to 0.2 % and is 2 % above what frequencies say of it."""
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


@pytest.mark.slow
def test_a_calibration_of_one_class_serves_another(
    taught: Calibration, on_springs: Posterior
) -> None:
    """It is of the bar, not of the class."""
    options = UpdateOptions(200, calibration=taught)
    found = update([a_test()], build("beam2", ROD), options)
    assert found.tension_n.std() < 0.5 * on_springs.tension_n.std()


def test_a_calibration_is_the_mean_and_covariance_of_the_deviations_drawn() -> None:
    coordinates = coordinates_of("beam2", STATED)
    rng = np.random.default_rng(1)
    drawn = coordinates.finished(coordinates.draw_prior(20_000, rng), rng)
    found = calibration_of(coordinates.names, drawn, STATED)
    assert found.names == ("section", "density", "modulus", "theta_L", "bending_factor")
    sd = np.sqrt(np.diag(found.covariance))
    np.testing.assert_allclose(sd, [0.01, 0.003, 0.015, 0.0005, 0.1], rtol=0.04)
    np.testing.assert_allclose(found.mean / sd, 0.0, atol=0.04)
    again = coordinates_of("beam2", STATED, calibration=found)
    same = again.deviations
    np.testing.assert_allclose(same.factor @ same.factor.T, found.covariance, atol=1e-12)


# ------------------------------------------------ the engine on these coordinates


def log_evidence_by_quadrature(test: ModalTest) -> float:
    """Of beam1 as made, over the apparent tension and c, on a grid about the best."""
    problem = Problem.of([test], build("beam1", ROD), silent)
    first = np.linspace(-0.06, 0.06, 300)
    second = np.linspace(-5, 5, 300)
    low, high = np.log((0.02, 5.0))
    log_a = np.log(1.0) + first
    shares = (log_a - low) / (high - low)
    z_a, z_c = np.meshgrid(norm.ppf(shares), second, indexing="ij")
    z = np.column_stack([z_a.ravel(), z_c.ravel()])
    problem.settle(z[problem.log_posterior(problem.evaluate(z)).argmax()])
    log = problem.log_posterior(problem.evaluate(z)).reshape(z_a.shape)
    highest = log.max()
    inner = np.trapezoid(np.exp(log - highest), second, axis=1)
    return float(highest + np.log(np.trapezoid(inner, norm.ppf(shares))))


def test_the_evidence_of_a_bar_as_made_is_that_of_quadrature(unread: Posterior) -> None:
    expected = log_evidence_by_quadrature(a_test())
    assert unread.log_evidence == pytest.approx(expected, abs=4 * unread.log_evidence_sd + 0.02)
    assert unread.log_evidence_sd < 0.05


def test_an_update_of_the_bar_as_made_holds_the_tension_and_repeats_with_its_seed(
    on_springs: Posterior,
) -> None:
    again = update([a_test()], build("beam2", ROD), UpdateOptions(200, seed=4))
    np.testing.assert_array_equal(on_springs.samples, again.samples)
    low, high = np.quantile(again.tension_n, [0.005, 0.995])
    assert low < ROD.nominal_tension_n < high
    assert again.effective_sample_size > 100


@pytest.mark.slow
def test_a_later_test_of_the_bar_as_made_is_refreshed_to_the_same_answer() -> None:
    model = build("beam2", ROD)
    known = update([a_test(modes=4, log10_k=7.0)], model, UpdateOptions(200))
    later = a_test(log10_k=7.0)
    found = refresh([later], model, known, UpdateOptions(600))
    expected = update([later], model, UpdateOptions(600, seed=2))
    error = 5 * np.hypot(found.log_evidence_sd, expected.log_evidence_sd)
    assert found.log_evidence == pytest.approx(expected.log_evidence, abs=error)
    spread, fewest = expected.tension_n.std(), 300
    of_mean = 5 * spread * np.sqrt(2 / fewest)
    assert found.tension_n.mean() == pytest.approx(expected.tension_n.mean(), abs=of_mean)
    assert found.tension_n.std() == pytest.approx(spread, rel=0.2)


def test_a_bar_on_springs_is_told_from_a_clamped_one() -> None:
    models = [build(name, ROD) for name in ("beam1", "beam2")]
    found = select([a_test(log10_k=6.5)], models, UpdateOptions(200))
    assert sum(found.probabilities) == pytest.approx(1.0)
    assert {each.priors for each in found.posteriors} == {"description"}
    assert found.selected.model == "beam2"
    assert found.probabilities[0] > 0.999


def drawn_factor(posterior: Posterior) -> FloatArray:
    return posterior.parameter("bending_factor")


@pytest.mark.slow
def test_a_strands_factor_is_found_from_its_frequencies_and_stays_in_its_range() -> None:
    """Seven tenths are planted, anything from three to ten is allowed."""
    found = update(
        [a_test(STRAND, modes=7, log10_k=6.8)], build("beam2", STRAND), UpdateOptions(500)
    )
    factor = drawn_factor(found)
    assert factor.min() >= 0.3
    assert factor.max() <= 1.0
    low, high = np.quantile(factor, [0.01, 0.99])
    assert low < 0.7 < high
    low, high = np.quantile(found.tension_n, [0.005, 0.995])
    assert low < STRAND.nominal_tension_n < high
