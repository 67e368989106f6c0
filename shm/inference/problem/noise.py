"""The unknown errors of measured frequencies, the same for every inference and diagnosis.

Two sizes are unknown. Stated standard deviations s are estimates themselves: the true ones are
phi s, phi log-normal with a spread of 20 % and heavier tails (a jackknife over five hits is no
better). And each mode has an error of unknown size tau that repeats in all tests: what no model
has. tau is log-uniform from 1e-5 to 3e-3 (sound hangers that others measured had up to 5e-4). Half
of its variance is each mode's own, half goes together in neighbouring orders: what a model lacks is
seldom of one mode alone, and many modes that lack the same thing teach less than as many that err
by themselves.

With probability 0.05 tau lies beyond, up to 0.3. An update counts that: a class that does not fit
gets a wide posterior, not a sharp one at a wrong place. In a diagnosis it is a hypothesis of its
own, something unknown.
"""

from __future__ import annotations

import numpy as np
import scipy

from shm.assumptions import Assumptions
from shm.values import FloatArray, IntArray

# Numerical: five values reach 36 % to either side. With three, which reach 20 %, a diagnosis named
# false causes of two hangers of twenty (record 0013). Cost is in proportion.
_PHI_NODES = 5

UNFELT = 0.1
"""Of the least standard deviation of a datum: loads and tau below that change nothing."""


def correlate_model_errors(
    modes: tuple[IntArray, IntArray],
    others: tuple[IntArray, IntArray],
    assumed: Assumptions,
) -> FloatArray:
    """Return the correlation (F, G) of the model's errors of `modes` with those of `others`.

    Both are planes (F,) and orders (F,) from 1. Those of one plane and order are one error,
    whatever the test.
    """
    (plane, order), (other_plane, other_order) = modes, others
    same_plane = np.equal.outer(plane, other_plane)
    same_mode = same_plane & np.equal.outer(order, other_order)
    apart = np.subtract.outer(np.log(order), np.log(other_order))
    apart = apart / assumed.model_error_reach.value
    shared = np.exp(-0.5 * apart**2) * np.where(same_plane, 1.0, 0.5)
    together = assumed.model_error_shared.value
    return np.asarray((1 - together) * same_mode + together * shared)


def grid_model_errors(
    least_sd: float, step: float, assumed: Assumptions, beyond_usual: bool
) -> tuple[FloatArray, FloatArray]:
    """Return values of tau (k,), `step` apart in the logarithm, and log prior probabilities (k,).

    `least_sd` is the least standard deviation of a datum. The values end at the largest usual one,
    or go on to where no tension is given any more.
    """
    smallest, usual = np.log(assumed.model_error.bounds)
    likely = assumed.usual_model_error_share.value if beyond_usual else 1.0
    top = np.log(assumed.largest_model_error.value) if beyond_usual else usual
    least = np.log(2 * UNFELT * least_sd)
    lowest = np.clip(least, smallest, max(smallest, usual - np.log(10)))
    nodes = np.linspace(lowest, top, int((top - lowest) / step) + 2)
    density = np.full(len(nodes), likely / (usual - smallest))
    if beyond_usual:
        density[nodes > usual] = (1 - likely) / (top - usual)
    share = density * (nodes[1] - nodes[0])
    share[-1] /= 2
    # The first stands for all that is too small to be felt.
    share[0] = share[0] / 2 + likely * (lowest - smallest) / (usual - smallest)
    return np.exp(nodes), np.log(share / share.sum())


def grid_sd_factors(
    assumed: Assumptions, scatter: float = 0.0, freedom: int = 0
) -> tuple[FloatArray, FloatArray]:
    """Return equally probable values of phi (k,), and log weights (k,).

    `scatter` is that of tests about their means, in stated variances, with its degrees of
    `freedom`; the weights hold what it says of phi.
    """
    grid = np.linspace(-1.5, 2.5, 401)
    spread, tails = assumed.stated_sd_log_sd.value, assumed.stated_sd_freedom.value
    log = -(tails + 1) / 2 * np.log1p((grid / spread) ** 2 / tails)
    prior = log - scipy.special.logsumexp(log)
    joint = prior - freedom * grid - 0.5 * scatter * np.exp(-2 * grid)
    total = float(scipy.special.logsumexp(joint))
    share = np.exp(joint - total)
    reached = share.cumsum() - share / 2
    middle = (np.arange(_PHI_NODES) + 0.5) / _PHI_NODES
    nodes = np.interp(middle, reached, grid)
    return np.exp(nodes), np.full(_PHI_NODES, total - np.log(_PHI_NODES))
