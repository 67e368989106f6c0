"""One answer beside one truth: every score of a case, known by hand."""

from __future__ import annotations

import numpy as np
import pytest

from shm.errors import BadInput
from tests.benchmarks.blind.scores import (
    calibration_error,
    case_scores,
    corrected_calibration_error,
    left_out_scores,
)
from tests.benchmarks.blind.truth import Answer, CaseScore, TrueCase
from tests.helpers.trial_answers import a_truth, an_answer

ALIAS = {"point_mass": 0.3, "sag": 0.5, "timebase": 0.1}
GROUP = (("sag", "point_mass"),)


def scored(truth: TrueCase, answer: Answer) -> CaseScore:
    (score,) = case_scores([truth], [answer])
    return score


def second(truth: TrueCase, first: Answer, answer: Answer) -> CaseScore:
    (score,) = left_out_scores([truth], [first], [answer])
    return score


def test_the_planted_effect_that_leads_is_first_and_right() -> None:
    score = scored(a_truth(), an_answer({"point_mass": 0.8, "sag": 0.1}, 0.04, 0.06))
    assert (score.leader, score.leading_probability) == ("point_mass", 0.8)
    assert score.right
    assert score.first
    assert score.in_group
    assert not score.misattributed


def test_an_effect_that_the_first_cannot_be_told_from_is_in_its_group_but_not_first() -> None:
    score = scored(a_truth(), an_answer(ALIAS, 0.04, 0.06, groups=GROUP))
    assert (score.leader, score.alike) == ("sag", ("point_mass",))
    assert score.leading_probability == pytest.approx(0.8)
    assert score.right
    assert score.in_group
    assert not score.first


def test_without_the_group_the_same_answer_is_wrong() -> None:
    score = scored(a_truth(), an_answer(ALIAS, 0.04, 0.06))
    assert not (score.right)
    assert not (score.in_group)
    assert not (score.first)


def test_named_first_does_not_mind_what_no_gap_has() -> None:
    score = scored(a_truth(), an_answer({"point_mass": 0.3, "sag": 0.1}, no_gap=0.6))
    assert score.first
    assert not (score.right)
    assert (score.leader, score.leading_probability) == ("no gap", 0.6)


@pytest.mark.parametrize(
    ("no_gap", "unexplained", "sag", "right"),
    [
        (0.7, 0.2, 0.1, True),
        (0.06, 0.1, 0.84, True),
        (0.04, 0.86, 0.1, False),
        (0.04, 0.1, 0.86, False),
    ],
)
def test_a_sound_hanger_is_right_where_no_gap_leads(
    no_gap: float, unexplained: float, sag: float, right: bool
) -> None:
    score = scored(a_truth("none"), an_answer({"sag": sag}, no_gap, unexplained))
    assert score.right == right
    assert (score.planted, score.size) == ("nothing", 0.0)


def test_what_the_catalogue_lacks_is_right_where_unexplained_leads() -> None:
    truth = a_truth("unknown", ["breathing_crack"])
    assert scored(truth, an_answer({"sag": 0.3}, 0.04, 0.66)).right
    misled = scored(truth, an_answer({"sag": 0.95}, 0.01, 0.04))
    assert misled.misattributed
    assert not misled.right


@pytest.mark.parametrize(("factor", "covered"), [(1.019, True), (0.981, True), (1.02, False)])
def test_the_tension_is_covered_by_its_95_percent_interval(factor: float, covered: bool) -> None:
    score = scored(a_truth(), an_answer({"point_mass": 1.0}, tension=(0.9, factor)))
    assert score.tension_covered is covered
    assert score.tension_error_after == pytest.approx(factor - 1)


@pytest.mark.parametrize("kind", ["none", "one", "two", "unknown"])
def test_a_failure_and_a_missing_answer_are_wrong_everywhere(kind: str) -> None:
    truth = a_truth(kind, ["point_mass", "sag"] if kind == "two" else ["point_mass"])  # type: ignore[arg-type]
    failed = Answer("c0001", (), None, "no mode was found")
    for score, why in (
        (scored(truth, failed), "no mode was found"),
        (case_scores([truth], [])[0], "not answered"),
    ):
        assert score.failure == why
        assert not (score.right)
        assert not (score.first)
        assert not (score.in_group)
        assert score.tension_covered is False


def test_an_answer_to_a_case_that_the_key_lacks_is_refused() -> None:
    with pytest.raises(BadInput, match="c0009"):
        case_scores([a_truth()], [an_answer({"sag": 1.0}, case="c0009")])


def test_left_out_the_right_answer_is_unexplained() -> None:
    score = second(a_truth(), an_answer({"point_mass": 1.0}), an_answer({"sag": 0.26}, 0.04, 0.7))
    assert score.right
    assert not score.misattributed


def test_left_out_an_effect_of_the_group_of_the_first_round_is_excused() -> None:
    alike, alone = an_answer(ALIAS, groups=GROUP), an_answer(ALIAS)
    blamed = an_answer({"sag": 0.95}, 0.0, 0.05)
    excused = second(a_truth(), alike, blamed)
    assert excused.in_group
    assert not excused.misattributed
    assert not excused.right
    assert second(a_truth(), alone, blamed).misattributed
    assert not second(a_truth(), alone, an_answer({"sag": 0.9}, 0.0, 0.1)).misattributed


def test_left_out_the_groups_of_two_effects_are_that_of_the_pair_and_of_each() -> None:
    truth = a_truth("two", ["point_mass", "sag"])
    first = an_answer({"point_mass": 0.6, "timebase": 0.4}, groups=(("point_mass", "timebase"),))
    assert second(truth, first, an_answer({"timebase": 0.95})).in_group
    assert second(truth, first, an_answer({"section_loss": 0.95})).misattributed


def test_left_out_an_answer_after_a_failed_first_round_is_judged_by_the_effect_alone() -> None:
    failed = Answer("c0001", (), None, "no mode")
    assert second(a_truth(), failed, an_answer({"sag": 0.95})).misattributed


def test_cases_of_which_nothing_was_left_out_have_no_second_round() -> None:
    assert left_out_scores([a_truth("unknown", ["breathing_crack"])], [], []) == ()


def test_calibration_error_of_known_bins() -> None:
    """Thirty cases make two bins: one says 0.6 and is right in 9 of 15, one 0.9 and in 6 of 15."""
    probability = np.repeat([0.6, 0.9], 15)
    right = np.array([1.0] * 9 + [0.0] * 6 + [1.0] * 6 + [0.0] * 9)
    assert calibration_error(probability, right) == pytest.approx((0.0 + 0.5) / 2)
    value, (low, high) = corrected_calibration_error(probability, right, np.random.default_rng(1))
    assert low <= value <= high
    assert 0.1 < value < 0.26


def test_calibration_error_of_one_case_has_no_interval() -> None:
    one = np.array([0.7]), np.array([1.0])
    value, ends = corrected_calibration_error(*one, np.random.default_rng(1))
    assert value == pytest.approx(0.3)
    assert ends == (value, value)
