"""What the modes of a tensioned beam look like whatever its length, tension and end springs.

Used to number modes when some are missing; a yardstick of about one percent, not a model to update.
Far from its ends a tensioned Euler-Bernoulli beam vibrates as sin(beta s + theta), s = x/L, plus an
edge term exp(-alpha s) at either end, alpha^2 = xi^2 + beta^2, xi = L sqrt(T/EI). A rotational
spring kappa = k L/EI sets tan(theta) = -kappa beta/(alpha^2 + beta^2 + kappa alpha), and
beta + 2 theta = n pi numbers the modes; the frequency goes as alpha beta. (Standard beam theory,
the overlap of the two edge terms left out: below 1 % in frequency, and only for n = 1, xi = 0.)
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from shm.values import FloatArray

HIGHEST_ORDER = 60
_TENSION = np.concatenate(([0.0], np.geomspace(1.0, 1000.0, 40)))
_NO_TENSION = 0.5
_SPRING = np.array([0.0, 1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1e9])


@dataclass(frozen=True, eq=False)
class Pattern:
    """Modes of tensioned beams over a grid of xi and kappa.

    `log_xi` has shape (tensions,), the others (tensions, springs, orders): `log_frequency` up to a
    constant, `beta`, `alpha` and `theta` of the shape.
    """

    log_xi: FloatArray
    log_frequency: FloatArray
    beta: FloatArray
    alpha: FloatArray
    theta: FloatArray

    def shapes(self, position: FloatArray) -> FloatArray:
        """Values at x/L `position` (points,): (tensions, springs, orders, points)."""
        beta, alpha, theta = (
            array[..., np.newaxis] for array in (self.beta, self.alpha, self.theta)
        )
        edge = np.sin(theta) * np.exp(-alpha * position)
        orders = np.arange(1, self.beta.shape[-1] + 1)[:, np.newaxis]
        far_edge = (-1.0) ** orders * np.sin(theta) * np.exp(-alpha * (1 - position))
        return np.asarray(np.sin(beta * position + theta) - edge + far_edge)


@lru_cache(maxsize=1)
def tensioned_beam_pattern() -> Pattern:
    """The grid of patterns; made once."""
    order = np.arange(1, HIGHEST_ORDER + 1)
    tension, spring, order_pi = np.meshgrid(_TENSION, _SPRING, order * np.pi, indexing="ij")
    beta = _solve_beta(tension, spring, order_pi)
    alpha = np.hypot(tension, beta)
    log_xi = np.log(np.maximum(_TENSION, _NO_TENSION))
    return Pattern(log_xi, np.log(alpha * beta), beta, alpha, _theta(beta, tension, spring))


def _theta(beta: FloatArray, tension: FloatArray, spring: FloatArray) -> FloatArray:
    alpha = np.hypot(tension, beta)
    return np.asarray(-np.arctan2(spring * beta, alpha**2 + beta**2 + spring * alpha))


def _solve_beta(tension: FloatArray, spring: FloatArray, order_pi: FloatArray) -> FloatArray:
    """beta + 2 theta(beta) = n pi by bisection; the left side grows with beta."""
    low, high = order_pi, order_pi + np.pi / 2
    for _ in range(40):
        middle = (low + high) / 2
        above = middle + 2 * _theta(middle, tension, spring) > order_pi
        low, high = np.where(above, low, middle), np.where(above, middle, high)
    return np.asarray((low + high) / 2)
