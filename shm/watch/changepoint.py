"""Has anything changed? The evidence of no change, and of each change at each time.

Every visit has a hidden label: sound, or disturbed in one of the ways of a table. Given the labels
all is linear and normal; the labels, and how often each comes, are found by variational
expectation and maximisation (Beal 2003, Variational Algorithms for Approximate Bayesian Inference).
Its bound stands for the log evidence, of no change and of each change alike.

A change is a cause with a beginning, a step or a ramp, and a size. With the labels of no change its
evidence follows in closed form from sums over the tests (the generalised likelihood ratio of
Willsky and Jones 1976, here averaged over a prior), so that all are looked at; the most probable
get labels of their own. Each has a mass in years: the time in which it may have begun times its
Bayes factor to no change. The sum of the masses is the Shiryaev-Roberts statistic (Shiryaev 1963,
Roberts 1966, Pollak 1985), which without a change grows by a year in a year.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.special import gammaln

from shm.values import BoolArray, FloatArray, IntArray
from shm.watch.causes import Direction, Hypotheses
from shm.watch.history import Sums
from shm.watch.options import OF_ONE_VISIT_YEARS, WatchOptions

STEP, RAMP = 0, 1
_CLOSE = 0.003  # technical: of the limit, from which on the most probable changes get own labels


@dataclass(frozen=True, eq=False)
class Fit:
    """The normal posterior of parameters and the labels of the visits under which it was found.

    `labels` (visits, J); `mean` (p,) and `covariance` (p, p) are of the null's parameters, then of
    the unit normals of a change.
    """

    log_evidence: float
    labels: FloatArray
    mean: FloatArray
    covariance: FloatArray


@dataclass(frozen=True, eq=False)
class Weighed:
    """One change: its place (beginning, kind, direction, size) and log mass in years, and a fit."""

    place: tuple[int, int, int, int]
    log_mass: float
    fit: Fit


@dataclass(frozen=True, eq=False)
class Evidence:
    """What the tests so far have for each change.

    `log_mass` (beginnings, kinds, D, sizes) is in years, over no (further) change; of changes that
    the last visit alone speaks for it is -inf, unless there are no others. `null` is the fit of no
    change, `changes` are the most probable, the most probable first.
    """

    directions: tuple[Direction, ...]
    sizes: tuple[float, ...]
    years: FloatArray
    beginnings: IntArray
    log_mass: FloatArray
    null: Fit
    changes: tuple[Weighed, ...] = ()

    @property
    def is_open(self) -> bool:
        """Whether more than one visit can speak for a change."""
        return bool(is_old(self.years, self.beginnings).any())

    @property
    def log_years(self) -> float:
        """Log of the Shiryaev-Roberts statistic in years: one visit alone speaks for no change."""
        return log_sum(self.log_mass) if self.is_open else -math.inf

    @cached_property
    def shares(self) -> FloatArray:
        """Probability of each change, given that there is one."""
        if not self.log_mass.size:
            return self.log_mass
        return np.asarray(np.exp(self.log_mass - log_sum(self.log_mass)))

    def extent(self, place: tuple[int, int, int, int]) -> float:
        """Return by how much a change has come: 1 of a step, of a ramp the years since it began.

        It began at the test before the first that shows it.
        """
        at, kind, *_ = place
        return float(self.years[-1] - self.years[self.beginnings[at] - 1]) if kind else 1.0


def is_old(years: FloatArray, beginnings: IntArray) -> BoolArray:
    """Return which beginnings (B,) lie before the last visit."""
    return np.asarray(years[beginnings] < years[-1] - OF_ONE_VISIT_YEARS)


def log_sum(values: FloatArray) -> float:
    """Return the log of a sum of exponentials; -inf of none."""
    return float(np.logaddexp.reduce(values.ravel())) if values.size else -math.inf


@dataclass(frozen=True, eq=False)
class ChangePoint:
    """Finds the evidence of changes in the tests of one hanger."""

    hypotheses: Hypotheses
    options: WatchOptions

    @cached_property
    def _counts(self) -> FloatArray:
        """The prior of how often each label comes (J,), as counts of visits."""
        shares = np.array([each.share for each in self.hypotheses.disturbances])
        return self.options.share_visits * np.append(1 - shares.sum(), shares)

    @cached_property
    def _is_error(self) -> BoolArray:
        """Which labels (J,) are errors of the measurement."""
        return np.array([False, *(each.is_error for each in self.hypotheses.disturbances)])

    def _surely(self, label: int) -> FloatArray:
        """Return labels (J,) that are sure: a hundredth of a sound one would outweigh all others,
        for its errors are a thousandth of a disturbance's."""
        certain = np.zeros(len(self._counts))
        certain[label] = 1.0
        return certain

    def evidence(self, sums: Sums, known: FloatArray, first: int) -> Evidence:
        """Return the evidence of `sums`; `known` (visits, J) are the labels that were found
        without the last tests, and a change begins no earlier than at the test `first`."""
        null = self.fit_null(sums, known)
        beginnings = _thinned(np.arange(first, len(sums.years)), self.options.beginnings)
        directions, sizes = self.hypotheses.directions, self.options.sizes
        shape = (len(beginnings), 2, len(directions), len(sizes))
        evidence = Evidence(
            directions, sizes, sums.years, beginnings, np.full(shape, -np.inf), null
        )
        if not len(beginnings):
            return evidence
        waited = np.log(_waited(sums.years, beginnings)) - null.log_evidence
        if evidence.is_open:
            waited[~is_old(sums.years, beginnings)] = -np.inf
        screens = [
            self._screen(sums, beginnings, *labels) for labels in self._screening(null.labels)
        ]
        log_mass = np.max([each.log_evidence for each in screens], axis=0)
        log_mass = log_mass + waited[:, None, None, None]
        fits: dict[tuple[int, int, int, int], Fit] = {}
        if evidence.is_open and log_mass.max() > math.log(_CLOSE * self.options.limit_years):
            stayed = self._log_null(sums, null) - null.log_evidence
            waited, log_mass = waited - stayed, log_mass - stayed
            for place in self._to_refine(log_mass):
                fit = self._refine(sums, beginnings, place, screens)
                refined = fit.log_evidence + self._log_prior(place) + waited[place[0]]
                before = fit.labels[: sums.visit[beginnings[place[0]]], ~self._is_error]
                if before.sum() > 0.5 and refined > log_mass[place]:
                    fits[place], log_mass[place] = fit, refined
        changes = []
        for place in _largest(log_mass, self.options.leading):
            if place not in fits:
                best = max(screens, key=lambda each: float(each.log_evidence[place]))
                fits[place] = best.fit(place, directions, sizes)
            changes.append(Weighed(place, float(log_mass[place]), fits[place]))
        return replace(evidence, log_mass=log_mass, changes=tuple(changes))

    def _log_prior(self, place: tuple[int, int, int, int]) -> float:
        """Return that of a change's cause, kind and size."""
        _, _, d, size = place
        direction = self.hypotheses.directions[d]
        share = self.options.size_shares[size]
        return direction.log_prior - math.log(1 + direction.may_ramp) + math.log(share)

    # ------------------------------------------------------------ no change

    def fit_null(self, sums: Sums, known: FloatArray) -> Fit:
        """Return the best fit without a change of several beginnings: the labels found before;
        the last one to three visits, or the first, disturbed; all but the first or the last."""
        prior = np.tile(self._counts / self._counts.sum(), (sums.visits, 1))
        before = prior.copy()
        before[: len(known)] = known[: sums.visits]
        starts = [before, prior]
        # A visit that says nothing finds its own label; what recurs is found from itself alone.
        widest = len(self._counts) - 1
        recurring = [n for n, each in enumerate(self.hypotheses.disturbances, 1) if each.recurs]
        for label in (widest, *recurring):
            for visits in (slice(-1, None), slice(-2, None), slice(-3, None), slice(0, 1)):
                start = before.copy()
                start[visits] = self._surely(label)
                starts.append(start)
        for trusted in (0, -1):
            start = np.tile(self._surely(widest), (sums.visits, 1))
            start[trusted] = self._surely(0)
            starts.append(start)
        return _climb(sums, None, np.array(starts), self._counts, 1 + self.options.rounds)

    def _log_null(self, sums: Sums, null: Fit) -> float:
        """Return the log evidence of no change, with that of disturbances which were still there
        at the last visit: they came as often as this hanger's do, up to `spell_visits` ago."""
        found, last = [null.log_evidence], sums.visits - 1
        for visits in range(1, min(self.options.spell_visits, last)):
            begins = np.flatnonzero(sums.visit == last - visits)
            labels = null.labels.copy()
            labels[-visits - 1 :] = self._surely(0)
            seen = self._counts + labels[: -visits - 1].sum(axis=0)
            share = seen / seen.sum()
            for label, each in enumerate(self.hypotheses.disturbances, 1):
                if not each.stays:
                    continue
                factor = each.factor(self.hypotheses.quantities, self.hypotheses.loosening)
                prior = math.log(share[label] * each.stays**visits / len(begins))
                for begin in begins.tolist():
                    change = factor, np.where(np.arange(len(sums.years)) >= begin, 1.0, 0.0)
                    fit = _climb(sums, change, labels[None], self._counts, self.options.rounds)
                    found.append(fit.log_evidence + prior)
        return log_sum(np.array(found))

    # ------------------------------------------------------------ changes

    def _screening(self, labels: FloatArray) -> list[tuple[FloatArray, FloatArray]]:
        """Return labels (visits, J) before and since a change by which all are looked at.

        What looks disturbed without a change may be the change, or an error all the same; where the
        first visit does, it may be sound and all since be changed.
        """
        sound = np.zeros_like(labels)
        sound[:, 0] = 1.0
        is_error = labels[:, self._is_error].sum(axis=1, keepdims=True) > 0.5
        chosen = [(labels, sound)]
        if is_error.any():
            chosen.append((labels, np.where(is_error, labels, sound)))
        if labels[0, 0] < 0.5:
            is_first = np.arange(len(labels))[:, None] == 0
            chosen.append((np.where(is_first, sound, labels), sound))
        return chosen

    def _screen(
        self, sums: Sums, beginnings: IntArray, before: FloatArray, since: FloatArray
    ) -> Screen:
        """Return the evidence of all changes under given labels."""
        null, change, years = slice(0, sums.null), slice(sums.null, None), sums.years
        square, cross, constant = sums.expected(before)
        later_square, later_cross, later_constant = sums.expected(since)
        by_years = [_onwards(_times(later_square, years**k))[beginnings] for k in range(3)]
        pulls = [_onwards(_times(later_cross, years**k))[beginnings] for k in range(2)]
        total = _until(square)[beginnings][:, null, null] + by_years[0][:, null, null]
        total = total + sums.precision
        pull = _until(cross)[beginnings][:, null] + pulls[0][:, null]
        covariance = np.asarray(np.linalg.inv(total), float)
        mean = np.asarray((covariance @ pull[..., None])[..., 0], float)
        bound = _until(constant)[beginnings] + _onwards(later_constant)[beginnings]
        bound += (pull * mean).sum(axis=1) / 2 - np.linalg.slogdet(total)[1] / 2
        bound += np.linalg.slogdet(sums.precision)[1] / 2
        at_visit = sums.visit[beginnings]
        counts = _until(before)[at_visit] + _onwards(since)[at_visit]
        entropy = _until(_entropy(before))[at_visit] + _onwards(_entropy(since))[at_visit]
        bound += entropy + _log_dirichlet(self._counts, counts)
        start = years[beginnings - 1][:, None, None]
        own = [
            by_years[0][:, change, change],
            (by_years[2] - 2 * start * by_years[1] + start**2 * by_years[0])[:, change, change],
        ]
        crossed = [
            by_years[0][:, null, change],
            (by_years[1] - start * by_years[0])[:, null, change],
        ]
        own_pull = [pulls[0][:, change], (pulls[1] - start[..., 0] * pulls[0])[:, change]]
        moments = tuple(zip(own, crossed, own_pull, strict=True))
        gains = self._gains(covariance, mean, moments)
        # What follows on errors alone is no change: nothing is known of before.
        bound[_until(before[:, ~self._is_error].sum(axis=1))[at_visit] < 0.5] = -np.inf
        found = bound[:, None, None, None] + gains
        return Screen(found, before, since, at_visit, total, pull, moments)

    def _gains(
        self,
        covariance: FloatArray,
        mean: FloatArray,
        moments: Sequence[tuple[FloatArray, FloatArray, FloatArray]],
    ) -> FloatArray:
        """Return what each change (B, kinds, D, sizes) adds to the log evidence, with its prior.

        `covariance` (B, p, p) and `mean` (B, p) are the null's without a change.
        """
        directions, sizes = self.hypotheses.directions, np.array(self.options.sizes)
        found = np.full((len(mean), 2, len(directions), len(sizes)), -np.inf)
        for kind, (own, crossed, pull) in enumerate(moments):
            turned = np.swapaxes(crossed, 1, 2)
            information = own - turned @ covariance @ crossed
            left = pull - (turned @ mean[..., None])[..., 0]
            for d, direction in enumerate(directions):
                if kind == RAMP and not direction.may_ramp:
                    continue
                inner = direction.factor.T @ information @ direction.factor
                strength, axes = np.linalg.eigh((inner + np.swapaxes(inner, 1, 2)) / 2)
                strength = np.maximum(strength, 0)[..., None]
                along = np.einsum("br,brs->bs", left @ direction.factor, axes)[..., None]
                grown = 1 + sizes**2 * strength
                gain = ((sizes * along) ** 2 / grown - np.log(grown)).sum(axis=1) / 2
                prior = [self._log_prior((0, kind, d, size)) for size in range(len(sizes))]
                found[:, kind, d] = gain + prior
        return found

    def _to_refine(self, log_mass: FloatArray) -> list[tuple[int, int, int, int]]:
        """Return the changes to look at closely: the most probable, and those of other causes."""
        chosen = _largest(log_mass, self.options.refined // 2)
        for place in _largest(log_mass.max(axis=(0, 1, 3), keepdims=True), self.options.refined):
            own = np.where(np.arange(log_mass.shape[2])[:, None] == place[2], log_mass, -np.inf)
            chosen += _largest(own, 1)
        return list(dict.fromkeys(chosen))

    def _refine(
        self,
        sums: Sums,
        beginnings: IntArray,
        place: tuple[int, int, int, int],
        screens: Sequence[Screen],
    ) -> Fit:
        """Return the fit of a change with its own labels."""
        at, kind, d, size = place
        first, years = int(beginnings[at]), sums.years
        gate = np.where(np.arange(len(years)) >= first, 1.0, 0.0)
        if kind == RAMP:
            gate = gate * (years - years[first - 1])
        factor = self.options.sizes[size] * self.hypotheses.directions[d].factor
        starts = [each.labels(at) for each in screens]
        return _climb(sums, (factor, gate), np.array(starts), self._counts, self.options.rounds)


@dataclass(frozen=True, eq=False)
class Screen:
    """All changes under given labels, `before` and `since` them (visits, J).

    `log_evidence` (beginnings, kinds, D, sizes) includes the prior; `at_visit` is the visit of each
    beginning; `total` and `pull` are the null's normal equations at each, `moments` of each kind
    those of a change: its own, with the null, and its pull.
    """

    log_evidence: FloatArray
    before: FloatArray
    since: FloatArray
    at_visit: IntArray
    total: FloatArray
    pull: FloatArray
    moments: tuple[tuple[FloatArray, FloatArray, FloatArray], ...]

    def labels(self, at: int) -> FloatArray:
        """Return the labels (visits, J) of a change with a beginning."""
        is_before = np.arange(len(self.before))[:, None] < self.at_visit[at]
        return np.where(is_before, self.before, self.since)

    def fit(
        self,
        place: tuple[int, int, int, int],
        directions: Sequence[Direction],
        sizes: Sequence[float],
    ) -> Fit:
        """Return the fit of one change."""
        at, kind, d, size = place
        own, crossed, pull = (each[at] for each in self.moments[kind])
        factor = sizes[size] * directions[d].factor
        corner = crossed @ factor
        matrix = np.block(
            [
                [self.total[at], corner],
                [corner.T, factor.T @ own @ factor + np.eye(factor.shape[1])],
            ]
        )
        covariance = np.linalg.inv(matrix)
        mean = covariance @ np.concatenate([self.pull[at], factor.T @ pull])
        return Fit(float(self.log_evidence[place]), self.labels(at), mean, covariance)


@dataclass(frozen=True, eq=False)
class _Model:
    """The normal equations of parameters: the null's, and the unit normals of a change.

    `factor` (n + q, r) is that of the change, `gates` (T J,) by how much it has come at each test.
    """

    sums: Sums
    factor: FloatArray
    gates: FloatArray
    counts: FloatArray

    @cached_property
    def cross(self) -> FloatArray:
        """Z'Wy of each test and label (T J, p)."""
        return self.sums.cross.reshape(self.sums.constant.size, -1)

    @cached_property
    def precision(self) -> FloatArray:
        """The prior precision of all parameters."""
        size, r = self.sums.null, self.factor.shape[1]
        found = np.zeros((size + r, size + r))
        found[:size, :size] = self.sums.precision
        found[size:, size:] = np.eye(r)
        return found

    def normal_equations(self, weight: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the matrix (S, p, p) and the pull (S, p) with weights (S, T J) of the labels."""
        (square, crossed, own), size = self.sums.blocks, self.sums.null
        gated = weight * self.gates
        matrix = np.tile(self.precision, (len(weight), 1, 1))
        matrix[:, :size, :size] += np.tensordot(weight, square, 1)
        pull = np.zeros((len(weight), len(self.precision)))
        pull[:, :size] = weight @ self.cross[:, :size]
        if self.factor.shape[1]:
            corner = np.tensordot(gated, crossed, 1) @ self.factor
            matrix[:, :size, size:] += corner
            matrix[:, size:, :size] += np.swapaxes(corner, 1, 2)
            inner = np.tensordot(gated * self.gates, own, 1)
            matrix[:, size:, size:] += self.factor.T @ inner @ self.factor
            pull[:, size:] = (gated @ self.cross[:, size:]) @ self.factor
        return matrix, pull

    def log_density(self, mean: FloatArray, covariance: FloatArray) -> FloatArray:
        """Return that of each test and label (S, T J), over parameters of these moments."""
        (square, crossed, own), size = self.sums.blocks, self.sums.null
        second = mean[:, :, None] * mean[:, None, :] + covariance
        found = self.sums.constant.reshape(-1) + mean[:, :size] @ self.cross[:, :size].T
        found = found - _traces(second[:, :size, :size], square) / 2
        if self.factor.shape[1]:
            moved = mean[:, size:] @ self.factor.T
            both = second[:, :size, size:] @ self.factor.T
            alone = self.factor @ second[:, size:, size:] @ self.factor.T
            of_both = moved @ self.cross[:, size:].T - _traces(both, crossed)
            found = found + self.gates * of_both - self.gates**2 * _traces(alone, own) / 2
        return np.asarray(found)

    def relabelled(self, labels: FloatArray, log_density: FloatArray) -> FloatArray:
        """Return labels (S, visits, J) by the density of their tests, and how often each came in
        the other visits (Asuncion et al. 2009)."""
        of_tests = log_density.reshape(len(labels), *self.sums.constant.shape)
        begins = np.flatnonzero(np.diff(self.sums.visit, prepend=-1))
        seen = labels.sum(axis=1, keepdims=True) - labels
        found = np.add.reduceat(of_tests, begins, axis=1)
        found = found + np.log(self.counts + np.maximum(seen, 0.0))
        found = np.exp(found - found.max(axis=2, keepdims=True))
        return np.asarray(found / found.sum(axis=2, keepdims=True))


def _climb(
    sums: Sums,
    change: tuple[FloatArray, FloatArray] | None,
    starts: FloatArray,
    counts: FloatArray,
    rounds: int,
) -> Fit:
    """Return the best fit from several beginnings (S, visits, J) of the labels, with the evidence
    of all that end in other labels: each is a bound over its own.

    A `change` is its factor (n + q, r) and by how much it has come at each test (T,). `counts` (J,)
    are the prior's of labels.
    """
    tests, kinds = sums.constant.shape
    none = np.zeros((sums.cross.shape[2] - sums.null, 0)), np.zeros(tests)
    factor, gate = change or none
    model = _Model(sums, factor, np.repeat(gate, kinds), counts)
    labels = starts
    for left in range(rounds, -1, -1):
        weight = labels[:, sums.visit].reshape(len(labels), -1)
        matrix, pull = model.normal_equations(weight)
        covariance = np.asarray(np.linalg.inv(matrix), float)
        mean = np.asarray((covariance @ pull[..., None])[..., 0], float)
        if left:
            labels = model.relabelled(labels, model.log_density(mean, covariance))
    bound = weight @ sums.constant.reshape(-1) + (pull * mean).sum(axis=1) / 2
    bound += (np.linalg.slogdet(sums.precision)[1] - np.linalg.slogdet(matrix)[1]) / 2
    bound += _entropy(labels).sum(axis=1) + _log_dirichlet(counts, labels.sum(axis=1))
    best = int(bound.argmax())
    apart = np.unique(labels.argmax(axis=2), axis=0, return_inverse=True)[1].ravel()
    each = [float(bound[apart == one].max()) for one in range(int(apart.max()) + 1)]
    return Fit(log_sum(np.array(each)), labels[best], mean[best], covariance[best])


def _traces(moments: FloatArray, blocks: FloatArray) -> FloatArray:
    """Return the sums of products (S, T J) of moments (S, a, b) and blocks (T J, a, b)."""
    return np.asarray(moments.reshape(len(moments), -1) @ blocks.reshape(len(blocks), -1).T)


def _entropy(labels: FloatArray) -> FloatArray:
    """Return the entropy of the labels (..., J) of each visit."""
    return np.asarray(-(labels * np.log(np.maximum(labels, 1e-300))).sum(axis=-1))


def _log_dirichlet(counts: FloatArray, seen: FloatArray) -> FloatArray:
    """Return the log evidence of labels that were `seen` so often (..., J), the shares unknown."""
    both = counts + seen
    found = gammaln(both).sum(axis=-1) - gammaln(both.sum(axis=-1))
    return np.asarray(found - gammaln(counts).sum() + gammaln(counts.sum()))


def _largest(log_mass: FloatArray, most: int) -> list[tuple[int, int, int, int]]:
    """Return the places of the largest finite masses, the largest first."""
    order = np.argsort(log_mass.ravel())[::-1][:most]
    places = np.array(np.unravel_index(order, log_mass.shape)).T
    return [tuple(each) for each in places.tolist() if math.isfinite(log_mass[tuple(each)])]


def _waited(years: FloatArray, beginnings: IntArray) -> FloatArray:
    """Return years (B,) in which each change may have begun: since the one before."""
    before = np.concatenate([beginnings[:1] - 1, beginnings[:-1]])
    return np.asarray(np.maximum(years[beginnings] - years[before], 1e-12))


def _thinned(beginnings: IntArray, most: int) -> IntArray:
    """Return all of the last `most` / 2 beginnings, and of older ones evenly as many."""
    if len(beginnings) <= most:
        return beginnings
    recent = most // 2
    old = beginnings[:-recent]
    picked = np.unique(np.linspace(0, len(old) - 1, most - recent).round().astype(int))
    return np.concatenate([old[picked], beginnings[-recent:]])


def _until(values: FloatArray) -> FloatArray:
    """Return sums over all before each, along the first axis."""
    return np.concatenate([np.zeros_like(values[:1]), np.cumsum(values, axis=0)])


def _onwards(values: FloatArray) -> FloatArray:
    """Return sums over all from each on, along the first axis."""
    return np.asarray(np.cumsum(values[::-1], axis=0)[::-1])


def _times(values: FloatArray, weight: FloatArray) -> FloatArray:
    return np.asarray(values * weight.reshape(-1, *([1] * (values.ndim - 1))))
