"""The ways in which a visit is disturbed, each with its share of visits and its covariance.

A disturbance moves the log frequencies of one visit, and as a rule no other's: a joint gives in the
wind, a van stands beside the hanger, another hanger is hit. The table is judgement, of what owners
report: joints give and wires slip on one windy day in eight; heavy vehicles, sensors and mistakes
together disturb one visit in twenty-five.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from shm.values import TENSION, FloatArray, WatchedQuantity


@dataclass(frozen=True)
class Disturbance:
    """One way in which a visit is disturbed.

    `share` is that of visits, before any test. Standard deviations: `tension` of the logarithm of
    the tension; `springs` of each spring, in its steps; `common` of all log frequencies alike;
    `each` of every log frequency. What `recurs` is so many times as much, and alike each time: a
    joint that gives does so to the same place. `stays` is the probability that it is still there
    at the next visit. An `is_error` one is of the measurement. Unless it `passes` for a matter of
    course, the test is to be repeated.
    """

    name: str
    share: float
    tension: float = 0.0
    springs: float = 0.0
    common: float = 0.0
    each: float = 0.0
    recurs: float = 0.0
    stays: float = 0.0
    is_error: bool = False
    passes: bool = False

    def quantity_sds(self, quantities: Sequence[WatchedQuantity]) -> FloatArray:
        """Return the standard deviation of each quantity (q,), in its coordinate."""
        return np.array(
            [
                self.tension if one.name == TENSION else self.springs * one.step_sd
                for one in quantities
            ]
        )

    def factor(self, quantities: Sequence[WatchedQuantity], loosening: FloatArray) -> FloatArray:
        """Return a factor (n + q, r) of what it does but for each frequency by itself.

        `loosening` (n, k) is along which a joint gives beside its spring's slope.
        """
        n, sds = len(loosening), self.quantity_sds(quantities)
        modes = [self.springs * loosening, self.common * np.ones((n, 1))]
        of_modes = np.hstack([each for each in modes if each.any()] or [np.zeros((n, 0))])
        moved = np.diag(sds)[:, sds > 0]
        found = np.zeros((n + len(sds), moved.shape[1] + of_modes.shape[1]))
        found[n:, : moved.shape[1]] = moved
        found[:n, moved.shape[1] :] = of_modes
        return found


OF_HANGERS = (
    Disturbance(
        "a joint gives", 0.06, springs=1.0, each=0.0005, recurs=3.0, stays=0.3, passes=True
    ),
    Disturbance(
        "a load beside the hanger", 0.03, tension=0.05, each=0.0005, stays=0.08, passes=True
    ),
    Disturbance("another clock or sensors", 0.01, common=0.1, each=0.05, is_error=True),
    Disturbance("another hanger", 0.01, tension=0.2, springs=10.0, each=0.0005, is_error=True),
    Disturbance("orders mistaken", 0.01, common=1.0, each=0.3, is_error=True),
)
OF_FREQUENCIES = (
    Disturbance("another clock or mode", 0.01, common=0.1, each=0.05, is_error=True),
    Disturbance("gross", 0.001, common=1.0, each=0.05, is_error=True),
)
"""Of a structure without a model: no tension moves alone, and no spring."""
