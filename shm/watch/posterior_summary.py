"""Summary of the evidence after a test: the change, its onset, and the shift of each quantity.

Shifts in the units that people read, of mixtures of normal distributions in the coordinate.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta

import numpy as np
import scipy

from shm.values import (
    NAN,
    TENSION,
    Change,
    Drift,
    FloatArray,
    Hanger,
    Moved,
    Reading,
    WatchedQuantity,
    is_ratio,
)
from shm.values.drift import threshold_of
from shm.watch.change_point import LOG_SHARES, SIZES, STEP, Evidence
from shm.watch.options import DAYS_PER_YEAR, WatchOptions
from shm.watch.quantities import coordinate_of, shift_of, value_at

_ALIKE_NATS = 3.0  # 20 to 1: what is as likely is named beside
_TAIL = 0.05  # 90 % lie between
_DIGITS = 3  # probabilities that read alike are ordered by tension first
_TRADED = 0.25  # judgement: of what an end does, that looks like another tension
_BEYOND_DOUBT = 1e4  # judgement: times what a detection takes
# Technical: exact for polynomials of degree 13.
_NODES, _WEIGHTS = np.polynomial.hermite_e.hermegauss(7)
_WEIGHTS = _WEIGHTS / _WEIGHTS.sum()
_NEGLIGIBLE = 1e-7  # technical: less than the least probability that is told


@dataclass(frozen=True, eq=False)
class SummaryContext:
    """The facts that all tests of one hanger share.

    `start` is the time of the first reading, `baseline_years` from it the mean of the baseline's.
    `effects` (r, n + q) are what a change does to what owners look at: of each plane the first
    frequency, then the mean; `by_mode` (n, n + q) to every mode.
    """

    quantities: tuple[WatchedQuantity, ...]
    hanger: Hanger
    options: WatchOptions
    start: datetime
    baseline_years: float
    effects: FloatArray
    by_mode: FloatArray

    def at(self, years: float) -> datetime:
        """Return the time so many years from the start."""
        return self.start + timedelta(days=years * DAYS_PER_YEAR)

    def model_uncertainty(self, means: FloatArray) -> FloatArray:
        """Return standard deviations (B, q) of shifts `means` (B, q) that the model leaves open.

        A share of each, as the baseline's own values are open; some of what ends do may be
        tension's."""
        its = means * [each.scale_sd for each in self.quantities]
        is_tension = np.array([each.name == TENSION for each in self.quantities])
        if is_tension.any() and not is_tension.all():
            of_ends = np.abs(means[:, ~is_tension]).sum(axis=1, keepdims=True)
            first = len(self.effects.T) - len(self.quantities)
            of_tension = self.effects[1::2, first:][:, is_tension].mean()
            its[:, is_tension] = np.hypot(its[:, is_tension], _TRADED * of_ends / of_tension)
        return np.asarray(its)


def probability_of_change(evidence: Evidence, options: WatchOptions) -> float:
    """That something has changed since the last call, if changes come at the rate assumed."""
    odds = min(evidence.log_statistic, evidence.log_most) + math.log(options.change_rate_per_year)
    return 1 / (1 + math.exp(min(-odds, 700.0)))


def summarize_change(
    subject: SummaryContext,
    evidence: Evidence,
    causes: Evidence,
    reading: Reading,
    before: float,
    outlier: float,
    *,
    against_baseline: int,
) -> Change:
    """The change since the last call; `before` is the probability that there was one earlier, and
    `causes` the evidence by which causes are weighed, no test's say being bounded. `outlier` is
    that of this test being a blunder."""
    now = probability_of_change(evidence, subject.options)
    began_after, began_by = _began(subject, causes, reading)
    return Change(
        evidence_years=math.exp(min(evidence.log_evidence, 700.0)),
        limit_years=subject.options.limit_years,
        probability=1 - (1 - before) * (1 - now),
        sudden=_sudden(causes),
        began_after=began_after,
        began_by=began_by,
        moved=rank_causes(subject, causes),
        outlier_probability=outlier,
        material_probability=_material(subject, causes),
        against_baseline=against_baseline,
    )


def _material(subject: SummaryContext, evidence: Evidence) -> float:
    """The probability that a change, if there is one, moves one of the frequencies that owners look
    at by more than what is to be told."""
    if not len(evidence.beginnings):
        return 0.0
    weights, changes = _leading(evidence, np.ones(len(evidence.directions), bool))
    return float(weights @ _materials(subject, evidence, changes))


def _materials(
    subject: SummaryContext, evidence: Evidence, changes: Sequence[tuple[int, ...]]
) -> FloatArray:
    """The same (changes,) of each; of any mode, where no doubt is left that something changed."""
    effects, least = subject.effects, subject.options.least_frequency_shift
    if evidence.log_evidence > math.log(_BEYOND_DOUBT * subject.options.limit_years):
        effects = np.vstack([effects, subject.by_mode])
    if not changes:
        return np.zeros(0)
    found = evidence.changes_at(changes)
    middle = np.array([mean for mean, _ in found]) @ effects.T
    sd = np.sqrt(np.square(effects @ np.array([factor for _, factor in found])).sum(axis=2))
    sd = np.maximum(sd, 1e-12)
    tails = scipy.special.ndtr((-least - middle) / sd) + scipy.special.ndtr((middle - least) / sd)
    return np.asarray(tails.max(axis=1))


def _sudden(evidence: Evidence) -> float:
    if not len(evidence.beginnings):
        return NAN
    return float(evidence.shares[:, :, STEP].sum())


def _began(
    subject: SummaryContext, evidence: Evidence, reading: Reading
) -> tuple[datetime, datetime]:
    """Between which times the change began, with 90 % probability; the test's own if none can."""
    beginnings, years = evidence.beginnings, evidence.years
    if not len(beginnings):
        return reading.time, reading.time
    reached = np.cumsum(evidence.shares.sum(axis=(1, 2, 3, 4)))
    last = len(beginnings) - 1
    first, final = (min(int(np.searchsorted(reached, p)), last) for p in (_TAIL, 1 - _TAIL))
    return (
        subject.at(float(years[beginnings[first] - 1])),
        subject.at(float(years[beginnings[final]])),
    )


def rank_causes(subject: SummaryContext, evidence: Evidence) -> tuple[Moved, ...]:
    """Each quantity as one that changed, and each other cause, the likeliest first.

    A spring precedes the tension that is as likely: a part of its loss may be read as tension.
    """
    if not len(evidence.beginnings):
        return ()
    by_direction = evidence.by_direction()
    causes = dict.fromkeys(each.name for each in evidence.directions if not each.members)
    parts = [
        *(
            np.array([j in each.members for each in evidence.directions])
            for j in range(len(subject.quantities))
        ),
        *(np.array([each.name == cause for each in evidence.directions]) for cause in causes),
    ]
    names = [*(each.name for each in subject.quantities), *causes]
    probability = np.array([min(float(by_direction[part].sum()), 1.0) for part in parts])
    is_tension = [name == TENSION for name in names]
    order = np.lexsort([np.array(is_tension), -probability.round(_DIGITS)]).tolist()
    return tuple(
        _as_changed(subject, evidence, names, j, parts[j], float(probability[j])) for j in order
    )


def _as_changed(
    subject: SummaryContext,
    evidence: Evidence,
    names: Sequence[str],
    j: int,
    part: FloatArray,
    probability: float,
) -> Moved:
    """Return what is at `j` of the names, given that it changed: by the directions of its `part`.

    Of a cause that is no quantity the shift is that of the frequencies' mean, a fraction.
    """
    weights, changes = _leading(evidence, part)
    found = evidence.changes_at(changes)
    n = evidence.layout.n
    together, similar = _find_company(evidence, part, names, names[j])
    if j < len(subject.quantities):
        quantity = subject.quantities[j]
        means = np.array([each[0][n:] for each in found])
        sd = np.array([math.sqrt(float((each[1][n + j] ** 2).sum())) for each in found])
        sd = np.hypot(sd, subject.model_uncertainty(means)[:, j])
        shift = shift_of_mixture(quantity, weights, means[:, j], sd)
        end, plane = quantity.end, quantity.plane
    else:
        means = np.array([each[0][:n].mean() for each in found])
        square = np.array([float((each[1][:n].mean(axis=0) ** 2).sum()) for each in found])
        mean_all = float(weights @ means)
        spread = float(weights @ (square + (means - mean_all) ** 2))
        shift, end, plane = (mean_all, math.sqrt(max(spread, 0.0))), None, None
    return Moved(
        quantity=names[j],
        probability=probability,
        shift_mean=shift[0],
        shift_sd=shift[1],
        end=end,
        plane=plane,
        alike=similar,
        together=together,
    )


def _leading(
    evidence: Evidence, part: FloatArray, *, is_last_counted: bool = True
) -> tuple[FloatArray, list[tuple[int, ...]]]:
    """Return the most probable changes in the directions of `part` (D,) and their weights, sum 1.

    Unless `is_last_counted`, changes that begin at the last test are left out.
    """
    log_mass = np.where(part[:, None], evidence.log_mass, -np.inf)
    if not is_last_counted:  # before the weights: those of the others may all underflow
        log_mass[-1] = -np.inf
    flat = log_mass.ravel()
    # Technical: changes that a mixture is made of, the likeliest
    most = min(24, len(flat))
    best = np.argpartition(flat, len(flat) - most)[-most:]
    best = best[np.isfinite(flat[best])]
    weights = np.exp(flat[best] - np.logaddexp.reduce(flat[best])) if len(best) else flat[best]
    places = np.array(np.unravel_index(best, log_mass.shape)).T
    return np.asarray(weights), [tuple(each) for each in places.tolist()]


def _find_company(
    evidence: Evidence, part: FloatArray, names: Sequence[str], itself: str
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return what moves with `itself` in the best direction of `part`, and what fits without it.

    The latter are what directions without it have whose evidence is as good, those aside that only
    add to another such.
    """
    mass = np.logaddexp.reduce(np.moveaxis(evidence.log_mass, 3, 0).reshape(len(part), -1), axis=1)
    sets = [
        frozenset(names[j] for j in each.members) or frozenset([each.name])
        for each in evidence.directions
    ]
    joined: dict[frozenset[str], float] = {}
    for each, log_mass in zip(sets, mass.tolist(), strict=True):
        joined[each] = float(np.logaddexp(joined.get(each, -math.inf), log_mass))
    best = sets[int(np.argmax(np.where(part, mass, -np.inf)))]
    close = [
        each
        for each, log_mass in joined.items()
        if joined[best] - log_mass < _ALIKE_NATS and not each & best
    ]
    fewest = [each for each in close if not any(other < each for other in close)]
    its = {n for j, n in enumerate(names) if n in best}
    chosen = set().union(*fewest) - its
    together = tuple(name for name in names if name in its and name != itself)
    return together, tuple(name for name in names if name in chosen)


def summarize_drifts(
    subject: SummaryContext,
    evidence: Evidence,
    causes: Evidence,
    reading: Reading,
    *,
    is_baseline: bool,
) -> tuple[Drift, ...]:
    """The shift of each quantity since the baseline: slow creep, called changes, and a new one.

    Mean and sd are those of a quantity that has changed: averaged over "nothing has", a small shift
    would pass for none, and be surer the smaller it is. The probability of a shift beyond the
    threshold is averaged over all; where springs trade with the tension, and no frequency moves by
    more than what is to be told, nothing is beyond. As long as no test since the
    baseline says anything, a shift is as open as before any.
    """
    probability = probability_of_change(evidence, subject.options)
    evidence = causes
    loadings = _of_null(evidence, subject)
    nulls = [
        (
            float(weight),
            loadings @ evidence.null_mean[k],
            loadings @ evidence.null_covariance[k] @ loadings.T,
        )
        for k, weight in enumerate(np.exp(evidence.log_null))
    ]
    q = len(subject.quantities)
    everything = np.ones(len(evidence.directions), bool)
    weights, means, sds, changes = _shifts(evidence, everything, loadings)
    none = np.array([each[0] for each in nulls]) * (1 - probability)
    all_weights = np.concatenate([none, probability * weights]) if len(weights) else none
    all_means = np.concatenate([np.array([each[1] for each in nulls]).reshape(-1, q), means])
    sds_of_null = np.array([np.sqrt(np.maximum(np.diag(each[2]), 0)) for each in nulls])
    all_sds = np.hypot(
        np.concatenate([sds_of_null.reshape(-1, q), sds]), subject.model_uncertainty(all_means)
    )
    reported = np.ones(len(all_weights))
    if len(changes) and not evidence.called:
        reported[len(none) :] = _materials(subject, evidence, changes)
    found = []
    for j, quantity in enumerate(subject.quantities):
        chosen = (all_weights, all_means, all_sds)
        if not evidence.called and len(evidence.beginnings):
            part = np.array([j in each.members for each in evidence.directions])
            its = _shifts(evidence, part, loadings, alone=len(evidence.beginnings) == 1)
            if len(its[0]):
                chosen = (*its[:2], np.hypot(its[2], subject.model_uncertainty(its[1])))
        elif not evidence.called and not is_baseline:
            sd = quantity.step_sd * math.sqrt(float(np.exp(LOG_SHARES) @ SIZES**2))
            chosen = np.ones(1), np.zeros((1, q)), np.full((1, q), sd)
        shift = shift_of_mixture(quantity, chosen[0], chosen[1][:, j], chosen[2][:, j])
        moving = (all_sds[:, j] > 0) | (all_means[:, j] != 0)
        threshold = threshold_of(quantity.name, subject.hanger)
        chance = beyond(
            quantity,
            (reported * all_weights)[moving],
            all_means[moving, j],
            all_sds[moving, j],
            threshold,
            subject.options.least_frequency_shift,
        )
        at = reading.test, reading.time
        found.append(drift_of(quantity, subject.hanger, at, shift, chance))
    return tuple(found)


def _of_null(evidence: Evidence, subject: SummaryContext) -> FloatArray:
    """Loadings (q, null) of slow creep and called changes on the shift of each quantity by now."""
    layout, now = evidence.layout, float(evidence.years[-1])
    its = np.hstack([np.zeros((layout.q, layout.n)), np.eye(layout.q)])
    creep = np.zeros((layout.q, len(layout.null)))
    creeping = [is_ratio(each.name) for each in subject.quantities]
    creep[creeping, -1] = now - subject.baseline_years
    blocks = [creep]
    for each in evidence.called:
        blocks.append(its)
        if each.is_ramp:
            blocks.append((now - each.years) * its)
    return np.hstack(blocks)


def _shifts(
    evidence: Evidence, part: FloatArray, loadings: FloatArray, *, alone: bool = True
) -> tuple[FloatArray, FloatArray, FloatArray, list[tuple[int, ...]]]:
    """Weights (B,), means and sds (B, q) of the quantities' shifts, given one change of `part`.

    Unless `alone` may, a change that the last test by itself speaks for does not count.
    """
    layout = evidence.layout
    if not len(evidence.beginnings):
        return np.zeros(0), np.zeros((0, layout.q)), np.zeros((0, layout.q)), []
    weights, changes = _leading(evidence, part, is_last_counted=alone)
    if not changes:
        return weights, np.zeros((0, layout.q)), np.zeros((0, layout.q)), []
    found = evidence.changes_at(changes)
    before, spread = evidence.of_null(changes, loadings)
    means = np.array([mean[layout.n :] for mean, _ in found]) + before
    variance = np.array([np.square(each[layout.n :]).sum(axis=1) for _, each in found]) + spread
    return weights, means, np.sqrt(np.maximum(variance, 0)), changes


def drift_of(
    quantity: WatchedQuantity,
    hanger: Hanger,
    at: tuple[str, datetime],
    shift: tuple[float, float],
    probability: float,
) -> Drift:
    """Return a shift (mean, sd) by a test, its name and time, with that of being beyond."""
    still, mean = value_at(quantity, 0.0), shift[0]
    return Drift(
        hanger=hanger.id,
        test=at[0],
        time=at[1],
        quantity=quantity.name,
        baseline=quantity.baseline,
        value=still * (1 + mean) if is_ratio(quantity.name) else still + mean,
        shift_mean=mean,
        shift_sd=shift[1],
        threshold=threshold_of(quantity.name, hanger),
        probability=probability,
    )


def shift_of_mixture(
    quantity: WatchedQuantity, weights: FloatArray, mean: FloatArray, sd: FloatArray
) -> tuple[float, float]:
    """Return mean and sd of a shift: of normal distributions (B,) in the coordinate.

    There is none with what `weights` leave. By Gauss-Hermite quadrature of seven nodes in each.
    """
    chosen = weights > _NEGLIGIBLE
    weights = weights[chosen]
    mean, sd = mean[chosen], sd[chosen]
    shifts = shift_of(quantity, mean[:, None] + sd[:, None] * _NODES)
    first = float(weights @ shifts @ _WEIGHTS)
    second = float(weights @ (shifts - first) ** 2 @ _WEIGHTS)
    second += (1 - float(weights.sum())) * first**2
    return first, math.sqrt(max(second, 0.0))


def beyond(
    quantity: WatchedQuantity,
    weights: FloatArray,
    mean: FloatArray,
    sd: FloatArray,
    threshold: float,
    least: float = 0.0,
) -> float:
    """Return the probability of a shift beyond a threshold, the likelier way, by the mixture.

    Decades of an end that is as good as clamped move nothing: what moves the frequencies' mean by
    less than `least`, a spring's coordinate, is not beyond.
    """
    chosen = weights > _NEGLIGIBLE
    weights, mean = weights[chosen], mean[chosen]
    sd = np.maximum(sd[chosen], 1e-12)
    low, high = (_coordinate(quantity, sign * threshold) for sign in (-1, 1))
    if not is_ratio(quantity.name):
        low, high = min(low, -least), max(high, least)
    down = float(weights @ scipy.special.ndtr((low - mean) / sd))
    up = float(weights @ scipy.special.ndtr((mean - high) / sd))
    return min(max(down, up), 1.0)


def _coordinate(quantity: WatchedQuantity, shift: float) -> float:
    """Return the coordinate of a shift; infinite where the quantity's table ends before it."""
    is_fraction = is_ratio(quantity.name)
    value = quantity.baseline * (1 + shift) if is_fraction else quantity.baseline + shift
    if not min(quantity.values) < value < max(quantity.values):
        return math.copysign(math.inf, shift)
    return coordinate_of(quantity, value)
