"""The next measurements one after the other: what each costs, and what it promises.

What every explanation foresees of all measurements that could be made is one normal distribution
of their data, given the old ones (`shm.gap.foresight`); so what a second measurement adds to
a first one is counted once. Something unknown foresees that what was left over comes again in every
test. Data drawn from each explanation by its probability tell how far, on average,
the true one would get ahead of all others together.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
import scipy

from shm.gap.attribution import WITHIN_REACH, Attribution
from shm.gap.contract import Fit
from shm.gap.experiment_design import Proposal, lift_off, proposals, together
from shm.gap.foresight import Errors, Foresight, NewTests
from shm.gap.next_measurement import NO_GAP, new_sensors
from shm.gap.noise import (
    FREQUENCY_SIZES,
    LARGEST_FREQUENCY,
    LARGEST_SHAPE,
    alike_in_planes,
    same_mode,
    sizes_of,
    smooth_over_orders,
)
from shm.gap.probabilities import families, probabilities
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
    """Return the next measurements, the best promise for its hours first, within a budget.

    `hours` are by kind. The plan ends where the true explanation is expected to have 0.95, or
    nothing promises a fifth of a unit of log odds more.
    """
    steps: list[PlannedMeasurement] = []
    chosen: list[int] = []
    log_odds, probability = race.expected(chosen)
    while probability < ENOUGH and len(steps) < _MOST_STEPS:
        left = budget_hours - sum(step.hours for step in steps)
        costs = {k: hours[each.kind] for k, each in enumerate(race.offered) if k not in chosen}
        gains = race.gains(chosen, [k for k, cost in costs.items() if cost <= left])
        if not gains:
            break
        best = max(gains, key=lambda k: gains[k] / costs[k])
        chosen.append(best)
        log_odds, probability = race.expected(chosen)
        what, kind = race.offered[best].what, race.offered[best].kind
        step = PlannedMeasurement(what, kind, costs[best], gains[best], log_odds, probability)
        steps.append(step)
    return tuple(steps)


def nothing_planned(race: Race, hours: Mapping[str, float], budget_hours: float) -> str:
    """Return in words why a plan holds nothing."""
    _, probability = race.expected([])
    if probability >= ENOUGH:
        return (
            f"These data are enough: whichever explanation is true, it is expected to have "
            f"{probability:.2f} already. What `shm gap diagnose` lists to measure next tells it "
            "from others that are unlikely as it is."
        )
    able = [race.offered[k] for k in race.gains([], range(len(race.offered)))]
    if not able:
        return "No measurement promises to tell the explanations further apart."
    cheapest = min(able, key=lambda each: hours[each.kind])
    return (
        f"No measurement that promises to tell the explanations further apart fits into "
        f"{budget_hours:g} h. The cheapest, {cheapest.what}, takes {hours[cheapest.kind]:g} h."
    )


@dataclass(frozen=True, eq=False)
class Explanation:
    """A cause, no gap or something unknown by its `name`, with its probability.

    `fits` are those of the places where it may act, each with its weight.
    """

    name: str
    probability: float
    fits: tuple[tuple[float, Fit], ...]

    @property
    def is_known(self) -> bool:
        return not self.fits[0][1].hypothesis.flexible


def explanations(attribution: Attribution) -> list[Explanation]:
    """Return every explanation, the likeliest first; the probabilities add to 1.

    Without what is kept for causes off the catalogue that pass for one of it, which no measurement
    of a plan changes.
    """
    kinds = families(attribution.tried, attribution.search.variants)
    chances, _ = probabilities(kinds)
    found = []
    for kind, chance in zip(kinds, (chances / chances.sum()).tolist(), strict=True):
        name = kind.name or NO_GAP
        if kind.flexible:
            name = joined((*kind.best.hypothesis.names, UNKNOWN))
        fits = [
            (float(np.exp(each.log_evidence - kind.best.log_evidence)), each.fit)
            for each in kind.tried
            if each.fit is not None and each.log_evidence > kind.best.log_evidence - _AS_LIKELY
        ]
        found.append(Explanation(name, chance, tuple(fits[:_PLACES])))
    return sorted(found, key=lambda each: -each.probability)


def log_odds_of(probability: FloatArray | float) -> FloatArray:
    """Return log odds of probabilities, up to a thousand to one either way."""
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
        """Return the race of the explanations that these data leave a chance."""
        problem, racing = attribution.search.problem, _racing(attribution)
        known = [each.fits[0][1] for each in racing if each.is_known]
        offered = _offered(problem, known)
        design, rows = together([each.design for each in offered])
        reads = [each.kind == "lift-off" for each in offered]
        rows = [
            np.append(r, design.size) if read else r for r, read in zip(rows, reads, strict=True)
        ]
        reading_sd = problem.hanger.assumptions.tension_reading_sd.value if any(reads) else NAN
        errors, new = Errors.of(problem, known[0]), NewTests(problem, design, reading_sd)
        first = new.foresee(known[0], errors)
        contenders = []
        for each in racing:
            ways = [
                (weight * share, new.foresee(fit, own).turned_to(first))
                for weight, fit in each.fits
                for share, own in _ways(problem, fit, errors)
            ]
            total = sum(weight for weight, _ in ways)
            shares = tuple((weight / total, seen) for weight, seen in ways)
            contenders.append(Contender(each.name, each.probability, shares))
        draws = [
            seen.mean
            + rng.standard_normal((_DRAWS, len(seen.mean))) @ np.linalg.cholesky(seen.covariance).T
            for contender in contenders
            for _, seen in contender.ways
        ]
        return cls(offered, tuple(rows), tuple(contenders), np.array(draws))

    def expected(self, chosen: Sequence[int]) -> tuple[float, float]:
        """Return mean log odds and probability of the true one after the `chosen` measurements."""
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

    def gains(self, chosen: Sequence[int], further: Iterable[int]) -> dict[int, float]:
        """Return the log odds that each `further` measurement promises, if it is worth the work."""
        now, _ = self.expected(chosen)
        found = {k: self.expected([*chosen, k])[0] - now for k in further}
        return {k: gain for k, gain in found.items() if gain >= _WORTH_IT}

    @property
    def _holds(self) -> FloatArray:
        """Return 1 where the second names every cause of the first, (contenders, contenders)."""
        names = [each.name for each in self.contenders]
        return np.array([[float(holds(other, one)) for other in names] for one in names])


def holds(other: str, one: str) -> bool:
    """Return whether the explanation `other` names every cause that `one` does."""
    if {one, other} & {NO_GAP, UNKNOWN}:
        return one == other
    return set(parted(one)) <= set(parted(other))


def _log_density(contender: Contender, rows: IntArray, data: FloatArray) -> FloatArray:
    """Return the log density (ways, draws) of data (ways, draws, rows), but for a constant."""
    found = []
    for share, seen in contender.ways:
        root = np.linalg.cholesky(seen.covariance[np.ix_(rows, rows)])
        away = (data - seen.mean[rows]).reshape(-1, len(rows))
        scaled = scipy.linalg.solve_triangular(root, away.T, lower=True)
        log = -0.5 * (scaled**2).sum(axis=0) - np.log(np.diag(root)).sum() + np.log(share)
        found.append(log.reshape(data.shape[:2]))
    return np.asarray(scipy.special.logsumexp(found, axis=0))


def _racing(attribution: Attribution) -> list[Explanation]:
    """Return the explanations in the race, the likeliest known one first, unknown ones last."""
    able = [each for each in explanations(attribution) if each.fits]
    best = next(each.probability for each in able if each.is_known)
    kept = [each for each in able if each.probability > best * np.exp(-WITHIN_REACH)][:_CONTENDERS]
    total = sum(each.probability for each in kept)
    kept = [replace(each, probability=each.probability / total) for each in kept]
    return sorted(kept, key=lambda each: not each.is_known)


def _offered(problem: GapProblem, fits: Sequence[Fit]) -> tuple[Proposal, ...]:
    """Return all that could come next; sensors where the leader and a rival differ most."""
    found = [
        *proposals(problem.design, problem.hanger),
        *lift_off(problem.design, problem.hanger),
        *(each for fit in fits[1:] for each in new_sensors(problem, (fits[0], fit))),
    ]
    return tuple({each.what: each for each in found}.values())


def _ways(problem: GapProblem, fit: Fit, usual: Errors) -> list[tuple[float, Errors]]:
    """Return the errors by which a fit may go on, with weights: of what is known the `usual` ones.

    Something unknown moves shapes too, and frequencies independently over orders, smoothly, or
    smoothly and alike in both planes. Each way counts by what it makes of the data so far.
    """
    if not fit.hypothesis.flexible:
        return [(1.0, usual)]
    design, noise = problem.design, problem.repeated.frequency + np.diag(usual.frequency_sd**2)
    left = (problem.observations.value - fit.predicted)[: design.frequencies]
    shape_sd = float(np.sqrt(usual.shape_sd * LARGEST_SHAPE))
    if len(fit.noise.shape):
        shape_sd = max(usual.shape_sd, float(np.sqrt(np.median(fit.noise.shape))))
    assumed = problem.hanger.assumptions
    sizes = sizes_of(usual.frequency_sd, LARGEST_FREQUENCY, FREQUENCY_SIZES, assumed).tolist()
    ways = [
        replace(usual, shape_sd=shape_sd, remainder=size, pattern=pattern)
        for size, pattern in product(sizes, (same_mode, smooth_over_orders, alike_in_planes))
    ]
    roots = [np.linalg.cholesky(way.between(design, design) + noise) for way in ways]
    log = [
        -np.sum(np.linalg.solve(root, left) ** 2) / 2 - np.log(np.diag(root)).sum()
        for root in roots
    ]
    best = np.argsort(log)[::-1][:_WAYS]
    return [(float(np.exp(log[k] - log[best[0]])), ways[k]) for k in best]
