"""What to measure next: the tests that are expected to tell the leading explanations apart."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from shm.gap.contract import Design, Fit
from shm.gap.foresight import Errors, Foresight, divergence, foreseen
from shm.gap.problem import GapProblem
from shm.gap.proposals import Proposal, proposals, sensors_wanted, with_sensors
from shm.values import FloatArray, NextMeasurement

NO_GAP = "no gap"
_CONTENDERS = 4
_OUT_OF_THE_RACE = 10.0
_WORTH_IT = 0.5
_LISTED = 8
_AS_GOOD_AS_CERTAIN = 100.0
_CANDIDATE_PLACES = 11
_NEW_SENSORS = 2
_APART = 1 / 6

_Promise = tuple[Proposal, float]


def ranked(problem: GapProblem, fits: Sequence[Fit]) -> tuple[NextMeasurement, ...]:
    """Measurements that separate the first of `fits` from each of the next, best first.

    `fits` are ordered by probability, the baseline among them where no gap is a contender; those
    with a flexible remainder, or with evidence smaller by a factor of exp(10), are passed over. The
    expected log Bayes factor is the Kullback-Leibler divergence between what two explanations
    predict of the new data given the old ones (Lindley 1956; normal approximation), in the
    direction which expects less: so much is to be expected whichever is true. Of each kind of
    measurement the best is kept, for the pair that it tells apart best; one that promises less than
    0.5, or hardly more than the same test once more, is left out. What promises more than 100 is
    as good as certain: more is not claimed, and the easier comes first.
    """
    contenders = _contenders(fits)
    if len(contenders) < 2:
        return ()
    general = proposals(problem.observations.design, problem.hanger)
    errors = Errors.of(problem.observations, contenders[0])
    foresights = [
        [foreseen(problem, fit, each.design, errors) for each in general] for fit in contenders
    ]
    found = []
    for fit, seen in zip(contenders[1:], foresights[1:], strict=True):
        pair = (contenders[0], fit)
        promises = _promises(general, foresights[0], seen)
        promises += [_promise(problem, pair, each, errors) for each in _sensors(problem, pair)]
        found += [_named(pair, promise) for promise in _worth_it(promises)]
    found.sort(key=lambda measurement: -measurement.expected_log_bayes_factor)
    distinct: dict[str, NextMeasurement] = {}
    for measurement in found:
        distinct.setdefault(measurement.what, measurement)
    return tuple(distinct.values())[:_LISTED]


def _contenders(fits: Sequence[Fit]) -> list[Fit]:
    """At most four fits of different effects that are still in the race, the leader first."""
    distinct: dict[str, Fit] = {}
    for fit in fits:
        if not fit.hypothesis.flexible:
            distinct.setdefault(fit.hypothesis.name, fit)
    best = max((fit.log_evidence for fit in distinct.values()), default=0.0)
    racing = [f for f in distinct.values() if f.log_evidence > best - _OUT_OF_THE_RACE]
    return racing[:_CONTENDERS]


def _promises(
    general: Sequence[Proposal], one: Sequence[Foresight], other: Sequence[Foresight]
) -> list[_Promise]:
    return [(each, _expected(*pair)) for each, *pair in zip(general, one, other, strict=True)]


def _promise(
    problem: GapProblem, pair: tuple[Fit, Fit], proposal: Proposal, errors: Errors
) -> _Promise:
    one, other = (foreseen(problem, fit, proposal.design, errors) for fit in pair)
    return proposal, _expected(one, other)


def _expected(one: Foresight, other: Foresight) -> float:
    other = other.turned_to(one)
    return min(divergence(one, other), divergence(other, one))


def _worth_it(promises: Sequence[_Promise]) -> list[_Promise]:
    """The best of each kind, if it promises enough and more than a repetition."""
    repeated = max(value for proposal, value in promises if proposal.kind == "repeat")
    best: dict[str, _Promise] = {}
    for promise in promises:
        kind = promise[0].kind
        best[kind] = max(best.get(kind, promise), promise, key=lambda each: each[1])
    return [
        (proposal, value)
        for proposal, value in best.values()
        if value >= _WORTH_IT + (0.0 if proposal.kind == "repeat" else repeated)
    ]


def _named(pair: tuple[Fit, Fit], promise: _Promise) -> NextMeasurement:
    one, other = (fit.hypothesis.name or NO_GAP for fit in pair)
    return NextMeasurement(promise[0].what, (one, other), min(promise[1], _AS_GOOD_AS_CERTAIN))


def _sensors(problem: GapProblem, pair: tuple[Fit, Fit]) -> list[Proposal]:
    """Sensors where the shapes that the pair predicts differ most; none where there are enough."""
    design = problem.observations.design
    if not sensors_wanted(design):
        return []
    length_m = problem.hanger.length_m
    shares = np.arange(1, _CANDIDATE_PLACES + 1) / (_CANDIDATE_PLACES + 1)
    places_m = tuple(float(round(share * length_m, 1)) for share in shares)
    everywhere = with_sensors(design, places_m).design
    apart = _differences(problem, pair, everywhere)[len(design.places_m) :]
    chosen: list[int] = []
    for place in np.argsort(-apart):
        if all(abs(shares[place] - shares[each]) >= _APART for each in chosen):
            chosen.append(int(place))
    return [with_sensors(design, tuple(sorted(places_m[i] for i in chosen[:_NEW_SENSORS])))]


def _differences(problem: GapProblem, pair: tuple[Fit, Fit], design: Design) -> FloatArray:
    """How far the shapes of two fits differ at each place (places,), sums of squares."""
    none = np.zeros((design.size, design.size))
    one, other = (
        Foresight(design, problem.predict(fit.hypothesis, fit.z[None], design)[0], none)
        for fit in pair
    )
    squares = (one.mean - other.turned_to(one).mean)[design.frequencies :] ** 2
    return np.asarray(
        np.bincount(design.shape_place, squares, minlength=len(design.places_m)), dtype=float
    )
