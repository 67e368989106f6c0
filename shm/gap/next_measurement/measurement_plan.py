"""Next measurements that tell the leading explanations apart, and a plan of several steps.

What every explanation foresees of all measurements that could be made is one normal distribution of
their data, given the old ones (`shm.gap.next_measurement.foresight`); so what a second measurement
adds to a first one is counted once. Something unknown foresees that what was left over comes again
in every test. Data drawn from each explanation by its probability tell how far, on average, the
true one would get ahead of all others together.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
import scipy

from shm.gap.causes.probabilities import families, probabilities
from shm.gap.causes.search import WITHIN_REACH, Attribution
from shm.gap.hypotheses.contract import Fit
from shm.gap.hypotheses.noise import (
    FREQUENCY_SIZES,
    LARGEST_FREQUENCY,
    LARGEST_SHAPE,
    correlate_orders,
    same_mode,
    sizes_of,
    smooth_over_orders,
)
from shm.gap.hypotheses.problem import GapProblem
from shm.gap.next_measurement.experiment_design import (
    Proposal,
    lift_off,
    measured_already,
    proposals,
    together,
    with_sensors,
)
from shm.gap.next_measurement.foresight import Errors, Foresight, NewTests, divergence, find_signs
from shm.values import MEASUREMENT_HOURS, NAN, FloatArray, IntArray, NextMeasurement
from shm.values.diagnosis import joined, parted

UNKNOWN, NO_GAP = "something unknown", "no gap"
ENOUGH = 0.95
"""Of the true explanation: from there on nobody goes out for more."""
# Judgement: a fifth of a unit of log odds turns 0.5 into 0.55, and a list that a person reads.
_WORTH_IT, _MOST_STEPS = 0.2, 6
# Technical: a mean log odds to some 0.1; explanations and places of one that are still in the race.
_DRAWS, _CONTENDERS, _PLACES, _WAYS, _AS_LIKELY = 32, 8, 3, 12, 3.0
# Judgement: the leader against three rivals, as far behind as 20,000 to one, and a list that a
# person reads.
_IN_THE_LIST, _OUT_OF_THE_RACE, _LISTED = 4, 10.0, 8
# Judgement: half a unit of log evidence turns even odds into 0.62 and is not worth a day's work;
# 100 are more than any model's errors leave true.
_WORTH_A_DAY, _AS_GOOD_AS_CERTAIN = 0.5, 100.0
# Judgement: every twelfth of the length, which one finds with a tape; two sensors that a person can
# carry, no nearer than a sixth, half a wave of the sixth mode, lest they see the same.
_CANDIDATE_PLACES, _NEW_SENSORS, _APART = 11, 2, 1 / 6


def ranked(problem: GapProblem, fits: Sequence[Fit]) -> tuple[NextMeasurement, ...]:
    """Return measurements that separate the first of `fits` from each of the next, best first.

    `fits` are ordered by probability, the baseline among them where no gap is a contender; those
    with a flexible remainder, or with evidence smaller by a factor of exp(10), are passed over. The
    expected log Bayes factor is the Kullback-Leibler divergence between what two explanations
    predict of the new data given the old ones (Lindley 1956; normal approximation), in the
    direction which expects less: so much is to be expected whichever is true. Of each kind of
    measurement the best is kept, for the pair that it tells apart best; one that promises less than
    0.5, or hardly more than the same test once more, is left out. What promises more than 100 is
    as good as certain: more is not claimed, and the easier comes first.
    """
    contenders = _leading(fits)
    if len(contenders) < 2:
        return ()
    leader, *rivals = contenders
    offered, rows, new = _offered(problem, contenders)
    errors = Errors.of(problem, leader)
    seen = [new.foresee(leader, errors, indices) for indices in rows]
    found = []
    for rival in rivals:
        other = [new.foresee(rival, errors, indices) for indices in rows]
        promises = {
            each: min(divergence(one, two), divergence(two, one))
            for each, one, two in zip(offered, seen, other, strict=True)
        }
        names = leader.hypothesis.name or NO_GAP, rival.hypothesis.name or NO_GAP
        found += [
            NextMeasurement(each.what, names, min(promises[each], _AS_GOOD_AS_CERTAIN))
            for each in _worth_it(promises)
        ]
    found.sort(key=lambda measurement: -measurement.expected_log_bayes_factor)
    distinct: dict[str, NextMeasurement] = {}
    for measurement in found:
        distinct.setdefault(measurement.what, measurement)
    return tuple(distinct.values())[:_LISTED]


def _leading(fits: Sequence[Fit]) -> list[Fit]:
    """Return at most four fits of different effects that are in the race, the leader first."""
    distinct: dict[str, Fit] = {}
    for fit in fits:
        if not fit.hypothesis.flexible:
            distinct.setdefault(fit.hypothesis.name, fit)
    best = max((fit.log_evidence for fit in distinct.values()), default=0.0)
    racing = [f for f in distinct.values() if f.log_evidence > best - _OUT_OF_THE_RACE]
    return racing[:_IN_THE_LIST]


def _worth_it(promises: Mapping[Proposal, float]) -> list[Proposal]:
    """Return the best of each kind, if it promises enough and more than a repetition."""
    best = {
        kind: max((each for each in promises if each.kind == kind), key=promises.__getitem__)
        for kind in dict.fromkeys(each.kind for each in promises)
    }
    repeated = promises[best["repeat"]]
    return [
        each
        for kind, each in best.items()
        if promises[each] >= _WORTH_A_DAY + repeated * (kind != "repeat")
    ]


def new_sensors(problem: GapProblem, pair: tuple[Fit, Fit]) -> list[Proposal]:
    """Return sensors where the shapes of the pair differ most; none where there are enough."""
    design = problem.observations.design
    if "sensors" in measured_already(design):
        return []
    length_m = problem.hanger.length_m
    shares = np.arange(1, _CANDIDATE_PLACES + 1) / (_CANDIDATE_PLACES + 1)
    places_m = tuple(float(round(share * length_m, 1)) for share in shares)
    everywhere = with_sensors(design, places_m).design
    one, other = (problem.predict(fit.hypothesis, fit.z[None], everywhere) for fit in pair)
    squares = (one[0] - (other * find_signs(everywhere, other, one[0]))[0]) ** 2
    by_place = np.bincount(everywhere.shape_place, squares[everywhere.frequencies :])
    apart = by_place[len(design.places_m) :]
    chosen: list[int] = []
    for place in np.argsort(-apart):
        if all(abs(shares[place] - shares[each]) >= _APART for each in chosen):
            chosen.append(int(place))
    return [with_sensors(design, tuple(sorted(places_m[i] for i in chosen[:_NEW_SENSORS])))]


def _offered(
    problem: GapProblem, fits: Sequence[Fit], reading_sd: float = NAN
) -> tuple[tuple[Proposal, ...], list[IntArray], NewTests]:
    """Return all that could come next, the rows that each has of all their data, and their tests.

    Sensors where the first of `fits` and another one differ most; a lift-off where a tension is
    read with an error.
    """
    found = [
        *proposals(problem.design, problem.hanger),
        *(lift_off(problem.design, problem.hanger) if np.isfinite(reading_sd) else ()),
        *(each for fit in fits[1:] for each in new_sensors(problem, (fits[0], fit))),
    ]
    offered = tuple({each.what: each for each in found}.values())
    design, rows = together([each.design for each in offered])
    reads = [each.kind == "lift-off" for each in offered]
    rows = [np.append(r, design.size) if read else r for r, read in zip(rows, reads, strict=True)]
    return offered, rows, NewTests(problem, design, reading_sd if any(reads) else NAN)


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
    """Hold what every contender foresees of the data (data,) of all measurements `offered`.

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
        reading_sd = problem.hanger.assumptions.tension_reading_sd.value
        offered, rows, new = _offered(problem, known, reading_sd)
        errors = Errors.of(problem, known[0])
        contenders = []
        for each in racing:
            ways = [
                (weight * share, new.foresee(fit, way_errors))
                for weight, fit in each.fits
                for share, way_errors in _ways(problem, fit, errors)
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
        correct = np.einsum("kj,jkn->kn", self._holds[truth], after)
        means = np.average(
            [log_odds_of(correct).mean(axis=1), correct.mean(axis=1)], axis=1, weights=weight
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
    close = [each for each in able if each.probability > best * np.exp(-WITHIN_REACH)][:_CONTENDERS]
    total = sum(each.probability for each in close)
    close = [replace(each, probability=each.probability / total) for each in close]
    return sorted(close, key=lambda each: not each.is_known)


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
        for size, pattern in product(sizes, (same_mode, smooth_over_orders, correlate_orders))
    ]
    roots = [np.linalg.cholesky(way.between(design, design) + noise) for way in ways]
    log = [
        -np.sum(np.linalg.solve(root, left) ** 2) / 2 - np.log(np.diag(root)).sum()
        for root in roots
    ]
    best = np.argsort(log)[::-1][:_WAYS]
    return [(float(np.exp(log[k] - log[best[0]])), ways[k]) for k in best]
