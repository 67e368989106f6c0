"""How a frequency looks beside all other data, and what a gross error of it costs.

A frequency comes with a small probability not from the identification's distribution but from a
wide one (Box and Tiao, Biometrika 55, 1968): a wrong mode, a tone of a machine, a slip of the pen.
The price of an ordinary datum is taken from Student's t instead of the normal distribution, since
the standard deviation that a test states is itself an estimate from some twenty hits: 4.5 of them
are rare, but no proof of an error.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import stats
from scipy.special import logsumexp

from shm.gap.contract import Fit, Hypothesis
from shm.gap.landscape import Landscape
from shm.gap.problem import GapProblem
from shm.values import FloatArray, IntArray

GROSS_ERROR = 0.01
"""The prior probability of a frequency to be a gross error.

Of routine data 1 to 10 % are (Hampel, Ronchetti, Rousseeuw and Stahel 1986, 1.2c); modes that were
chosen with care are taken to be the better end of that.
"""

WIDE_FROM, WIDE_TO = 1e-4, 3.0
"""Sizes of gross errors, of the logarithm of the frequency: log-uniform, up or down."""

FREEDOM = 20.0
"""Degrees of freedom of the stated standard deviations."""


@dataclass(frozen=True, eq=False)
class LeftOut:
    """Frequencies (r) seen from all other data, by each possibility of the unknown errors (nodes).

    `deviation` (nodes, r) is the measured less the expected logarithm, `sd` (nodes, r) its standard
    deviation, `log_all` (nodes,) the log evidence of all data.
    """

    deviation: FloatArray
    sd: FloatArray
    log_all: FloatArray

    @property
    def log_rest(self) -> FloatArray:
        """Log evidence (nodes, r) of all data but each frequency."""
        return np.asarray(self.log_all[:, None] - stats.norm.logpdf(self.deviation, scale=self.sd))

    @property
    def gross(self) -> FloatArray:
        """Log evidence (r,) relative to that of all data, were each frequency a gross error."""
        return self._relative(log_gross(self.deviation))

    @property
    def ordinary(self) -> FloatArray:
        """The same (r,) were it an ordinary datum, whose error has the tails of Student's t."""
        return self._relative(log_ordinary(self.deviation, self.sd))

    @property
    def expected(self) -> tuple[FloatArray, FloatArray]:
        """Mean and standard deviation (r,) of the deviations, over the possibilities."""
        weight = np.exp(self.log_rest - logsumexp(self.log_rest, axis=0))
        mean = (weight * self.deviation).sum(axis=0)
        square = (weight * (self.sd**2 + self.deviation**2)).sum(axis=0)
        return mean, np.sqrt(square - mean**2)

    def given_rest(self, log_density: FloatArray) -> FloatArray:
        """Log of the mean density (r,), the possibilities weighed by all other data."""
        rest = self.log_rest
        return np.asarray(logsumexp(rest + log_density, axis=0) - logsumexp(rest, axis=0))

    def _relative(self, log_density: FloatArray) -> FloatArray:
        whole = logsumexp(self.log_all)
        return np.asarray(logsumexp(self.log_rest + log_density, axis=0) - whole)


def log_gross(deviation: FloatArray) -> FloatArray:
    """Log of prior probability times density of a gross error of this size."""
    size = np.abs(deviation).clip(WIDE_FROM, WIDE_TO)
    return np.asarray(np.log(GROSS_ERROR) - np.log(2 * size * np.log(WIDE_TO / WIDE_FROM)))


def log_ordinary(deviation: FloatArray, sd: FloatArray) -> FloatArray:
    """Log of probability times density of an ordinary error."""
    return np.asarray(np.log1p(-GROSS_ERROR) + stats.t.logpdf(deviation, FREEDOM, scale=sd))


def left_out(
    problem: GapProblem,
    hypothesis: Hypothesis,
    z: FloatArray,
    predicted: FloatArray,
    slopes: FloatArray,
    rows: IntArray,
) -> LeftOut:
    """Each of the frequencies `rows` (r,) left out in turn, by what is linear about z (d,).

    `predicted` (data,) and `slopes` (data, d) are those at z. The standardised deviations are the
    deleted residuals of regression (Cook and Weisberg 1982, 2.2), with priors.
    """
    residual, d = problem.observations.value - predicted, len(z)
    units = np.zeros((len(residual), len(rows)))
    units[rows, np.arange(len(rows))] = 1.0
    likelihood = problem.likelihood(hypothesis)
    gram = likelihood.gram(np.column_stack([slopes, residual, units])[None])[0]
    # The prior is d more data, of value 0 and standard deviation 1.
    inner, outer = gram[:, :d, :d] + np.eye(d), gram[:, :d, d:]
    outer[:, :, 0] -= z
    solved = np.linalg.solve(inner, outer)
    pull = gram[:, d, d:] - np.einsum("kd,kdc->kc", outer[:, :, 0], solved)
    own = np.einsum("kcc->kc", gram[:, d + 1 :, d + 1 :])
    precision = own - (outer[:, :, 1:] * solved[:, :, 1:]).sum(axis=1)
    height = likelihood.log_height - np.linalg.slogdet(inner)[1] / 2
    return LeftOut(
        deviation=pull[:, 1:] / precision,
        sd=1 / np.sqrt(precision),
        log_all=height - (pull[:, 0] + z @ z) / 2,
    )


def at(problem: GapProblem, fit: Fit, row: int) -> LeftOut:
    """A frequency of `problem` seen from its other data, to which `fit` was fitted."""
    landscape = Landscape(problem, fit.hypothesis)
    branch = next(each for each in landscape.coordinates.branches if each.holds(fit.z[None])[0])
    w = branch.w(fit.z[None])
    views = landscape.views(w, branch.signs[None])
    predicted = problem.observations.value - views.residual[0]
    return left_out(problem, fit.hypothesis, w[0], predicted, views.slopes[0], np.array([row]))


def without_shape(problem: GapProblem, row: int) -> GapProblem:
    """The same problem without the shape of the mode `row`; itself where it has none."""
    observations, design = problem.observations, problem.design
    kept = np.flatnonzero(design.shape_mode != row)
    if len(kept) == len(design.shape_mode):
        return problem
    data = np.concatenate([np.arange(design.frequencies), design.frequencies + kept])
    shapeless = replace(
        design,
        shape_mode=design.shape_mode[kept],
        shape_place=design.shape_place[kept],
        shape_component=design.shape_component[kept],
    )
    part = observations.part(shapeless, data)
    made = GapProblem(problem.hanger, problem.baseline, part)
    made.smallest = problem.smallest
    return made
