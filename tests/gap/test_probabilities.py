"""Probabilities of families."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shm.gap.contract import Hypothesis
from shm.gap.probabilities import (
    CALIBRATION,
    NO_GAP,
    PAIR,
    SINGLE,
    UNKNOWN,
    ScoredHypothesis,
    families,
    log_prior,
    probabilities,
)
from shm.models.effects import Variant
from tests.gap import linear_toy as toy


def _tried(
    log_evidence: float, *names: str, at: str = "everywhere", flexible: bool = False
) -> ScoredHypothesis:
    effects = tuple((name, Variant(at)) for name in names)
    return ScoredHypothesis(Hypothesis(effects, flexible), log_evidence, 0.0)


def test_families_prior_any_variants() -> None:
    once = [_tried(0.0), _tried(2.0, "a"), _tried(2.0, "b")]
    often = [_tried(0.0), _tried(2.0, "a"), *(_tried(2.0, "b", at=f"{k}") for k in range(9))]
    few, _ = probabilities(families(once, {"a": 1, "b": 1}))
    many, _ = probabilities(families(often, {"a": 1, "b": 9}))
    assert sorted(many) == pytest.approx(sorted(few))


def test_families_over_variants() -> None:
    """An untried variant is impossible; the best stands for its family."""
    (family,) = families([_tried(2.0, "a")], {"a": 2})
    assert family.log_evidence == pytest.approx(2.0 - np.log(2), abs=1e-3)
    tried = [_tried(1.0, "a", at="deck end"), _tried(4.0, "a", at="arch end")]
    assert families(tried, {"a": 2})[0].best.hypothesis.at == "arch end"


def test_probabilities_no_evidence_priors() -> None:
    kinds = families([_tried(0.0), _tried(0.0, "a"), _tried(0.0, "b")], {"a": 1, "b": 1})
    chances = dict(zip([each.name for each in kinds], probabilities(kinds)[0], strict=True))
    assert chances[""] / chances["a"] == pytest.approx(NO_GAP / (SINGLE / 2))


def test_probabilities_mimic_share() -> None:
    tried = [_tried(0.0), _tried(30.0, "a"), _tried(0.0, "b"), _tried(0.0, flexible=True)]
    chances, mimic = probabilities(families(tried, {"a": 1, "b": 1}))
    assert chances.sum() + mimic == pytest.approx(1.0)
    assert mimic / chances[0] == pytest.approx(CALIBRATION.mimics_one * UNKNOWN / SINGLE, rel=1e-6)


def test_probabilities_mimic_by_law_error() -> None:
    off = [_tried(0.0), replace(_tried(30.0, "a"), log_mimic=32.0)]
    near = [_tried(0.0), replace(_tried(30.0, "a"), log_mimic=29.0)]
    (_, far_off), (_, hardly_off) = (probabilities(families(t, {"a": 1})) for t in (off, near))
    assert far_off > 5 * hardly_off


def test_log_prior_unknown_beside_rarest() -> None:
    variants = {"a": 1, "b": 1}
    priors = [
        log_prior(_tried(0.0, *names, flexible=flexible).hypothesis, variants)
        for names, flexible in (((), True), (("a",), False), (("a", "b"), False), (("a",), True))
    ]
    assert priors[3] < min(priors[:3])
    pair = _tried(0.0, "a", "b", flexible=True).hypothesis
    assert log_prior(pair, variants) - priors[2] == pytest.approx(priors[3] - priors[1])


def test_fitted_unlikely_bar_fits_worse() -> None:
    own = toy.fit(np.zeros(toy.design().size), toy.tension())
    unlikely = replace(own, z=np.array([4.0]))
    assert ScoredHypothesis.fitted(unlikely, 1).log_fit == pytest.approx(
        ScoredHypothesis.fitted(own, 1).log_fit - 8.0
    )
    assert ScoredHypothesis.fitted(unlikely, 0).log_fit == pytest.approx(own.log_fit)


def test_probabilities_unknown_resembles_nothing() -> None:
    """Of something unknown that is fitted as such a part is left that resembles no effect."""
    tried = [_tried(0.0), _tried(-50.0, "a"), _tried(0.0, flexible=True)]
    kinds = families(tried, {"a": 1})
    chances = dict(zip([(k.name, k.flexible) for k in kinds], probabilities(kinds)[0], strict=True))
    rest = 1 - CALIBRATION.mimics_one - CALIBRATION.mimics_two
    assert chances["", True] / chances["", False] == pytest.approx(rest * UNKNOWN / NO_GAP)


def test_log_prior_pairs_share_theirs() -> None:
    variants = {"a": 2, "b": 3, "c": 1}
    pair = _tried(0.0, "a", "b").hypothesis
    assert log_prior(pair, variants) == pytest.approx(np.log(PAIR / 3 / 6))
