"""What a state is made of, and how the level of each quantity follows from it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shm.values import FloatArray


@dataclass(frozen=True)
class Design:
    """A state: levels (q), temperature coefficients (q), jumps, rates, and last a new change (q).

    `jumps` are the quantities (by number) in which a called change has happened, `rates` those of
    them which go on by so much a year since `since_years`. The new change is left to the filters.
    """

    q: int
    jumps: tuple[int, ...] = ()
    rates: tuple[int, ...] = ()
    since_years: float = 0.0

    @property
    def size(self) -> int:
        """Elements of a state, the new change included."""
        return self.known + self.q

    @property
    def known(self) -> int:
        """Elements of a state without the new change."""
        return 2 * self.q + len(self.jumps) + len(self.rates)

    def loadings(self, years: float, kelvin: float) -> FloatArray:
        """Of the level of each quantity (q, known)."""
        eye = np.eye(self.q)
        return np.hstack([eye, kelvin * eye, self._changes(years)])

    def change_loadings(self, years: float) -> FloatArray:
        """Of what the called changes have made of each quantity (q, known)."""
        return np.hstack([np.zeros((self.q, 2 * self.q)), self._changes(years)])

    def _changes(self, years: float) -> FloatArray:
        eye = np.eye(self.q)
        return np.hstack(
            [eye[:, list(self.jumps)], (years - self.since_years) * eye[:, list(self.rates)]]
        )

    def after(self, years: float, jumped: set[int], going_on: set[int]) -> Design:
        """The design once more changes are called."""
        return Design(
            self.q,
            tuple(sorted({*self.jumps, *jumped})),
            tuple(sorted({*self.rates, *going_on})),
            years,
        )

    def carried(self, later: Design, progress: float, going_on: bool) -> FloatArray:
        """Of a state in this design to one in `later` (later.size, size): the new change is called.

        `progress` is how much of it is done, `going_on` whether it goes on. A change of a quantity
        that the later design has no place for is lost.
        """
        matrix = np.zeros((later.size, self.size))
        matrix[: 2 * self.q, : 2 * self.q] = np.eye(2 * self.q)
        done = np.hstack([self.change_loadings(later.since_years), progress * np.eye(self.q)])
        jumps, rates = 2 * self.q, 2 * self.q + len(later.jumps)
        matrix[jumps:rates] = done[list(later.jumps)]
        for row, which in enumerate(later.rates, start=rates):
            if which in self.rates:
                matrix[row, 2 * self.q + len(self.jumps) + self.rates.index(which)] = 1
            if going_on:
                matrix[row, self.known + which] = 1
        return matrix
