"""What the search tries, of a small catalogue and real fits."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from shm.errors import UsageError
from shm.gap.contract import GapOptions, Hypothesis
from shm.gap.probabilities import ScoredHypothesis
from shm.gap.search import ALONE, DROWNED, Search, fit_alone, hypotheses, invisible
from shm.inference.posterior import laplace
from shm.models.effects import EFFECTS, Variant
from shm.values import ENOUGH_EFFECTIVE
from tests.helpers.effects import all_but
from tests.helpers.gap_campaigns import campaign as own_campaign
from tests.helpers.gap_campaigns import problem_of, simulated

CATALOGUE = ("effective_length", "bending_stiffness", "point_mass")
CLAMP, STIFFER = ("point_mass", Variant()), ("bending_stiffness", Variant())
MASS = Hypothesis((CLAMP,))
PAIR = Hypothesis((CLAMP, STIFFER))


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


@pytest.mark.parametrize("baseline", ["beam1", "beam3"])
def test_hypotheses_are_the_catalogue_but_what_is_hidden(baseline: str) -> None:
    """What the baseline has itself, what the conditions cannot show and what is taken out."""
    problem = problem_of(simulated(shapes=False, modes=5), baseline)
    hidden, out = invisible(problem), ("point_mass", "timebase")
    own = ("rotational_end_flexibility", "shear_and_rotary_inertia", "sag")
    if baseline == "beam3":
        assert all("beam3" in hidden[name] for name in own)
    assert {"temperature_tension", "geometric_hardening", "sensor_misalignment"} <= set(hidden)
    found = hypotheses(problem, out)
    assert {each.name for each in found} == set(EFFECTS) - set(hidden) - set(out)
    assert all(len(h.effects) == 1 and not h.flexible for h in found)
    with pytest.raises(UsageError, match="moonlight"):
        hypotheses(problem, ("moonlight",))


def test_search_drowned_is_invisible() -> None:
    problem = problem_of(simulated(shapes=False, modes=2, frequency_sd=0.03))
    search = Search(problem, GapOptions(without=all_but("point_mass")), np.random.default_rng(1))
    assert dict(search.invisible)["point_mass"] == DROWNED
    assert search.variants == {}


def test_search_planted_pair_leads() -> None:
    found = scored(searched(12.0, 3.1, 0.3)[0])
    plain = [each for each in found.values() if not each.hypothesis.flexible]
    best = max(plain, key=lambda each: each.log_evidence)
    assert set(best.hypothesis.effects) == set(PAIR.effects)


def test_scored_laws_of_fitted_effects() -> None:
    """An error of the law that is allowed for and not needed costs a little."""
    search, _ = searched(12.0, 3.1)
    for h, each in scored(search).items():
        has_laws = bool(h.effects) and not h.flexible and each.fit is not None
        assert (each.draws is not None) is has_laws
        if has_laws:
            assert each.fit is not None
            assert abs(each.log_evidence - each.fit.log_evidence) < 1


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


def test_fit_alone_unknown_errors() -> None:
    fit = fit_alone(problem_of(own_campaign(given_sd=False)), np.random.default_rng(1))
    assert 0.5e-4 < fit.model_error < 1e-3
