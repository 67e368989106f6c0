"""What the search tries, of a small catalogue and real fits."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from shm.errors import UsageError
from shm.gap.causes.probabilities import ScoredHypothesis
from shm.gap.causes.scan import VISIBLE, Scan, scan, scan_pair
from shm.gap.causes.search import ALONE, DROWNED, Search, fit_alone, hypotheses, invisible
from shm.gap.hypotheses.contract import GapOptions, Hypothesis
from shm.inference.sampler.linear import Linear
from shm.models.effects import EFFECTS, Variant
from shm.values import ENOUGH_EFFECTIVE
from tests.helpers.effects import all_but
from tests.helpers.gap_campaigns import campaign, fit_of, problem_of, scan_of, simulated

CATALOGUE = ("effective_length", "bending_stiffness", "point_mass")
CLAMP, STIFFER = ("point_mass", Variant()), ("bending_stiffness", Variant())
MASS = Hypothesis((CLAMP,))
PAIR = Hypothesis((CLAMP, STIFFER))


@cache
def searched(*values: float) -> tuple[Search, tuple[tuple[str, float], ...]]:
    """Search for a clamp, and for a second effect where it has a value, and what was reported."""
    planted = (CLAMP, STIFFER) if len(values) > 2 else (CLAMP,) if values else ()
    problem = problem_of(campaign(planted, values, tests=1, modes=5))
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


def test_progress_never_goes_back() -> None:
    labels, done = zip(*searched(12.0, 3.1)[1], strict=True)
    assert list(done) == sorted(done)
    assert {"baseline", "single effects", "pairs", "something unknown"} <= set(labels)


def test_fit_alone_springs_any_seed() -> None:
    """One test of two planes, ends on springs: evidence and tension do not depend on the seed."""
    problem = problem_of(campaign(tests=1, modes=5), "beam2")
    found = [fit_alone(problem, np.random.default_rng(seed)) for seed in (1, 2, 3, 4)]
    assert all(each.effective >= ENOUGH_EFFECTIVE for each in found)
    assert found[0].log_evidence == pytest.approx(found[1].log_evidence, abs=0.8)
    tension = [problem.tension_n(ALONE, each.draws) for each in found]
    half = np.ptp(np.quantile(tension[0], [0.05, 0.95])) / 2
    assert np.mean(tension[0]) == pytest.approx(np.mean(tension[1]), abs=0.3 * half)


def test_fit_alone_unknown_errors() -> None:
    fit = fit_alone(problem_of(campaign(given_sd=False)), np.random.default_rng(1))
    assert 0.5e-4 < fit.model_error < 1e-3


STIFFENED = Hypothesis((("bending_stiffness", Variant()),))
HEAVIER = Hypothesis((("distributed_mass", Variant()),))
CLAMPED = Hypothesis((("point_mass", Variant()),))


@pytest.mark.parametrize(
    ("least", "growth", "smallest"),
    [
        (0.05, 1000.0, np.log(VISIBLE / 0.05) / np.log(1000)),
        (0.1, 1.0, 1.0),
        (9.0, 1.0, 0.0),
    ],
)
def test_smallest_by_what_is_visible(least: float, growth: float, smallest: float) -> None:
    """What grows a thousandfold over the prior is seen from the size where it is VISIBLE on."""
    magnitude = np.random.default_rng(1).permutation(np.linspace(0, 1, 801))
    visible, none = least * growth**magnitude, np.zeros((801, 1))
    made = Scan(STIFFENED, none, none, magnitude, visible, np.zeros(801), none)
    assert made.smallest == pytest.approx(smallest, abs=1e-3)
    assert made.seen.any()


@pytest.mark.parametrize(
    ("hypothesis", "values"), [(HEAVIER, [0.06]), (STIFFENED, [0.1]), (CLAMPED, [5.0, 3.1])]
)
def test_scan_evidence_near_fit(hypothesis: Hypothesis, values: list[float]) -> None:
    problem = problem_of(campaign(hypothesis.effects, values))
    before, found = fit_alone(problem, np.random.default_rng(1)), scan_of(problem, hypothesis)
    fit = fit_of(problem, hypothesis)
    gained = fit.log_evidence - before.log_evidence
    assert found.log_evidence - before.log_evidence == pytest.approx(gained, abs=3 + 0.5 * gained)
    starts = found.starts(problem, before)
    assert starts.shape[1] == len(fit.z)
    own = slice(len(before.z), None)
    assert np.abs(starts[:, own] - fit.z[own]).max(axis=1).min() < 1.0
    if hypothesis == CLAMPED:  # the best place is started from as seen from the other end, too
        assert starts[-1, -1] == pytest.approx(-starts[0, -1])


def test_scan_beside_adds_shifts() -> None:
    pair = Hypothesis((*CLAMPED.effects, *STIFFENED.effects))
    problem = problem_of(campaign(pair.effects, [12.0, 3.1, 0.2]))
    before = fit_alone(problem, np.random.default_rng(1))
    likelihood = problem.likelihood(Hypothesis())
    alone = scan(problem, before, Linear(likelihood, before.slopes), STIFFENED)
    leader = fit_of(problem, CLAMPED)
    found = scan_pair(problem, leader, Linear(likelihood, leader.slopes), alone)
    assert found.hypothesis == pair
    np.testing.assert_array_equal(found.shift, alone.shift)
    assert found.log_evidence > leader.log_evidence + 3
    assert found.effect[found.log.argmax(), 0] == pytest.approx(0.2, abs=0.1)
