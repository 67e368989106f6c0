"""Draws of several proposals, each weighed against the mixture of all: adaptive multiple importance
sampling (Cornuet et al. 2012, Scandinavian Journal of Statistics 39, 798).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Generic, Protocol, Self, TypeVar

import numpy as np
from scipy.special import logsumexp

from shm.values import FloatArray


class Batch(Protocol):
    """What is known of some draws."""

    def joined(self, other: Self, /) -> Self:
        """These draws and then the others."""


P = TypeVar("P")
B = TypeVar("B", bound=Batch)


class Pool(Generic[P, B]):
    """All draws so far, as one `batch`, with the log of target over proposals.

    `log_density(proposal, batch)` is the log density (n,) of a proposal at the draws of a batch.
    """

    batch: B

    def __init__(self, log_density: Callable[[P, B], FloatArray]):
        self._log_density = log_density
        self._proposals: list[tuple[P, int]] = []
        self._log_target: FloatArray = np.empty(0)
        self._log_drawn: FloatArray = np.empty(0)

    @property
    def draws(self) -> int:
        """How many were drawn, those that were not kept among them."""
        return sum(draws for _, draws in self._proposals)

    @property
    def log_weights(self) -> FloatArray:
        """Of the draws in `batch` (n,); the mean over all `draws` is the target's integral."""
        return np.asarray(self._log_target - self._log_drawn + np.log(self.draws))

    def add(self, proposal: P, draws: int, batch: B, log_target: FloatArray) -> None:
        """Those kept of so many draws of a proposal, where the target's log density is known."""
        self._append([(proposal, draws)], batch, log_target)

    def absorb(self, other: Pool[P, B]) -> None:
        """The draws of another pool of the same target."""
        self._append(other._proposals, other.batch, other._log_target)

    def _append(self, proposals: list[tuple[P, int]], batch: B, log_target: FloatArray) -> None:
        first = not self._proposals
        old = np.empty(0) if first else self._drawn(proposals, self.batch)
        self._proposals = [*self._proposals, *proposals]
        new = self._drawn(self._proposals, batch)
        self._log_drawn = np.append(np.logaddexp(self._log_drawn, old), new)
        self._log_target = np.append(self._log_target, log_target)
        self.batch = batch if first else self.batch.joined(batch)

    def _drawn(self, proposals: list[tuple[P, int]], batch: B) -> FloatArray:
        """Log of how many draws per volume (n,) the proposals, each of so many, put there."""
        parts = [np.log(draws) + self._log_density(each, batch) for each, draws in proposals]
        return np.asarray(logsumexp(parts, axis=0))
