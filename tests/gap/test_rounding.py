"""Frequencies that were rounded: to which step, and what that adds to their errors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shm.gap.contract import Hypothesis
from shm.gap.observations import observed, remark_on_rounding, rounding_covariance
from shm.gap.problem import GapProblem
from shm.gap.search import fit_alone, hypotheses
from shm.inference.data_checks import step_hz
from shm.values import NAN, ModalTest
from tests.helpers.effects import all_but
from tests.helpers.gap_campaigns import HANGER, campaign, fit_of, problem_of


def rounded(step: float, sd_hz: float = NAN) -> ModalTest:
    (test,) = campaign(tests=1, modes=6, sd=1e-6)
    return replace(
        test,
        modes=tuple(
            replace(
                mode,
                frequency_hz=round(mode.frequency_hz / step) * step if step else mode.frequency_hz,
                frequency_sd_hz=sd_hz,
                shape=(),
            )
            for mode in test.modes
        ),
    )


@pytest.mark.parametrize("step", [0.5, 0.1, 0.125, 0.05, 0.01])
def test_the_step_is_found(step: float) -> None:
    assert step_hz(rounded(step)) == pytest.approx(step)


def test_there_is_none_of_full_numbers_nor_where_errors_are_stated() -> None:
    assert step_hz(rounded(0.0)) == 0.0
    stated = rounded(0.1, sd_hz=0.03)
    assert step_hz(stated) == 0.0
    assert remark_on_rounding([stated]) == ""


def test_low_modes_err_most_and_equal_numbers_are_one_datum() -> None:
    test = rounded(0.1)
    seen = observed([test], HANGER)
    covariance, hz = rounding_covariance(seen), np.exp(seen.value)
    sd = 0.1 / np.sqrt(12) / hz
    equal = np.equal.outer(hz, hz)
    assert equal.sum() > len(hz)
    one, other = (int(k) for k in np.argwhere(np.triu(equal, 1))[0])
    pair = covariance[np.ix_([one, other], [one, other])]
    assert pair.mean() == pytest.approx(sd[one] ** 2)
    assert pair[0, 0] + pair[1, 1] - 2 * pair[0, 1] == pytest.approx(2 * sd[one] ** 2)
    alone = np.flatnonzero(equal.sum(axis=1) == 1)
    assert np.diag(covariance)[alone] == pytest.approx(sd[alone] ** 2)
    assert not covariance[~equal].any()


def test_every_size_of_the_unknown_errors_stands_beside_the_rounding() -> None:
    problem = problem_of([rounded(0.1)])
    least = problem.repeated.frequency + rounding_covariance(problem.observations)
    for node in problem.likelihood(Hypothesis()).nodes:
        beyond = np.diag(node.covariance.frequency - least)
        assert beyond == pytest.approx(np.full(12, node.model_error**2))


def test_what_rounding_does_to_a_sound_hanger_is_no_evidence_of_a_cause() -> None:
    """Taken as errors of one fraction they gave a loss of section odds of 295 to 1."""
    seen, rng = observed([rounded(0.2)], HANGER), np.random.default_rng(1)
    gained = []
    for each in (seen, replace(seen, rounding=None)):
        whole = problem_of([rounded(0.2)])
        problem = GapProblem(whole.model, whole.tests, each)
        nothing = fit_alone(problem, rng)
        (loss,) = hypotheses(problem, all_but("section_loss"))
        gained.append(fit_of(problem, loss).log_evidence - nothing.log_evidence)
    assert gained[0] < 0 < 3 < gained[1]


def test_the_owner_is_told_what_rounding_costs() -> None:
    said = remark_on_rounding([rounded(0.0), rounded(0.1)])
    assert "rounded to 0.1 Hz" in said
    assert remark_on_rounding([rounded(0.0)]) == ""
