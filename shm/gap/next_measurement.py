"""Next measurements: the tests that are expected to tell the leading explanations apart."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from shm.gap.contract import Fit
from shm.gap.experiment_design import Proposal, measured_already, proposals, with_sensors
from shm.gap.foresight import Errors, NewTests, divergence, find_signs
from shm.gap.problem import GapProblem
from shm.values import NextMeasurement

NO_GAP = "no gap"
# Judgement: the leader against three rivals, as far behind as 20,000 to one, and a list that a
# person reads.
_CONTENDERS, _OUT_OF_THE_RACE, _LISTED = 4, 10.0, 8
# Judgement: half a unit of log evidence turns even odds into 0.62 and is not worth a day's work;
# 100 are more than any model's errors leave true.
_WORTH_IT, _AS_GOOD_AS_CERTAIN = 0.5, 100.0
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
    leader, *rivals = _contenders(fits) or (None,)
    if leader is None or not rivals:
        return ()
    errors = Errors.of(problem, leader)
    general = {e: NewTests(problem, e.design) for e in proposals(problem.design, problem.hanger)}
    found = []
    for rival in rivals:
        sensors = new_sensors(problem, (leader, rival))
        promises = {}
        for each, new in (general | {e: NewTests(problem, e.design) for e in sensors}).items():
            own = new.foresee(leader, errors)
            other = new.foresee(rival, errors).turned_to(own)
            promises[each] = min(divergence(own, other), divergence(other, own))
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


def _contenders(fits: Sequence[Fit]) -> list[Fit]:
    """Return at most four fits of different effects that are in the race, the leader first."""
    distinct: dict[str, Fit] = {}
    for fit in fits:
        if not fit.hypothesis.flexible:
            distinct.setdefault(fit.hypothesis.name, fit)
    best = max((fit.log_evidence for fit in distinct.values()), default=0.0)
    racing = [f for f in distinct.values() if f.log_evidence > best - _OUT_OF_THE_RACE]
    return racing[:_CONTENDERS]


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
        if promises[each] >= _WORTH_IT + repeated * (kind != "repeat")
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
