"""Priors of the bar as made, by its description: deviations, end details, a measured tension.

A measured tension is data: it enters the posterior of its own test, and what it teaches of mass and
stiffness (`calibration_of`) is the prior of later tests of the hanger and of its family.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from shm.assumptions import DEFAULTS, Assumption, Assumptions
from shm.inference.options import Calibration
from shm.inference.sampler.coordinates import exchange, fold_pairs, log_folded, split_pairs
from shm.models import AsMade
from shm.models.one_hanger.hanger_model import BENDING, DENSITY, LENGTH, MODULUS, SECTION
from shm.values import FloatArray, Hanger, ModalTest

DEVIATIONS = (SECTION, DENSITY, MODULUS)


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


def errors_of_reading(
    usual_sd: float, assumed: Assumptions = DEFAULTS
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the sds of the logarithm of a reading, each with the log of its probability.

    The usual one, and that of a gross error: another unit, another hanger, a slip of the pen.
    """
    share = assumed.gross_error_share.value
    gross_sd = assumed.gross_reading_log_sd.value
    return (usual_sd, math.log1p(-share)), (gross_sd, math.log(share))


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
            columns = [k for k, n in enumerate(calibration.names) if n in self.names]
            self.mean[rows] = calibration.mean[columns]
            covariance[np.ix_(rows, rows)] = calibration.covariance[np.ix_(columns, columns)]
        self.factor: FloatArray = _root(covariance)

    def row(self, **shares: float) -> FloatArray:
        """Return the factors (k,) by which a combination of the deviations goes with n."""
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
    """ln of the tension over the nominal one, between `bounds`: about as designed, or anything.

    Where it is known to within `known_sd` (a fraction), it is normal about the nominal one.
    """

    def __init__(
        self,
        bounds: tuple[float, float],
        assumed: Assumptions = DEFAULTS,
        known_sd: float = math.nan,
    ):
        low, high = (math.log(each) for each in bounds)
        designed, sd = assumed.as_designed_share.value, assumed.as_designed_log_sd.value
        self._logs = np.linspace(low, high, _NODES)
        normal = scipy.special.ndtr(self._logs / sd)
        # What the normal distribution has beyond the bounds is anything within them.
        anything = 1 - designed * (normal[-1] - normal[0])
        flat = np.linspace(0, 1, _NODES)
        below = designed * (normal - normal[0]) + anything * flat
        self._scores = scipy.special.ndtri(below.clip(_EDGE, 1 - _EDGE))
        if math.isfinite(known_sd):
            self._scores = np.linspace(-_WIDEST, _WIDEST, _NODES)
            self._logs = known_sd * self._scores

    def value(self, scores: FloatArray) -> FloatArray:
        """Return logarithms (n,) of normal scores."""
        return np.asarray(np.interp(scores, self._scores, self._logs))

    def score(self, logarithms: FloatArray) -> FloatArray:
        """Return normal scores (n,) of logarithms."""
        return np.asarray(np.interp(logarithms, self._logs, self._scores))


class Ends:
    """The prior of the end springs of a beam: that of their fixity, by kind of end.

    The fixity of an end, k/(k + EI/L + sqrt(EI T)/2), is the part of a clamped end's moment that it
    takes. It is Beta distributed, and those of all ends and planes are correlated as normal scores.
    `springs` are those that are felt; in each pair of `swaps` they can be exchanged.
    """

    def __init__(self, hanger: Hanger, springs: Sequence[str], swaps: Sequence[tuple[str, str]]):
        assumed = hanger.assumptions
        self._springs = tuple(springs)
        self._pairs = [
            (springs.index(one), springs.index(other))
            for one, other in swaps
            if {one, other} <= set(springs)
        ]
        self._folded = self._pairs
        self._unit = hanger.bending_stiffness_n_m2 / hanger.length_m
        similarity = assumed.similarity_of_ends.value
        correlation = (1 - similarity) * np.eye(_ALL) + similarity
        self._factor = np.linalg.cholesky(correlation)
        factor = self._factor[: len(springs), : len(springs)]
        self._inverse = np.linalg.inv(factor)
        fixity = fixity_of(hanger.end_kind, assumed)
        freedom = fixity.value * (1 - fixity.value) / fixity.sd**2 - 1
        shape = fixity.value * freedom, (1 - fixity.value) * freedom
        self._nodes = np.linspace(-_WIDEST, _WIDEST, _NODES)
        held = scipy.special.betaincinv(*shape, scipy.special.ndtr(self._nodes))
        loose = scipy.special.betaincinv(*shape[::-1], scipy.special.ndtr(-self._nodes))
        self._logit = np.log(held.clip(_EDGE) / loose.clip(_EDGE))

    @property
    def felt(self) -> bool:
        """Return True where a measured frequency depends on an end spring."""
        return bool(self._springs)

    def log10_springs(
        self, scores: FloatArray, slenderness: FloatArray, rng: np.random.Generator | None
    ) -> dict[str, FloatArray]:
        """Return log10 of all springs in N m/rad, by name, at independent normal `scores`
        (n, springs).

        Springs that are not felt are drawn, or without `rng` in the middle of their distribution.
        """
        n, felt = len(slenderness), len(self._springs)
        rest = np.zeros((n, _ALL - felt)) if rng is None else rng.standard_normal((n, _ALL - felt))
        correlated = np.hstack([scores, rest]) @ self._factor.T
        logit = np.interp(correlated, self._nodes, self._logit)
        log10 = logit / _LOG_10 + np.log10(self._unit * (1 + slenderness / 2))[:, None]
        order = [*self._springs, *(name for name in SPRINGS if name not in self._springs)]
        return dict(zip(order, log10.T, strict=True))

    def scores(
        self, log10_springs: Mapping[str, FloatArray], slenderness: FloatArray, n: int
    ) -> FloatArray:
        """Return the scores (n, springs) of log10 of the springs that are felt."""
        if not self._springs:
            return np.empty((n, 0))
        log10 = np.column_stack([log10_springs[name] for name in self._springs])
        logit = _LOG_10 * (log10 - np.log10(self._unit * (1 + slenderness / 2))[:, None])
        return np.asarray(np.interp(logit, self._logit, self._nodes) @ self._inverse.T)

    def fold(self, scores: FloatArray) -> FloatArray:
        """Return scores (n, springs) with the stiffer spring of each pair first."""
        return self._independent(fold_pairs(self._correlated(scores), self._folded))

    def exchanged(self, scores: FloatArray, rng: np.random.Generator) -> FloatArray:
        """Return scores (n, springs) with each pair exchanged or not by chance."""
        return self._independent(exchange(self._correlated(scores), self._pairs, rng))

    def connect(self, scores: FloatArray, rng: np.random.Generator) -> FloatArray:
        """Fold no pair whose posterior, that of `scores` (n, springs), goes on beyond the fold.

        Returns the scores with these pairs exchanged or not by chance.
        """
        correlated = self._correlated(scores)
        self._folded, open_ = split_pairs(correlated, self._folded)
        return self._independent(exchange(correlated, open_, rng))

    def log_folded(self, scores: FloatArray) -> FloatArray:
        """Return by how much folding raises the log density (n,); -inf outside of the fold."""
        return log_folded(self._correlated(scores), self._folded)

    def _correlated(self, scores: FloatArray) -> FloatArray:
        count = len(self._springs)
        return np.asarray(scores @ self._factor[:count, :count].T)

    def _independent(self, correlated: FloatArray) -> FloatArray:
        return np.asarray(correlated @ self._inverse.T)


SPRINGS = ("log10_k1", "log10_k2", "log10_k3", "log10_k4")
_ALL = len(SPRINGS)
_NODES = 4001  # numerical: of tables of quantiles, in steps far below what is felt
_WIDEST, _EDGE = 6.0, 1e-12
_LOG_10 = math.log(10)


def fixity_of(kind: str, assumed: Assumptions) -> Assumption:
    """Return the fixity of one kind of end."""
    return {
        "socket": assumed.socket_fixity,
        "welded": assumed.welded_fixity,
        "plate": assumed.plate_fixity,
        "threaded": assumed.threaded_fixity,
        "fork": assumed.fork_fixity,
        "unstated": assumed.unstated_fixity,
    }[kind]


def clamped_probability(kind: str, assumed: Assumptions) -> float:
    """Return how probable clamped ends are beforehand, for one kind of end."""
    return {
        "socket": assumed.socket_clamped,
        "welded": assumed.welded_clamped,
        "plate": assumed.plate_clamped,
        "threaded": assumed.threaded_clamped,
        "fork": assumed.fork_clamped,
        "unstated": assumed.unstated_clamped,
    }[kind].value


def calibration_of(names: Sequence[str], samples: FloatArray, hanger: Hanger) -> Calibration:
    """Return what draws (n, parameters) of a posterior say of the bar's deviations."""
    values = dict(zip(names, samples.T, strict=True))
    chosen = [n for n in (*DEVIATIONS, LENGTH, BENDING) if n in values]
    stated = hanger.bending_stiffness_factor
    logs = {LENGTH: lambda v: np.log(v), BENDING: lambda v: np.log(v / stated)}
    table = np.column_stack([logs.get(n, np.asarray)(values[n]) for n in chosen])
    return Calibration(tuple(chosen), table.mean(axis=0), np.atleast_2d(np.cov(table.T)))
