"""What the search tries, of a small catalogue and real fits."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from shm.errors import UsageError
from shm.gap import search as searching
from shm.gap.contract import GapOptions, Hypothesis
from shm.gap.probabilities import ScoredHypothesis
from shm.gap.problem import GapProblem
from shm.gap.search import ALONE, Search, fit_alone, hypotheses, invisible
from shm.inference.posterior import laplace
from shm.models.effects import EFFECTS, Variant
from shm.simulate import HangerState
from shm.values import ENOUGH_EFFECTIVE
from tests.helpers.effects import all_but
from tests.helpers.gap_campaigns import HANGER, problem_of
from tests.helpers.gap_campaigns import campaign as own_campaign
from tests.worlds.simulated.campaign import CampaignPlan, campaign

CATALOGUE = ("effective_length", "bending_stiffness", "point_mass")
CLAMP, STIFFER = ("point_mass", Variant()), ("bending_stiffness", Variant())
MASS = Hypothesis((CLAMP,))
PAIR = Hypothesis((CLAMP, STIFFER))
SIMULATED = set(EFFECTS) - {"load_scale"}  # no simulated campaign reads a tension
LONE = CampaignPlan(temperatures_c=(10.0,), amplitudes=(1.0,), shapes=False, mass_share=0.0)


@cache
def searched(*values: float) -> tuple[Search, tuple[tuple[str, float], ...]]:
    """Search for a clamp, and for a second effect where it has a value, and what was reported."""
    planted = (CLAMP, STIFFER) if len(values) > 2 else (CLAMP,) if values else ()
    problem = problem_of(own_campaign(planted, values, tests=1, modes=5))
    told: list[tuple[str, float]] = []
    search = Search(
        problem,
        GapOptions(without=all_but(*CATALOGUE), draws=50),
        np.random.default_rng(1),
        lambda label, done: told.append((label, done)),
    )
    search.run()
    return search, tuple(told)


def scored(search: Search) -> dict[Hypothesis, ScoredHypothesis]:
    tried = search.scored()
    assert len({each.hypothesis for each in tried}) == len(tried)
    return {each.hypothesis: each for each in tried}


def _problem(baseline: str = "beam1", plan: CampaignPlan | None = None) -> GapProblem:
    rng = np.random.default_rng(1)
    tests = campaign(HANGER, HangerState(711e3), (), plan or CampaignPlan(), rng)
    return problem_of(tests, baseline)


def test_hypotheses_whole_catalogue() -> None:
    found = hypotheses(_problem())
    bar = _problem().has_itself
    assert {each.name for each in found} == SIMULATED - set(bar)
    assert all(len(h.effects) == 1 and not h.flexible for h in found)


def test_hypotheses_effects_taken_out() -> None:
    names = {each.name for each in hypotheses(_problem(), ("point_mass", "timebase"))}
    assert not names & {"point_mass", "timebase"}
    with pytest.raises(UsageError, match="moonlight"):
        hypotheses(_problem(), ("moonlight",))


def test_invisible_what_the_baseline_has() -> None:
    problem = _problem("beam3")
    hidden = invisible(problem)
    for name in ("rotational_end_flexibility", "shear_and_rotary_inertia", "sag"):
        assert "beam3" in hidden[name]
        assert name not in {each.name for each in hypotheses(problem)}


def test_invisible_conditions_not_varied() -> None:
    problem = _problem(plan=LONE)
    hidden = invisible(problem)
    assert {"temperature_tension", "geometric_hardening", "sensor_misalignment"} <= set(hidden)
    assert not set(hidden) & {each.name for each in hypotheses(problem)}


def test_search_drowned_is_invisible() -> None:
    plan = replace(LONE, modes=2, frequency_sd=0.03)
    problem = _problem(plan=plan)
    options = GapOptions(without=all_but("point_mass"))
    search = Search(problem, options, np.random.default_rng(1))
    assert dict(search.invisible)["point_mass"] == searching.DROWNED
    assert search.variants == {}


def test_search_every_effect_and_place_scored() -> None:
    search, _ = searched(12.0, 3.1)
    found = scored(search)
    survey = search.problem.design.survey
    singles = {
        Hypothesis(((name, variant),))
        for name in CATALOGUE
        for variant in EFFECTS[name].variants(HANGER, survey)
    }
    assert {ALONE} | {each for each in singles if each in search.scans} <= set(found)
    assert found[ALONE].fit is search.baseline
    assert search.variants["point_mass"] == 1


def test_search_sound_tries_no_pairs() -> None:
    search, _ = searched()
    found = scored(search)
    assert not [h for h in found if len(h.effects) > 1]
    assert max(found.values(), key=lambda each: each.log_evidence).hypothesis == ALONE


def test_search_planted_pair_leads() -> None:
    found = scored(searched(12.0, 3.1, 0.3)[0])
    plain = [each for each in found.values() if not each.hypothesis.flexible]
    best = max(plain, key=lambda each: each.log_evidence)
    assert set(best.hypothesis.effects) == set(PAIR.effects)


def test_search_something_unknown_beside_leaders() -> None:
    found = scored(searched(12.0, 3.1)[0])
    flexible = [h for h in found if h.flexible]
    assert {replace(ALONE, flexible=True), replace(MASS, flexible=True)} <= set(flexible)
    assert all(found[h].fit is not None for h in flexible)


def test_scored_laws_of_fitted_effects() -> None:
    """An error of the law that is allowed for and not needed costs a little."""
    search, _ = searched(12.0, 3.1)
    for h, each in scored(search).items():
        has_laws = bool(h.effects) and not h.flexible and each.fit is not None
        assert (each.draws is not None) is has_laws
        if has_laws:
            assert each.fit is not None
            assert abs(each.log_evidence - each.fit.log_evidence) < 1


def test_sample_probable_enough_draws() -> None:
    search, _ = searched(12.0, 3.1)
    search.sample_probable(lambda: {MASS: 0.9})
    assert search.fits[MASS].method == "sampled"
    assert search.fits[MASS].effective == 50  # of 50 draws


def test_progress_never_goes_back() -> None:
    labels, done = zip(*searched(12.0, 3.1)[1], strict=True)
    assert list(done) == sorted(done)
    assert {"baseline", "single effects", "pairs", "something unknown"} <= set(labels)


def test_fit_alone_springs_any_seed() -> None:
    """One test of two planes, ends on springs: evidence and tension do not depend on the seed."""
    tests = own_campaign(tests=1, modes=5)
    problems = [problem_of(tests, "beam2") for _ in range(4)]
    found = [fit_alone(p, np.random.default_rng(seed)) for seed, p in enumerate(problems, 1)]
    assert all(each.effective >= ENOUGH_EFFECTIVE for each in found)
    assert found[0].log_evidence == pytest.approx(found[1].log_evidence, abs=0.8)
    problem = problem_of(own_campaign(tests=1, modes=5), "beam2")
    tension = [problem.tension_n(ALONE, each.draws) for each in found]
    half = np.ptp(np.quantile(tension[0], [0.05, 0.95])) / 2
    assert np.mean(tension[0]) == pytest.approx(np.mean(tension[1]), abs=0.3 * half)


def test_fit_alone_far_off_priors() -> None:
    """A bar that must be 8 standard deviations off is climbed to all the same."""
    found = searched(12.0, 3.1, 0.3)[0].baseline
    assert laplace(found.peaks) == pytest.approx(found.log_evidence, abs=1.0)


def test_fit_alone_part_predicts_the_rest() -> None:
    """Held-out orders are met by the fit of the others."""
    problem = problem_of(own_campaign(tests=3))
    kept = problem.design.frequency_order != 4
    fit = fit_alone(problem.part(kept), np.random.default_rng(1))
    out = np.flatnonzero(~kept)
    miss = problem.value[out] - problem.predict(ALONE, fit.draws)[:, out]
    assert np.abs(miss.mean(axis=0)).max() < 2e-3


def test_fit_alone_unknown_errors() -> None:
    fit = fit_alone(problem_of(own_campaign(given_sd=False)), np.random.default_rng(1))
    assert 0.5e-4 < fit.model_error < 1e-3
