"""What the modes of a tensioned beam look like whatever its length, tension and end springs.

Used to number modes when some are missing; a yardstick of about one percent, not a model to update.
Far from its ends a tensioned Euler-Bernoulli beam vibrates as sin(beta s + theta), s = x/L, plus an
edge term exp(-alpha s) at either end, alpha^2 = xi^2 + beta^2, xi = L sqrt(T/EI). A rotational
spring kappa = k L/EI sets tan(theta) = -kappa beta/(alpha^2 + beta^2 + kappa alpha), and
beta + 2 theta = n pi numbers the modes; the frequency goes as alpha beta. (Standard beam theory,
the overlap of the two edge terms left out: below 1 % in frequency, and only for n = 1, xi = 0.)
Springs are spread by their fixity, kappa/(kappa + sqrt(xi^2 + pi^2)): theta is nearly proportional
to it, and two springs that differ act on the frequencies as two of their mean fixity do.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from shm.values import FloatArray, IntArray

HIGHEST_ORDER = 60
STEP = 0.002
"""Of log frequency in the tables of the nearest order."""
_TENSION = np.concatenate(([0.0], np.geomspace(1.0, 300.0, 58), [1000.0]))
_NO_TENSION = 0.5
_FIXITY = np.array([0.0, 0.25, 0.5, 0.75, 1.0])


@dataclass(frozen=True, eq=False)
class Pattern:
    """Modes of tensioned beams over a grid of xi and of spring fixity.

    `log_xi` has shape (tensions,), the others (tensions, springs, orders): `log_frequency` in units
    of the first frequency of the pinned beam, `beta`, `alpha` and `theta` of the shape.
    """

    log_xi: FloatArray
    log_frequency: FloatArray
    beta: FloatArray
    alpha: FloatArray
    theta: FloatArray

    def shapes(self, position: FloatArray, tensions: IntArray) -> FloatArray:
        """Values at x/L `position` (points,): (tensions, springs, orders, points)."""
        beta, alpha, theta = (
            array[tensions][..., np.newaxis] for array in (self.beta, self.alpha, self.theta)
        )
        edge = np.sin(theta) * np.exp(-alpha * position)
        orders = np.arange(1, self.beta.shape[-1] + 1)[:, np.newaxis]
        far_edge = (-1.0) ** orders * np.sin(theta) * np.exp(-alpha * (1 - position))
        return np.asarray(np.sin(beta * position + theta) - edge + far_edge)


@dataclass(frozen=True, eq=False)
class Nearest:
    """The order nearest to a log frequency, and how far it is, for every pattern of the grid.

    `log_frequency` (entries,) rises by `STEP`; `order` (from 0) and `residual` are (entries,
    tensions, springs).
    """

    log_frequency: FloatArray
    order: IntArray
    residual: FloatArray

    def entry(self, log_frequency: FloatArray) -> IntArray:
        """Entries of log frequencies; those beyond the table get its ends."""
        entry = np.round((log_frequency - self.log_frequency[0]) / STEP).astype(int)
        return np.asarray(np.clip(entry, 0, len(self.log_frequency) - 1))


@lru_cache(maxsize=1)
def tensioned_beam_pattern() -> Pattern:
    """The grid of patterns; made once."""
    order = np.arange(1, HIGHEST_ORDER + 1)
    tension, fixity, order_pi = np.meshgrid(_TENSION, _FIXITY, order * np.pi, indexing="ij")
    beta = _solve_beta(tension, fixity, order_pi)
    alpha = np.hypot(tension, beta)
    log_xi = np.log(np.maximum(_TENSION, _NO_TENSION))
    log_frequency = np.log(alpha * beta) - log_pinned(log_xi)[:, np.newaxis, np.newaxis]
    return Pattern(log_xi, log_frequency, beta, alpha, _theta(beta, tension, fixity))


@lru_cache(maxsize=4)
def nearest_orders(shift: tuple[float, ...] = ()) -> Nearest:
    """The table of nearest orders; made once for each `shift` (orders,) of log frequency."""
    logs = tensioned_beam_pattern().log_frequency
    if shift:
        logs = np.maximum.accumulate(logs + np.array(shift), axis=-1)
    entries = np.arange(logs.min() - 1.0, logs.max() + STEP, STEP)
    limits = (logs[..., 1:] + logs[..., :-1]) / 2
    order = np.array([[np.searchsorted(limit, entries) for limit in row] for row in limits])
    near = np.take_along_axis(logs, order, axis=-1)
    residual = np.moveaxis(entries - near, -1, 0)
    return Nearest(entries, np.moveaxis(order, -1, 0).astype(np.int16), residual.astype(np.float32))


def log_pinned(log_xi: FloatArray) -> FloatArray:
    """Log of the pinned beam's first frequency in units of sqrt(EI/m)/(2 pi L^2)."""
    return np.asarray(np.log(np.pi * np.hypot(np.exp(log_xi), np.pi)))


def _theta(beta: FloatArray, tension: FloatArray, fixity: FloatArray) -> FloatArray:
    alpha = np.hypot(tension, beta)
    spring = fixity * np.hypot(tension, np.pi)
    return np.asarray(
        -np.arctan2(spring * beta, (1 - fixity) * (alpha**2 + beta**2) + spring * alpha)
    )


def _solve_beta(tension: FloatArray, fixity: FloatArray, order_pi: FloatArray) -> FloatArray:
    """beta + 2 theta(beta) = n pi by bisection; the left side grows with beta."""
    low, high = order_pi, order_pi + np.pi / 2
    for _ in range(40):
        middle = (low + high) / 2
        above = middle + 2 * _theta(middle, tension, fixity) > order_pi
        low, high = np.where(above, low, middle), np.where(above, middle, high)
    return np.asarray((low + high) / 2)
