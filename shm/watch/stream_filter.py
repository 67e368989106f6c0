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
from dataclasses import dataclass, replace

import numpy as np
import scipy

from shm.values import FloatArray, IntArray
from shm.watch.conditions import DAYS_PER_YEAR
from shm.watch.local_level import corrected

CLIP = 3.0
"""Sds: a reading then adds 4.5 to a log likelihood ratio, of the 13.7 that 100 years take."""
LEVEL, SLOPE, SLOW, FAST, _RATE, FEATURES = range(6)
"""Where the state has what; the coefficients of the conditions begin at FEATURES."""
# The tension's wander is a fraction of it. Season: a deck's bearings and joints, relaxation of
# 0.2 % a year (`WatchOptions.creep_per_year_sd`) and as much again. Days: weather, moisture, loads
# that stay. Hours: sun on one side, traffic. Judgement, after the worlds of `tests/worlds`.
_SEASON_PER_ROOT_YEAR = 3e-3
_SLOW_DAYS, _SLOW_SD = 10.0, 1e-3
_FAST_DAYS = np.repeat([1.0, 4.0], 4) / 24
_FAST_SD = np.tile([2e-4, 7e-4, 2e-3, 4e-3], 2)
_UNSTEADY = (
    0.2  # judgement: of the hours' wander, by what each reading is off on its own: live load
)
_SLOPE_DAYS = 60.0  # judgement: how long a loss goes on at one rate
_WITHIN_A_YEAR = 0.3  # judgement: of a coefficient's prior sd, by what it wanders in a year
_FIRST_SD = 0.01  # of the level at the first reading, against the table made of that very reading
_MEMORY_DAYS = 60.0  # judgement: over which the bank forgets which of its filters held
# Judgement: a change of 2 % a step, or of 0.15 % a day; ten times more or less costs it log 10.
_STEP_SD, _SLOPE_SD = 0.02, 1.5e-3
_MOST, _RECENT = 32, 10  # technical: beginnings kept, the newest all, older ones ever farther apart
_OLDEST_DAYS = 180.0  # judgement: what is slower is the season's


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

    @classmethod
    def begun(cls, day: float, coefficient_sd: FloatArray) -> Bank:
        m, p = len(_FAST_SD), FEATURES + len(coefficient_sd)
        variance = np.zeros((m, p))
        variance[:, LEVEL] = _FIRST_SD**2
        variance[:, SLOW] = _SLOW_SD**2
        variance[:, FAST] = variance[:, _RATE] = _FAST_SD**2
        variance[:, FEATURES:] = coefficient_sd**2
        return cls(
            day,
            np.zeros((m, p)),
            variance[:, :, None] * np.eye(p),
            np.zeros(m),
            *_no_beginnings(m, p),
        )

    @property
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
        days = day - self.day
        m, p = self.mean.shape
        slope, slow = math.exp(-days / _SLOPE_DAYS), math.exp(-days / _SLOW_DAYS)
        step = np.tile(np.eye(p), (m, 1, 1))
        step[:, LEVEL, SLOPE], step[:, SLOPE, SLOPE], step[:, SLOW, SLOW] = days, slope, slow
        # A Matern process of order 3/2: what the weather does comes smoothly.
        past = days / _FAST_DAYS
        fast = np.exp(-past) * np.array([[1 + past, past], [-past, 1 - past]])
        step[:, FAST:FEATURES, FAST:FEATURES] = np.moveaxis(fast, 2, 0)
        noise = np.zeros((m, p))
        noise[:, LEVEL] = _SEASON_PER_ROOT_YEAR**2 * days / DAYS_PER_YEAR
        noise[:, SLOW] = _SLOW_SD**2 * (1 - slow**2)
        noise[:, FEATURES:] = (_WITHIN_A_YEAR * coefficient_sd) ** 2 * days / DAYS_PER_YEAR
        back = np.swapaxes(step, 1, 2)
        covariance = step @ self.covariance @ back + noise[:, :, None] * np.eye(p)
        lost = np.eye(2) - np.einsum("ijm,kjm->mik", fast, fast)
        covariance[:, FAST:FEATURES, FAST:FEATURES] += _FAST_SD[:, None, None] ** 2 * lost
        return replace(
            self,
            day=day,
            mean=np.einsum("mij,mj->mi", step, self.mean),
            covariance=covariance,
            log_weight=self.log_weight * math.exp(-days / _MEMORY_DAYS),
            effect=self.effect @ back[:, None].astype(np.float32),
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
        if self.day - self.by_day[0] > _OLDEST_DAYS:
            return self._kept(np.arange(1, len(self.by_day)))
        if len(self.by_day) <= _MOST:
            return self
        old = self.by_day[: len(self.by_day) - _RECENT]
        drop = int(np.argmin(np.diff(old) / (self.day - old[1:])))
        spans = self.span_days.copy()
        spans[drop + 1] += spans[drop]
        after = self.after_day.copy()
        after[drop + 1] = after[drop]
        bank = replace(self, span_days=spans, after_day=after)
        return bank._kept(np.delete(np.arange(len(spans)), drop))

    def _kept(self, chosen: IntArray) -> Bank:
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
        own = variance + (_UNSTEADY * _FAST_SD) ** 2
        spread = np.einsum("i,mij,j->m", design, self.covariance, design) + own
        clipped = np.maximum(spread, missed**2 / CLIP**2)
        noise = (own + clipped - spread)[:, None, None]
        step = corrected(self.mean, self.covariance, design[None], np.array([value]), noise)
        # The loss is bounded as the gain of a change is: else a large wander would explain it.
        fit = -np.log(spread) / 2 - np.minimum(missed**2 / spread, CLIP**2) / 2
        foreseen = self.effect @ design.astype(np.float32)
        gain = step.gain[:, None, None, :, 0].astype(np.float32)
        return replace(
            self,
            mean=step.mean_after,
            covariance=step.covariance_after,
            log_weight=self.log_weight + fit - fit.max(),
            effect=self.effect - foreseen[..., None] * gain,
            score=self.score + foreseen * (missed / clipped)[:, None, None],
            information=self.information + foreseen**2 / clipped[:, None, None],
        )

    def design(self, conditions: FloatArray) -> FloatArray:
        """What a reading sees of the state (p,)."""
        return np.concatenate([[1.0, 0.0, 1.0, 1.0, 0.0], conditions])

    def evidence(self, least_shift: float) -> Evidence:
        """What all readings say of a change; material is one by more than `least_shift`."""
        if not len(self.by_day):
            return NOTHING
        prior = 1 / np.array([_STEP_SD, _SLOPE_SD]) ** 2
        precision = self.information + prior
        size = self.score / precision
        log_ratio = (self.score * size + np.log(prior / precision)) / 2
        shares = self.weight[:, None, None] * (self.span_days / 2)[:, None]
        largest = float(log_ratio.max())
        chance = shares * np.exp(log_ratio - largest)
        total = largest + math.log(float(chance.sum()))
        chance /= chance.sum()
        reach = np.stack([np.ones_like(self.by_day), self.day - self.after_day], axis=1)
        shift, sd = size * reach, reach / np.sqrt(precision)
        beyond = scipy.special.ndtr((np.abs(shift) - least_shift) / sd)
        mean = float((chance * shift).sum())
        began = np.cumsum(chance.sum(axis=(0, 2)))
        first, last = np.searchsorted(began, [0.05, 0.95 * began[-1]])
        at, kind = np.unravel_index(int(chance.sum(axis=0).argmax()), chance.shape[1:])
        return Evidence(
            years=math.exp(min(total, 100.0)) / DAYS_PER_YEAR,
            shift=mean,
            shift_sd=math.sqrt(float((chance * (sd**2 + (shift - mean) ** 2)).sum())),
            material=float((chance * beyond).sum()),
            sudden=float(chance[:, :, 0].sum()),
            after_day=float(self.after_day[first]),
            by_day=float(self.by_day[last]),
            beginning=int(at),
            kind=int(kind),
        )

    def changed(self, evidence: Evidence) -> Bank:
        """With the likeliest change taken into the state, and none that began before now."""
        at = (slice(None), evidence.beginning, evidence.kind)
        prior = 1 / (_STEP_SD, _SLOPE_SD)[evidence.kind] ** 2
        precision = self.information[at] + prior
        effect = self.effect[at].astype(np.float64)
        more = effect[:, :, None] * effect[:, None, :] / precision[:, None, None]
        bank = replace(
            self,
            mean=self.mean + effect * (self.score[at] / precision)[:, None],
            covariance=self.covariance + more,
        )
        return bank.without_beginnings()

    def without_beginnings(self) -> Bank:
        """From here on only what begins later is a change."""
        effect, score, information, *days = _no_beginnings(*self.mean.shape)
        return replace(
            self,
            effect=effect,
            score=score,
            information=information,
            after_day=days[0],
            by_day=days[1],
            span_days=days[2],
        )


def _no_beginnings(m: int, p: int) -> tuple[FloatArray, ...]:
    none = np.zeros((m, 0, 2))
    return np.zeros((m, 0, 2, p), np.float32), none, none, np.zeros(0), np.zeros(0), np.zeros(0)


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
