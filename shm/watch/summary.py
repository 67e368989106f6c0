"""What the evidence says after a test: what changed, since when, and how far each quantity is.

All figures are of samples of the posterior: changes by their mass, sizes by their normal fits. A
shift is given with its interval, what the model leaves open included.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from functools import cached_property

import numpy as np

from shm.values import (
    NAN,
    TENSION,
    BoolArray,
    Change,
    CreepRate,
    Drift,
    FloatArray,
    Hanger,
    Moved,
    Reading,
    is_ratio,
)
from shm.values.drift import threshold_of
from shm.watch.causes import Hypotheses
from shm.watch.changepoint import STEP, Evidence, Weighed, log_sum
from shm.watch.history import History
from shm.watch.options import DAYS_PER_YEAR, WatchOptions
from shm.watch.quantities import shift_of, value_at

_TAIL = 0.05  # 90 % lie between
_DIGITS = 3  # probabilities that read alike are ordered by tension last


@dataclass(frozen=True, eq=False)
class Samples:
    """Samples of the posterior, given a change or none: of what has `moved` (draws, n + q) in that
    change, and of each quantity's whole shift since the baseline, `shift` (draws, q)."""

    moved: FloatArray
    shift: FloatArray


@dataclass(frozen=True, eq=False)
class Summary:
    """Makes the summary of one test."""

    hypotheses: Hypotheses
    options: WatchOptions
    hanger: Hanger
    history: History
    evidence: Evidence
    effects: FloatArray

    @cached_property
    def probability(self) -> float:
        """That something has changed since the last call, if changes come at the rate assumed."""
        odds = self.evidence.log_years + math.log(self.options.change_rate_per_year)
        return 1 / (1 + math.exp(min(-odds, 700.0)))

    # ------------------------------------------------------------ change

    def change(self, reading: Reading, outlier: float, against_baseline: int) -> Change:
        """Return the change since the last call."""
        began_after, began_by = self._began(reading)
        return Change(
            evidence_years=math.exp(min(self.evidence.log_years, 700.0)),
            limit_years=self.options.limit_years,
            probability=1 - self.history.unchanged * (1 - self.probability),
            sudden=float(self.evidence.shares[:, STEP].sum()) if self._has_changes else NAN,
            began_after=began_after,
            began_by=began_by,
            moved=self._moved() if self._has_changes else (),
            outlier_probability=outlier,
            material_probability=self._material(),
            against_baseline=against_baseline,
        )

    @property
    def _has_changes(self) -> bool:
        return bool(self.evidence.changes)

    def _material(self) -> float:
        """Return the probability that a change, if there is one, moves the first frequency of a
        plane, or its mean, by more than what is to be reported."""
        if not self._has_changes:
            return 0.0
        moved = self._draw(self.evidence.changes).moved @ self.effects.T
        return float((np.abs(moved) > self.options.least_frequency_shift).any(axis=1).mean())

    def _began(self, reading: Reading) -> tuple[datetime, datetime]:
        """Return between which times the change began, with 90 % probability."""
        beginnings, years = self.evidence.beginnings, self.evidence.years
        if not self._has_changes:
            return reading.time, reading.time
        reached = np.cumsum(self.evidence.shares.sum(axis=(1, 2, 3)))
        last = len(beginnings) - 1
        first, final = (min(int(np.searchsorted(reached, p)), last) for p in (_TAIL, 1 - _TAIL))
        return self._at(years[beginnings[first] - 1]), self._at(years[beginnings[final]])

    def _at(self, years: float) -> datetime:
        return self.history.start + timedelta(days=float(years) * DAYS_PER_YEAR)

    def _moved(self) -> tuple[Moved, ...]:
        """Return each quantity as one that changed, and each other cause, the most probable first.

        A spring precedes the tension that is as probable: a part of its loss may be read as
        tension.
        """
        names = self.hypotheses.names
        by_direction = self.evidence.shares.sum(axis=(0, 1, 3))
        parts = [self._part(name) for name in names]
        probability = np.array([min(float(by_direction[part].sum()), 1.0) for part in parts])
        is_tension = np.array([name == TENSION for name in names])
        order = np.lexsort([is_tension, -probability.round(_DIGITS)]).tolist()
        return tuple(self._as_changed(names[j], parts[j], float(probability[j])) for j in order)

    def _part(self, name: str) -> BoolArray:
        """Return the directions (D,) in which a quantity moves, or of a cause."""
        quantities = [each.name for each in self.hypotheses.quantities]
        if name in quantities:
            j = quantities.index(name)
            return np.array([j in each.members for each in self.evidence.directions])
        return np.array([each.name == name for each in self.evidence.directions])

    def _as_changed(self, name: str, part: BoolArray, probability: float) -> Moved:
        """Return what changed, given that it did: of a cause that is no quantity, by the mean of
        the frequencies."""
        n = self.hypotheses.n
        samples = self._draw(self._changes_of(part))
        quantity = next((each for each in self.hypotheses.quantities if each.name == name), None)
        if quantity is None:
            shift = samples.moved[:, :n].mean(axis=1)
        else:
            j = self.hypotheses.quantities.index(quantity)
            shift = shift_of(quantity, self._left_open(samples.moved[:, n:])[:, j])
        together, alike = self._company(name, part)
        return Moved(
            quantity=name,
            probability=probability,
            shift_mean=float(shift.mean()),
            shift_sd=float(shift.std()),
            end=quantity.end if quantity else None,
            plane=quantity.plane if quantity else None,
            alike=alike,
            together=together,
        )

    def _changes_of(self, part: BoolArray) -> list[Weighed]:
        """Return the weighed changes in some directions."""
        return [each for each in self.evidence.changes if part[each.place[2]]]

    def _has_sound_baseline(self, change: Weighed) -> bool:
        """Return whether one visit of the baseline at least is sound if this has changed: else
        nothing is known of how far it is from there."""
        visits = self.history.visit[: self.options.baseline_tests]
        return bool((change.fit.labels[visits, 0] > 0.5).any())

    def _company(self, name: str, part: BoolArray) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Return what moves with a name in its most probable direction; and what does as well
        without it, but for what only adds to another such."""
        names, mass = self.hypotheses.names, self.evidence.log_mass
        by_direction = np.array([log_sum(each) for each in np.moveaxis(mass, 2, 0)])
        sets = [
            frozenset(names[j] for j in each.members) or frozenset([each.name])
            for each in self.evidence.directions
        ]
        joined: dict[frozenset[str], float] = {}
        for one, log_mass in zip(sets, by_direction.tolist(), strict=True):
            joined[one] = float(np.logaddexp(joined.get(one, -math.inf), log_mass))
        first = sets[int(np.argmax(np.where(part, by_direction, -np.inf)))]
        close = [
            one
            for one in joined
            if name not in one and joined[first] - joined[one] < self.options.unnamed_nats
        ]
        least = [one for one in close if not any(other < one for other in close)]
        alike = [one for one in names if any(one in each for each in least)]
        return tuple(one for one in names if one in first - {name}), tuple(alike)

    # ------------------------------------------------------------ shifts

    def drifts(self, reading: Reading) -> tuple[Drift, ...]:
        """Return the shifts of all quantities since the baseline by now.

        Each is given that its quantity has changed, where nothing is called yet, and as probable
        beyond its threshold as all changes and none have it.
        """
        none, anything = self._draw([]), self._draw(self.evidence.changes)
        found = []
        for j, quantity in enumerate(self.hypotheses.quantities):
            threshold = threshold_of(quantity.name, self.hanger)
            beyond = self._beyond(none, j, threshold) * (1 - self.probability)
            if self._has_changes:
                beyond = beyond + self.probability * self._beyond(anything, j, threshold)
            own = none
            if not self._has_called:
                changes = self._changes_of(self._part(quantity.name))
                own = self._draw([each for each in changes if self._has_sound_baseline(each)])
            if self._has_called and self._has_changes:
                is_changed = np.arange(len(none.shift)) < self.probability * len(none.shift)
                shift = np.where(is_changed, anything.shift[:, j], none.shift[:, j])
            else:
                shift = own.shift[:, j]
            moved = shift_of(quantity, shift)
            mean = float(moved.mean())
            rest = value_at(quantity, 0.0)
            found.append(
                Drift(
                    hanger=self.hanger.id,
                    test=reading.test,
                    time=reading.time,
                    quantity=quantity.name,
                    baseline=quantity.baseline,
                    value=rest * (1 + mean) if is_ratio(quantity.name) else rest + mean,
                    shift_mean=mean,
                    shift_sd=float(moved.std()),
                    threshold=threshold,
                    probability=float(beyond.max()),
                )
            )
        return tuple(found)

    @property
    def _has_called(self) -> bool:
        return bool(len(self.history.called))

    def _beyond(self, samples: Samples, j: int, threshold: float) -> FloatArray:
        """Return the probability of a shift of a quantity beyond its threshold, down and up.

        Decades of an end that is as good as clamped move nothing: a shift that moves the mean
        frequency by less than what is to be reported is not beyond, nor is such a change.
        """
        quantity = self.hypotheses.quantities[j]
        shift = shift_of(quantity, samples.shift[:, j])
        least = self.options.least_frequency_shift
        is_material = np.ones(len(shift), bool)
        if not is_ratio(quantity.name):
            is_material = np.abs(samples.shift[:, j]) >= least
        if not self._has_called:
            effect = np.abs(samples.moved @ self.effects.T) > least
            is_material &= effect.any(axis=1)
        return np.array([(is_material & (way * shift > threshold)).mean() for way in (-1, 1)])

    def creep(self) -> CreepRate | None:
        """Return the tension's creep if nothing but what was called changes; None where that is
        improbable."""
        if self.probability > 0.5:
            return None
        at, null = len(self.hypotheses.null_sd) - 1, self.evidence.null
        sd = math.sqrt(float(null.covariance[at, at]))
        return CreepRate(float(null.mean[at]), sd, self.options.creep_per_year_sd)

    # ------------------------------------------------------------ samples

    def _draw(self, changes: Sequence[Weighed]) -> Samples:
        """Return samples given one of `changes`, by their masses; given no change where there is
        none."""
        rng = np.random.default_rng(self.options.draws)
        draws, n, q = self.options.draws, self.hypotheses.n, self.hypotheses.q
        loadings = self._null_loadings()
        if not changes:
            null = self.evidence.null
            return Samples(
                np.zeros((draws, n + q)),
                self._left_open(_normal(null.mean, null.covariance, loadings, draws, rng)),
            )
        mass = np.array([each.log_mass for each in changes])
        share = np.cumsum(np.exp(mass - log_sum(mass)))
        chosen = np.searchsorted(share[:-1], (np.arange(draws) + 0.5) / draws)
        moved, before = np.zeros((draws, n + q)), np.zeros((draws, q))
        for k in np.unique(chosen).tolist():
            rows = np.flatnonzero(chosen == k)
            each = changes[k]
            *_, d, size = each.place
            factor = self.evidence.sizes[size] * self.evidence.directions[d].factor
            factor = factor * self.evidence.extent(each.place)
            both = np.zeros((q + n + q, loadings.shape[1] + factor.shape[1]))
            both[:q, : loadings.shape[1]] = loadings
            both[q:, loadings.shape[1] :] = factor
            drawn = _normal(each.fit.mean, each.fit.covariance, both, len(rows), rng)
            before[rows], moved[rows] = drawn[:, :q], drawn[:, q:]
        return Samples(moved, self._left_open(before + moved[:, n:]))

    def _null_loadings(self) -> FloatArray:
        """Return loadings (q, null) of creep and called changes on each quantity's shift by now."""
        n, q = self.hypotheses.n, self.hypotheses.q
        years = self.evidence.years
        baseline = float(years[: self.options.baseline_tests].mean())
        creep = np.zeros((q, len(self.hypotheses.null_sd)))
        creeping = [is_ratio(each.name) for each in self.hypotheses.quantities]
        creep[creeping, -1] = float(years[-1]) - baseline
        own = np.hstack([np.zeros((q, n)), np.eye(q)])
        blocks = [creep]
        for _, since, is_ramp in self.history.called.tolist():
            blocks.append(own)
            if is_ramp:
                blocks.append((float(years[-1]) - since) * own)
        known = sum(each.shape[1] for each in blocks)
        recurring = len(self.evidence.null.mean) - known
        return np.hstack([*blocks, np.zeros((q, recurring))])

    def _left_open(self, shifts: FloatArray) -> FloatArray:
        """Return shifts (draws, q) with what the model leaves open: a fraction of each, as the
        baseline's own value is open."""
        scale = np.array([each.scale_sd for each in self.hypotheses.quantities])
        rng = np.random.default_rng(self.options.draws + 1)
        return np.asarray(shifts * (1 + scale * rng.standard_normal(shifts.shape)))


def _normal(
    mean: FloatArray,
    covariance: FloatArray,
    loadings: FloatArray,
    draws: int,
    rng: np.random.Generator,
) -> FloatArray:
    """Return draws (draws, rows) of `loadings` (rows, p) of normal parameters."""
    spread = loadings @ covariance @ loadings.T
    strength, axes = np.linalg.eigh((spread + spread.T) / 2)
    factor = axes * np.sqrt(np.maximum(strength, 0.0))
    return np.asarray(loadings @ mean + rng.standard_normal((draws, len(strength))) @ factor.T)
