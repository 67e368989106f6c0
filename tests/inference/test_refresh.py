"""Compare posteriors started from a known one with those from scratch."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shm.errors import UsageError
from shm.inference import UpdateOptions, refresh, select, update
from shm.models import THESIS, Model, build, parameter_sets
from shm.models.classes.beam import Beam2
from shm.values import FloatArray, ModalTest, Posterior
from tests.helpers.evidence_oracle import ORACLE, TABLES, modal_test
from tests.helpers.given_modes import with_modes
from tests.helpers.hangers import HANGER_3

THETA = {"theta_F": 1.0, "theta_L": 0.97}
THETA |= {"log10_k1": 7.0, "log10_k2": 7.5, "log10_k3": 7.4, "log10_k4": 8.0}
FITTED = replace(HANGER_3, plate=None, fittings_m=(0.3, 0.3))


def measured(model: Model, seed: int, error: float = 0.01, **changes: float) -> ModalTest:
    """Return twelve frequencies of the hanger above, with changes and fractional noise."""
    values = {name: value for name, value in THETA.items() if name in model.parameter_names}
    exact = model.frequencies_hz(model.pack({**values, **changes})[None], 6)[0]
    noise = error * np.random.default_rng(seed).standard_normal(exact.shape)
    return with_modes(exact, noise=noise, name=f"t{seed}")


@pytest.fixture(scope="module")
def beam1() -> Model:
    return build("beam1", HANGER_3, THESIS)


@pytest.fixture(scope="module")
def known(beam1: Model) -> Posterior:
    return update([measured(beam1, 1)], beam1, UpdateOptions(500))


def assert_same(found: Posterior, expected: Posterior, names: tuple[str, ...]) -> None:
    """Compare medians and evidence within 5 standard errors, the middle half within a fifth."""
    for name in names:
        one, other = found.parameter(name), expected.parameter(name)
        smallest = min(found.effective_sample_size, expected.effective_sample_size)
        error = 5 * 1.25 * other.std() * np.sqrt(2 / smallest)
        assert np.median(one) == pytest.approx(np.median(other), abs=error), name
        width, expected_width = (np.ptp(np.quantile(x, [0.25, 0.75])) for x in (one, other))
        assert width == pytest.approx(expected_width, rel=0.2), name
    error = 5 * np.hypot(found.log_evidence_sd, expected.log_evidence_sd)
    assert found.log_evidence == pytest.approx(expected.log_evidence, abs=error)


def test_a_later_test_has_the_posterior_of_an_update_from_scratch(
    beam1: Model, known: Posterior
) -> None:
    """Refresh a hanger that has lost 8 % of its tension."""
    later = measured(beam1, 2, theta_F=0.92)
    found = refresh([later], beam1, known)
    assert found.tests == ("t2",)
    assert_same(found, update([later], beam1, UpdateOptions(1000, seed=3)), ("theta_F", "theta_L"))
    again = refresh([later], beam1, known)
    np.testing.assert_array_equal(found.samples, again.samples)
    assert (found.log_evidence, found.evaluations) == (again.log_evidence, again.evaluations)


def midpoints(low: float, high: float, cells: int) -> FloatArray:
    return low + (high - low) * (np.arange(cells) + 0.5) / cells


def integrate_evidence(test: ModalTest, beam1: Model, cells: int) -> float:
    """Integrate the likelihood over theta_F, theta_L and sigma on midpoints, without a sampler.

    Beyond the box hardly anything is left: twice as wide a one adds 1e-4.
    """
    box = {"theta_F": (0.8, 1.6), "theta_L": (0.9, 1.15)}
    axes = [midpoints(*limits, cells) for limits in box.values()]
    theta = np.column_stack([each.ravel() for each in np.meshgrid(*axes)])
    seen = np.array([mode.frequency_hz for mode in test.modes]).reshape(2, 6)
    misfit = ((beam1.frequencies_hz(theta, 6) / seen - 1) ** 2).sum(axis=(1, 2))
    sigma = midpoints(0.002, 0.1, cells)
    log_likelihood = -misfit[:, None] / (2 * sigma**2) - 12 * np.log(sigma * np.sqrt(2 * np.pi))
    volume = np.prod([np.ptp(limits) for limits in box.values()]) * 0.098
    prior = 1 / np.prod([np.ptp(beam1.bounds[name]) for name in box])
    return float(np.log(np.exp(log_likelihood).mean() * volume * prior) - np.log(seen).sum())


def test_refresh_evidence_by_quadrature(beam1: Model, known: Posterior) -> None:
    test = measured(beam1, 4, theta_F=1.1)
    expected = integrate_evidence(test, beam1, 70)
    assert expected == pytest.approx(-15.608, abs=2e-3)
    found = refresh([test], beam1, known)
    assert found.log_evidence_sd < 0.03
    assert found.log_evidence == pytest.approx(expected, abs=3 * found.log_evidence_sd)


def test_a_loosened_end_is_followed_by_a_decade() -> None:
    beam2 = build("beam2", HANGER_3, THESIS)
    before = update([measured(beam2, 5, 0.004)], beam2, UpdateOptions(500))
    loosened = measured(beam2, 6, 0.004, log10_k1=6.0, theta_F=0.92)
    found = refresh([loosened], beam2, before, UpdateOptions(1000, seed=1))
    expected = update([loosened], beam2, UpdateOptions(1000, seed=2))
    assert_same(found, expected, ("theta_F", "theta_L"))
    low, high = np.quantile(found.parameter("theta_F"), [0.005, 0.995])
    assert low < 0.92 < high


class Fork(Model):
    """Give frequencies by how far `a` is from 0.5: two modes, equally probable."""

    name = "fork"
    bounds = {"a": (0.0, 1.0), "theta_F": (0.5, 5.0)}  # noqa: RUF012

    def frequencies_hz(self, theta: FloatArray, modes: int) -> FloatArray:
        away = (theta[:, 0] - 0.5) ** 2
        rising = np.arange(1, modes + 1)
        planes = np.stack([theta[:, 1], theta[:, 1] * (1 + 4 * away)], axis=1)
        return np.asarray(5 * planes[:, :, None] * rising)


def test_a_mode_that_the_known_posterior_has_lost_is_found_again() -> None:
    fork = Fork(HANGER_3)
    exact = fork.frequencies_hz(np.array([[0.8, 1.0]]), 6)[0]
    test = with_modes(exact, noise=0.005 * np.random.default_rng(1).standard_normal(exact.shape))
    known = update([test], fork, UpdateOptions(400))
    lost = replace(known, samples=known.samples[known.parameter("a") > 0.5])
    found = refresh([test], fork, lost, UpdateOptions(1000, seed=2))
    assert np.mean(found.parameter("a") > 0.5) == pytest.approx(0.5, abs=0.08)
    assert found.log_evidence == pytest.approx(known.log_evidence, abs=0.25)


class ExpensiveBeam2(Beam2):
    """State that Beam2 is expensive."""

    expensive = True


def test_selection_starts_expensive_classes_from_the_cheap_ones(beam1: Model) -> None:
    heard: list[str] = []
    selection = select(
        [modal_test(TABLES["1.1"])],
        [ExpensiveBeam2(HANGER_3), beam1],
        UpdateOptions(1000, 5),
        lambda label, fraction: heard.append(label),
    )
    assert heard[0] == "beam1"
    found = selection.selected
    assert found.model == "beam2"
    assert abs(found.log_evidence - ORACLE["1.1", "beam2", 1]) < 4 * found.log_evidence_sd


def test_a_posterior_of_an_older_version_is_refreshed_and_has_usual_values() -> None:
    """Take one that has springs and deviations alone, from before fittings were terms."""
    model = build("beam1", FITTED)
    test = measured(model, 7, 1e-3, theta_L=1.0, **{n: model.usual(n) for n in model.terms},
                    **dict.fromkeys(("section", "density", "modulus"), 0.0))  # fmt: skip
    now = update([test], model, UpdateOptions(200))
    kept = [k for k, name in enumerate(now.names) if name not in model.terms]
    names, units = (tuple(each[k] for k in kept) for each in (now.names, now.units))
    older = replace(
        now,
        names=names,
        units=units,
        samples=now.samples[:, kept],
        most_probable=now.most_probable[kept],
    )
    found = refresh([test], model, older, UpdateOptions(200, seed=2))
    assert found.names == now.names
    error = 5 * now.tension_n.std() / np.sqrt(100)
    assert found.tension_n.mean() == pytest.approx(now.tension_n.mean(), abs=error)
    theta = parameter_sets(older, model)
    assert theta.shape == (200, len(model.parameter_names))
    for name in model.terms:
        column = theta[:, model.parameter_names.index(name)]
        np.testing.assert_allclose(column, model.usual(name))
    with pytest.raises(UsageError, match="was made without theta_F"):
        parameter_sets(replace(older, names=("other", *names[1:])), model)
