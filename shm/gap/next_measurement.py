"""What to measure next: the tests that are expected to tell the leading explanations apart.

What a fit predicts of data not yet measured, and how far two such predictions differ.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from shm.assumptions import DEFAULTS
from shm.gap.contract import Design, Fit
from shm.gap.experiment_design import Proposal, proposals, sensors_wanted, with_sensors
from shm.gap.noise import same_mode
from shm.gap.problem import GapProblem
from shm.gap.residuals import identification_sd
from shm.values import NAN, FloatArray, NextMeasurement

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
    errors = Errors.of(problem, contenders[0])
    foresights = [
        [foreseen(problem, fit, each.design, errors) for each in general] for fit in contenders
    ]
    found = []
    for fit, seen in zip(contenders[1:], foresights[1:], strict=True):
        pair = (contenders[0], fit)
        pairs = zip(general, foresights[0], seen, strict=True)
        promises = [(each, _expected(*both)) for each, *both in pairs]
        for each in new_sensors(problem, pair):
            both = (foreseen(problem, own, each.design, errors) for own in pair)
            promises.append((each, _expected(*both)))
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


def new_sensors(problem: GapProblem, pair: tuple[Fit, Fit]) -> list[Proposal]:
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


_STEP_IN_SDS = 0.1  # technical: far from rounding, near enough for slopes to hold


@dataclass(frozen=True, eq=False)
class Foresight:
    """The normal distribution of new data: `mean` (data,), `covariance` (data, data)."""

    design: Design
    mean: FloatArray
    covariance: FloatArray

    def turned_to(self, other: Foresight) -> Foresight:
        """The same with the sign of each shape that agrees with `other`."""
        sign = _agreement(self.design, self.mean[None], other.mean)[0]
        return Foresight(self.design, sign * self.mean, np.outer(sign, sign) * self.covariance)


@dataclass(frozen=True, eq=False)
class Errors:
    """What the data err by: `sd` (data,) independently, the frequencies by `repeated` as well.

    The latter, a fraction, is the model error, the same for a mode in all tests. Explanations that
    are compared are given the same errors, lest a difference in errors pass for one in prediction.
    Something unknown leaves a `remainder` beside them. `unseen_shape` is what shapes err by where
    none was measured; `sensors` (S, k) are what errors of sensors do to the shapes of a new design,
    None where those of the old ones stand for them.
    """

    sd: FloatArray
    repeated: float
    remainder: Remainder | None = None
    unseen_shape: float = DEFAULTS.unstated_shape_sd.value
    sensors: FloatArray | None = None

    @classmethod
    def of(cls, problem: GapProblem, fit: Fit) -> Errors:
        known = np.isfinite(problem.observations.sd[: problem.design.frequencies])
        return cls(
            identification_sd(problem, fit),
            fit.model_error if known.any() else 0.0,
            unseen_shape=problem.hanger.assumptions.unstated_shape_sd.value,
        )

    def between(self, one: Design, other: Design, *, same: bool) -> FloatArray:
        """The covariance (F of one, F of the other) by what repeats; of the `same` tests or not."""
        found = self.repeated**2 * same_mode(one, other)
        return found if self.remainder is None else found + self.remainder.between(one, other, same)


@dataclass(frozen=True)
class Remainder:
    """What something unknown leaves over: `size` (a fraction), alike over orders as `pattern` says.

    It comes again in every test, or is new in each (`by_test`).
    """

    size: float
    pattern: Callable[[Design, Design], FloatArray]
    by_test: bool

    def between(self, one: Design, other: Design, same: bool) -> FloatArray:
        """Its covariance (F of one, F of the other); of the `same` tests or not."""
        found = self.size**2 * self.pattern(one, other)
        if not self.by_test:
            return np.asarray(found)
        return np.asarray(same * found * (one.frequency_test[:, None] == other.frequency_test))


def foreseen(
    problem: GapProblem, fit: Fit, design: Design, errors: Errors, reading_sd: float = NAN
) -> Foresight:
    """What `fit` predicts of the data of new tests, given the old ones.

    With a `reading_sd` (a fraction) the last datum is the logarithm of a tension that is read.
    Parameters vary by their posterior, the prediction with them to first order. New data err as
    the present ones do (median). The model error of a mode is the same in the new test as in the
    old ones, so that what the fit left over of a mode is expected again.
    """
    roots = _roots(fit.covariance)
    around = _around(problem, fit, roots)
    predicted = problem.predict(fit.hypothesis, around, design)
    predicted = predicted * _agreement(design, predicted, predicted[0])
    if np.isfinite(reading_sd):
        tension_n = problem.tension_n(fit.hypothesis, around)
        predicted = np.column_stack([predicted, np.log(tension_n)])
    ahead, back = np.split(predicted[1:], 2)
    spread = (ahead - back).T / (2 * _STEP_IN_SDS)
    return _given_the_old(problem, fit, design, errors, predicted[0], spread, reading_sd)


def divergence(one: Foresight, other: Foresight) -> float:
    """The Kullback-Leibler divergence of two normal distributions, in natural units.

    The log Bayes factor to expect in favour of `one` where it is true.
    """
    factor = scipy.linalg.cho_factor(other.covariance, lower=True)
    apart = one.mean - other.mean
    trace = np.trace(scipy.linalg.cho_solve(factor, one.covariance))
    logs = 2 * np.log(np.diag(factor[0])).sum() - np.linalg.slogdet(one.covariance)[1]
    return float((trace + apart @ scipy.linalg.cho_solve(factor, apart) - len(apart) + logs) / 2)


def _roots(covariance: FloatArray) -> FloatArray:
    """Rows (d, d) whose outer products add to the covariance."""
    variance, directions = np.linalg.eigh(covariance)
    return np.asarray((directions * np.sqrt(np.maximum(variance, 0.0))).T)


def _around(problem: GapProblem, fit: Fit, roots: FloatArray) -> FloatArray:
    """The fit's point, then a step ahead and back in each direction (2 d + 1, d).

    A parameter that may have either sign jumps at 0: its points keep to the sign of the fit.
    """
    step = _STEP_IN_SDS * roots
    points = np.concatenate([fit.z[None], fit.z + step, fit.z - step])
    coordinates = problem.coordinates(fit.hypothesis)
    effects = np.array([parameter.signed for parameter in coordinates.effects], dtype=bool)
    signed = np.append(np.zeros(coordinates.baseline, dtype=bool), effects)
    other_side = signed & (points * fit.z < 0)
    return np.where(other_side, np.copysign(1e-6, fit.z), points)


def _given_the_old(
    problem: GapProblem,
    fit: Fit,
    design: Design,
    errors: Errors,
    mean: FloatArray,
    spread: FloatArray,
    reading_sd: float,
) -> Foresight:
    """Condition predictions `mean` (data,) and `spread` (data, d) on the errors of the old data."""
    observations = problem.observations
    old, new = observations.design.frequencies, design.frequencies
    was, will = problem.repeated, problem.section_of(design)
    shared = errors.between(design, observations.design, same=False) + will @ was.section.T
    among_old = errors.between(observations.design, observations.design, same=True)
    among_old += was.frequency
    gain = np.linalg.solve(among_old + np.diag(errors.sd[:old] ** 2), shared.T).T
    mean, spread = mean.copy(), spread.copy()
    mean[:new] += gain @ (observations.value - fit.predicted)[:old]
    spread[:new] -= gain @ (fit.slopes @ _roots(fit.covariance).T)[:old]
    together = np.linalg.norm(was.sensors, axis=1) if errors.sensors is None else 0.0
    shapes = np.hypot(errors.sd[old:], together)
    shape_sd = np.median(shapes) if shapes.size else errors.unseen_shape
    counts = [new, design.size - new, len(mean) - design.size]
    sd = np.repeat([np.median(errors.sd[:old]), shape_sd, reading_sd], counts)
    noise = np.diag(sd**2)
    own = np.hstack([problem.tensions_of(design), problem.masses_of(design)])
    among_new = errors.between(design, design, same=True) + will @ will.T + own @ own.T
    noise[:new, :new] += among_new - gain @ shared.T
    if errors.sensors is not None:
        noise[new : design.size, new : design.size] += errors.sensors @ errors.sensors.T
    return Foresight(design, mean, spread @ spread.T + noise)


def _agreement(design: Design, predicted: FloatArray, reference: FloatArray) -> FloatArray:
    """Signs (n, data) that turn the shapes in `predicted` (n, data) to those in `reference`."""
    signs = np.ones_like(predicted)
    frequencies = design.frequencies
    products = (predicted * reference)[:, frequencies:]
    for mode in np.unique(design.shape_mode):
        rows = np.flatnonzero(design.shape_mode == mode)
        agrees = products[:, rows].sum(axis=1) >= 0
        signs[:, frequencies + rows] = np.where(agrees, 1.0, -1.0)[:, None]
    return signs
