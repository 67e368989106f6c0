"""Compute the Shiryaev-Roberts statistic over all beginnings and causes, in closed form.

Each test is y = A a + H d + errors: `a` are the modes' own levels, how they go with temperature,
excitation and creep; `d` is a change, from some test on at once (a step) or ever further (a ramp).
With V the covariance of `a` if nothing changes, what a change has for it follows from J = sum H'WH
- U'VU and v = sum H'Wy - U'V sum A'Wy, where U = sum A'WH over the tests since (the generalised
likelihood ratio of Willsky and Jones 1976, averaged over a prior).

The mass of a change, in years, is the time in which it may have begun times its Bayes factor to no
change. A sum of masses exceeds L years not before L years on average (Shiryaev 1963, Roberts 1966,
Pollak 1985).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache

import numpy as np
import scipy

from shm.values import BoolArray, FloatArray, IntArray
from shm.watch.engine.causes import DetectedChange, Direction, Layout
from shm.watch.engine.limits import LIMITS
from shm.watch.engine.options import OF_ONE_VISIT_YEARS

STEP, RAMP = 0, 1
SIZES = np.array([1.0, 6.0])
"""Of a change, in units of its prior: what may not be missed, and what nobody can miss."""

# Judgement: nine of ten changes are just what may not be missed.
LOG_SHARES = np.log([0.9, 0.1])
SAMPLES = 500
"""Of a summary: a probability of a half is known to 0.02, a mean to a twentieth of its sd."""


@dataclass(frozen=True, eq=False)
class Sums:
    """Z'WZ (tests, K, z, z), Z'Wy (tests, K, z) and the log density's constant (tests, K)."""

    square: FloatArray
    cross: FloatArray
    constant: FloatArray


def sums_of(
    columns: FloatArray, values: FloatArray, variances: FloatArray, covariance: FloatArray
) -> Sums:
    """Of tests with `columns` (T, n, z), `values` and `variances` (T, n), infinite where a mode was
    not measured, and the `covariance` (T, K, n, n) of their scatter beside that."""
    joint = joint_covariance(variances, covariance)
    weight = np.linalg.inv(joint)
    weighted = weight @ columns[:, None]
    of_values = np.einsum("tkij,tj->tki", weight, values)
    constant = -(np.einsum("tki,ti->tk", of_values, values) + np.linalg.slogdet(joint)[1]) / 2
    return Sums(
        np.swapaxes(columns, 1, 2)[:, None] @ weighted,
        np.einsum("tki,tiz->tkz", of_values, columns),
        constant,
    )


def joint_covariance(variances: FloatArray, covariance: FloatArray) -> FloatArray:
    """Return the covariance (T, K, n, n) of tests, their own `variances` (T, n) included."""
    its = np.minimum(variances, LIMITS.unmeasured)
    return np.asarray(covariance + its[:, None, :, None] * np.eye(its.shape[1]))


@dataclass(frozen=True, eq=False)
class Evidence:
    """The evidence of all tests: log masses (beginnings, K, kinds, D, sizes) of changes, in years.

    `log_most` bounds what all masses together are worth (`persistence`).
    `log_null` (K,) is the log probability of each scatter without change. `beginnings` are numbers
    of tests: the change came before it. `years` are the tests' times.
    """

    layout: Layout
    directions: tuple[Direction, ...]
    years: FloatArray
    beginnings: IntArray
    called: tuple[DetectedChange, ...]
    log_null: FloatArray
    log_mass: FloatArray
    null_mean: FloatArray
    null_covariance: FloatArray
    seen: tuple[FloatArray, FloatArray, FloatArray] = field(repr=False)
    log_most: float = math.inf

    @property
    def log_statistic(self) -> float:
        """Log of the Shiryaev-Roberts statistic in years."""
        return _total(self.log_mass)

    @property
    def log_evidence(self) -> float:
        """The same without the changes that one visit alone speaks for, and by the scatter without
        change that is likeliest, so that the rate of false calls holds for each scatter."""
        if not len(self.beginnings):
            return -math.inf
        choices = math.log(len(self.log_null))
        worst = float(self.log_null.max()) + choices
        of_more = self.years[self.beginnings] < self.years[-1] - OF_ONE_VISIT_YEARS
        return min(_total(self.log_mass[of_more]) - max(worst, 0.0), self.log_most)

    @property
    def waited(self) -> FloatArray:
        """Years (beginnings,) in which each may have begun."""
        return _onset_interval_years(self.years, self.beginnings)

    @cached_property
    def shares(self) -> FloatArray:
        """Probability of each change, given that there is one."""
        if not self.log_mass.size:
            return self.log_mass
        return np.exp(self.log_mass - self.log_statistic)

    @property
    def of_last_visit(self) -> tuple[float, float]:
        """Return the last visit's largest log Bayes factor of any change, and the log mass of all.

        In years. Visits in haste count as a week apart, as far as this goes.
        """
        at = int(np.searchsorted(self.years[self.beginnings], self.years[-1] - OF_ONE_VISIT_YEARS))
        if at == len(self.beginnings):
            return 0.0, -math.inf
        waited = math.log(max(float(_onset_interval_years(self.years, self.beginnings)[at]), 1e-12))
        kinds = np.log([1 + each.may_ramp for each in self.directions])
        prior = np.array([each.log_prior for each in self.directions]) - kinds
        over_scatters = np.logaddexp.reduce(self.log_mass[at, :, STEP], axis=0) - waited
        factor = float((over_scatters - prior[:, None] - LOG_SHARES).max())
        return factor, _total(self.log_mass[at]) - waited + max(
            waited, math.log(LIMITS.a_week_years)
        )

    def by_direction(self) -> FloatArray:
        """Probability (D,) of each direction, given a change."""
        return np.asarray(self.shares.sum(axis=(0, 1, 2, 4)))

    def draw(
        self,
        part: BoolArray | None = None,
        loadings: FloatArray | None = None,
        *,
        is_last_counted: bool = True,
    ) -> tuple[FloatArray, FloatArray]:
        """Draw changes (SAMPLES, n + q) by the last test, and the null's parameters with each.

        The latter as `loadings` (rows, p) of them, (SAMPLES, rows). Of the most probable changes in
        the directions of `part` (D,); where there is none, none is drawn. Unless `is_last_counted`,
        changes that begin at the last test are left out. Draws come in pairs about the mean.
        """
        loadings = np.zeros((0, self.null_mean.shape[1])) if loadings is None else loadings
        chosen = np.ones(len(self.directions), bool) if part is None else part
        log_mass = np.where(chosen[:, None], self.log_mass, -np.inf)
        if not is_last_counted:
            log_mass[-1:] = -np.inf
        leading = np.argsort(log_mass.ravel())[-LIMITS.change_point_leading :]
        leading = leading[np.isfinite(log_mass.ravel()[leading])]
        if not len(leading):
            return np.zeros((0, self.layout.n + self.layout.q)), np.zeros((0, len(loadings)))
        weight = np.exp(log_mass.ravel()[leading] - _total(log_mass.ravel()[leading]))
        places = np.array(np.unravel_index(leading, log_mass.shape)).T
        at, k, kind, *_ = places.T
        mean, factor = self._sizes(places)
        chosen = np.repeat(_allot(weight, SAMPLES // 2), 2)
        rates = mean[chosen] + np.einsum("sir,sr->si", factor[chosen], _pairs(factor.shape[2]))
        done = np.where(kind == RAMP, self._progress(at), 1.0)[chosen, None]
        response = loadings @ self.null_covariance[k] @ self.seen[2][kind, at, k]
        shared = np.einsum("src,sc->sr", response[chosen], rates)
        return done * rates, self._draw_null(k[chosen], loadings) - shared

    def draw_null(self, loadings: FloatArray) -> FloatArray:
        """Draw `loadings` (rows, p) of the null's parameters if nothing (further) changed."""
        of_scatters = _allot(np.exp(self.log_null), SAMPLES // 2)
        return self._draw_null(np.repeat(of_scatters, 2), loadings)

    def _draw_null(self, k: IntArray, loadings: FloatArray) -> FloatArray:
        """Return such draws (SAMPLES, rows) at the scatters `k` (SAMPLES,)."""
        covariance = loadings @ self.null_covariance @ loadings.T
        strength, axes = np.linalg.eigh((covariance + np.swapaxes(covariance, 1, 2)) / 2)
        root = axes * np.sqrt(np.maximum(strength, 0.0))[:, None]
        normal = _pairs(len(loadings), seed=1)
        moved = np.einsum("sri,si->sr", root[k], normal)
        return np.asarray(self.null_mean[k] @ loadings.T + moved)

    def mean_of(self, index: tuple[int, ...]) -> tuple[FloatArray, FloatArray]:
        """Return a change (n + q,) by the last test, and the null's parameters (p,) with it."""
        places = np.array([index])
        at, k, kind, *_ = places.T
        (rate,), _ = self._sizes(places)
        moved = self.null_covariance[k[0]] @ self.seen[2][kind[0], at[0], k[0]] @ rate
        done = self.progress(index[0]) if index[2] == RAMP else 1.0
        return done * rate, self.null_mean[k[0]] - moved

    def _sizes(self, places: IntArray) -> tuple[FloatArray, FloatArray]:
        """Means (changes, n + q) and factors (changes, n + q, r); of a ramp, a year of it."""
        at, k, kind, d, size = places.T
        information, pull, _ = self.seen
        factor = SIZES[size][:, None, None] * self._factors[d]
        crossed = factor.transpose(0, 2, 1)
        inner = np.eye(factor.shape[2]) + crossed @ information[kind, at, k] @ factor
        root = np.linalg.cholesky(np.linalg.inv((inner + inner.transpose(0, 2, 1)) / 2))
        reach = factor @ root
        pulled = reach.transpose(0, 2, 1) @ pull[kind, at, k][..., None]
        return (reach @ pulled)[..., 0], reach

    @cached_property
    def _factors(self) -> FloatArray:
        """Return those of all directions (D, n + q, r), with zeros where one has fewer columns."""
        columns = max(each.factor.shape[1] for each in self.directions)
        return np.stack(
            [
                np.pad(each.factor, ((0, 0), (0, columns - each.factor.shape[1])))
                for each in self.directions
            ]
        )

    def progress(self, at: int) -> float:
        """Years since a ramp began: half way between the two tests."""
        return float(self._progress(np.array(at)))

    def _progress(self, at: IntArray) -> FloatArray:
        return np.asarray(self.years[-1] - _ramp_from(self.years, self.beginnings)[at])


def evidence_of(
    sums: Sums,
    years: FloatArray,
    baseline_tests: int,
    layout: Layout,
    directions: Sequence[Direction],
    called: Sequence[DetectedChange] = (),
    most_beginnings: int = 60,
) -> Evidence:
    """The evidence of `sums` of tests (T,) at `years`, ascending; no change before the baseline's.

    Changes that were `called` are part of the null, each with a level of its own from there on; a
    new one is looked for after the last of them.
    """
    null = _NullSums.of(sums, years, layout, called)
    mean, covariance, log_null = null.fitted()
    log_null = log_null - _total(log_null)
    first = max([baseline_tests, *(each.first + 1 for each in called)])
    beginnings = _chosen(np.arange(first, len(years)), most_beginnings)
    seen = null.seen(years, beginnings, mean, covariance)
    waited = np.log(np.maximum(_onset_interval_years(years, beginnings), 1e-12))
    log_mass = _log_factors(directions, seen) + log_null[None, :, None, None, None]
    log_mass = log_mass + waited[:, None, None, None, None]
    return Evidence(
        layout, tuple(directions), years, beginnings, tuple(called),
        log_null, log_mass, mean, covariance, seen,
    )  # fmt: skip


def select_null(years: FloatArray, layout: Layout, called: Sequence[DetectedChange]) -> FloatArray:
    """Return what makes the columns of tests those of the null (T, z, p), called changes in it."""
    every = np.eye(len(layout.prior_sd))
    columns = [np.tile(every[:, layout.null], (len(years), 1, 1))]
    for each in called:
        since = (np.arange(len(years)) >= each.first)[:, None, None] * every[:, layout.change]
        columns.append(since)
        if each.is_ramp:
            columns.append((years - each.years)[:, None, None] * since)
    return np.concatenate(columns, axis=2)


@dataclass(frozen=True, eq=False)
class _NullSums:
    """Sums of tests (T, K, ...) by the columns of the null (p), called changes among them.

    `square` (p, p), `cross` (p,) and `constant` () are those of the null, `response` (p, c) those
    of the null and a change, `own` (c, c) and `pull` (c,) those of a change. `prior` (p, p) is the
    null's precision.
    """

    square: FloatArray
    cross: FloatArray
    constant: FloatArray
    response: FloatArray
    own: FloatArray
    pull: FloatArray
    prior: FloatArray

    @classmethod
    def of(
        cls, sums: Sums, years: FloatArray, layout: Layout, called: Sequence[DetectedChange]
    ) -> _NullSums:
        part = layout.change
        priors = [np.diag(layout.prior_sd[layout.null] ** -2.0)]
        for each in called:
            priors += [each.precision] * (2 if each.is_ramp else 1)
        taken = select_null(years, layout, called)[:, None]
        turned = np.swapaxes(taken, 2, 3)
        weighted = turned @ sums.square
        return cls(
            weighted @ taken,
            (turned @ sums.cross[..., None])[..., 0],
            sums.constant,
            weighted[..., part],
            sums.square[..., part, part],
            sums.cross[..., part],
            np.asarray(scipy.linalg.block_diag(*priors)),
        )

    def fitted(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return mean (K, p), covariance (K, p, p), log evidence (K,) of no (further) change."""
        joint, vector = self.square.sum(axis=0), self.cross.sum(axis=0)
        joint = (joint + np.swapaxes(joint, 1, 2)) / 2 + self.prior
        covariance = np.linalg.inv(joint)
        mean = np.einsum("kij,kj->ki", covariance, vector)
        log_evidence = self.constant.sum(axis=0) + (vector * mean).sum(axis=1) / 2
        log_evidence += (np.linalg.slogdet(self.prior)[1] - np.linalg.slogdet(joint)[1]) / 2
        return mean, covariance, np.asarray(log_evidence)

    def seen(
        self, years: FloatArray, beginnings: IntArray, mean: FloatArray, covariance: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return J and v of a change at each beginning, and what the null has in common with it.

        Each (2, beginnings, K, ...), a step's and a ramp's, by mean and covariance of the null.
        """
        since = _ramp_from(years, beginnings)

        def from_on(values: FloatArray, power: int) -> FloatArray:
            """Return sums over the tests from each beginning on, by powers of a ramp's years."""
            found: FloatArray = np.zeros(())
            for k in range(power + 1):
                weight = years.reshape(-1, *[1] * (values.ndim - 1)) ** k
                total = np.cumsum((values * weight)[::-1], axis=0)[::-1][beginnings]
                by = math.comb(power, k) * (-since) ** (power - k)
                found = found + by.reshape(-1, *[1] * (values.ndim - 1)) * total
            return np.asarray(found)

        parts = []
        for kind in (STEP, RAMP):
            response = from_on(self.response, kind)
            its = from_on(self.own, 2 * kind)
            information = its - np.swapaxes(response, 2, 3) @ (covariance @ response)
            pull = from_on(self.pull, kind) - np.einsum("bkpc,kp->bkc", response, mean)
            parts.append((information, pull, response))
        information, pull, response = (np.array(each) for each in zip(*parts, strict=True))
        return information, pull, response


def _log_factors(
    directions: Sequence[Direction], seen: tuple[FloatArray, FloatArray, FloatArray]
) -> FloatArray:
    """Log prior times Bayes factor (beginnings, K, kinds, D, sizes) of each change."""
    information, pull, _ = seen
    shape = (*information.shape[1:3], 2, len(directions), len(SIZES))
    found = np.full(shape, -np.inf)
    for d, direction in enumerate(directions):
        kinds = (STEP, RAMP) if direction.may_ramp else (STEP,)
        for kind in kinds:
            inner = direction.factor.T @ information[kind] @ direction.factor
            strength, axes = np.linalg.eigh((inner + np.swapaxes(inner, 2, 3)) / 2)
            strength = np.maximum(strength, 0)[..., None]
            along = np.einsum("bkr,bkrs->bks", pull[kind] @ direction.factor, axes)[..., None]
            grown = 1 + SIZES**2 * strength
            factor = ((SIZES * along) ** 2 / grown - np.log(grown)).sum(axis=2) / 2
            found[:, :, kind, d] = factor + LOG_SHARES + direction.log_prior - math.log(len(kinds))
    return found


def _ramp_from(years: FloatArray, beginnings: IntArray) -> FloatArray:
    """Return when a ramp began (beginnings,): at the test before the first that shows it."""
    return np.asarray(years[beginnings - 1])


def _onset_interval_years(years: FloatArray, beginnings: IntArray) -> FloatArray:
    """Years (beginnings,) in which each may have begun: since the one before, thinned or not."""
    before = np.concatenate([beginnings[:1] - 1, beginnings[:-1]])
    return np.asarray(years[beginnings] - years[before])


def _chosen(beginnings: IntArray, most: int) -> IntArray:
    """Of beginnings all of the last `most` / 2, of older ones evenly as many."""
    if len(beginnings) <= most:
        return beginnings
    recent = most // 2
    old = beginnings[:-recent]
    picked = np.unique(np.linspace(0, len(old) - 1, most - recent).round().astype(int))
    return np.concatenate([old[picked], beginnings[-recent:]])


def _total(log_mass: FloatArray) -> float:
    """Log of the sum; -inf of nothing."""
    return float(np.logaddexp.reduce(log_mass.ravel())) if log_mass.size else -math.inf


def _allot(weight: FloatArray, count: int) -> IntArray:
    """Return which of some alternatives each of `count` draws is of, by their weights."""
    reached = np.cumsum(weight) / weight.sum()
    return np.minimum(np.searchsorted(reached, (np.arange(count) + 0.5) / count), len(weight) - 1)


@lru_cache(maxsize=32)
def _pairs(columns: int, seed: int = 0) -> FloatArray:
    """Return standard normal draws (SAMPLES, columns), each followed by its opposite."""
    half = np.random.default_rng(seed).standard_normal((SAMPLES // 2, columns))
    return np.stack([half, -half], axis=1).reshape(SAMPLES, columns)
