"""What the search tries at each of its steps, of a small catalogue and real fits."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest
from scipy.special import logsumexp

from shm.gap import search as searching
from shm.gap.contract import GapOptions, Hypothesis
from shm.gap.model_probabilities import ScoredHypothesis, log_prior
from shm.gap.search import Search
from shm.inference.options import silent
from shm.models.effects import EFFECTS, Variant
from tests.helpers.gap_campaigns import campaign, problem_of

CATALOGUE = ("effective_length", "bending_stiffness", "point_mass")
CLAMP, STIFFER = ("point_mass", Variant()), ("bending_stiffness", Variant())
MASS = Hypothesis((CLAMP,))
NOTHING = Hypothesis()
Step = Callable[[Search, list[ScoredHypothesis]], list[ScoredHypothesis]]
STEPS: dict[str, Step] = {
    "unknown": Search.with_unknown,
    "pairs": Search.with_pairs,
    "other pairs": Search.with_other_pairs,
    "every effect": Search.with_every_effect,
    "many pairs": Search.with_many_pairs,
    "sampled": Search.with_sampled,
    "laws": Search.with_laws,
}


def begun(  # type: ignore[no-untyped-def]
    effects=(CLAMP,), values=(12.0, 3.1), progress=silent, catalogue=CATALOGUE
) -> Search:
    problem = problem_of(campaign(effects, values, tests=1, modes=5))
    without = tuple(name for name in EFFECTS if name not in catalogue)
    options = GapOptions(without=without, draws=50)
    return Search(problem, options, np.random.default_rng(1), progress)


@pytest.fixture(scope="module")
def told() -> list[tuple[str, float]]:
    return []


@pytest.fixture(scope="module")
def clamped(told: list[tuple[str, float]]) -> Search:
    return begun(progress=lambda label, done: told.append((label, done)))


@pytest.fixture(scope="module")
def steps(clamped: Search) -> dict[str, list[ScoredHypothesis]]:
    """What was tried after each step, of a bar with a clamp."""
    found = {"singles": clamped.singles()}
    tried = found["singles"]
    for name, step in STEPS.items():
        found[name] = tried = step(clamped, tried)
    return found


@pytest.fixture(scope="module")
def sound() -> tuple[Search, list[ScoredHypothesis]]:
    search = begun((), ())
    return search, search.singles()


def of(tried: Sequence[ScoredHypothesis]) -> dict[Hypothesis, ScoredHypothesis]:
    return {each.hypothesis: each for each in tried}


def parts(pair: Hypothesis) -> set[Hypothesis]:
    return {Hypothesis((effect,)) for effect in pair.effects}


def weight(search: Search, each: ScoredHypothesis) -> float:
    return each.log_evidence + log_prior(each.hypothesis, search.variants)


@pytest.mark.slow
def test_every_step_keeps_what_was_tried_and_tries_nothing_twice(
    steps: dict[str, list[ScoredHypothesis]],
) -> None:
    before: set[tuple[frozenset[object], bool]] = set()
    for name, tried in steps.items():
        kinds = [(frozenset(e.hypothesis.effects), e.hypothesis.flexible) for e in tried]
        assert len(set(kinds)) == len(kinds), name
        assert before <= set(kinds), name
        before = set(kinds)


def test_singles_are_no_gap_and_every_effect_at_every_place(
    clamped: Search, steps: dict[str, list[ScoredHypothesis]]
) -> None:
    tried = steps["singles"]
    assert tried[0].hypothesis == NOTHING
    assert tried[0].fit is clamped.baseline
    places = clamped.problem.observations.design.survey
    expected = {
        Hypothesis(((name, variant),))
        for name in CATALOGUE
        for variant in EFFECTS[name].variants(clamped.problem.hanger, places)
    }
    assert set(of(tried)) == {NOTHING} | expected
    assert clamped.variants == {"effective_length": 3, "bending_stiffness": 1, "point_mass": 1}


def test_what_stands_a_chance_is_fitted_and_the_rest_screened(
    clamped: Search, steps: dict[str, list[ScoredHypothesis]]
) -> None:
    """A planted clamp explains 14 more than anything else that acts alone."""
    tried = of(steps["singles"])
    assert tried[MASS].method == "normal"
    others = [each for h, each in tried.items() if h not in (MASS, NOTHING)]
    assert {each.method for each in others} == {"screened"}
    assert tried[MASS].log_evidence > clamped.baseline.log_evidence + 5
    assert all(each.log_evidence < tried[MASS].log_evidence - 5 for each in others)


def test_of_a_sound_bar_nothing_leads_and_no_pair_is_called_for(
    sound: tuple[Search, list[ScoredHypothesis]],
) -> None:
    search, tried = sound
    assert len([each for each in tried if each.fit is not None]) > 2
    assert not search.calls_for_pairs(tried)


def test_a_second_effect_is_called_for_where_a_first_one_is_supported(
    clamped: Search, steps: dict[str, list[ScoredHypothesis]]
) -> None:
    tried = steps["singles"]
    assert clamped.calls_for_pairs(tried)
    mass = of(tried)[MASS]
    assert mass.fit is not None
    level = clamped.baseline.log_evidence + searching.SUPPORTED
    for log_evidence, called in ((level + 0.01, True), (level - 0.01, False)):
        fit = replace(mass.fit, log_evidence=log_evidence)
        one = [tried[0], replace(mass, fit=fit)]
        assert clamped.calls_for_pairs(one) is called


def test_something_unknown_is_added_to_no_gap_and_to_fitted_leaders_alone(
    steps: dict[str, list[ScoredHypothesis]],
) -> None:
    added = [each.hypothesis for each in steps["unknown"] if each.hypothesis.flexible]
    assert added == [replace(NOTHING, flexible=True), replace(MASS, flexible=True)]
    assert all(each.fit is not None for each in steps["unknown"] if each.hypothesis.flexible)


def test_pairs_are_of_a_leader_with_each_other_effect_and_fitted(
    steps: dict[str, list[ScoredHypothesis]],
) -> None:
    known, after = of(steps["unknown"]), of(steps["pairs"])
    pairs = [each for h, each in after.items() if h not in known and not h.flexible]
    assert {frozenset(each.hypothesis.effects) for each in pairs} == {
        frozenset((CLAMP, *single.effects))
        for single in known
        if len(single.effects) == 1 and single != MASS and not single.flexible
    }
    assert all(each.fit is not None for each in pairs)
    best = max(pairs, key=lambda each: each.log_evidence).hypothesis
    assert [h for h in after if h not in known and h.flexible] == [replace(best, flexible=True)]


def test_in_the_end_every_single_effect_has_a_fit_no_worse_than_its_scan(
    clamped: Search, steps: dict[str, list[ScoredHypothesis]]
) -> None:
    scanned, fits = of(steps["other pairs"]), of(steps["every effect"])
    assert all(each.fit is not None for each in fits.values())
    given_up = [h for h, each in scanned.items() if each.fit is None]
    assert len(given_up) == 4
    for each in given_up:
        assert fits[each].log_evidence == pytest.approx(scanned[each].log_evidence, abs=1.5)


def test_pairs_of_all_kinds_are_tried_once_and_few_of_each(
    clamped: Search, steps: dict[str, list[ScoredHypothesis]]
) -> None:
    known = of(steps["every effect"])
    added = [e.hypothesis for e in steps["many pairs"] if e.hypothesis not in known]
    plain = [pair for pair in added if not pair.flexible]
    assert plain
    assert all(MASS not in parts(pair) for pair in plain)  # those are tried already
    assert {frozenset(pair.names) for pair in plain} == {
        frozenset(("effective_length", "bending_stiffness"))
    }


def test_two_planted_effects_are_found_as_a_pair_that_no_leader_held() -> None:
    search = begun((CLAMP, STIFFER), [12.0, 3.1, 0.3])
    tried = search.singles()
    tried = search.with_pairs(tried)
    lone = [e for e in tried if len(e.hypothesis.effects) < 2 or STIFFER in e.hypothesis.effects]
    best = max(lone, key=lambda each: weight(search, each)).hypothesis
    assert set(best.effects) == {CLAMP, STIFFER}
    without = [e for e in tried if len(e.hypothesis.effects) < 2]
    pair = Hypothesis((CLAMP, ("effective_length", search.hypotheses[0].effects[0][1])))
    begun_elsewhere = search._with_pairs_of(search._parts(pair, without), without)
    found = search.with_other_pairs(begun_elsewhere)
    top = max(found, key=lambda each: weight(search, each)).hypothesis
    assert set(top.effects) == {CLAMP, STIFFER}


def test_a_fit_of_a_pair_is_no_worse_than_where_its_effects_lie_alone(
    clamped: Search, steps: dict[str, list[ScoredHypothesis]]
) -> None:
    tried = of(steps["every effect"])
    for pair in (h for h in tried if len(h.effects) == 2 and not h.flexible):
        fits = {h: tried[h].fit for h in parts(pair)}
        joined = clamped._joined(pair, fits)  # type: ignore[arg-type]
        coordinates = clamped.problem.coordinates(pair)
        common, d = len(clamped.baseline.z), coordinates.dimension
        assert [each.shape for each in joined] == [(d,), (d,)]
        effects = np.concatenate([fits[Hypothesis((e,))].z[common:] for e in pair.effects])  # type: ignore[union-attr]
        for each, effect in zip(joined, pair.effects, strict=True):
            np.testing.assert_array_equal(each[common:], effects)
            np.testing.assert_array_equal(each[:common], fits[Hypothesis((effect,))].z[:common])  # type: ignore[union-attr]
        known = dict(list(fits.items())[:1])
        assert clamped._joined(pair, known) == []  # type: ignore[arg-type]


def test_the_likeliest_are_sampled_and_the_others_stay(
    clamped: Search, steps: dict[str, list[ScoredHypothesis]]
) -> None:
    before, after = of(steps["many pairs"]), of(steps["sampled"])
    first = max(weight(clamped, each) for h, each in before.items() if not h.flexible)
    near = {
        h
        for h, each in before.items()
        if not h.flexible and weight(clamped, each) > first - searching.SAMPLED_WITHIN
    }
    assert MASS in near
    assert {h for h, each in after.items() if each.method == "sampled"} == near
    assert all(after[h] is each for h, each in before.items() if h not in near)
    again = of(clamped.with_sampled(steps["many pairs"]))
    assert all(again[h].fit is after[h].fit for h in near)  # nothing is sampled twice


def test_no_more_than_five_are_sampled_the_likeliest_first(
    monkeypatch: pytest.MonkeyPatch, clamped: Search, steps: dict[str, list[ScoredHypothesis]]
) -> None:
    sampled: list[Hypothesis] = []

    def note(problem, fit, rng, draws, thorough):  # type: ignore[no-untyped-def]
        sampled.append(fit.hypothesis)
        assert thorough
        return fit

    monkeypatch.setattr(searching, "sampled", note)
    monkeypatch.setattr(clamped, "_samples", {})
    alike = [
        replace(each, log_evidence=-log_prior(each.hypothesis, clamped.variants) - 0.1 * number)
        for number, each in enumerate(steps["every effect"])
        if not each.hypothesis.flexible
    ]
    assert len(alike) > searching.MOST_SAMPLED
    clamped.with_sampled(alike[::-1])
    assert set(sampled) == {each.hypothesis for each in alike[: searching.MOST_SAMPLED]}


def test_laws_are_allowed_for_where_an_effect_was_fitted(
    steps: dict[str, list[ScoredHypothesis]],
) -> None:
    before, after = of(steps["sampled"]), of(steps["laws"])
    for h, each in after.items():
        has_laws = bool(h.effects) and not h.flexible
        assert (each.log_mimic is not None) is has_laws
        assert (each.draws is not None) is has_laws
        if not has_laws:
            assert each is before[h]
        else:  # an error of the law that is allowed for and not needed costs a little
            assert abs(each.log_evidence - before[h].log_evidence) < 1


@pytest.mark.slow
def test_what_lies_hopelessly_far_behind_keeps_the_letter_of_its_law(
    monkeypatch: pytest.MonkeyPatch, clamped: Search, steps: dict[str, list[ScoredHypothesis]]
) -> None:
    tried = steps["every effect"]
    first = max(each.log_evidence for each in tried)
    gap = first - clamped.baseline.log_evidence
    far = min(tried, key=lambda each: each.log_evidence if each.hypothesis.effects else first)
    behind = first - far.log_evidence
    for within, share, looked_at in (
        (behind + 0.1, 0.0, True),
        (behind - 0.1, 0.0, False),
        (0.0, (behind + 0.1) / gap, True),
        (0.0, (behind - 0.1) / gap, False),
    ):
        monkeypatch.setattr(searching, "LAWS_WITHIN", within)
        monkeypatch.setattr(searching, "LAWS_WITHIN_SHARE", share)
        found = of(clamped.with_laws(tried))[far.hypothesis]
        assert (found.log_mimic is not None) is looked_at


def test_the_mean_over_laws_gives_half_to_an_effects_own(
    monkeypatch: pytest.MonkeyPatch, clamped: Search, steps: dict[str, list[ScoredHypothesis]]
) -> None:
    """p = 1/2 p(own) e^gain + 1/2n sum of p(other) e^gain, and the same of what passes for it."""
    tried = of(steps["every effect"])[MASS]
    assert tried.fit is not None
    own = tried.fit
    others = [replace(own, log_evidence=own.log_evidence + more) for more in (1.0, -2.0)]
    gains = {id(own): (0.3, 0.1), id(others[0]): (-0.4, 0.2), id(others[1]): (0.5, -0.6)}

    class Found:
        def __init__(self, fit):  # type: ignore[no-untyped-def]
            self.fit, self.draws = fit, fit.draws
            self.gain, self.mimic = gains[id(fit)]

    monkeypatch.setattr(searching, "by_its_laws", lambda p, b, fit, rng: Found(fit))
    monkeypatch.setattr(clamped, "_by_other_laws", lambda fit: others)
    found = clamped._by_its_laws(tried, anew=True)
    base = np.array([0, 1.0, -2.0]) + own.log_evidence + np.log([0.5, 0.25, 0.25])
    assert found.log_evidence == pytest.approx(logsumexp(base + np.array([0.3, -0.4, 0.5])))
    assert found.log_mimic == pytest.approx(logsumexp(base + np.array([0.1, 0.2, -0.6])))
    assert found.fit is own  # the likeliest of the three
    alone = clamped._by_its_laws(tried, anew=False)
    assert alone.log_evidence == pytest.approx(own.log_evidence + 0.3)


def test_progress_never_goes_back_and_names_what_is_done(
    steps: dict[str, list[ScoredHypothesis]], told: list[tuple[str, float]]
) -> None:
    assert steps
    labels, done = zip(*told, strict=True)
    assert list(done) == sorted(done)
    assert done[0] == 0
    assert done[-1] <= 1
    assert [label for label in labels if label.startswith("screening")]
    for words in ("baseline", "fitting point_mass", "something unknown", "sampling point_mass"):
        assert words in labels
    assert "other laws of point_mass" in labels


def test_every_effect_that_was_not_tried_is_said_to_be_invisible_with_the_reason() -> None:
    search = begun(catalogue=(*CATALOGUE, "temperature_tension"))
    search.singles()
    told = dict(search.invisible)
    assert set(told).isdisjoint(search.variants)
    assert "two known temperatures" in told["temperature_tension"]
    assert all(reason.endswith(".") and " " in reason for reason in told.values())
    assert searching.DROWNED not in told.values()
    search.scans.pop(MASS)
    assert dict(search.invisible) == told | {"point_mass": searching.DROWNED}
