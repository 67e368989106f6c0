"""What a state is made of, how the level of each quantity follows from it, and readings as the
filters take them: in units of a step, along the directions that a test sees.

What may change together is each quantity alone, or the ends' springs that one cause loosens. A pin
that wears, or a bolt that comes loose, takes stiffness from its end in both planes. Such a change
shifts the logarithms of the stiffnesses about alike, so that in units of each spring's step, which
is what so many decades do, it is about the same for all of them. How nearly is not known: before
any data the shifts of a joint change go together with a correlation of 0.8.

Where a spring stands for both ends of a plane and one of them loosens, a part of it is read as
tension (see readings.py). The other plane tells that from tension unless it loosens, too: then
springs and tension move together, the tension by any amount of its own.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime

import numpy as np

from shm.errors import BadInput
from shm.values import NAN, TENSION, End, FloatArray, Reading, WatchedQuantity
from shm.watch.options import WatchOptions

_CORRELATION = 0.8  # judgement: see above
_ENDS: tuple[End, ...] = ("deck", "arch")
DAYS_PER_YEAR = 365.25  # Julian
_SEASON_YEARS = 60 / DAYS_PER_YEAR  # judgement: so many days are of one season
_SEEN_AT_ALL = 1e-4  # in units of a step: an sd of a hundred steps sees nothing
_SEEN_BESIDE_OTHERS = 1e-11  # technical: below is rounding of the largest


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


@dataclass(frozen=True, eq=False)
class Direction:
    """One way to change: the numbers of the quantities that move, the others stay.

    `root` (q, members) is a factor of the covariance of the shifts in steps, before any data.
    """

    members: tuple[int, ...]
    root: FloatArray

    @property
    def covariance(self) -> FloatArray:
        """Of the shifts of all quantities (q, q), 0 of those that stay."""
        return self.root @ self.root.T


def directions_of(quantities: Sequence[WatchedQuantity]) -> tuple[Direction, ...]:
    """Each quantity alone, in their order; then springs of one end, of both, those with tension.

    A spring of which the data do not tell the end may belong to either. What is one spring alone,
    or the same springs again, is left out.
    """
    everything = range(len(quantities))
    springs = [j for j in everything if quantities[j].name != TENSION]
    of_ends = [[j for j in springs if quantities[j].end in (end, None)] for end in _ENDS]
    joint = dict.fromkeys(tuple(each) for each in (*of_ends, springs) if len(each) > 1)
    is_read_as_tension = any(len(quantities[j].parameters) > 1 for j in springs)
    mixed = [tuple(everything)] if joint and is_read_as_tension else []
    chosen = dict.fromkeys([*((j,) for j in everything), *joint, *mixed])
    return tuple(direction_of(each, springs, len(quantities)) for each in chosen)


def direction_of(members: tuple[int, ...], springs: Sequence[int], q: int) -> Direction:
    """Of the quantities `members` among q, of which the `springs` move about alike."""
    n = len(members)
    among = np.eye(n)
    alike = np.isin(members, springs)
    among[np.ix_(alike, alike)] += _CORRELATION * (1 - np.eye(int(alike.sum())))
    root = np.zeros((q, n))
    root[list(members)] = np.linalg.cholesky(among)
    return Direction(members, root)


@dataclass(frozen=True, eq=False)
class Measurement:
    """One reading: `values` (d,) = `directions` (q, d)' x + noise of `variances` (d,).

    x is in units of each quantity's `step_sd`. Directions that the test does not see are left out,
    so d <= q. `kelvin` is the temperature from the reference, `kelvin_sd` 0 where it was measured;
    where not, `per_kelvin` (q,) is what the softening of the steel does to x besides.
    """

    years: float
    kelvin: float
    kelvin_sd: float
    per_kelvin: FloatArray
    values: FloatArray
    directions: FloatArray
    variances: FloatArray


@dataclass(frozen=True, eq=False)
class Warmth:
    """What the temperatures of the readings so far say of the next that has none.

    `reference_c` is the mean of the baseline's, or the first one known, NaN before there is any;
    `known_k` are those measured, from it, and `unknown_years` the times of the last tests without.
    """

    reference_c: float
    known_k: FloatArray
    unknown_years: FloatArray

    @classmethod
    def at(cls, temperatures_c: Sequence[float]) -> Warmth:
        """Before any reading; the reference is the mean of the baseline's `temperatures_c`."""
        known = [value for value in temperatures_c if math.isfinite(value)]
        return cls(float(np.mean(known)) if known else NAN, np.zeros(0), np.zeros(0))

    def after(
        self, temperature_c: float, years: float, options: WatchOptions
    ) -> tuple[Warmth, float, float]:
        """The same after one more reading, and what is to be taken for its kelvin and their sd.

        A temperature that was not measured is as those measured before: their mean and standard
        deviation. Tests of one season share what they miss, so that those of 60 days tell no more
        together than one.
        """
        if math.isfinite(temperature_c):
            reference = self.reference_c if math.isfinite(self.reference_c) else temperature_c
            kelvin = temperature_c - reference
            known = np.append(self.known_k, kelvin)
            return replace(self, reference_c=reference, known_k=known), kelvin, 0.0
        lately = self.unknown_years[self.unknown_years > years - _SEASON_YEARS]
        unknown = np.append(lately, years)
        mean, sd = _unmeasured(self.known_k, options.unknown_temperature_sd_k)
        return replace(self, unknown_years=unknown), mean, sd * math.sqrt(len(unknown))


def years_between(first: datetime, second: datetime) -> float:
    """From the first to the second, in years of 365.25 days."""
    return (second - first).total_seconds() / 86400 / DAYS_PER_YEAR


def measurement_of(
    reading: Reading, steps: FloatArray, years: float, kelvin: float, kelvin_sd: float
) -> Measurement:
    """A reading of quantities whose steps are `steps` (q,).

    Raises BadInput where it is not of as many.
    """
    n = len(steps)
    if reading.mean.shape != (n,) or reading.information.shape != (n, n):
        raise BadInput(f"The reading of test {reading.test} is not of {n} quantities.")
    information = steps[:, None] * reading.information * steps
    sizes, vectors = np.linalg.eigh((information + information.T) / 2)
    seen = sizes > max(_SEEN_AT_ALL, _SEEN_BESIDE_OTHERS * float(sizes[-1]))
    sizes, vectors = sizes[seen], vectors[:, seen]
    softened = np.zeros(n) if reading.per_kelvin is None else reading.per_kelvin / steps
    values = vectors.T @ (steps * (reading.information @ reading.mean)) / sizes
    values = values - kelvin * (vectors.T @ softened)
    # Rows of about unit variance keep the innovations well conditioned.
    scale = 1 / np.sqrt(1 + 1 / sizes)
    return Measurement(
        years=years,
        kelvin=kelvin,
        kelvin_sd=kelvin_sd,
        per_kelvin=softened,
        values=values * scale,
        directions=vectors * scale,
        variances=scale**2 / sizes,
    )


def _unmeasured(known_k: FloatArray, otherwise_sd: float) -> tuple[float, float]:
    """Mean and sd where the temperature is unknown; few known ones do not tell their sd."""
    mean = float(np.mean(known_k)) if len(known_k) else 0.0
    spread = float(np.std(known_k, ddof=1)) if len(known_k) > 1 else 0.0
    return mean, max(spread, otherwise_sd)
