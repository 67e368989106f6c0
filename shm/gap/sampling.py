"""The fit of a hypothesis, by draws or by normal distributions on its peaks."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from shm.gap.contract import Fit, Method
from shm.gap.posterior import Target
from shm.inference.mixture import normalised
from shm.inference.options import EMCEE
from shm.inference.posterior import Peak, laplace
from shm.inference.sampling import sample as sample_density
from shm.values import NAN, FloatArray


def sample(
    target: Target,
    peaks: Sequence[Peak],
    draws: int,
    rng: np.random.Generator,
) -> Fit:
    """Return the fit of a hypothesis about `peaks`, the best first, with so many equal draws.

    Where fewer than 200 are effective, emcee goes on.
    """
    found = sample_density(target, peaks, draws, rng)
    method: Method = "emcee" if found.method == EMCEE else "sampled"
    return _fit(
        target,
        peaks,
        found.points.z,
        (found.log_evidence, found.log_evidence_sd),
        found.effective_sample_size,
        method,
    )


def approximate(
    target: Target, peaks: Sequence[Peak], draws: int, rng: np.random.Generator, beyond: float
) -> Fit:
    """Return the fit of a hypothesis by normal distributions on its peaks (Laplace's method).

    `beyond` is added to the log evidence: the difference to sampling of a like posterior.
    """
    log = np.array([peak.log_evidence for peak in peaks])
    counts = rng.multinomial(draws, normalised(log))
    found = np.vstack(
        [rng.multivariate_normal(p.z, p.covariance, n) for p, n in zip(peaks, counts, strict=True)]
    )
    return _fit(target, peaks, found, (laplace(peaks) + beyond, NAN), NAN, "normal")


def _fit(
    target: Target,
    peaks: Sequence[Peak],
    draws: FloatArray,
    log_evidence: tuple[float, float],
    effective: float,
    method: Method,
) -> Fit:
    best = peaks[0]
    residual, slopes = target.view(best.z)
    error = target.likelihood.nodes[int(target.likelihood.by_node(residual[None])[0].argmax())]
    return Fit(
        hypothesis=target.hypothesis,
        z=best.z,
        covariance=best.covariance,
        predicted=target.value - residual,
        slopes=slopes,
        noise=error.covariance,
        model_error=error.model_error,
        draws=draws,
        log_fit=float(target.likelihood.log(residual[None])[0]),
        log_evidence=log_evidence[0],
        log_evidence_sd=log_evidence[1],
        method=method,
        peaks=tuple(peaks),
        effective=effective,
    )
