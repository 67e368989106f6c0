"""The hybrid: a warm start from a cheap class for an expensive one changes nothing but cost."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shm.inference import UpdateOptions, select, update
from shm.inference.likelihood import Likelihood
from shm.inference.problem import Problem
from shm.inference.search import warm_start_from
from shm.models import THESIS, build
from shm.models.beam import Beam2
from shm.values import Posterior
from tests.helpers.evidence_oracle import ORACLE, TABLES, modal_test
from tests.helpers.hangers import HANGER_3

TESTS = [modal_test(TABLES["1.1"])]


class ExpensiveBeam2(Beam2):
    """Beam2, said to be expensive."""

    expensive = True


@pytest.fixture(scope="module")
def cheap() -> Posterior:
    return update(TESTS, build("beam1", HANGER_3, THESIS), UpdateOptions(500))


@pytest.fixture(scope="module")
def alone() -> Posterior:
    return update(TESTS, build("beam2", HANGER_3, THESIS), UpdateOptions(1000, 5))


def assert_same(found: Posterior, expected: Posterior) -> None:
    smallest = min(found.effective_sample_size, expected.effective_sample_size)
    for name in ("theta_F", "theta_L"):
        one, other = found.parameter(name), expected.parameter(name)
        error = 4 * np.hypot(one.std(), other.std()) / np.sqrt(smallest)
        assert np.median(one) == pytest.approx(np.median(other), abs=error), name
    error = found.log_evidence - ORACLE["1.1", "beam2", 1]
    assert abs(error) < 4 * found.log_evidence_sd


def test_a_hint_gives_the_same_posterior_for_fewer_evaluations(
    cheap: Posterior, alone: Posterior
) -> None:
    found = update(
        TESTS, build("beam2", HANGER_3, THESIS), UpdateOptions(1000, 5), warm_start=cheap
    )
    assert_same(found, alone)
    assert found.evaluations < alone.evaluations


def test_a_wrong_hint_gives_the_same_posterior(cheap: Posterior, alone: Posterior) -> None:
    """The warm start's tension is 15 % off, and sure of it."""
    column = cheap.names.index("theta_F")
    samples = cheap.samples.copy()
    middle = np.median(alone.parameter("theta_F"))
    samples[:, column] = 1.15 * middle + 0.002 * (samples[:, column] - samples[:, column].mean())
    wrong = replace(cheap, samples=samples)
    found = update(
        TESTS, build("beam2", HANGER_3, THESIS), UpdateOptions(1000, 5), warm_start=wrong
    )
    assert_same(found, alone)


def test_the_density_of_the_starts_is_that_of_their_draws(cheap: Posterior) -> None:
    """The mean of prior over starts, under the starts, is one; and the starts lie inside."""
    problem = Problem(build("beam2", HANGER_3, THESIS), Likelihood(TESTS))
    warm_start = warm_start_from(problem, cheap)
    assert warm_start is not None
    z = warm_start.draw(20_000, np.random.default_rng(1))
    assert np.isfinite(problem.coordinates.log_prior(z)).all()
    assert np.exp(-warm_start.log_ratio(z)).mean() == pytest.approx(1, abs=0.03)


def test_a_posterior_that_shares_no_parameter_is_no_hint(cheap: Posterior) -> None:
    stranger = replace(cheap, names=("mass", "damping", "sigma"))
    problem = Problem(build("beam2", HANGER_3, THESIS), Likelihood(TESTS))
    assert warm_start_from(problem, stranger) is None
    assert warm_start_from(problem, None) is None


def test_selection_starts_expensive_classes_from_the_cheap_ones(alone: Posterior) -> None:
    models = [ExpensiveBeam2(HANGER_3), build("beam1", HANGER_3, THESIS)]
    heard: list[str] = []
    selection = select(
        TESTS, models, UpdateOptions(1000, 5), lambda label, fraction: heard.append(label)
    )
    assert heard[0] == "beam1"
    assert selection.selected.model == "beam2"
    assert_same(selection.selected, alone)
    assert selection.selected.evaluations < alone.evaluations
