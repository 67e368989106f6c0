"""How far an effect's law may be off: a real one does not follow the catalogue to the letter.

Corrosion has no edges, sockets taper, joints slip by another power. The larger an effect, the more
its law's own error stands out of the noise, and without an allowance a second effect or something
unknown would take the blame. So the data may err about a prediction by a fraction of what the
effect does to each of them beyond what the baseline can follow, the same in all tests of a mode;
the fraction is unknown.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.special import logsumexp

from shm.gap.contract import Covariance, Fit, NoiseNode, Observations
from shm.gap.likelihood import Likelihood
from shm.gap.noise import same_mode
from shm.values import FloatArray

FRACTIONS = ((0.0, 0.4), (0.03, 0.2), (0.1, 0.2), (0.2, 0.2))
"""By how much an effect's law is off, each with its prior probability."""


def law_gain(observations: Observations, baseline: Fit, fit: Fit) -> float:
    """What the log evidence of a fit with effects gains if their laws may be off.

    Never less than the log of the prior probability that they are exact. The prediction is taken
    as linear about the fit.
    """
    shift = fit.predicted - baseline.predicted
    logs = [
        _log_evidence(observations, fit, _allowed(observations, fit, shift, e))
        for e, _ in FRACTIONS
    ]
    return float(logsumexp(logs, b=[share for _, share in FRACTIONS]) - logs[0])


def _allowed(
    observations: Observations, fit: Fit, shift: FloatArray, fraction: float
) -> Covariance:
    """The errors of a fit with those of a law that is off by a fraction of its shift (data,)."""
    count = observations.design.frequencies
    off = fraction * shift
    together = np.outer(off[:count], off[:count]) * same_mode(observations.design)
    return replace(
        fit.noise,
        frequency=fit.noise.frequency + together,
        shape=fit.noise.shape + off[count:] ** 2,
    )


def _log_evidence(observations: Observations, fit: Fit, errors: Covariance) -> float:
    """The log evidence of a fit about its most probable point, all its parameters linear."""
    likelihood = Likelihood([NoiseNode(errors, 0.0, fit.model_error)])
    residual = observations.value - fit.predicted
    gram = likelihood.gram(np.column_stack([fit.slopes, residual])[None])[0, 0]
    inner, pull = gram[:-1, :-1] + np.eye(len(fit.z)), gram[:-1, -1] - fit.z
    left = gram[-1, -1] + fit.z @ fit.z - pull @ np.linalg.solve(inner, pull)
    return float(likelihood.log_height[0] - np.linalg.slogdet(inner)[1] / 2 - left / 2)
