"""Allow for laws that are off: a real effect does not follow the catalogue to the letter.

Corrosion has no edges, sockets taper, joints slip by another power. So the data may err about a
prediction by an unknown fraction of what the effect does beyond what the hanger alone can follow,
the same in all tests: from mode to mode, or smoothly over the orders. Trials say how often by how
much (`calibration.toml`), for effects of the catalogue and for something unknown that passes for
one.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import scipy

from shm.gap.calibration import CALIBRATION, Share
from shm.gap.contract import Fit
from shm.gap.noise import same_mode, smooth_over_orders
from shm.gap.problem import GapProblem
from shm.inference.likelihood import Covariance, Likelihood
from shm.inference.mixture import normalised
from shm.values import FloatArray


@dataclass(frozen=True, eq=False)
class ByLaws:
    """A fit with effects whose laws may be off.

    `gain` is the gain of its log evidence, `mimic` the gain were it something unknown that passes
    for the effects. `draws` (n, d) are of the posterior by all laws.
    """

    gain: float
    mimic: float
    draws: FloatArray


def allow_for_laws(
    problem: GapProblem, baseline: Fit, fit: Fit, rng: np.random.Generator
) -> ByLaws:
    """Return what a fit gains where its effects' laws may be off, all about it taken as linear."""
    residual = problem.value - fit.predicted
    ways = [(CALIBRATION.exact, fit.noise), *_allowances(problem, baseline, fit)]
    found = [_linear(fit, errors, residual) for _, errors in ways]
    log = np.array([each for each, *_ in found]) - found[0][0]
    own, unknown = (
        np.log([getattr(share, name) for share, _ in ways]) + log for name in Share._fields
    )
    chosen = rng.choice(len(ways), size=len(fit.draws), p=normalised(own))
    draws = fit.draws.copy()
    for way in np.unique(chosen[chosen > 0]):
        rows = np.flatnonzero(chosen == way)
        _, step, inner = found[way]
        normal = rng.standard_normal((len(rows), len(fit.z)))
        draws[rows] = fit.z + step + np.linalg.solve(np.linalg.cholesky(inner).T, normal.T).T
    return ByLaws(
        float(scipy.special.logsumexp(own)), float(scipy.special.logsumexp(unknown)), draws
    )


def _linear(
    fit: Fit, errors: Covariance, residual: FloatArray
) -> tuple[float, FloatArray, FloatArray]:
    """Return log evidence, step (d,) and curvature (d, d) about a fit by other errors."""
    likelihood = Likelihood.of(errors, fit.model_error)
    inner, step, square, followed = likelihood.linear(fit.slopes, residual, fit.z)
    misfit = square + fit.z @ fit.z - followed
    log = likelihood.log_height[0] - np.linalg.slogdet(inner)[1] / 2 - misfit / 2
    return float(log), step, inner


def _allowances(problem: GapProblem, baseline: Fit, fit: Fit) -> Iterator[tuple[Share, Covariance]]:
    design, shift = problem.design, fit.predicted - baseline.predicted
    count, patterns = design.frequencies, (same_mode(design), smooth_over_orders(design))
    for fraction, share in CALIBRATION.off_by.items():
        off = fraction * shift
        for alike in patterns:
            errors = replace(
                fit.noise,
                frequency=fit.noise.frequency + np.outer(off[:count], off[:count]) * alike,
                shape=fit.noise.shape + off[count:] ** 2,
            )
            yield Share(*(each / len(patterns) for each in share)), errors
