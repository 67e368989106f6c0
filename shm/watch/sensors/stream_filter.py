"""The tension of a hanger reading by reading: a bank of Kalman filters and the changes they miss.

Each filter's state is what the tension does without a change: a level that wanders over the
seasons, two stationary wanders (of days, of hours) and what temperature, excitation and wind do to
it, learnt as it goes. The filters differ in how far the wanders go; which of them hold, the
readings say. A change at any past time would have left its signature in the innovations since
(Willsky and Jones 1976, A generalized likelihood ratio approach; Basseville and Nikiforov 1993,
chapter 7): it is carried along by the filter's own recursion, so that memory and time are bounded.

The evidence is the Shiryaev-Roberts sum of likelihood ratios over all beginnings, steps and ramps:
without a change its mean grows by a year in a year, so that the mean time to a false call is at
least the limit (Pollak 1985). Readings far off count as if they were `CLIP` sds off: no lone
reading, however wild, calls a change.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
import scipy

from shm.values import FloatArray, IntArray
from shm.watch.engine.limits import LIMITS
from shm.watch.engine.options import DAYS_PER_YEAR

CLIP = 3.5
"""Sds: a reading then adds 4.5 to a log likelihood ratio, of the 13.7 that 100 years take."""
LEVEL, SLOPE, SLOW, FAST, _RATE, FEATURES = range(6)
"""Where the state has what; the coefficients of the conditions begin at FEATURES."""
_FAST_SD = np.geomspace(2e-4, 1e-2, 8)
_SLOW_SD = 0.25 * _FAST_SD


@dataclass(frozen=True, eq=False)
class Bank:
    """m filters of states (p,), and c possible beginnings of a change.

    `effect` (m, c, 2, p) is by what the state is off for a unit of a step, or of a slope a day;
    `score` and `information` (m, c, 2) what the innovations say of its size. Beginnings lie between
    `after_day` and `by_day` (c,) and stand for `span_days`.
    """

    day: float
    mean: FloatArray
    covariance: FloatArray
    log_weight: FloatArray
    effect: FloatArray
    score: FloatArray
    information: FloatArray
    after_day: FloatArray
    by_day: FloatArray
    span_days: FloatArray
    excess: FloatArray = field(default_factory=lambda: np.ones(len(LIMITS.ages_days)))
    watched: float = 0.0

    @classmethod
    def begun(cls, day: float, coefficient_sd: FloatArray) -> Bank:
        m, p = len(_FAST_SD), FEATURES + len(coefficient_sd)
        variance = np.zeros((m, p))
        variance[:, LEVEL] = LIMITS.first_sd**2
        variance[:, SLOW] = _SLOW_SD**2
        variance[:, FAST] = variance[:, _RATE] = _FAST_SD**2
        variance[:, FEATURES:] = coefficient_sd**2
        return cls(
            day,
            np.zeros((m, p)),
            variance[:, :, None] * np.eye(p),
            np.zeros(m),
            **_no_beginnings(m, p),
        )

    @cached_property
    def weight(self) -> FloatArray:
        """Of each filter (m,), by how it has held; they add up to 1."""
        weight = np.exp(self.log_weight - self.log_weight.max())
        return np.asarray(weight / weight.sum())

    def along(self, direction: FloatArray) -> tuple[float, float]:
        """Mean and sd of a combination (p,) of the state, over the bank."""
        means = self.mean @ direction
        middle = float(self.weight @ means)
        within = np.einsum("i,mij,j->m", direction, self.covariance, direction)
        return middle, math.sqrt(float(self.weight @ (within + (means - middle) ** 2)))

    def advanced(self, day: float, coefficient_sd: FloatArray) -> Bank:
        """To another day, without a reading."""
        days = round(day - self.day, 9)
        step, back, noise = _transition(days, self.mean.shape[1])
        covariance = step @ self.covariance @ np.swapaxes(step, 1, 2) + noise
        wandered = (LIMITS.within_a_year * coefficient_sd) ** 2 * days / DAYS_PER_YEAR
        covariance[:, range(FEATURES, len(step[0])), range(FEATURES, len(step[0]))] += wandered
        return replace(
            self,
            day=day,
            mean=np.einsum("mij,mj->mi", step, self.mean),
            covariance=covariance,
            log_weight=self.log_weight * math.exp(-days / LIMITS.memory_days),
            effect=self.effect @ back,
        )

    def with_beginning(self, after_day: float) -> Bank:
        """With a change that may have begun since `after_day`; the least telling one is merged."""
        m, p = self.mean.shape
        born = np.zeros((m, 1, 2, p), np.float32)
        born[:, :, 0, LEVEL] = 1
        born[:, :, 1, LEVEL], born[:, :, 1, SLOPE] = self.day - after_day, 1
        zero = np.zeros((m, 1, 2))
        bank = replace(
            self,
            effect=np.concatenate([self.effect, born], axis=1),
            score=np.concatenate([self.score, zero], axis=1),
            information=np.concatenate([self.information, zero], axis=1),
            after_day=np.append(self.after_day, after_day),
            by_day=np.append(self.by_day, self.day),
            span_days=np.append(self.span_days, self.day - after_day),
        )
        return bank._thinned()

    def _thinned(self) -> Bank:
        """Without the oldest, or that beginning which lies nearest to the next for its age."""
        if self.day - self.by_day[0] > LIMITS.oldest_days:
            return self._selected(np.arange(1, len(self.by_day)))
        if len(self.by_day) <= LIMITS.most:
            return self
        old = self.by_day[: len(self.by_day) - LIMITS.recent]
        drop = int(np.argmin(np.diff(old) / (self.day - old[1:])))
        spans = self.span_days.copy()
        spans[drop + 1] += spans[drop]
        after = self.after_day.copy()
        after[drop + 1] = after[drop]
        bank = replace(self, span_days=spans, after_day=after)
        return bank._selected(np.delete(np.arange(len(spans)), drop))

    def _selected(self, chosen: IntArray) -> Bank:
        return replace(
            self,
            effect=self.effect[:, chosen],
            score=self.score[:, chosen],
            information=self.information[:, chosen],
            after_day=self.after_day[chosen],
            by_day=self.by_day[chosen],
            span_days=self.span_days[chosen],
        )

    def seen(self, value: float, variance: float, conditions: FloatArray) -> Bank:
        """After a reading `value` of ln T's shift under `conditions` (p - FEATURES,)."""
        design = self.design(conditions)
        missed = value - self.mean @ design
        its = variance + (LIMITS.unsteady * _FAST_SD) ** 2
        spread = np.einsum("i,mij,j->m", design, self.covariance, design) + its
        clipped = np.maximum(spread, missed**2 / CLIP**2)
        gain = self.covariance @ design / clipped[:, None]
        # The loss is bounded as the gain of a change is: else a large wander would explain it.
        fit = -np.log(spread) / 2 - np.minimum(missed**2 / spread, CLIP**2) / 2
        foreseen = self.effect @ design.astype(np.float32)
        pulled = foreseen[..., None] * gain[:, None, None].astype(np.float32)
        bank = replace(
            self,
            mean=self.mean + gain * missed[:, None],
            covariance=self.covariance - gain[:, :, None] * gain[:, None] * clipped[:, None, None],
            log_weight=self.log_weight + fit - fit.max(),
            effect=self.effect - pulled,
            score=self.score + foreseen * (missed / clipped)[:, None, None],
            information=self.information + foreseen**2 / clipped[:, None, None],
        )
        return bank._with_excess() if len(self.by_day) > LIMITS.recent else bank

    def _with_excess(self) -> Bank:
        """Having learnt from the scores of steps that may have begun a quarter, one, four days ago.
        A wander that the model lacks shows in them as if there were changes all the time."""
        age = self.day - self.by_day
        at = [int(np.abs(np.log(age[:-1] / each)).argmin()) for each in LIMITS.ages_days]
        square = self.weight @ (self.score[:, at, 0] ** 2 / self.information[:, at, 0])
        share = 1 / min(self.watched + LIMITS.model_readings, LIMITS.excess_readings)
        excess = self.excess + share * (np.minimum(square, LIMITS.largest_square) - self.excess)
        return replace(self, excess=excess, watched=self.watched + 1)

    def design(self, conditions: FloatArray) -> FloatArray:
        """Return what a reading sees of the state (p,)."""
        return np.concatenate([[1.0, 0.0, 1.0, 1.0, 0.0], conditions])

    @property
    def _tempered(self) -> FloatArray:
        """By what the evidence of each beginning is divided (c, 1)."""
        age = np.log(np.maximum(self.day - self.by_day, LIMITS.ages_days[0]))
        return np.maximum(np.interp(age, np.log(LIMITS.ages_days), self.excess), 1.0)[:, None]

    def evidence(self, least_shift: float) -> Evidence:
        """Return what all readings say of a change; material is one by more than `least_shift`."""
        if not len(self.by_day):
            return NOTHING
        prior = 1 / np.array([LIMITS.step_sd, LIMITS.slope_sd]) ** 2
        score, precision = self.score / self._tempered, self.information / self._tempered + prior
        size = score / precision
        log_ratio = (score * size + np.log(prior / precision)) / 2
        shares = self.weight[:, None, None] * (self.span_days / 2)[:, None]
        largest = float(log_ratio.max())
        chance = shares * np.exp(log_ratio - largest)
        total = largest + math.log(float(chance.sum()))
        chance /= chance.sum()
        reach = np.stack([np.ones_like(self.by_day), self.day - self.after_day], axis=1)
        shift, sd = size * reach, reach / np.sqrt(precision)
        beyond = scipy.special.ndtr((np.abs(shift) - least_shift) / sd)
        began = np.cumsum(chance.sum(axis=(0, 2)))
        first, last = np.searchsorted(began, [0.05, 0.95 * began[-1]])
        at, kind = np.unravel_index(int(chance.sum(axis=0).argmax()), chance.shape[1:])
        # Sizes of the likeliest beginning: those of others are of other days.
        share, each, its_sd = (part[:, at, kind] for part in (chance, shift, sd))
        share = share / share.sum()
        mean = float(share @ each)
        return Evidence(
            years=math.exp(min(total, 100.0)) / DAYS_PER_YEAR / LIMITS.overstated,
            shift=mean,
            shift_sd=math.sqrt(float(share @ (its_sd**2 + (each - mean) ** 2))),
            material=float((chance * beyond).sum()),
            sudden=float(chance[:, :, 0].sum()),
            after_day=float(self.after_day[first]),
            by_day=float(self.by_day[last]),
            beginning=int(at),
            kind=int(kind),
        )

    def changed(self, evidence: Evidence) -> Bank:
        """With the likeliest change taken into the state, and none that began before now."""
        reach = (1.0, self.day - self.after_day[evidence.beginning])[evidence.kind]
        effect = self.effect[:, evidence.beginning, evidence.kind].astype(np.float64) / reach
        more = effect[:, :, None] * effect[:, None, :] * evidence.shift_sd**2
        bank = replace(
            self, mean=self.mean + effect * evidence.shift, covariance=self.covariance + more
        )
        return bank.without_beginnings()

    def absorbed(self, evidence: Evidence) -> Bank:
        """With the likeliest change taken for none: what is read from here on is without it."""
        bank = self.changed(evidence)
        mean = bank.mean.copy()
        mean[:, LEVEL] -= evidence.shift
        return replace(bank, mean=mean)

    @property
    def wander_sd(self) -> float:
        """By what ln T wanders within a day or two."""
        return math.sqrt(float(self.weight @ (_FAST_SD**2 + _SLOW_SD**2)))

    def without_beginnings(self) -> Bank:
        """From here on only what begins later is a change."""
        return replace(self, **_no_beginnings(*self.mean.shape))


@lru_cache(maxsize=64)
def _transition(days: float, p: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Of states (m, p, p) over some days; transposed, for effects; and the noise that they add."""
    m, slow = len(_FAST_SD), math.exp(-days / LIMITS.slow_days)
    step = np.tile(np.eye(p), (m, 1, 1))
    step[:, LEVEL, SLOPE], step[:, SLOPE, SLOPE] = days, math.exp(-days / LIMITS.slope_days)
    step[:, SLOW, SLOW] = slow
    # A Matern process of order 3/2: what the weather does comes smoothly.
    past = days / LIMITS.fast_days
    fast = math.exp(-past) * np.array([[1 + past, past], [-past, 1 - past]])
    step[:, FAST:FEATURES, FAST:FEATURES] = fast
    noise = np.zeros((m, p, p))
    noise[:, LEVEL, LEVEL] = LIMITS.season_per_root_year**2 * days / DAYS_PER_YEAR
    noise[:, SLOW, SLOW] = _SLOW_SD**2 * (1 - slow**2)
    lost = np.eye(2) - fast @ fast.T
    noise[:, FAST:FEATURES, FAST:FEATURES] = _FAST_SD[:, None, None] ** 2 * lost
    return step, np.swapaxes(step, 1, 2)[:, None].astype(np.float32), noise


def _no_beginnings(m: int, p: int) -> dict[str, Any]:
    days = dict.fromkeys(("after_day", "by_day", "span_days"), np.zeros(0))
    sums = dict.fromkeys(("score", "information"), np.zeros((m, 0, 2)))
    return {"effect": np.zeros((m, 0, 2, p), np.float32), **sums, **days}


@dataclass(frozen=True)
class Evidence:
    """The Shiryaev-Roberts statistic in years, and the change behind it: its shift of ln T by now.

    `beginning` and `kind` (0 step, 1 ramp) are the likeliest; 90 % lie between the two days.
    """

    years: float
    shift: float
    shift_sd: float
    material: float
    sudden: float
    after_day: float
    by_day: float
    beginning: int
    kind: int


NOTHING = Evidence(0.0, 0.0, math.inf, 0.0, 0.5, math.nan, math.nan, -1, 0)
"""Before any beginning is possible."""
