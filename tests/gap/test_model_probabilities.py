"""Probabilities of families."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shm.gap.contract import Hypothesis
from shm.gap.model_probabilities import (
    CALIBRATION,
    NO_GAP,
    SINGLE,
    UNKNOWN,
    ScoredHypothesis,
    families,
    log_prior,
    misfit_odds,
    probabilities,
    undetected_share,
)
from shm.models.effects import Variant
from tests.gap import linear_toy as toy


def _tried(
    log_evidence: float, *names: str, at: str = "everywhere", flexible: bool = False
) -> ScoredHypothesis:
    effects = tuple((name, Variant(at)) for name in names)
    return ScoredHypothesis(Hypothesis(effects, flexible), log_evidence, 0.0)


def test_probabilities_add_to_one() -> None:
    tried = [_tried(0.0), _tried(1.0, "a"), _tried(3.0, "b"), _tried(2.0, flexible=True)]
    chances, mimic = probabilities(families(tried, {"a": 1, "b": 1}))
    assert chances.sum() + mimic == pytest.approx(1.0)


def test_an_effect_does_not_gain_by_having_more_variants() -> None:
    once = [_tried(0.0), _tried(2.0, "a"), _tried(2.0, "b")]
    often = [_tried(0.0), _tried(2.0, "a"), *(_tried(2.0, "b", at=f"{k}") for k in range(9))]
    few, _ = probabilities(families(once, {"a": 1, "b": 1}))
    many, _ = probabilities(families(often, {"a": 1, "b": 9}))
    assert sorted(many) == pytest.approx(sorted(few))


def test_variants_that_were_not_tried_count_as_impossible() -> None:
    (family,) = families([_tried(2.0, "a")], {"a": 2})
    assert family.log_evidence == pytest.approx(2.0 - 0.6931, abs=1e-3)


def test_with_evidence_for_nothing_the_priors_stand() -> None:
    tried = [_tried(0.0), _tried(0.0, "a"), _tried(0.0, "b")]
    chances = dict(
        zip(
            [family.name for family in families(tried, {"a": 1, "b": 1})],
            probabilities(families(tried, {"a": 1, "b": 1}))[0],
            strict=True,
        )
    )
    assert chances[""] / chances["a"] == pytest.approx(NO_GAP / (SINGLE / 2))


def test_what_is_unknown_may_pass_for_an_effect() -> None:
    tried = [_tried(0.0), _tried(30.0, "a"), _tried(0.0, "b"), _tried(0.0, flexible=True)]
    chances, mimic = probabilities(families(tried, {"a": 1, "b": 1}))
    assert chances.sum() + mimic == pytest.approx(1.0)
    assert mimic / chances[0] == pytest.approx(CALIBRATION.mimics_one * UNKNOWN / SINGLE, rel=1e-6)


def test_a_pair_that_imitates_freely_is_claimed_less_surely() -> None:
    variants = dict.fromkeys(
        ("point_mass", "section_loss", "geometric_hardening", "sensor_mass"), 1
    )
    free = [_tried(0.0), _tried(40.0, "point_mass", "section_loss")]
    bound = [_tried(0.0), _tried(40.0, "geometric_hardening", "sensor_mass")]
    (freely, _), (surely, _) = (probabilities(families(t, variants)) for t in (free, bound))
    assert freely[0] < 0.7 < 0.95 < surely[0]


def test_the_further_an_effect_is_off_its_law_the_likelier_something_unknown_passes_for_it() -> (
    None
):
    off = [_tried(0.0), replace(_tried(30.0, "a"), log_mimic=32.0)]
    near = [_tried(0.0), replace(_tried(30.0, "a"), log_mimic=29.0)]
    (_, far_off), (_, hardly_off) = (probabilities(families(t, {"a": 1})) for t in (off, near))
    assert far_off > 5 * hardly_off


def test_something_unknown_beside_a_cause_is_rarer_than_a_second_cause_and_than_it_alone() -> None:
    variants = {"a": 1, "b": 1}
    priors = [
        log_prior(_tried(0.0, *names, flexible=flexible).hypothesis, variants)
        for names, flexible in (((), True), (("a",), False), (("a", "b"), False), (("a",), True))
    ]
    assert priors[3] < min(priors[:3])
    pair = _tried(0.0, "a", "b", flexible=True).hypothesis
    assert log_prior(pair, variants) - priors[2] == pytest.approx(priors[3] - priors[1])


def test_the_best_variant_comes_first() -> None:
    tried = [_tried(1.0, "a", at="deck end"), _tried(4.0, "a", at="arch end")]
    (family,) = families(tried, {"a": 2})
    assert family.best.hypothesis.at == "arch end"


def test_a_baseline_that_fits_by_an_unlikely_bar_fits_less_well() -> None:
    own = toy.fit(np.zeros(toy.design().size), toy.tension())
    unlikely = replace(own, z=np.array([4.0]))
    assert ScoredHypothesis.fitted(unlikely, 1).log_fit == pytest.approx(
        ScoredHypothesis.fitted(own, 1).log_fit - 8.0
    )
    assert ScoredHypothesis.fitted(unlikely, 0).log_fit == pytest.approx(own.log_fit)


def test_a_p_value_raises_the_odds_of_something_unknown_as_published() -> None:
    # Sellke, Bayarri and Berger (2001), table 1: bounds on the odds for 0.05, 0.01 and 0.001.
    assert 1 / misfit_odds(0.05) == pytest.approx(0.407, abs=5e-4)
    assert 1 / misfit_odds(0.01) == pytest.approx(0.125, abs=5e-4)
    assert 1 / misfit_odds(0.001) == pytest.approx(0.0188, abs=5e-5)
    assert misfit_odds(0.5) == misfit_odds(1.0) == 1
    assert misfit_odds(0.0) == misfit_odds(1e-9) < 1000


def test_of_a_bad_fit_something_unknown_gains_and_of_a_good_one_nothing_changes() -> None:
    tried = [_tried(0.0), _tried(9.0, "a"), _tried(8.0, "b"), _tried(7.0, flexible=True)]
    kinds = families(tried, {"a": 1, "b": 1})
    before, mimic = probabilities(kinds)
    same, passes = probabilities(kinds, 0.6)
    assert (*same, passes) == pytest.approx((*before, mimic))
    after, passes = probabilities(kinds, 0.001)
    assert after.sum() + passes == pytest.approx(1.0)
    a, unknown = (next(i for i, k in enumerate(kinds) if k.name == n and k.flexible == f)
                  for n, f in (("a", False), ("", True)))  # fmt: skip
    odds = misfit_odds(0.001)
    assert after[unknown] / after[a] == pytest.approx(odds * before[unknown] / before[a])
    assert passes / after[a] == pytest.approx(odds * mimic / before[a])


def test_of_what_is_unexplained_a_part_is_a_cause_that_was_missed() -> None:
    tried = [_tried(0.0), _tried(900.0, "a"), _tried(897.0, "b"), _tried(2000.0, flexible=True)]
    kinds = families(tried, {"a": 1, "b": 1})
    chances, mimic = probabilities(kinds)
    told = undetected_share(kinds, chances)
    assert told.sum() + mimic == pytest.approx(1.0)
    by_name = {(k.name, k.flexible): c for k, c in zip(kinds, told, strict=True)}
    assert by_name["", True] == pytest.approx(1 - CALIBRATION.undetected_share)
    assert by_name["a", False] / by_name["b", False] == pytest.approx(np.exp(3.0))
    assert by_name["", False] == 0


def test_a_cause_that_a_remainder_does_not_rule_out_was_not_missed() -> None:
    kinds = families([_tried(9.0), _tried(30.0, "a"), _tried(31.0, flexible=True)], {"a": 1})
    chances, _ = probabilities(kinds)
    assert undetected_share(kinds, chances) is chances
