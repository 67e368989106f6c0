"""Proposals for a posterior that is a narrow, bent valley in coordinates where the prior is normal.

The slopes at points along the valley tell directions that the data determine from those that they
leave free. A draw takes its free coordinates y from a t mixture or from the prior, and the
determined ones x from normal distributions of several widths around their optimum given y. So the
proposal follows the valley however narrow it is, and its density is known: that of y times that of
x given y. Ablations: docs/decisions/0009-sampling-along-the-valley.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from shm.inference.sampler.coordinates import log_normal
from shm.inference.sampler.density import Density, Points
from shm.inference.sampler.mixture import TMixture
from shm.values import BoolArray, FloatArray, IntArray


@dataclass(frozen=True)
class Numerics:
    """Numerical settings of valleys; weights correct for all of them.

    A direction is `determined` where the data take that fraction of the prior's variance at all but
    `few` of the points, and `unfelt` where they take less than that. `rounds` from `starts` find
    the directions. The optimum is sought by `gauss_newton` steps with new slopes, each with
    `chords` steps with the same, none longer than `longest_step`, until it is `near_enough` in
    standard deviations; new slopes count as those at the optimum where it was not farther than
    `far`. It starts where `neighbours` points of the valley lead, with their slopes. A datum that
    is not predicted misses by `no_mode`. A point farther `away` across a valley
    is in another one, which has `fewest_points`; at most `most_valleys` are followed. `from_prior`
    is the probability that the free coordinates of a draw come from the prior, so that no weight is
    unbounded, and `least_chance` that of a part of a mixture.
    """

    determined: float = 0.98
    few: float = 0.2
    unfelt: float = 0.02
    rounds: int = 20
    starts: int = 12
    gauss_newton: int = 5
    chords: int = 3
    longest_step: float = 0.7
    near_enough: float = 0.5
    far: float = 1.0
    neighbours: int = 3
    away: float = 10.0
    fewest_points: int = 12
    most_valleys: int = 3
    from_prior: float = 0.1
    least_chance: float = 0.01
    least: float = 1e-3
    no_mode: float = 10.0


_SET = Numerics()

_SCALES = np.array([0.6, 1.0, 1.7, 3.0, 6.0, 25.0, 200.0, 2000.0])
_FIRST_CHANCES = np.array([0.1, 0.35, 0.25, 0.15, 0.09, 0.02, 0.02, 0.02])
"""Widths of the determined coordinates, times that at the model error that the valley was made for;
how probable each is at first. The model error is itself uncertain: few data leave tails that go on
to the ends of the prior."""


@dataclass(frozen=True, eq=False)
class Draws(Points):
    """Draws `z` (n, d) with their predictions (n, measurements).

    For each valley (n, valleys): the squared distance `square` of the determined coordinates from
    their optimum given the free ones, in standard deviations, and ln of the inverse of these
    standard deviations' product, `log_size`.
    """

    square: FloatArray
    log_size: FloatArray


class Valley:
    """The valley of a posterior through `points` (m, d).

    `whitening` (data, data) makes residuals independent with standard deviations of 1.
    """

    def __init__(self, density: Density, points: FloatArray, whitening: FloatArray):
        self._density, self._whitening = density, whitening
        slopes = whitening @ density.slopes(points)
        self.felt, self._unfelt, self._determined = _split(slopes)
        self.free = np.hstack([self.felt, self._unfelt])
        self._y, self._x = points @ self.free, points @ self._determined
        self._scale = self._y.std(axis=0) + _SET.least
        along, self._across = slopes @ self.free, slopes @ self._determined
        # How the optimum of x moves with y, at each point.
        turned = np.swapaxes(self._across, 1, 2)
        self._leads = -np.linalg.solve(_precision(self._across), turned @ along)

    def draw(
        self, y: FloatArray, scale: FloatArray, rng: np.random.Generator
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Draw points (n, d) with free coordinates `y` (n, f), their determined ones `scale` (n,)
        times as wide as the normal approximation.

        Returns the points, and `square` and `log_size` (n,) of `Draws`.
        """
        optimum, factor = self._optimum(y)
        deviate = scale[:, None] * rng.standard_normal((len(y), self.determined))
        away = np.linalg.solve(np.swapaxes(factor, 1, 2), deviate[..., None])[..., 0]
        square = (deviate**2).sum(axis=1)
        return optimum + away @ self._determined.T, square, _log_size(factor)

    def distance(self, z: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return `square` and `log_size` (n,) of `Draws` at `z` (n, d)."""
        optimum, factor = self._optimum(z @ self.free)
        deviate = np.einsum("nhg,nh->ng", factor, (z - optimum) @ self._determined)
        return (deviate**2).sum(axis=1), _log_size(factor)

    @property
    def determined(self) -> int:
        """Return how many directions the data determine."""
        return int(self._determined.shape[1])

    def follows(self, points: FloatArray) -> BoolArray:
        """Return which points (n, d) lie where this valley is, not in another one."""
        return self.distance(points)[0] < _SET.away**2 * (1 + self.determined)

    def log_unfelt(self, z: FloatArray) -> FloatArray:
        """Return the log density (n,) of the prior along the directions that no datum feels."""
        return log_normal(z @ self._unfelt)

    def optimum(self, y: FloatArray) -> FloatArray:
        """Return the most probable points (n, d) with free coordinates `y` (n, f)."""
        return self._optimum(y)[0]

    def _optimum(self, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the optimum (n, d) given `y` (n, f), and a Cholesky factor (n, g, g) of the
        precision of the determined coordinates there.

        The slopes of the valley's nearest points lead there, new ones end there.
        """
        near, weight = self._nearest(y)
        step = np.einsum("nkgf,nkf->nkg", self._leads[near], y[:, None] - self._y[near])
        x = (weight[..., None] * (self._x[near] + step.clip(-1, 1))).sum(axis=1)
        z = y @ self.free.T + x @ self._determined.T
        across = np.einsum("nk,nkfg->nfg", weight, self._across[near])
        factor: FloatArray = np.linalg.cholesky(_precision(across)).astype(np.float64)
        rows = np.arange(len(y) if self.determined else 0)
        for again in range(_SET.gauss_newton):
            if not len(rows):
                break
            residual = None
            if again:
                residual, across = self._density.look(z[rows], self._determined)
                across = self._whitening @ across
                factor[rows] = np.linalg.cholesky(_precision(across))
            begun = z[rows]
            size = self._descend(z, rows, across, factor[rows], residual)
            moved = np.einsum("nhg,nh->ng", factor[rows], (z[rows] - begun) @ self._determined)
            # Slopes of a point that was far from the optimum are not those there.
            if again:
                rows = rows[(size > _SET.near_enough) | (np.abs(moved).max(axis=1) > _SET.far)]
        return z, factor

    def _descend(
        self,
        z: FloatArray,
        rows: IntArray,
        across: FloatArray,
        factor: FloatArray,
        residual: FloatArray | None,
    ) -> FloatArray:
        """Move some rows of `z` to the optimum by steps with the same slopes `across`.

        Returns the size (rows,) of the last step in standard deviations. The `residual` where they
        begin is computed unless it is known.
        """
        size = np.full(len(rows), np.inf)
        for _ in range(_SET.chords):
            going = np.flatnonzero(size > _SET.near_enough)
            if not len(going):
                break
            active = rows[going]
            misfit = -(self._density.residual(z[active]) if residual is None else residual)
            none, residual = _SET.no_mode, None
            misfit = np.nan_to_num(misfit, nan=none, posinf=none, neginf=-none)
            misfit = misfit @ self._whitening.T
            gradient = np.einsum("nfg,nf->ng", across[going], misfit) + z[active] @ self._determined
            half = np.linalg.solve(factor[going], gradient[..., None])
            step = -np.linalg.solve(np.swapaxes(factor[going], 1, 2), half)[..., 0]
            longest = np.abs(step).max(axis=1)
            step *= np.minimum(1.0, _SET.longest_step / longest.clip(_SET.least))[:, None]
            z[active] += step @ self._determined.T
            size[going] = np.where(
                longest > _SET.longest_step, np.inf, np.abs(half[..., 0]).max(axis=1)
            )
        return size

    def _nearest(self, y: FloatArray) -> tuple[IntArray, FloatArray]:
        """Return the nearest of the valley's points to each y (n, k), and their weights (n, k)."""
        felt = self.felt.shape[1]
        apart = (y[:, None, :felt] - self._y[:, :felt]) / self._scale[:felt]
        square = (apart**2).sum(axis=2)
        count = min(_SET.neighbours, square.shape[1])
        near = np.argpartition(square, count - 1, axis=1)[:, :count]
        weight = 1 / (np.take_along_axis(square, near, axis=1) + _SET.least) ** 2
        return near, weight / weight.sum(axis=1, keepdims=True)


def valleys_through(
    density: Density, points: FloatArray, nearest: IntArray, whitening: FloatArray
) -> list[Valley]:
    """Return the valleys that hold nearly all `points` (m, d), the most crowded first.

    `nearest` (m,) is the optimum that each point came from.
    """
    found: list[Valley] = []
    left = np.arange(len(points))
    while len(left) > _SET.fewest_points and len(found) < _SET.most_valleys:
        crowded = left[nearest[left] == np.bincount(nearest[left]).argmax()]
        rows = crowded if len(crowded) > _SET.fewest_points else left
        found.append(Valley(density, points[rows], whitening))
        left = left[~found[-1].follows(points[left])]
    return found or [Valley(density, points, whitening)]


@dataclass(frozen=True, eq=False)
class Proposal:
    """A mixture over `valleys` with `chances` (valleys,).

    In each the free coordinates that are felt have a t mixture, or none where there are none.
    `scales` are the chances of `_SCALES`.
    """

    valleys: Sequence[Valley]
    mixtures: Sequence[TMixture | None]
    chances: FloatArray
    scales: FloatArray

    @classmethod
    def through(
        cls, valleys: Sequence[Valley], points: FloatArray, clusters: int, rng: np.random.Generator
    ) -> Proposal:
        """Return a first one from `points` (n, d) along the valleys."""
        mixtures, sizes = [], []
        for valley in valleys:
            members = points[valley.follows(points)]
            members = members if len(members) > _SET.fewest_points else points
            felt = valley.felt.shape[1]
            mixtures.append(TMixture.of(members @ valley.felt, clusters, rng) if felt else None)
            sizes.append(len(members))
        return cls(valleys, mixtures, np.array(sizes) / sum(sizes), _FIRST_CHANCES)

    def refitted(self, draws: Draws, weights: FloatArray) -> Proposal:
        """Return it one step of expectation maximisation nearer to weighted draws."""
        parts = self._log_parts(draws)
        owned = np.exp(parts - parts.max(axis=1, keepdims=True))
        owned *= (weights / owned.sum(axis=1))[:, None]
        chances = owned.sum(axis=0).clip(_SET.least_chance)
        mixtures = [
            mixture and mixture.refitted(draws.z @ valley.felt, shares / shares.sum())
            if shares.sum() > _SET.least_chance
            else mixture
            for valley, mixture, shares in zip(self.valleys, self.mixtures, owned.T, strict=True)
        ]
        scaled = self._log_scaled(draws)
        of_scale = np.exp(scaled - scaled.max(axis=2, keepdims=True))
        of_scale /= of_scale.sum(axis=2, keepdims=True)
        scales = np.einsum("nv,nvs->s", owned, of_scale).clip(_SET.least_chance)
        chances, scales = chances / chances.sum(), scales / scales.sum()
        return Proposal(self.valleys, mixtures, chances, scales)

    def draw(self, density: Density, n: int, rng: np.random.Generator) -> Draws:
        """Return `n` draws."""
        z, square, log_size = [], [], []
        for index, count in enumerate(rng.multinomial(n, self.chances)):
            valley, mixture = self.valleys[index], self.mixtures[index]
            y = rng.standard_normal((count, valley.free.shape[1]))
            chosen = rng.random(count) > _SET.from_prior
            if mixture is not None and chosen.any():
                y[chosen, : valley.felt.shape[1]] = mixture.draw(int(chosen.sum()), rng)
            scale = rng.choice(_SCALES, count, p=self.scales)
            points, *drawn = valley.draw(y, scale, rng)
            at = [drawn if each is valley else each.distance(points) for each in self.valleys]
            z.append(points)
            square.append(np.column_stack([each[0] for each in at]))
            log_size.append(np.column_stack([each[1] for each in at]))
        points = np.vstack(z)
        return Draws(points, density.predict(points), np.vstack(square), np.vstack(log_size))

    def log_density(self, draws: Draws) -> FloatArray:
        """Return the log density (n,) at draws."""
        return np.asarray(scipy.special.logsumexp(self._log_parts(draws), axis=1))

    def _log_parts(self, draws: Draws) -> FloatArray:
        """Return the log density (n, valleys) of each valley, times its chance."""
        found = np.log(self.chances) + scipy.special.logsumexp(self._log_scaled(draws), axis=2)
        for index, (valley, mixture) in enumerate(zip(self.valleys, self.mixtures, strict=True)):
            found[:, index] += valley.log_unfelt(draws.z)
            if mixture is not None:
                y = draws.z @ valley.felt
                prior = np.log(_SET.from_prior) + log_normal(y)
                near = np.log1p(-_SET.from_prior) + mixture.log_density(y)
                found[:, index] += np.logaddexp(prior, near)
        return np.asarray(found)

    def _log_scaled(self, draws: Draws) -> FloatArray:
        """Return the log density (n, valleys, scales) of the determined coordinates given the free
        ones, times the chance of the scale.
        """
        count = np.array([valley.determined for valley in self.valleys])[:, None]
        normal = -0.5 * draws.square[..., None] / _SCALES**2 - count * np.log(_SCALES)
        normal = normal - count / 2 * np.log(2 * np.pi) + draws.log_size[..., None]
        return np.asarray(normal + np.log(self.scales))


def _log_size(factor: FloatArray) -> FloatArray:
    """Return the log determinant (n,) of factors (n, g, g) of a precision."""
    return np.asarray(np.log(np.einsum("nkk->nk", factor)).sum(axis=1))


def _split(slopes: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return orthonormal directions from whitened slopes (m, measurements, d) along the valley:
    free ones that are felt (d, f), free ones that no datum feels (d, u), determined ones (d, g).

    g is how many directions the data determine at most points. The valley may turn: the determined
    directions are those across it at all points, as far as they can be, by the largest mean log
    determinant of what the data say along them.
    """
    d = slopes.shape[2]
    taken = np.eye(d) - np.linalg.inv(_precision(slopes))
    determined = (np.linalg.eigvalsh(taken) > _SET.determined).sum(axis=1)
    count = int(np.quantile(determined, _SET.few))
    taken += _SET.least * np.eye(d)
    starts = [taken.mean(axis=0), *taken[:: len(taken) // _SET.starts + 1]]
    tried = [_across(taken, np.linalg.eigh(each)[1][:, d - count :]) for each in starts]
    across = max(tried, key=lambda each: _log_taken(taken, each))
    whole = np.linalg.qr(np.hstack([across, np.eye(d)]))[0]
    free = whole[:, count:d]
    # What the data take along free directions, the determined ones being free to follow.
    left = np.linalg.inv(_precision(slopes))
    taken_there = np.eye(d - count) - free.T @ left @ free
    size, ways = np.linalg.eigh(taken_there.mean(axis=0))
    unfelt = size < _SET.unfelt
    return free @ ways[:, ~unfelt], free @ ways[:, unfelt], whole[:, :count]


def _across(taken: FloatArray, across: FloatArray) -> FloatArray:
    """Return the directions (d, g) near `across` that the data determine best at all points."""
    for _ in range(_SET.rounds if 0 < across.shape[1] < len(across) else 0):
        inner = np.linalg.inv(across.T @ taken @ across)
        across = np.linalg.qr((taken @ across @ inner).mean(axis=0))[0]
    return across


def _log_taken(taken: FloatArray, across: FloatArray) -> float:
    return float(np.linalg.slogdet(across.T @ taken @ across)[1].mean())


def _precision(slopes: FloatArray) -> FloatArray:
    """Return the precision (m, k, k) of coordinates with whitened slopes (m, measurements, k)."""
    return np.asarray(np.swapaxes(slopes, 1, 2) @ slopes + np.eye(slopes.shape[2]))
