"""What is claimed and what is left possible, where some of it was never fitted."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from shm.gap.causes.probabilities import ScoredHypothesis
from shm.gap.causes.search import Attribution, Explanation, answered, hardly_behind, possible
from shm.gap.hypotheses.contract import Fit, Hypothesis
from shm.models.effects import Variant
from tests.gap import linear_toy as toy
from tests.helpers.diagnoses import MASS, a_diagnosis


def a_fit(name: str) -> Fit:
    return toy.fit(np.zeros(toy.design().size), toy.tension(), name)


BASELINE, UNEXPLAINED = a_fit("baseline"), a_fit("unexplained")


def cause(
    effect: str, probability: float, fit: Fit | None, group: int | None = None
) -> Explanation:
    """Of one place, screened where there is no fit."""
    tried = ScoredHypothesis(Hypothesis(((effect, Variant()),)), 5.0, 8.0, fit)
    return Explanation(tried, (tried,), probability, 5.0, 8.0, group)


def attribution(
    *causes: Explanation, no_gap: float = 0.01, unexplained: float = 0.05
) -> Attribution:
    return Attribution(
        baseline=BASELINE,
        no_gap_probability=no_gap,
        unexplained_probability=unexplained,
        unexplained=UNEXPLAINED,
        explanations=causes,
        groups=(tuple(each.effect for each in causes),),
        invisible=(),
        p_values=(0.5, 1.0),
        search=SimpleNamespace(),  # type: ignore[arg-type]
        tried=(),
    )


MASS_FIT, SAG_FIT = a_fit("mass"), a_fit("sag")


@pytest.mark.parametrize(
    ("mass", "sag", "chances", "grouped", "expected"),
    [
        (None, None, (0.5, 0.4), True, [(1.0, UNEXPLAINED)]),  # only screened
        (None, SAG_FIT, (0.5, 0.4), True, [(0.4, SAG_FIT)]),  # those that were fitted
        (MASS_FIT, SAG_FIT, (0.8, 0.1), False, [(0.8, MASS_FIT)]),  # not another ungrouped one
    ],
)
def test_a_leading_group_is_answered_by_its_fitted_members(
    mass: Fit | None,
    sag: Fit | None,
    chances: tuple[float, float],
    grouped: bool,
    expected: list[tuple[float, Fit]],
) -> None:
    of = 0 if grouped else None
    found = attribution(
        cause("point_mass", chances[0], mass, of), cause("sag", chances[1], sag, of)
    )
    assert found.leading is not None
    assert answered(found) == expected


@pytest.mark.parametrize(
    ("no_gap", "unexplained", "fit"), [(0.9, 0.1, BASELINE), (0.01, 0.99, UNEXPLAINED)]
)
def test_where_no_cause_leads_it_is_no_gap_or_something_unknown(
    no_gap: float, unexplained: float, fit: Fit
) -> None:
    found = attribution(no_gap=no_gap, unexplained=unexplained)
    assert found.leading is None
    assert answered(found) == [(1.0, fit)]


def test_all_that_was_fitted_is_possible_with_its_probability() -> None:
    """A tension is averaged over them; what was only screened has no draws to add."""
    found = possible(attribution(cause("point_mass", 0.5, None), cause("sag", 0.4, SAG_FIT)))
    assert [weight for weight, _ in found] == pytest.approx([0.01, 0.05, 0.4])
    assert [fit for _, fit in found] == [BASELINE, UNEXPLAINED, SAG_FIT]


@pytest.mark.parametrize(
    ("causes", "no_gap", "leading"),
    [
        # A group outweighs the single cause that is more probable than each member.
        ((("sag", 0.4, None), ("point_mass", 0.3, 0), ("effective_length", 0.25, 0)), 0.01, 1),
        ((("sag", 0.4, None), ("point_mass", 0.2, 0), ("effective_length", 0.1, 0)), 0.01, 0),
        ((("sag", 0.9, None),), 0.06, None),
        ((("sag", 0.02, None),), 0.01, None),
        ((), 0.01, None),
    ],
)
def test_leading_is_decided_once(
    causes: tuple[tuple[str, float, int | None], ...], no_gap: float, leading: int | None
) -> None:
    explanations = [cause(effect, p, None, group) for effect, p, group in causes]
    unexplained = 0.05
    found = attribution(*explanations, no_gap=no_gap, unexplained=unexplained)
    shown = replace(
        a_diagnosis(),
        causes=tuple(
            replace(MASS, effect=effect, probability=p, group=group) for effect, p, group in causes
        ),
        no_gap_probability=no_gap,
        unexplained_probability=unexplained,
    )
    assert found.leads == shown.leads
    if leading is None:
        assert found.leading is shown.leading is None
    else:
        assert found.leading is explanations[leading]
        assert shown.leading is shown.causes[leading]


@pytest.mark.parametrize(
    ("log_bayes_factor", "log_fit", "alike"),
    [(7.5, 9.0, True), (6.5, 9.0, False), (6.5, 11.5, True), (2.5, 12.0, False)],
)
def test_a_cause_that_fits_as_well_is_not_told_apart_by_what_its_freedom_costs(
    log_bayes_factor: float, log_fit: float, alike: bool
) -> None:
    best, other = weighed(10.0, 12.0), weighed(log_bayes_factor, log_fit)
    assert hardly_behind(other, best) == alike


def weighed(log_bayes_factor: float, log_fit: float) -> Explanation:
    return Explanation(ScoredHypothesis(Hypothesis(), 0.0, 0.0), (), 0.1, log_bayes_factor, log_fit)
