"""All scores of a trial: by hand, of an oracle, of a liar, of somebody plausible."""

from __future__ import annotations

import math

import numpy as np
import pytest

from shm.blind.scoring import trial_score
from shm.blind.scoring.scores import (
    Samples,
    by_chance,
    calibration_error,
    corrected,
    counted,
    missed_if_perfect,
    share,
)
from shm.values import Answer, Mark, MarkName, Score, TrialScore, TrueCase
from tests.helpers.comparing import assert_same
from tests.helpers.trial_answers import a_truth, an_answer, liar, oracle, plausible, some_truths

SHA = ("0" * 64, "1" * 64)


def of(truths: tuple[TrueCase, ...], first: list[Answer], second: list[Answer]) -> TrialScore:
    return trial_score(truths, first, second, SHA, 7, np.random.default_rng(0))


def mark(score: TrialScore, name: MarkName, richness: str = "", way: str = "") -> Mark:
    return next(
        each
        for each in score.marks
        if (each.name, each.richness, each.way, each.effect) == (name, richness, way, "")
    )


@pytest.fixture(scope="module")
def truths() -> tuple[TrueCase, ...]:
    return some_truths()


@pytest.fixture(scope="module")
def perfect(truths: tuple[TrueCase, ...]) -> TrialScore:
    second = [oracle(truth, left_out=True) for truth in truths if truth.left_out]
    return of(truths, [oracle(truth) for truth in truths], second)


def test_an_oracle_meets_every_mark_that_enough_cases_speak_of(perfect: TrialScore) -> None:
    asked = [each for each in perfect.marks if each.asked]
    assert {each.met for each in asked} == {True, None}
    assert all(each.score.cases < 10 for each in asked if each.met is None)
    assert sum(each.met is True for each in asked) > 40


def test_a_liar_misses_every_mark_but_that_a_gap_is_there(truths: tuple[TrueCase, ...]) -> None:
    second = [liar(truth, left_out=True) for truth in truths if truth.left_out]
    score = of(truths, [liar(truth) for truth in truths], second)
    met = {each.name for each in score.marks if each.met and not each.way}
    assert met == {"detected"}
    missed = {each.name for each in score.marks if each.met is False}
    assert missed == {each.name for each in score.marks if each.asked} - {"detected"}


@pytest.mark.slow
def test_a_trial_in_which_every_answer_failed_meets_nothing(truths: tuple[TrueCase, ...]) -> None:
    failed = [Answer(truth.case, (), None, "stopped") for truth in truths]
    left_out = [Answer(t.case, t.left_out, None, "stopped") for t in truths if t.left_out]
    score = of(truths, failed, left_out)
    assert not [each.name for each in score.marks if each.met and not each.way]
    assert mark(score, "failed").score.value == 1.0
    assert mark(score, "false alarms").score.value == 1.0


def test_the_same_trial_has_the_same_intervals() -> None:
    truths, rng = some_truths(48), np.random.default_rng(3)
    answers = [plausible(truth, rng) for truth in truths]
    one, other = of(truths, answers, []), of(truths, answers, [])
    assert_same(one, other)
    assert {each.name for each in one.marks if each.name.startswith("left out")} == set()


def test_detection_is_judged_strictly_above_size_four() -> None:
    cases = tuple(
        a_truth(size=size, case=f"c{number:04d}")
        for number, size in enumerate([4.0] * 10 + [4.1] * 10, start=1)
    )
    blind = [an_answer({"point_mass": 0.2}, 0.8, case=truth.case) for truth in cases[:10]]
    seen = [an_answer({"point_mass": 0.9}, 0.01, case=truth.case) for truth in cases[10:]]
    found = mark(of(cases, blind + seen, []), "detected")
    assert (found.score.value, found.score.cases, found.met) == (1.0, 10, True)


def test_nine_cases_neither_meet_nor_miss() -> None:
    cases = tuple(a_truth(case=f"c{number:04d}") for number in range(1, 10))
    found = mark(of(cases, [liar(truth) for truth in cases], []), "in its group")
    assert (found.score.value, found.score.cases, found.met) == (0.0, 9, None)


def test_the_log_score_is_weighed_to_the_mix_and_floored() -> None:
    """-ln of 1/2, 1/4, 0 and 1/8 with weights 1/4, 1/2, 1/8, 1/8; one effect comes twice."""
    cases = (
        a_truth("none", case="c0001"),
        a_truth("one", case="c0002"),
        a_truth("one", case="c0003"),
        a_truth("two", ["point_mass", "sag"], case="c0004"),
        a_truth("unknown", ["breathing_crack"], case="c0005"),
    )
    answers = [
        an_answer({"sag": 0.5}, 0.5, case="c0001"),
        an_answer({"point_mass": 0.25}, 0.75, case="c0002"),
        an_answer({"point_mass": 0.25}, 0.75, case="c0003"),
        an_answer({"sag": 1.0}, case="c0004"),
        an_answer({"sag": 0.875}, 0.0, 0.125, case="c0005"),
    ]
    wanted = math.log(2) / 4 + math.log(4) / 2 + math.log(1e4) / 8 + math.log(8) / 8
    found = mark(of(cases, answers, []), "log score", "everything")
    assert found.score.value == pytest.approx(wanted)
    assert found.upper == 1.10


def test_the_log_score_is_not_known_where_a_kind_is_missing() -> None:
    found = mark(of((a_truth(),), [an_answer({"point_mass": 1.0})], []), "log score")
    assert math.isnan(found.score.value)
    assert found.met is None


def test_the_tension_ratio_is_that_of_medians() -> None:
    cases = tuple(a_truth(case=f"c{number:04d}") for number in range(1, 12))
    answers = [
        an_answer({"point_mass": 1.0}, case=truth.case, tension=(1 + 0.01 * n, 1 - 0.001 * n))
        for n, truth in enumerate(cases, start=1)
    ]
    score = of(cases, answers, [])
    assert mark(score, "tension error before, %").score.value == pytest.approx(6.0)
    assert mark(score, "tension error after, %").score.value == pytest.approx(0.6)
    ratio = mark(score, "tension error after over before")
    assert ratio.score.value == pytest.approx(0.1)
    assert ratio.met is True


def test_recordings_may_cost_five_hundredths_and_no_more() -> None:
    ways = ["modes"] * 20 + ["recordings"] * 20
    cases = tuple(
        a_truth(case=f"c{number:04d}", way=way)  # type: ignore[arg-type]
        for number, way in enumerate(ways, start=1)
    )
    for wrong, met in ((1, True), (2, False)):
        answers = [oracle(truth) for truth in cases[:-wrong]] + [liar(t) for t in cases[-wrong:]]
        found = mark(of(cases, answers, []), "named first", way="recordings less modes")
        assert found.score.value == pytest.approx(-wrong / 20)
        assert found.met is met
        assert found.score.low < found.score.value < found.score.high


def test_effects_are_scored_one_by_one(perfect: TrialScore) -> None:
    own = [each for each in perfect.marks if each.effect and each.name == "named first"]
    assert [each.effect for each in own] == sorted(each.effect for each in own)
    assert len(own) == 5
    assert sum(each.score.cases for each in own) == mark(perfect, "named first").score.cases


def test_bins_of_size_hold_every_planted_case_once(perfect: TrialScore) -> None:
    overall = [each for each in perfect.detection if not each.richness]
    assert sum(each.score.cases for each in overall) == 288
    assert all(each.low <= each.mean < each.high for each in overall)
    assert sum(each.score.cases for each in perfect.reliability) == 384


def test_a_share_has_the_interval_of_the_bootstrap_and_of_jeffreys_where_all_agree() -> None:
    rng = np.random.default_rng(1)
    mixed = share((np.repeat([1.0, 0.0], [80, 20]),), rng).score
    half_width = 1.645 * math.sqrt(0.8 * 0.2 / 100)
    assert mixed.low == pytest.approx(0.8 - half_width, abs=0.02)
    assert mixed.high == pytest.approx(0.8 + half_width, abs=0.02)
    agreed = share((np.ones(20),), rng).score
    assert (agreed.value, agreed.high) == (1.0, 1.0)
    assert 0.85 < agreed.low < 0.95
    assert share((np.zeros(20),), rng).score.high == pytest.approx(1 - agreed.low)


def test_the_calibration_error_counted_by_hand() -> None:
    """Two bins of 15: said 0.6, right 9 of 15; said 0.9, right 12 of 15: half of 0.1."""
    said = np.repeat([0.6, 0.9], 15)
    right = np.concatenate([np.arange(15) < 9, np.arange(15) < 12]).astype(float)
    assert calibration_error(said, right) == pytest.approx(0.05)


def forecasts(excess: float, seed: int, cases: int = 75) -> Samples:
    rng = np.random.default_rng(seed)
    said = rng.beta(4, 1, cases)
    return said, (rng.random(cases) < said - excess).astype(float)


def test_what_few_cases_add_is_taken_off_a_perfect_forecast_but_not_off_an_overconfident_one() -> (
    None
):
    rng = np.random.default_rng(0)
    perfect = [forecasts(0.0, seed) for seed in range(40)]
    raw = np.mean([counted(each, rng).score.value for each in perfect])
    less = np.mean([corrected(each, rng).score.value for each in perfect])
    chance = np.mean([by_chance(each, rng).score.value for each in perfect])
    assert raw == pytest.approx(chance, abs=0.01)
    assert less < 0.7 * raw
    overconfident = [corrected(forecasts(0.2, seed), rng).score.value for seed in range(40)]
    assert np.mean(overconfident) == pytest.approx(0.2, abs=0.03)


def test_few_perfect_forecasts_may_miss_the_mark_and_many_do_not() -> None:
    rng = np.random.default_rng(0)
    few, many = np.full(40, 0.8), np.full(2000, 0.8)
    missed = np.mean(
        [corrected((few, rng.random(40) < few), rng).score.value > 0.06 for _ in range(100)]
    )
    told = missed_if_perfect(0.06)((few, np.zeros(40)), rng).score
    assert told.value == pytest.approx(missed, abs=0.12)
    assert 0.1 < told.value < 0.6
    assert told.cases == 40
    assert missed_if_perfect(0.06)((many, np.zeros(2000)), rng).score.value < 0.05
    assert math.isnan(missed_if_perfect(0.06)((few[:1], few[:1]), rng).score.value)


@pytest.mark.parametrize(
    ("met", "interval", "surely"),
    [
        (True, (0.96, 0.99), True),
        (True, (0.94, 0.99), False),
        (False, (0.90, 0.94), True),
        (False, (0.90, 0.96), False),
        (False, (math.nan, math.nan), False),
        (None, (0.96, 0.99), False),
    ],
)
def test_a_mark_is_met_or_missed_with_the_whole_interval_or_not(
    met: bool | None, interval: tuple[float, float], surely: bool
) -> None:
    asked = Mark("detected", Score(0.95, *interval, 100), 0.95, math.inf, met=met)
    assert asked.by_whole_interval is surely
