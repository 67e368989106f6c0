"""The ways to change, the changes that were called, and what stands where in a test's columns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shm.values import FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class Direction:
    """One way to change: `factor` (columns, r) maps r independent unit normals to the change.

    `columns` are the modes (n), then the watched quantities (q). `name` is the cause's, `members`
    the quantities that move. `log_prior` is that of this cause given a change, `may_ramp` whether
    it may come slowly.
    """

    name: str
    factor: FloatArray
    members: tuple[int, ...]
    log_prior: float
    may_ramp: bool = True


@dataclass(frozen=True, eq=False)
class Told:
    """A called change: the test at which it began, its time, and whether it goes on.

    `precision` (n + q, n + q) is that of its size before the tests after the call: which causes
    called it.
    """

    first: int
    years: float
    is_ramp: bool
    precision: FloatArray


@dataclass(frozen=True, eq=False)
class Layout:
    """What stands where in the columns of a test: `n` modes, `q` quantities, then covariates.

    `prior_sd` (columns,) are those of the null's parameters; the quantities' own columns are no
    part of it, since the modes' levels hold them.
    """

    n: int
    q: int
    prior_sd: FloatArray

    @property
    def null(self) -> IntArray:
        """The columns of the null."""
        covariates = np.arange(self.n + self.q, len(self.prior_sd))
        return np.concatenate([np.arange(self.n), covariates])

    @property
    def change(self) -> slice:
        """The columns of which a change is made."""
        return slice(0, self.n + self.q)
