"""Posterior and evidence against quadrature, known truth and their own claims."""

from __future__ import annotations

from dataclasses import replace
from unittest.mock import Mock

import numpy as np
import pytest

from shm.errors import BadInput, UsageError
from shm.inference import UpdateOptions, select, update
from shm.inference.answer.outcome import _at_bounds
from shm.inference.problem.thesis_noise import ThesisLikelihood
from shm.models import THESIS, build
from shm.values import PLANES, AddedMass, FloatArray, ModalTest, Mode
from tests.helpers.evidence_oracle import TABLES, log_marginal, modal_test
from tests.helpers.hangers import HANGER_3

TABLE_1_1 = TABLES["1.1"]


def test_beam_1_has_the_tension_of_quadrature() -> None:
    """By the midpoint rule, on table 1.1; another seed gives other draws."""
    model, frequencies = build("beam1", HANGER_3, THESIS), np.array(list(TABLE_1_1.values()))
    axes = 0.5 + 4.5 * (np.arange(700) + 0.5) / 700, 0.5 + 1.0 * (np.arange(400) + 0.5) / 400
    theta = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 2)
    misfit = ((model.frequencies_hz(theta, 6) / frequencies - 1) ** 2).sum(axis=(1, 2))
    values = log_marginal(misfit, frequencies)
    weights = np.exp(values - values.max())
    mean = np.average(theta[:, 0], weights=weights)
    sd = np.sqrt(np.average((theta[:, 0] - mean) ** 2, weights=weights))
    posterior, other = (
        update([modal_test(TABLE_1_1)], model, UpdateOptions(4000, seed)) for seed in (2, 8)
    )
    assert not np.array_equal(posterior.samples, other.samples)
    tension = posterior.tension_n / HANGER_3.nominal_tension_n
    assert tension.mean() == pytest.approx(mean, abs=5 * sd / np.sqrt(4000))
    assert tension.std() == pytest.approx(sd, rel=0.08)


@pytest.mark.parametrize("springs", [(6.8, 7.6, 7.3, 8.2), (7.0, 7.6, 7.0, 7.6), (11, 11, 11, 11)])
def test_a_planted_tension_is_found_however_sharp_the_data(springs: tuple[float, ...]) -> None:
    """Frequencies good to 0.002 Hz confine the posterior to 1e-20 of the prior."""
    model = build("beam2", HANGER_3, THESIS)
    names = ("log10_k1", "log10_k2", "log10_k3", "log10_k4")
    truth = model.pack({"theta_F": 0.9, "theta_L": 1.0, **dict(zip(names, springs, strict=True))})
    noise = 0.002 * np.random.default_rng(5).standard_normal((2, 8))
    measured = model.frequencies_hz(truth[None], 8)[0] + noise
    frequencies = {plane: list(measured[i]) for i, plane in enumerate(PLANES)}
    posterior = update([modal_test(frequencies, sd_hz=0.002)], model)
    low, middle, high = np.quantile(posterior.tension_n, [0.005, 0.5, 0.995]) / 711e3
    assert middle == pytest.approx(0.9, rel=0.005)
    assert high - low < 0.02
    for row in posterior.predicted:
        assert row.mean_hz == pytest.approx(row.measured_hz, rel=4e-4)


def test_exchangeable_ends_are_both_found() -> None:
    posterior = update(
        [modal_test(TABLE_1_1)] * 10, build("beam2", HANGER_3, THESIS), UpdateOptions(1000, 3)
    )
    softer_deck = np.mean(posterior.parameter("log10_k1") < posterior.parameter("log10_k3"))
    assert 0.4 < softer_deck < 0.6


def test_an_uncertain_frequency_counts_less() -> None:
    """One mode is 20 % off; with its standard deviation stated the tension must not follow it."""
    model = build("beam1", HANGER_3, THESIS)
    exact = model.frequencies_hz(np.array([[1.0, 1.0]]), 10)[0, 0] * np.where(
        np.arange(10) == 3, 1.2, 1.0
    )
    sure = modal_test({"transverse": list(exact)})
    modes = tuple(replace(m, frequency_sd_hz=8.0 if m.order == 4 else 0.02) for m in sure.modes)
    unsure = replace(sure, modes=modes)
    widths = [update([test], model, UpdateOptions(500)).tension_n.std() for test in (sure, unsure)]
    assert widths[1] < widths[0] / 5


def test_repeatability_is_no_less_than_the_data_can_tell() -> None:
    """Of a short stiff bar, whose estimate hardly follows its tension (Cramer and Rao)."""
    stocky = replace(HANGER_3, plate=None, length_m=2.3, nominal_tension_n=1.4e6)
    exact, sd = build("beam1", stocky, THESIS), 5e-4

    def frequencies_hz(ratio: float) -> FloatArray:
        theta = exact.pack({"theta_F": ratio, "theta_L": 1.0})
        return exact.frequencies_hz(theta[None], 4)[0, 0]

    found_hz = frequencies_hz(1.0)
    modes = tuple(Mode("transverse", n, hz, sd * hz) for n, hz in enumerate(found_hz.tolist(), 1))
    test = ModalTest("t1", modes, hanger=3)
    posterior = update([test], build("beam1", stocky), UpdateOptions(samples=300))
    rise = np.log(frequencies_hz(1.01) / frequencies_hz(0.99)) / (0.02 * 1.4e6)
    least_n = sd / np.sqrt((rise**2).sum())
    assert posterior.repeatability_sd_n > 0.9 * least_n


def test_what_cannot_be_updated_is_refused_with_a_remedy() -> None:
    model = build("beam1", HANGER_3, THESIS)
    with pytest.raises(BadInput, match="no measured frequency"):
        update([ModalTest("t1", ())], model)
    with pytest.raises(BadInput, match="beyond the ends"):
        update([replace(modal_test(TABLE_1_1), added_mass=AddedMass(25.0, 13.6))], model)
    with pytest.raises(UsageError, match="no model class"):
        select([modal_test(TABLE_1_1)], [])


def test_the_likelihood_is_the_thesis_product_of_normals() -> None:
    """(4.5): f_hat ~ N(f, (sigma f_hat)^2 + sd^2), N_D equal data sets."""
    likelihood = ThesisLikelihood([modal_test({"transverse": [5.0, 12.0]}, sd_hz=0.05)] * 3)
    value = likelihood.joint(np.array([[5.1, 11.8] * 3]), np.array([0.02]))[0]
    expected = 0.0
    for found, seen in ((5.1, 5.0), (11.8, 12.0)):
        variance = (0.02 * seen) ** 2 + 0.05**2
        expected -= 1.5 * ((found - seen) ** 2 / variance + np.log(2 * np.pi * variance))
    assert value == pytest.approx(expected)


@pytest.mark.parametrize("sd_hz", [np.nan, 1e-3, 0.5])
@pytest.mark.parametrize("copies", [1, 10])
def test_the_model_error_is_integrated_out_exactly(sd_hz: float, copies: int) -> None:
    likelihood = ThesisLikelihood([modal_test(TABLE_1_1, sd_hz)] * copies)
    predicted = np.array([list(TABLE_1_1["transverse"]) + list(TABLE_1_1["longitudinal"])])
    predicted = np.tile(predicted * (1 + 0.01 * np.sin(np.arange(12))), (1, copies))
    sigma = np.exp(np.linspace(np.log(1e-4), 0, 20001))
    joint = likelihood.joint(np.repeat(predicted, len(sigma), axis=0), sigma)
    joint[0] += np.log1p(2 * sigma[0] / (sigma[1] - sigma[0]))
    expected = np.log(np.trapezoid(np.exp(joint - joint.max()), sigma)) + joint.max()
    assert likelihood.marginal(predicted)[0] == pytest.approx(expected, abs=5e-4)
    drawn = likelihood.draw_sigma(np.repeat(predicted, 4000, axis=0), np.random.default_rng(1))
    weights = np.exp(joint - joint.max()) * sigma
    mean = np.average(np.log(sigma), weights=weights)
    sd = np.sqrt(np.average((np.log(sigma) - mean) ** 2, weights=weights))
    assert np.log(drawn).mean() == pytest.approx(mean, abs=0.1 * sd + 0.01)


@pytest.mark.parametrize("crowded", [0.005, 0.995])
def test_a_parameter_that_crowds_at_either_end_of_its_prior_is_named(crowded: float) -> None:
    """A tenth of the draws within 2 % of the range is five times the share of a flat posterior."""
    flat = np.linspace(0, 1, 1000)
    crowding = np.where(np.arange(1000) % 8 == 0, crowded, flat)
    prior = Mock(lower=np.array([2.0, 5.0]), upper=np.array([4.0, 12.0]), names=("theta_F", "k"))
    samples = np.column_stack([2 + 2 * flat, 5 + 7 * crowding, flat])
    assert _at_bounds(Mock(prior=prior), samples) == ("k",)
