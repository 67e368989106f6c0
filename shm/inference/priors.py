"""Priors of the bar as made, by its description: deviations, end details, a measured tension.

A measured tension is data: it enters the posterior of its own test, and what it teaches of mass and
stiffness (`calibration_of`) is the prior of later tests of the hanger and of its family.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from shm.assumptions import DEFAULTS, Assumptions
from shm.models.as_made import BENDING, DENSITY, LENGTH, MODULUS, SECTION, AsMade
from shm.values import FloatArray, Hanger, IntArray, ModalTest

DEVIATIONS = (SECTION, DENSITY, MODULUS)

# Numerical: steps in widths of the bell, for which sums over bells of four springs are exact.
_STEP_OF_MIDDLES = 0.35


@dataclass(frozen=True, eq=False)
class Calibration:
    """What measured tensions have taught of the deviations of a bar as made.

    `names` are among `section`, `density`, `modulus`, `theta_L` and `bending_factor` (as logarithms
    of true over described); `mean` (k,) and `covariance` (k, k).
    """

    names: tuple[str, ...]
    mean: FloatArray
    covariance: FloatArray


@dataclass(frozen=True)
class TensionReading:
    """The tension that load cells, lift-offs or weights showed, all tests together."""

    tension_n: float
    sd: float
    """As a fraction of it."""


def reading_of(
    tests: Sequence[ModalTest], assumed: Assumptions = DEFAULTS
) -> TensionReading | None:
    """The readings of all tests as one, weighted by their precision; None where there is none."""
    values = [
        (test.tension_read_n, reading_sd_n(test, assumed))
        for test in tests
        if math.isfinite(test.tension_read_n)
    ]
    if not values:
        return None
    read, sd = np.array(values).T
    weight = sd**-2
    mean = float((weight * read).sum() / weight.sum())
    return TensionReading(mean, float(weight.sum() ** -0.5) / mean)


def reading_sd_n(test: ModalTest, assumed: Assumptions = DEFAULTS) -> float:
    """Standard deviation of a test's reading (N): as stated, else that of an ordinary lift-off."""
    known = math.isfinite(test.tension_read_sd_n) and test.tension_read_sd_n > 0
    unstated_n = assumed.tension_reading_sd.value * test.tension_read_n
    return test.tension_read_sd_n if known else unstated_n


class Deviations:
    """Normal prior of the deviations d = mean + factor n, n standard normal: `names` (k,).

    The length is one where it is taped, a strand's bending factor where it is stated or calibrated
    (its logarithm, to the stated one).
    """

    def __init__(self, model: AsMade, calibration: Calibration | None):
        scatter = model.hanger.scatter
        sds = {SECTION: scatter.section, DENSITY: scatter.density, MODULUS: scatter.modulus}
        if not model.length_is_open:
            sds[LENGTH] = scatter.swinging_length
        stated = model.is_strand and math.isfinite(scatter.bending_factor)
        taught = calibration is not None and BENDING in calibration.names
        if stated or (model.is_strand and taught):
            unstated = model.hanger.assumptions.strand_bending_log_sd.value
            sds[BENDING] = scatter.bending_factor if stated else unstated
        self.names = tuple(sds)
        self.mean: FloatArray = np.zeros(len(self.names))
        covariance = np.diag(np.array(list(sds.values())) ** 2)
        if calibration is not None:
            rows = [self.names.index(n) for n in calibration.names if n in self.names]
            kept = [k for k, n in enumerate(calibration.names) if n in self.names]
            self.mean[rows] = calibration.mean[kept]
            covariance[np.ix_(rows, rows)] = calibration.covariance[np.ix_(kept, kept)]
        self.factor: FloatArray = _root(covariance)

    def row(self, **shares: float) -> FloatArray:
        """How a combination of the deviations goes with n (k,)."""
        return np.asarray(np.array([shares.get(name, 0.0) for name in self.names]) @ self.factor)

    def mean_of(self, name: str) -> float:
        """The mean of one of them; 0 where it is none."""
        return float(self.mean[self.names.index(name)]) if name in self.names else 0.0

    def column(self, deviations: FloatArray, name: str) -> FloatArray:
        """One of them (n,) of (n, k); 0 where it is none."""
        if name not in self.names:
            return np.zeros(len(deviations))
        return np.asarray(deviations[:, self.names.index(name)])


def _root(covariance: FloatArray) -> FloatArray:
    """A square root, also of a covariance in which some deviation is known."""
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray(vectors * np.sqrt(values.clip(0)))


class TensionPrior:
    """ln of the tension over the nominal one, between `bounds`: about as designed, or anything."""

    def __init__(self, bounds: tuple[float, float], assumed: Assumptions = DEFAULTS):
        self._low, self._high = (math.log(each) for each in bounds)
        self._designed = assumed.as_designed_share.value
        self._sd = assumed.as_designed_log_sd.value

    def draw(self, n: int, rng: np.random.Generator) -> FloatArray:
        """Logarithms (n,)."""
        found = rng.uniform(self._low, self._high, n)
        designed = self._sd * rng.standard_normal(n)
        kept = (rng.random(n) < self._designed) & (designed > self._low) & (designed < self._high)
        return np.where(kept, designed, found)

    def log_density(self, log_ratio: FloatArray) -> FloatArray:
        """Log density (n,) of logarithms (n,), over that of a uniform one."""
        normal = np.exp(-0.5 * (log_ratio / self._sd) ** 2) / (self._sd * math.sqrt(2 * np.pi))
        inside = np.diff(scipy.special.ndtr(np.array([self._low, self._high]) / self._sd))
        anything = 1 - self._designed * float(inside[0])
        return np.log(anything + self._designed * (self._high - self._low) * normal)


class EndDetails:
    """The prior of springs together: the ends of one hanger are rarely each of another kind.

    They are independent, or all alike, or alike in each plane (a fork turns about one axis), or
    made to clamp (welded, or a nut on a thick plate): all in the stiffest decade; or round (a nut,
    a socket, a weld all around), the same in both planes, each end by itself or both alike. As
    probable each, every spring's log10 k uniform over its range, or over that decade; alike is
    within `similar_ends_decades`, the same within `round_end_decades`.
    `columns` are those of the box's `names`. Where the ends are `exchanged`, frequencies do not
    tell which spring of a plane stands at which end: `round_ends` holds then either way.
    """

    def __init__(
        self,
        names: Sequence[str],
        springs: Sequence[str],
        may_be_round: bool = True,
        exchanged: bool = True,
        assumed: Assumptions = DEFAULTS,
    ):
        decades = assumed.end_restraint.decades
        self._stiffest = 1 / decades
        self._similar_within = assumed.similar_ends_decades.value / decades
        self._same_within = assumed.round_end_decades.value / decades
        self.columns: IntArray = np.array(
            [k for k, name in enumerate(names) if name in springs], dtype=int
        )
        own = [names[k] for k in self.columns]
        planes = [name in ("log10_k1", "log10_k3") for name in own]
        whole = np.arange(len(planes))
        by_plane = [whole[np.equal(planes, side)] for side in (True, False)]
        self._kinds: list[list[IntArray]] = [
            [whole[[k]] for k in whole],
            [whole],
            [group for group in by_plane if len(group)],
        ]
        self._ends: list[list[IntArray]] = []
        if may_be_round and own == ["log10_k1", "log10_k2", "log10_k3", "log10_k4"]:
            self._ends.append([whole[[0, 1]], whole[[2, 3]]])
            if exchanged:
                self._ends.append([whole[[0, 3]], whole[[2, 1]]])

    @property
    def _count(self) -> int:
        """Of kinds: those of `_kinds`, made to clamp, and round ends each by itself or alike."""
        return len(self._kinds) + 1 + 2 * bool(self._ends)

    def draw(self, n: int, rng: np.random.Generator) -> FloatArray:
        """Shares of the springs' ranges (n, springs)."""
        shares = rng.random((n, len(self.columns)))
        kind = rng.integers(self._count, size=n)
        stiff = kind == len(self._kinds)
        shares[stiff] = 1 - self._stiffest * shares[stiff]
        for index, groups in enumerate(self._kinds[1:], start=1):
            rows = np.flatnonzero(kind == index)
            for group in groups:
                middles = rng.random((len(rows), 1))
                similar = _about(middles, len(group), rng, self._similar_within)
                shares[np.ix_(rows, group)] = similar
        for alike in (False, True):
            rows = np.flatnonzero(kind == len(self._kinds) + 1 + alike)
            middles = rng.random((len(rows), 2))
            if alike:
                middles = _about(middles[:, :1], 2, rng, self._similar_within)
            way = rng.integers(max(len(self._ends), 1), size=len(rows))
            for index, ends in enumerate(self._ends):
                own = way == index
                for end, middle in zip(ends, middles[own].T, strict=True):
                    found = _about(middle[:, None], len(end), rng, self._same_within)
                    shares[np.ix_(rows[own], end)] = found
        return shares

    def log_density(self, shares: FloatArray) -> FloatArray:
        """Log density (n,) of shares (n, springs), over that of independent springs."""
        own = _of_middles(shares, self._similar_within)
        total = np.ones(len(shares))
        for groups in self._kinds[1:]:
            parts = [own[:, group].prod(axis=1).mean(axis=1) for group in groups]
            total = total + np.prod(parts, axis=0)
        stiff = (shares > 1 - self._stiffest).all(axis=1)
        total = total + stiff * self._stiffest ** -float(shares.shape[1])
        for ends in self._ends:
            same = np.prod([_same(shares[:, end], self._same_within) for end in ends], axis=0)
            middles = np.stack([shares[:, end].mean(axis=1) for end in ends], axis=1)
            alike = _of_middles(middles, self._similar_within).prod(axis=1).mean(axis=1)
            total = total + same * (1 + alike) / len(self._ends)
        return np.asarray(np.log(total / self._count))


def _about(middle: FloatArray, count: int, rng: np.random.Generator, within: float) -> FloatArray:
    """Shares (n, count) about a middle (n, 1), reflected at the ends of the range."""
    shares = middle + within * rng.standard_normal((len(middle), count))
    folded = np.abs(shares) % 2
    return np.where(folded > 1, 2 - folded, folded)


def _of_middles(shares: FloatArray, within: float) -> FloatArray:
    """Density of shares (n, k) about each of evenly spread middles (n, k, middles)."""
    count = math.ceil(1 / (_STEP_OF_MIDDLES * within))
    middles = (np.arange(count) + 0.5) / count
    images = np.stack([shares, -shares, 2 - shares])
    away = (images[..., None] - middles) / within
    return np.asarray(np.exp(-0.5 * away**2).sum(axis=0) / (within * math.sqrt(2 * math.pi)))


def _same(pair: FloatArray, within: float) -> FloatArray:
    """Density (n,) of two shares (n, 2) that are the same, whatever they are."""
    one, other = pair.T
    away = np.stack([one - other, one + other, 2 - one - other]) / (math.sqrt(2) * within)
    return np.asarray(np.exp(-0.5 * away**2).sum(axis=0) / (within * math.sqrt(4 * math.pi)))


def calibration_of(names: Sequence[str], samples: FloatArray, hanger: Hanger) -> Calibration:
    """What draws (n, parameters) of a posterior say of the bar's deviations."""
    values = dict(zip(names, samples.T, strict=True))
    kept = [n for n in (*DEVIATIONS, LENGTH, BENDING) if n in values]
    stated = hanger.bending_stiffness_factor
    logs = {LENGTH: lambda v: np.log(v), BENDING: lambda v: np.log(v / stated)}
    table = np.column_stack([logs.get(n, np.asarray)(values[n]) for n in kept])
    return Calibration(tuple(kept), table.mean(axis=0), np.atleast_2d(np.cov(table.T)))
