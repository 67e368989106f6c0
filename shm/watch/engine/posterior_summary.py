"""Summary of the evidence after a test: the change, its onset, and the shift of each quantity.

Shifts are in the units that people read, by draws of the changes and of the null's parameters.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from functools import cache

import numpy as np
import scipy

from shm.values import (
    NAN,
    TENSION,
    BoolArray,
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
from shm.watch.engine.change_point import LOG_SHARES, SAMPLES, SIZES, STEP, Evidence
from shm.watch.engine.limits import LIMITS
from shm.watch.engine.options import DAYS_PER_YEAR, WatchOptions
from shm.watch.engine.quantities import shift_of, value_at


@cache
def _normal() -> FloatArray:
    """Return draws (samples,) of a standard normal distribution, evenly in probability."""
    return np.asarray(scipy.special.ndtri((np.arange(SAMPLES) + 0.5) / SAMPLES))


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

    def model_uncertainty(self, shifts: FloatArray) -> FloatArray:
        """Return standard deviations (draws, q) of `shifts` (draws, q) that the model leaves open.

        A share of each, as the baseline's own values are open; some of what ends do may be
        tension's."""
        its = shifts * [each.scale_sd for each in self.quantities]
        is_tension = np.array([each.name == TENSION for each in self.quantities])
        if is_tension.any() and not is_tension.all():
            of_ends = np.abs(shifts[:, ~is_tension]).sum(axis=1, keepdims=True)
            first = len(self.effects.T) - len(self.quantities)
            of_tension = self.effects[1::2, first:][:, is_tension].mean()
            its[:, is_tension] = np.hypot(its[:, is_tension], LIMITS.traded * of_ends / of_tension)
        return np.asarray(its)

    def with_model(self, shifts: FloatArray) -> FloatArray:
        """Return draws of shifts (draws, q) with what the model leaves open."""
        normal = np.random.default_rng(2).permutation(_normal())[: len(shifts), None]
        return np.asarray(shifts + self.model_uncertainty(shifts) * normal)


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
        sudden=float(causes.shares[:, :, STEP].sum()) if len(causes.beginnings) else NAN,
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
    changes, _ = evidence.draw()
    return float(_are_material(subject, evidence, changes).mean()) if len(changes) else 0.0


def _are_material(subject: SummaryContext, evidence: Evidence, changes: FloatArray) -> BoolArray:
    """The same (draws,) of each; of any mode, where no doubt is left that something changed."""
    effects, least = subject.effects, subject.options.least_frequency_shift
    if evidence.log_evidence > math.log(LIMITS.beyond_doubt * subject.options.limit_years):
        effects = np.vstack([effects, subject.by_mode])
    return np.asarray((np.abs(changes @ effects.T) > least).any(axis=1))


def _began(
    subject: SummaryContext, evidence: Evidence, reading: Reading
) -> tuple[datetime, datetime]:
    """Between which times the change began, with 90 % probability; the test's own if none can."""
    beginnings, years = evidence.beginnings, evidence.years
    if not len(beginnings):
        return reading.time, reading.time
    reached = np.cumsum(evidence.shares.sum(axis=(1, 2, 3, 4)))
    last = len(beginnings) - 1
    first, final = (
        min(int(np.searchsorted(reached, p)), last)
        for p in (LIMITS.posterior_summary_tail, 1 - LIMITS.posterior_summary_tail)
    )
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
    order = np.lexsort(
        [np.array(is_tension), -probability.round(LIMITS.posterior_summary_digits)]
    ).tolist()
    return tuple(
        _as_changed(subject, evidence, names, j, parts[j], float(probability[j])) for j in order
    )


def _as_changed(
    subject: SummaryContext,
    evidence: Evidence,
    names: Sequence[str],
    j: int,
    part: BoolArray,
    probability: float,
) -> Moved:
    """Return what is at `j` of the names, given that it changed: by the directions of its `part`.

    Of a cause that is no quantity the shift is that of the frequencies' mean, a fraction.
    """
    changes, _ = evidence.draw(part)
    n = evidence.layout.n
    together, similar = _find_company(evidence, part, names, names[j])
    shift, end, plane = changes[:, :n].mean(axis=1), None, None
    if j < len(subject.quantities):
        quantity = subject.quantities[j]
        shift = shift_of(quantity, subject.with_model(changes[:, n:])[:, j])
        end, plane = quantity.end, quantity.plane
    return Moved(
        quantity=names[j],
        probability=probability,
        shift_mean=float(shift.mean()) if len(shift) else 0.0,
        shift_sd=float(shift.std()) if len(shift) else 0.0,
        end=end,
        plane=plane,
        alike=similar,
        together=together,
    )


def _find_company(
    evidence: Evidence, part: BoolArray, names: Sequence[str], itself: str
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
        if joined[best] - log_mass < LIMITS.alike_nats and not each & best
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
    unmoved = subject.with_model(evidence.draw_null(loadings))
    moved, changes = _draw_shifts(subject, evidence, None, loadings)
    probability = probability if len(moved) else 0.0
    is_material = np.ones(len(moved), bool)
    if len(moved) and not evidence.called:
        is_material = _are_material(subject, evidence, changes)
    found = []
    for j, quantity in enumerate(subject.quantities):
        shifts = _mix(unmoved, moved, probability)[:, j]
        if not evidence.called and len(evidence.beginnings):
            part = np.array([j in each.members for each in evidence.directions])
            is_alone = len(evidence.beginnings) == 1
            its, _ = _draw_shifts(subject, evidence, part, loadings, is_last_counted=is_alone)
            shifts = its[:, j] if len(its) else shifts
        elif not evidence.called and not is_baseline:
            shifts = quantity.step_sd * math.sqrt(float(np.exp(LOG_SHARES) @ SIZES**2)) * _normal()
        threshold = threshold_of(quantity.name, subject.hanger)
        least = subject.options.least_frequency_shift
        down, up = (
            (1 - probability) * _share(_is_beyond(quantity, unmoved[:, j], threshold, way, least))
            + probability
            * _share(is_material & _is_beyond(quantity, moved[:, j], threshold, way, least))
            for way in (-1, 1)
        )
        at = reading.test, reading.time
        found.append(drift_of(quantity, subject.hanger, at, shifts, max(down, up)))
    return tuple(found)


def _share(chosen: BoolArray) -> float:
    return float(chosen.mean()) if len(chosen) else 0.0


def _mix(unmoved: FloatArray, moved: FloatArray, probability: float) -> FloatArray:
    """Return draws, of which as many are `moved` as is probable."""
    many = round(probability * len(moved))
    # Technical: draws of either that lie anywhere among them
    few = np.arange(many) * max(len(moved), 1) // max(many, 1)
    rest = np.arange(SAMPLES - many) * SAMPLES // max(SAMPLES - many, 1)
    return np.concatenate([unmoved[rest], moved[few]])


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


def _draw_shifts(
    subject: SummaryContext,
    evidence: Evidence,
    part: BoolArray | None,
    loadings: FloatArray,
    *,
    is_last_counted: bool = True,
) -> tuple[FloatArray, FloatArray]:
    """Draw the quantities' shifts (draws, q), given one change of `part`, and the changes."""
    changes, before = evidence.draw(part, loadings, is_last_counted=is_last_counted)
    return subject.with_model(changes[:, evidence.layout.n :] + before), changes


def drift_of(
    quantity: WatchedQuantity,
    hanger: Hanger,
    at: tuple[str, datetime],
    shifts: FloatArray,
    probability: float,
) -> Drift:
    """Return the shift by a test, its name and time: from draws (draws,) in the coordinate.

    `probability` is that of being beyond.
    """
    still, shift = value_at(quantity, 0.0), shift_of(quantity, shifts)
    mean = float(shift.mean())
    return Drift(
        hanger=hanger.id,
        test=at[0],
        time=at[1],
        quantity=quantity.name,
        baseline=quantity.baseline,
        value=still * (1 + mean) if is_ratio(quantity.name) else still + mean,
        shift_mean=mean,
        shift_sd=float(shift.std()),
        threshold=threshold_of(quantity.name, hanger),
        probability=probability,
    )


def drift_of_normal(
    quantity: WatchedQuantity, hanger: Hanger, at: tuple[str, datetime], mean: float, sd: float
) -> Drift:
    """Return the shift of which the coordinate has a normal law."""
    shifts, threshold = mean + sd * _normal(), threshold_of(quantity.name, hanger)
    ways = (_share(_is_beyond(quantity, shifts, threshold, way, 0.0)) for way in (-1, 1))
    return drift_of(quantity, hanger, at, shifts, max(ways))


def _is_beyond(
    quantity: WatchedQuantity, x: FloatArray, threshold: float, way: int, least: float
) -> BoolArray:
    """Return which draws `x` (draws,) in the coordinate are beyond a threshold, in one way.

    Decades of an end that is as good as clamped move nothing: what moves the frequencies' mean by
    less than `least`, a spring's coordinate, is not beyond.
    """
    beyond = way * shift_of(quantity, x) > threshold
    if not is_ratio(quantity.name):
        beyond &= way * x > least
    return np.asarray(beyond)
