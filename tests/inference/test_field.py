"""The noise of the field against the whole multivariate normal, integrated by brute force."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import logsumexp
from scipy.stats import t

from shm.assumptions import DEFAULTS
from shm.inference.problem.field import FieldLikelihood
from shm.inference.problem.systematic_errors import (
    errors_of_sensors,
    felt_by,
    loads_of_ends,
    loads_of_section,
    mean_of_ends,
)
from shm.models import build
from shm.models.classes.base import Conditions
from shm.values import PLANES, AddedMass, FloatArray, ModalTest, Mode, Plane
from tests.helpers.hangers import HANGER_3

MODEL = build("beam2", HANGER_3)
SPRINGS = {"log10_k1": 6.6, "log10_k2": 7.0, "log10_k3": 6.9, "log10_k4": 7.4}
TAU_LOWER, TAU_USUAL = DEFAULTS.model_error.bounds
TAU_UPPER = DEFAULTS.largest_model_error.value
THETA = MODEL.pack(
    {"theta_F": 1.0, "theta_L": 0.9, "section": 0.0, "density": 0.0, "modulus": 0.0, **SPRINGS}
    | {"inclination": 90.0, "sag_shape": 0.5}
)[None]
CLAMP = AddedMass(25.0, 3.6, 0.1)
Row = tuple[Plane, int]
FEW: tuple[Row, ...] = (("transverse", 1), ("transverse", 2), ("longitudinal", 1))


def measured(
    name: str,
    rows: tuple[Row, ...] = FEW,
    sd: float = 2e-4,
    off: float = 1.0,
    mass: AddedMass | None = None,
    seed: int = 1,
) -> ModalTest:
    """Frequencies of the bar, off by `off` standard deviations; an sd of NaN is not stated."""
    exact = MODEL.frequencies_at(THETA, 6, Conditions(added_mass=mass))[0]
    away = off * np.nan_to_num(sd, nan=1e-4) * np.random.default_rng(seed).standard_normal((2, 6))
    modes = tuple(
        Mode(plane, order, float(f * np.exp(away[PLANES.index(plane), order - 1])), sd * f)
        for plane, order in rows
        for f in [float(exact[PLANES.index(plane), order - 1])]
    )
    return ModalTest(name, modes, hanger=3, added_mass=mass)


def brute_force(tests: list[ModalTest], nodes: int = 50) -> float:
    """ln f_hat ~ N(ln f + mean, phi^2 diag(s^2) + tau^2 R + U U'), of all data as read.

    tau log-uniform in two ranges; ln phi Student's t of 4 degrees, scaled by 0.2.
    """
    modes = [(mode, test) for test in tests for mode in test.modes]
    plane = np.array([PLANES.index(mode.plane) for mode, _ in modes])
    order = np.array([mode.order for mode, _ in modes])
    seen = np.array([mode.frequency_hz for mode, _ in modes])
    sd = np.array([mode.frequency_sd_hz for mode, _ in modes]) / seen
    exact = np.array(
        [
            MODEL.frequencies_at(THETA, 6, Conditions(added_mass=test.added_mass))[0, p, o - 1]
            for (_, test), p, o in zip(modes, plane, order, strict=True)
        ]
    )
    likelihood = FieldLikelihood(tests, MODEL)
    typical = likelihood._typical(MODEL)[None]
    ends = MODEL.end_waves(typical, seen[None], plane)
    mean, sensors = errors_of_sensors(MODEL.hanger, felt_by(ends[0]), ())
    section = loads_of_section(MODEL.hanger, order)
    loads = np.hstack([sensors, section, loads_of_ends(ends, (0.0, 0.0), plane, order)])
    mean = mean + mean_of_ends(MODEL.end_waves(THETA, exact[None], plane), (0.0, 0.0))[0]
    rest = np.log(seen / exact) - mean
    same = np.equal.outer(plane, plane)
    apart = np.log(np.divide.outer(order, order)) / 0.7
    repeats = 0.5 * (same & np.equal.outer(order, order))
    repeats = repeats + 0.5 * np.exp(-(apart**2) / 2) * np.where(same, 1.0, 0.5)
    tau, log_tau = [], []
    for low, high, share in ((TAU_LOWER, TAU_USUAL, 0.95), (TAU_USUAL, TAU_UPPER, 0.05)):
        edges = np.linspace(np.log(low), np.log(high), nodes + 1)
        tau.append(np.exp((edges[1:] + edges[:-1]) / 2))
        log_tau.append(np.full(nodes, np.log(share / nodes)))
    log_phi = np.linspace(-1.5, 2.5, 4 * nodes)
    log_prior = t.logpdf(log_phi / 0.2, 4)
    log_prior -= logsumexp(log_prior)
    size, phi = np.concatenate(tau), np.exp(log_phi)
    own = np.multiply.outer(phi**2, np.diag(sd**2))[None]
    covariance = own + np.multiply.outer(size**2, repeats)[:, None] + loads @ loads.T
    square = (rest * np.linalg.solve(covariance, rest[:, None])[..., 0]).sum(axis=-1)
    log = -(square + np.linalg.slogdet(2 * np.pi * covariance)[1]) / 2
    log += np.concatenate(log_tau)[:, None] + log_prior
    return float(logsumexp(log) - np.log(seen).sum())


@pytest.mark.parametrize("off", [0.5, 1.0, 3.0])
def test_two_tests_of_each_mode_have_the_evidence_of_brute_force(off: float) -> None:
    """Their means and their scatter together say all that the single readings do."""
    tests = [measured("a", off=off), measured("b", off=off, seed=2)]
    likelihood = FieldLikelihood(tests, MODEL)
    assert likelihood.frequencies == 3
    found = likelihood.marginal(likelihood.predict(MODEL, THETA))[0]
    assert found == pytest.approx(brute_force(tests), abs=0.06)


@pytest.mark.parametrize("off", [0.5, 1.0, 3.0])
def test_one_mode_under_two_conditions_shares_its_error(off: float) -> None:
    """With a known mass it is another datum, and its own error of the mode the same."""
    rows = FEW[:2]
    tests = [measured("a", rows, off=off), measured("b", rows, off=off, mass=CLAMP, seed=2)]
    likelihood = FieldLikelihood(tests, MODEL)
    assert likelihood.frequencies == 4
    found = likelihood.marginal(likelihood.predict(MODEL, THETA))[0]
    assert found == pytest.approx(brute_force(tests), abs=0.1)
    # Independent errors of the two data would say something else.
    apart = [FieldLikelihood([test], MODEL) for test in tests]
    alone = sum(float(each.marginal(each.predict(MODEL, THETA))[0]) for each in apart)
    assert abs(found - alone) > 0.15


def everything(sd: float = 1e-4) -> ModalTest:
    return measured("a", tuple((plane, order) for plane in PLANES for order in range(1, 7)), sd)


def drawn_tau(predicted: FloatArray, likelihood: FieldLikelihood) -> FloatArray:
    return likelihood.draw_sigma(np.repeat(predicted, 2000, axis=0), np.random.default_rng(1))


def test_a_wrong_class_gets_a_wide_error_and_the_right_one_a_usual_one() -> None:
    likelihood = FieldLikelihood([everything()], MODEL)
    exact = likelihood.predict(MODEL, THETA)
    wrong = exact * (1 + 0.02 * np.sin(3.0 * np.arange(12)))
    right, wide = (drawn_tau(each, likelihood) for each in (exact, wrong))
    assert np.median(right) < 6e-4
    # An error of each mode by itself is half of tau's variance.
    assert np.median(wide) == pytest.approx(0.02, rel=0.3)
    assert likelihood.most_likely_sigma(wrong)[0] == pytest.approx(0.02, rel=0.4)
    # So much that a prior of at most 3e-3 would have refused the class as it stands.
    assert likelihood.marginal(wrong)[0] > likelihood.marginal(exact)[0] - 80


def test_the_errors_drawn_have_the_posterior_of_the_joint_likelihood() -> None:
    likelihood = FieldLikelihood([everything()], MODEL)
    exact = likelihood.predict(MODEL, THETA)
    predicted = exact * (1 + 2e-3 * np.sin(3.0 * np.arange(12)))
    tau = np.geomspace(TAU_LOWER, TAU_UPPER, 1500)
    joint = likelihood.joint(np.repeat(predicted, len(tau), axis=0), tau)
    # By the logarithm of tau, the prior is flat in each of two ranges.
    low, high = np.log(TAU_USUAL / TAU_LOWER), np.log(TAU_UPPER / TAU_USUAL)
    weight = np.exp(joint - joint.max()) * np.where(tau < TAU_USUAL, 0.95 / low, 0.05 / high)
    mean = np.average(np.log(tau), weights=weight)
    spread = np.sqrt(np.average((np.log(tau) - mean) ** 2, weights=weight))
    drawn = np.log(drawn_tau(predicted, likelihood))
    assert drawn.mean() == pytest.approx(mean, abs=0.15 * spread)
    assert drawn.std() == pytest.approx(spread, rel=0.2)


def test_a_reading_of_the_tension_is_one_more_datum() -> None:
    """A normal error of its logarithm, or a gross one, apart from all errors of frequencies."""
    test = everything()
    bare = FieldLikelihood([test], MODEL)
    read = FieldLikelihood([test], MODEL, (700e3, 0.02))
    frequencies = bare.predict(MODEL, THETA)
    gross = DEFAULTS.gross_error_share.value
    for tension_n in (690e3, 720e3, 7e6):
        whole = np.column_stack([frequencies, [tension_n]])
        away = np.log(tension_n / 700e3)
        usual, wide = (
            np.exp(-((away / sd) ** 2) / 2) / (sd * 700e3 * np.sqrt(2 * np.pi))
            for sd in (0.02, DEFAULTS.gross_reading_log_sd.value)
        )
        expected = np.log((1 - gross) * usual + gross * wide)
        gain = read.marginal(whole)[0] - bare.marginal(frequencies)[0]
        assert gain == pytest.approx(expected, abs=1e-9)


def test_an_unstated_radius_of_a_known_mass_is_a_load_of_its_test_alone() -> None:
    """Half of what two standard deviations of the radius do to ln f."""
    row = DEFAULTS.added_mass_radius_m
    rows: tuple[Row, ...] = (("transverse", 4), ("transverse", 6))
    unstated, stated = replace(CLAMP, radius_of_gyration_m=None), replace(CLAMP, x_m=6.1)
    tests = [measured("t1", rows), measured("t2", rows, mass=unstated)]
    tests.append(measured("t3", rows, mass=stated))
    typical = FieldLikelihood(tests, MODEL)._typical(MODEL)[None]
    ln_f = [
        np.log(MODEL.frequencies_at(typical, 6, Conditions(added_mass=mass))[0, 0, [3, 5]])
        for radius_m in (row.value - row.sd, row.value + row.sd)
        for mass in [replace(CLAMP, radius_of_gyration_m=radius_m)]
    ]
    load = (ln_f[1] - ln_f[0]) / 2
    known = [tests[0], replace(tests[1], added_mass=CLAMP), tests[2]]
    more = _covariance(tests) - _covariance(known)
    expected = np.zeros((6, 6))
    expected[2:4, 2:4] = np.outer(load, load)
    np.testing.assert_allclose(more, expected, atol=0.02 * np.abs(load).max() ** 2)
    assert np.abs(load).max() > 5e-5


def _covariance(tests: list[ModalTest]) -> FloatArray:
    loads = FieldLikelihood(tests, MODEL)._loads
    return np.asarray(loads @ loads.T)
