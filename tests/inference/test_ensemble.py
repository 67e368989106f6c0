"""Started from a known posterior, updating gives the posterior that it gives from scratch."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shm.documents import posterior_document
from shm.errors import BadInput, UsageError
from shm.inference import UpdateOptions, refresh, update, updating
from shm.inference.importance import Weighted, tail_index, weigh
from shm.inference.problem import Points
from shm.models import THESIS, Model, build
from shm.values import PLANES, AddedMass, FloatArray, ModalTest, Mode, Posterior
from tests.helpers.hangers import HANGER_3

THETA = {
    "theta_F": 1.0,
    "theta_L": 0.97,
    "log10_k1": 7.0,
    "log10_k2": 7.5,
    "log10_k3": 7.4,
    "log10_k4": 8.0,
}


def measured(model: Model, seed: int, error: float = 0.01, **changes: float) -> ModalTest:
    """Twelve frequencies of the hanger above, with what has changed and fractional noise."""
    values = {name: value for name, value in THETA.items() if name in model.parameter_names}
    exact = model.frequencies_hz(model.pack({**values, **changes})[None], 6)[0]
    noisy = exact * (1 + error * np.random.default_rng(seed).standard_normal(exact.shape))
    modes = tuple(
        Mode(plane, order + 1, float(noisy[row, order]))
        for row, plane in enumerate(PLANES)
        for order in range(6)
    )
    return ModalTest(f"t{seed}", modes, hanger=3)


@pytest.fixture(scope="module")
def beam1() -> Model:
    return build("beam1", HANGER_3, THESIS)


@pytest.fixture(scope="module")
def known(beam1: Model) -> Posterior:
    return update([measured(beam1, 1)], beam1, UpdateOptions(500))


@pytest.fixture(scope="module")
def later(beam1: Model) -> ModalTest:
    """A later test of the hanger, which has lost 8 % of its tension."""
    return measured(beam1, 2, theta_F=0.92)


@pytest.fixture(scope="module")
def scratch(beam1: Model, later: ModalTest) -> Posterior:
    return update([later], beam1, UpdateOptions(1000, seed=3))


def assert_same(found: Posterior, expected: Posterior, names: tuple[str, ...]) -> None:
    """Medians and evidence within 5 standard errors, the middle half as wide within a fifth."""
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
    beam1: Model, known: Posterior, later: ModalTest, scratch: Posterior
) -> None:
    found = refresh([later], beam1, known)
    assert found.method == "re-weighted"
    assert found.tests == ("t2",)
    assert_same(found, scratch, ("theta_F", "theta_L", "sigma"))


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
    expected = integrate_evidence(test, beam1, 100)
    assert expected == pytest.approx(integrate_evidence(test, beam1, 70), abs=1e-3)
    assert expected == pytest.approx(-15.608, abs=1e-3)
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
    """Frequencies that see only how far `a` is from 0.5: two modes, equally probable."""

    name = "fork"
    bounds = {"a": (0.0, 1.0), "theta_F": (0.5, 5.0)}  # noqa: RUF012

    def frequencies_hz(self, theta: FloatArray, modes: int) -> FloatArray:
        away = (theta[:, 0] - 0.5) ** 2
        rising = np.arange(1, modes + 1)
        planes = np.stack([theta[:, 1], theta[:, 1] * (1 + 4 * away)], axis=1)
        return np.asarray(5 * planes[:, :, None] * rising)


def fork_test(fork: Fork) -> ModalTest:
    exact = fork.frequencies_hz(np.array([[0.8, 1.0]]), 6)[0]
    noisy = exact * (1 + 0.005 * np.random.default_rng(1).standard_normal(exact.shape))
    modes = tuple(
        Mode(plane, order + 1, float(noisy[row, order]))
        for row, plane in enumerate(PLANES)
        for order in range(6)
    )
    return ModalTest("fork", modes, hanger=3)


def test_a_mode_that_the_known_posterior_has_lost_is_found_again() -> None:
    fork = Fork(HANGER_3)
    test = fork_test(fork)
    known = update([test], fork, UpdateOptions(400))
    upper = known.samples[known.parameter("a") > 0.5]
    lost = replace(known, samples=upper)
    found = refresh([test], fork, lost, UpdateOptions(1000, seed=2))
    assert np.mean(found.parameter("a") > 0.5) == pytest.approx(0.5, abs=0.08)
    assert found.log_evidence == pytest.approx(known.log_evidence, abs=0.25)


def test_draws_that_cannot_be_trusted_are_not_used(
    monkeypatch: pytest.MonkeyPatch, beam1: Model, known: Posterior, later: ModalTest
) -> None:
    """A proposal far from the posterior: nothing but the prior's share reaches it."""

    def astray(*arguments: object) -> tuple[FloatArray, FloatArray]:
        points = 2 + 0.01 * np.random.default_rng(1).standard_normal((200, 2))
        return points, points

    def no_better(problem: object, weighted: object, population: FloatArray, rng: object):  # type: ignore[no-untyped-def]
        return population

    monkeypatch.setattr(updating, "_population", astray)
    monkeypatch.setattr(updating, "_ensemble", no_better)
    monkeypatch.setattr(updating, "weigh", only_population)
    options = UpdateOptions(300, seed=5)
    found, expected = refresh([later], beam1, known, options), update([later], beam1, options)
    assert found.method == "tmcmc"
    np.testing.assert_array_equal(found.samples, expected.samples)
    assert found.evaluations > expected.evaluations


def only_population(problem, population, anchors, enough, rng, wider=()):  # type: ignore[no-untyped-def]
    """Importance sampling from one wide normal about what is astray, without any safeguard."""
    if not np.allclose(population, 2, atol=0.1):  # that of the start from scratch
        return weigh(problem, population, anchors, enough, rng, wider)
    z = population.mean(axis=0) + 0.3 * rng.standard_normal((2000, population.shape[1]))
    points = problem.evaluate(z)
    log_drawn = -0.5 * ((z - population.mean(axis=0)) ** 2).sum(axis=1) / 0.3**2
    return Weighted(points, problem.log_posterior(points) - log_drawn, len(z))


def test_the_ensemble_gives_the_same_posterior(
    monkeypatch: pytest.MonkeyPatch,
    beam1: Model,
    known: Posterior,
    later: ModalTest,
    scratch: Posterior,
) -> None:
    answers = iter([False, True])
    monkeypatch.setattr(updating, "trusted", lambda *arguments: next(answers))
    found = refresh([later], beam1, known)
    assert found.method == "ensemble"
    assert_same(found, scratch, ("theta_F", "theta_L", "sigma"))


def test_an_ensemble_wider_than_the_weighted_draws_gives_the_fallback() -> None:
    rng = np.random.default_rng(1)
    z = rng.standard_normal((2000, 2))
    weighted = Weighted(Points(z, z), np.zeros(2000), 2000)
    assert updating._as_wide(weighted, rng.standard_normal((500, 2)), 1000, rng)
    assert not updating._as_wide(weighted, rng.standard_normal((500, 2)) * [1, 2], 1000, rng)


def test_the_same_seed_gives_the_same_draws_on_every_path(
    monkeypatch: pytest.MonkeyPatch, beam1: Model, known: Posterior, later: ModalTest
) -> None:
    for answers in ([True], [False, True]):
        found = []
        for _ in range(2):
            left = iter(answers)
            monkeypatch.setattr(updating, "trusted", lambda *_, left=left: next(left))
            np.random.seed(len(found))  # noqa: NPY002
            found.append(refresh([later], beam1, known, UpdateOptions(200, seed=8)))
        np.testing.assert_array_equal(found[0].samples, found[1].samples)
        assert found[0].log_evidence == found[1].log_evidence
        assert found[0].evaluations == found[1].evaluations


@pytest.mark.parametrize("shape", [0.2, 0.5, 0.9, 1.5])
def test_the_tail_index_is_that_of_the_weights(shape: float) -> None:
    """Weights of a generalised Pareto distribution have its shape as tail index."""
    uniform = np.random.default_rng(3).random((20, 20000))
    weights = (uniform**-shape - 1) / shape
    found = np.mean([tail_index(np.log(row)) for row in weights])
    assert found == pytest.approx(shape, abs=0.1)


def test_the_tail_of_a_few_weights_above_zero_is_the_heaviest() -> None:
    log_weights = np.full(3000, -1e4)
    log_weights[:30] = 0.0
    assert tail_index(log_weights) == np.inf


def test_even_weights_are_trusted_and_few_or_wild_ones_are_not() -> None:
    rng = np.random.default_rng(1)
    z = np.zeros((4000, 1))

    def trusted(log_weights: FloatArray) -> bool:
        return updating.trusted(Weighted(Points(z, z), log_weights, 4000), 1000)

    assert trusted(0.5 * rng.standard_normal(4000))
    assert not trusted(4 * rng.standard_normal(4000))
    assert not trusted(np.log(rng.random(4000) ** -0.95) * (rng.random(4000) < 0.1))


def test_the_way_taken_stands_in_the_document(known: Posterior) -> None:
    assert posterior_document(known)["method"] == "tmcmc"
    assert posterior_document(replace(known, method="ensemble"))["method"] == "ensemble"


def test_a_posterior_of_another_class_is_refused(
    beam1: Model, known: Posterior, later: ModalTest
) -> None:
    with pytest.raises(UsageError, match=r"beam1 says nothing about beam2"):
        refresh([later], build("beam2", HANGER_3, THESIS), known)
    with pytest.raises(BadInput, match="beyond the ends"):
        refresh([replace(later, added_mass=AddedMass(25.0, 13.6))], beam1, known)


def test_progress_is_heard_from_start_to_end(
    beam1: Model, known: Posterior, later: ModalTest
) -> None:
    heard: list[tuple[str, float]] = []
    refresh([later], beam1, known, UpdateOptions(200), lambda *args: heard.append(args))
    assert heard[0] == ("beam1", 0.0)
    assert heard[-1] == ("beam1", 1.0)
    assert [fraction for _, fraction in heard] == sorted(fraction for _, fraction in heard)
