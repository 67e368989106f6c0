"""Probabilities of families."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from shm.gap.causes.probabilities import (
    CALIBRATION,
    NO_GAP,
    PAIR,
    SINGLE,
    UNKNOWN,
    ByLaws,
    ScoredHypothesis,
    allow_for_laws,
    families,
    log_prior,
    probabilities,
)
from shm.gap.causes.search import fit_alone
from shm.gap.hypotheses.contract import Fit, Hypothesis
from shm.gap.hypotheses.problem import GapProblem
from shm.models.effects import EFFECTS, Variant
from shm.simulate import PlantedEffect
from tests.gap import linear_toy as toy
from tests.helpers.gap_campaigns import HANGER, fit_of, problem_of, simulated
from tests.worlds.simulated.reality import Reality


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


WORN = PlantedEffect("section_loss", "everywhere", {"loss": 0.3, "x_m": 4.0, "extent_m": 2.0})
LAWS = [("section_loss", True), ("section_loss", False), ("point_mass", True)]


@cache
def _by_laws(effect: str, own_laws: bool) -> tuple[ByLaws, Fit, GapProblem]:
    """Fit `effect` to a worn hanger."""
    tests = simulated(WORN, seed=3, mass_share=0.02, reality=Reality(own_laws=own_laws))
    problem, rng = problem_of(tests), np.random.default_rng(1)
    variants = EFFECTS[effect].variants(HANGER, problem.design.survey)
    (variant,) = [each for each in variants if each.at == WORN.at]
    fit = fit_of(problem, Hypothesis(((effect, variant),)))
    return allow_for_laws(problem, fit_alone(problem, rng), fit, rng), fit, problem


def test_allow_for_laws_no_shift_no_gain() -> None:
    """Of an effect that does nothing all laws are one: their weights add to 1."""
    _, fit, problem = _by_laws("section_loss", False)
    found = allow_for_laws(problem, fit, fit, np.random.default_rng(1))
    assert (found.gain, found.mimic) == (pytest.approx(0.0, abs=1e-9), pytest.approx(0.0, abs=1e-9))


@pytest.mark.parametrize(("effect", "own_laws"), LAWS)
def test_laws_gain_at_least_log_exact(effect: str, own_laws: bool) -> None:
    """And the tension is as wide as by the exact one at least."""
    found, fit, problem = _by_laws(effect, own_laws)
    assert found.gain >= np.log(CALIBRATION.exact.known)
    assert found.mimic >= np.log(CALIBRATION.exact.unknown)
    after, before = (problem.tension_n(fit.hypothesis, d).std() for d in (found.draws, fit.draws))
    assert after > 0.85 * before


@pytest.mark.slow
def test_worn_without_edges_its_size_right() -> None:
    found, fit, problem = _by_laws("section_loss", True)
    loss = problem.coordinates(fit.hypothesis).effect_values(found.draws)[:, 0]
    assert abs(loss.mean() - WORN.values["loss"]) < 3 * loss.std()


def test_mimic_exceeds_gain_far_off() -> None:
    """What is exactly an effect hardly is something unknown that passes for it, and pays little."""
    exact, *_ = _by_laws("section_loss", False)
    wrong, *_ = _by_laws("point_mass", True)
    assert exact.gain < 1.0
    assert exact.mimic < exact.gain - 0.5
    assert wrong.mimic > wrong.gain + 0.5


def test_another_effect_not_excused() -> None:
    """A mass in place of the corrosion: what it does not do, no law of it does."""
    right, corrosion, _ = _by_laws("section_loss", True)
    wrong, mass, _ = _by_laws("point_mass", True)
    assert mass.log_evidence + wrong.gain < corrosion.log_evidence + right.gain - 10


@pytest.mark.slow
def test_a_law_off_from_mode_to_mode_forgiven() -> None:
    """Modes that the catalogue leaves alone move as much as the others, by a tenth of these."""
    _, fit, problem = _by_laws("section_loss", False)
    rng = np.random.default_rng(1)
    baseline, count = fit_alone(problem, rng), problem.design.frequencies
    typical = np.sqrt(np.mean((fit.predicted - baseline.predicted)[:count] ** 2))
    away = problem.observations.value.copy()
    away[:count] += 0.2 * typical * rng.standard_normal(count)
    observations = replace(problem.observations, value=away)
    moved = GapProblem(problem.model, problem.tests, observations, problem.described)
    assert allow_for_laws(moved, baseline, fit, rng).gain > 50


def test_draws_by_all_laws_are_on_both_sides_of_mid_length() -> None:
    """Frequencies alone do not tell a place from its mirror image, whatever the law."""
    mass = PlantedEffect("point_mass", "everywhere", {"mass_kg": 12.0, "x_m": 4.0})
    problem = problem_of(simulated(mass, seed=3, shape_sd=float("nan")))
    rng = np.random.default_rng(1)
    fit = fit_of(problem, Hypothesis((("point_mass", Variant()),)))
    assert len(fit.peaks) > 1
    found = allow_for_laws(problem, fit_alone(problem, rng), fit, rng)
    off = found.draws[(found.draws != fit.draws).any(axis=1)]
    place_m = problem.coordinates(fit.hypothesis).effect_values(off)[:, 1]
    assert 0.3 < np.mean(place_m < HANGER.length_m / 2) < 0.7
