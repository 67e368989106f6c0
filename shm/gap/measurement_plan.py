"""The next measurements one after the other: what each costs, and what it promises.

What every explanation foresees of all measurements that could be made is one normal distribution
of their data, given the old ones (`shm.gap.next_measurement`); so what a second measurement adds to
a first one is counted once. Something unknown foresees that what was left over comes again in every
test, or anew in each. Data drawn from each explanation by its probability tell how far, on average,
the true one would get ahead of all others together.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
import scipy

from shm.gap.attribution import WITHIN_REACH, Attribution, Explanation
from shm.gap.contract import Fit, Hypothesis
from shm.gap.experiment_design import Proposal, lift_off, proposals, together
from shm.gap.model_probabilities import log_prior
from shm.gap.next_measurement import NO_GAP, Errors, Foresight, Remainder, foreseen, new_sensors
from shm.gap.noise import (
    FREQUENCY_SIZES,
    LARGEST_FREQUENCY,
    LARGEST_SHAPE,
    alike_in_planes,
    same_mode,
    sizes_of,
    smooth_over_orders,
)
from shm.gap.problem import GapProblem
from shm.values import MEASUREMENT_HOURS, NAN, FloatArray, IntArray
from shm.values.diagnosis import joined, parted

UNKNOWN = "something unknown"
ENOUGH = 0.95
"""Of the true explanation: from there on nobody goes out for more."""
# Judgement: a fifth of a unit of log odds turns 0.5 into 0.55, and a list that a person reads.
_WORTH_IT, _MOST_STEPS = 0.2, 6
# Technical: a mean log odds to some 0.1; explanations and places of one that are still in the race.
_DRAWS, _CONTENDERS, _PLACES, _WAYS, _AS_LIKELY = 32, 8, 3, 12, 3.0


@dataclass(frozen=True)
class PlannedMeasurement:
    """One step of a plan, in `hours` of a crew.

    `promised_log_odds` is by how much the log odds of the true cause against all that lacks it are
    to rise, averaged over which it is; `log_odds` and `probability` are what it then has. Odds
    count up to a thousand to one.
    """

    what: str
    kind: str
    hours: float
    promised_log_odds: float
    log_odds: float
    probability: float


def planned(
    race: Race, hours: Mapping[str, float] = MEASUREMENT_HOURS, budget_hours: float = np.inf
) -> tuple[PlannedMeasurement, ...]:
    """The next measurements, that which promises most for its hours first, within a budget.

    `hours` are by kind. The plan ends where the true explanation is expected to have 0.95, or
    nothing promises a fifth of a unit of log odds more.
    """
    steps: list[PlannedMeasurement] = []
    chosen: list[int] = []
    log_odds, probability = race.expected(chosen)
    left = budget_hours
    while probability < ENOUGH and len(steps) < _MOST_STEPS:
        costs = {k: hours[each.kind] for k, each in enumerate(race.offered) if k not in chosen}
        tried = {k: race.expected([*chosen, k]) for k, cost in costs.items() if cost <= left}
        gains = {k: own - log_odds for k, (own, _) in tried.items() if own - log_odds >= _WORTH_IT}
        if not gains:
            break
        best = max(gains, key=lambda k: gains[k] / costs[k])
        log_odds, probability = tried[best]
        offered, left = race.offered[best], left - costs[best]
        chosen.append(best)
        steps.append(
            PlannedMeasurement(
                offered.what, offered.kind, costs[best], gains[best], log_odds, probability
            )
        )
    return tuple(steps)


def nothing_planned(race: Race, hours: Mapping[str, float], budget_hours: float) -> str:
    """Why a plan holds nothing, in words."""
    log_odds, probability = race.expected([])
    if probability >= ENOUGH:
        return (
            f"These data are enough: whichever explanation is true, it is expected to have "
            f"{probability:.2f} already. What `shm gap diagnose` lists to measure next tells it "
            "from others that are unlikely as it is."
        )
    gains = [race.expected([k])[0] - log_odds for k in range(len(race.offered))]
    able = [each for each, gain in zip(race.offered, gains, strict=True) if gain >= _WORTH_IT]
    if not able:
        return "No measurement promises to tell the explanations further apart."
    cheapest = min(able, key=lambda each: hours[each.kind])
    return (
        f"No measurement that promises to tell the explanations further apart fits into "
        f"{budget_hours:g} h. The cheapest, {cheapest.what}, takes {hours[cheapest.kind]:g} h."
    )


def chances(attribution: Attribution) -> dict[str, float]:
    """The probability of each explanation by the evidence, by its name.

    Without what is kept for causes off the catalogue that pass for one of it, which no measurement
    of a plan changes.
    """
    once = dict.fromkeys(attribution.search.variants, 1)
    weights = {NO_GAP: log_prior(Hypothesis(), once)}
    for each in attribution.explanations:
        weights[each.effect] = each.log_bayes_factor + log_prior(each.best.hypothesis, once)
    for name, fit in _remainders(attribution).items():
        ahead = fit.log_evidence - attribution.baseline.log_evidence
        weights[name] = ahead + log_prior(fit.hypothesis, once)
    total = scipy.special.logsumexp(list(weights.values()))
    return {name: float(np.exp(weight - total)) for name, weight in weights.items()}


def _remainders(attribution: Attribution) -> dict[str, Fit]:
    """The fits with a remainder by their names, which say what known cause comes with it."""
    fits = [each.fit for each in attribution.tried if each.fit and each.fit.hypothesis.flexible]
    fits.sort(key=lambda fit: fit.log_evidence)
    return {joined((*fit.hypothesis.names, UNKNOWN)): fit for fit in fits}


def log_odds_of(probability: FloatArray | float) -> FloatArray:
    """Log odds of probabilities, up to a thousand to one either way."""
    odds = scipy.special.logit(np.clip(probability, 0.0, 1.0))
    return np.asarray(np.clip(odds, -WITHIN_REACH, WITHIN_REACH))


@dataclass(frozen=True, eq=False)
class Contender:
    """An explanation with its probability: what it foresees, and how likely each way of it is."""

    name: str
    probability: float
    ways: tuple[tuple[float, Foresight], ...]


@dataclass(frozen=True, eq=False)
class Race:
    """What every contender foresees of the data (data,) of all measurements `offered`.

    `rows` are those of each; `draws` (ways, draws, data) are data by each way of each contender.
    """

    offered: tuple[Proposal, ...]
    rows: tuple[IntArray, ...]
    contenders: tuple[Contender, ...]
    draws: FloatArray

    @classmethod
    def of(cls, attribution: Attribution, rng: np.random.Generator) -> Race:
        problem = attribution.search.problem
        fits = _fits(attribution)
        offered = _offered(problem, [own[0][1] for _, _, own in fits if not _unknown(own)])
        design, rows = together([each.design for each in offered])
        rows = [
            np.append(own, design.size) if each.kind == "lift-off" else own
            for each, own in zip(offered, rows, strict=True)
        ]
        unstated = problem.hanger.assumptions.tension_reading_sd.value
        reading_sd = unstated if lift_off(problem.design, problem.hanger) else NAN
        errors = Errors.of(problem, fits[0][2][0][1])
        errors = replace(errors, sensors=problem.sensors_of(design))
        first: Foresight | None = None
        contenders = []
        for name, probability, own in fits:
            ways = []
            for weight, fit in own:
                flexible = fit.hypothesis.flexible
                for share, each in (
                    _unknown_ways(problem, fit, errors) if flexible else [(1.0, errors)]
                ):
                    seen = foreseen(problem, fit, design, each, reading_sd)
                    first = first or seen
                    ways.append((weight * share, seen.turned_to(first)))
            total = sum(weight for weight, _ in ways)
            contenders.append(
                Contender(name, probability, tuple((w / total, seen) for w, seen in ways))
            )
        draws = [
            seen.mean
            + rng.standard_normal((_DRAWS, len(seen.mean))) @ np.linalg.cholesky(seen.covariance).T
            for contender in contenders
            for _, seen in contender.ways
        ]
        return cls(offered, tuple(rows), tuple(contenders), np.array(draws))

    def expected(self, chosen: Sequence[int]) -> tuple[float, float]:
        """Mean log odds and probability of the true one after the `chosen` measurements."""
        prior = np.log([each.probability for each in self.contenders])
        logs = np.broadcast_to(prior[:, None, None], (len(prior), *self.draws.shape[:2]))
        if chosen:
            rows = np.concatenate([self.rows[k] for k in chosen])
            data = self.draws[:, :, rows]
            logs = logs + np.array([_log_density(each, rows, data) for each in self.contenders])
        after = np.exp(logs - scipy.special.logsumexp(logs, axis=0))
        truth = [k for k, each in enumerate(self.contenders) for _ in each.ways]
        weight = [each.probability * share for each in self.contenders for share, _ in each.ways]
        own = np.einsum("kj,jkn->kn", self._holds[truth], after)
        means = np.average(
            [log_odds_of(own).mean(axis=1), own.mean(axis=1)], axis=1, weights=weight
        )
        return float(means[0]), float(means[1])

    @property
    def _holds(self) -> FloatArray:
        """(contenders, contenders): 1 where the second names every cause of the first."""
        names = [each.name for each in self.contenders]
        return np.array([[float(holds(other, one)) for other in names] for one in names])


def holds(other: str, one: str) -> bool:
    """Whether the explanation `other` names every cause that `one` does."""
    if {one, other} & {NO_GAP, UNKNOWN}:
        return one == other
    return set(parted(one)) <= set(parted(other))


def _log_density(contender: Contender, rows: IntArray, data: FloatArray) -> FloatArray:
    """Log density (ways, draws) of data (ways, draws, rows), but for a constant."""
    found = []
    for share, seen in contender.ways:
        root = np.linalg.cholesky(seen.covariance[np.ix_(rows, rows)])
        away = (data - seen.mean[rows]).reshape(-1, len(rows))
        scaled = scipy.linalg.solve_triangular(root, away.T, lower=True)
        log = -0.5 * (scaled**2).sum(axis=0) - np.log(np.diag(root)).sum() + np.log(share)
        found.append(log.reshape(data.shape[:2]))
    return np.asarray(scipy.special.logsumexp(found, axis=0))


_Fits = list[tuple[float, Fit]]


def _unknown(fits: _Fits) -> bool:
    return fits[0][1].hypothesis.flexible


def _fits(attribution: Attribution) -> list[tuple[str, float, _Fits]]:
    """Name, probability and fits of the explanations in the race, the likeliest first."""
    own = {NO_GAP: [(1.0, attribution.baseline)]}
    own |= {name: [(1.0, fit)] for name, fit in _remainders(attribution).items()}
    own |= {each.effect: _places(each) for each in attribution.explanations}
    found = [(name, chance, own[name]) for name, chance in chances(attribution).items()]
    able = sorted((each for each in found if each[2]), key=lambda each: -each[1])
    best = next(each[1] for each in able if not _unknown(each[2]))
    kept = [each for each in able if each[1] > best * np.exp(-WITHIN_REACH)][:_CONTENDERS]
    kept.sort(key=lambda each: _unknown(each[2]))
    total = sum(probability for _, probability, _ in kept)
    return [(name, probability / total, fits) for name, probability, fits in kept]


def _places(explanation: Explanation) -> _Fits:
    """Where it may act, as far as it was fitted there, with weights."""
    best = explanation.best.log_evidence
    near = [
        (float(np.exp(each.log_evidence - best)), each.fit)
        for each in explanation.variants
        if each.fit is not None and each.log_evidence > best - _AS_LIKELY
    ]
    return near[:_PLACES]


def _offered(problem: GapProblem, fits: Sequence[Fit]) -> tuple[Proposal, ...]:
    """Every measurement that could come next; sensors where the leader and a rival differ most."""
    found = [
        *proposals(problem.design, problem.hanger),
        *lift_off(problem.design, problem.hanger),
        *(each for fit in fits[1:] for each in new_sensors(problem, (fits[0], fit))),
    ]
    return tuple({each.what: each for each in found}.values())


def _unknown_ways(problem: GapProblem, fit: Fit, usual: Errors) -> list[tuple[float, Errors]]:
    """By which errors something unknown may go on, with weights.

    As the engine takes it: over orders independent, smooth, or smooth and alike in both planes; the
    same in every test or new in each; in frequencies alone, or in shapes too. Each counts by what
    it makes of the data so far.
    """
    design, count = problem.design, problem.design.frequencies
    left = (problem.observations.value - fit.predicted)[:count]
    wide = replace(
        usual,
        sd=np.append(usual.sd[:count], np.maximum(usual.sd[count:], np.sqrt(fit.noise.shape))),
        unseen_shape=float(np.sqrt(usual.unseen_shape * LARGEST_SHAPE)),
    )
    sizes = sizes_of(
        usual.sd[:count], LARGEST_FREQUENCY, FREQUENCY_SIZES, problem.hanger.assumptions
    )
    ways = []
    for size, pattern, by_test in product(sizes, _PATTERNS, (False, True)):
        own = replace(usual, remainder=Remainder(float(size), pattern, by_test))
        among = own.between(design, design, same=True) + problem.repeated.frequency
        root = np.linalg.cholesky(among + np.diag(usual.sd[:count] ** 2))
        away = np.linalg.solve(root, left)
        log = -0.5 * float(away @ away) - float(np.log(np.diag(root)).sum())
        ways += [(log, own), (log, replace(wide, remainder=own.remainder))]
    ways.sort(key=lambda way: -way[0])
    return [(float(np.exp(log - ways[0][0])), own) for log, own in ways[:_WAYS]]


_PATTERNS = (same_mode, smooth_over_orders, alike_in_planes)
