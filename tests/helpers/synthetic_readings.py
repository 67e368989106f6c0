"""Readings of a hanger straight from a linear normal model, without any frequencies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta

import numpy as np

from shm.values import End, FloatArray, Plane, Reading, WatchedQuantity

START = datetime(2026, 1, 1, tzinfo=UTC)
DAYS_PER_YEAR = 365.25
SPRING_STEP = 0.003
TENSION_STEP = 0.05
SOUND_TESTS = 8
"""So many first tests hold no blunder: while nothing is known, nobody could tell one."""


def tension(step_sd: float = TENSION_STEP) -> WatchedQuantity:
    """The tension, 700 kN at the baseline."""
    coordinates = np.union1d(np.linspace(-1, 0.5, 301), 0.0)
    return WatchedQuantity("tension", 700e3, coordinates, 700e3 * np.exp(coordinates), step_sd)


def spring(name: str, end: End | None, plane: Plane) -> WatchedQuantity:
    """A spring of 10^7 N m/rad whose response saturates on either side."""
    log10_k = np.linspace(5, 9, 161)
    coordinates = 2 * SPRING_STEP / 0.3 * np.tanh((log10_k - 7) / 2)
    return WatchedQuantity(name, 7.0, coordinates, log10_k, SPRING_STEP, end, plane)


TENSION_ALONE = (tension(),)
PLANES_ALONE = (
    tension(),
    spring("log10_kx", None, "transverse"),
    spring("log10_ky", None, "longitudinal"),
)
BOTH_ENDS = (
    tension(),
    spring("log10_k1", "deck", "transverse"),
    spring("log10_k2", "deck", "longitudinal"),
    spring("log10_k3", "arch", "transverse"),
    spring("log10_k4", "arch", "longitudinal"),
)


def information(q: int, frequency_sd: float = 3e-4, modes: int = 6) -> FloatArray:
    """Of `modes` log frequencies a plane (q, q): 1, 3, or 5 quantities, the last of rank 3.

    Tension moves the lower modes a little more, springs the higher ones; the two ends of a plane
    move all frequencies alike.
    """
    rows = [
        [0.5 * (1 - 0.03 * mode), *(2 * mode / modes * (plane == own) for own in (0, 1))]
        for plane in (0, 1)
        for mode in range(1, modes + 1)
    ]
    sensitivity = np.array(rows)[:, [0, 1, 2, 1, 2][:q]]
    return np.asarray(sensitivity.T @ sensitivity / frequency_sd**2)


@dataclass(frozen=True, eq=False)
class History:
    """What happens to a hanger. `scatter` is of the tension, of springs in proportion to it.

    From the test `change_at` on, `step` (q,) is added, and `ramp` (q,) for each year since.
    """

    quantities: tuple[WatchedQuantity, ...] = TENSION_ALONE
    tests: int = 60
    days_between: float = 20.0
    scatter: float = 0.003
    per_kelvin: float = 0.001
    seasons_k: float = 15.0
    days_k: float = 5.0
    temperatures_missing: float = 0.0
    outliers: float = 0.01
    change_at: int = 10**6
    step: Sequence[float] = (0.0,)
    ramp: Sequence[float] = (0.0,)

    def readings(self, seed: int) -> list[Reading]:
        """One a test, at irregular times."""
        rng = np.random.default_rng(seed)
        q = len(self.quantities)
        years = np.cumsum(rng.exponential(self.days_between, self.tests) + 0.5) / DAYS_PER_YEAR
        kelvin = self.seasons_k * np.sin(2 * np.pi * (years + rng.random()))
        kelvin += self.days_k * rng.standard_normal(self.tests)
        steps = np.array([quantity.step_sd for quantity in self.quantities])
        scatter = self.scatter * steps / steps[0]
        x = scatter * rng.standard_normal((self.tests, q))
        x[:, 0] += self.per_kelvin * kelvin
        after = np.arange(self.tests) >= self.change_at
        since = years - years[min(self.change_at - 1, self.tests - 1)]
        x[after] += np.array(self.step) + since[after, None] * np.array(self.ramp)
        blunders = (rng.random(self.tests) < self.outliers) & (np.arange(self.tests) >= SOUND_TESTS)
        x[blunders] += 10 * scatter * rng.standard_normal((int(blunders.sum()), q))
        known = rng.random(self.tests) >= self.temperatures_missing
        return [
            reading(f"t{i}", years[i], x[i], 10 + kelvin[i] if known[i] else np.nan, rng)
            for i in range(self.tests)
        ]


def reading(
    test: str, years: float, x: FloatArray, temperature_c: float, rng: np.random.Generator
) -> Reading:
    """What a test at `years` from the start says, identification errors included."""
    sizes, vectors = np.linalg.eigh(information(len(x)))
    seen = sizes > 1e-9 * sizes[-1]
    errors = rng.standard_normal(len(x)) / np.sqrt(np.where(seen, sizes, 1.0))
    mean = vectors @ (seen * (vectors.T @ x + errors))
    return Reading(
        test,
        START + timedelta(days=float(years) * DAYS_PER_YEAR),
        float(temperature_c),
        mean,
        information(len(x)),
    )


def shifted(readings: Sequence[Reading], index: int, x: Sequence[float]) -> list[Reading]:
    """The readings, `x` (q,) added to that at `index` alone."""
    found = list(readings)
    sizes, vectors = np.linalg.eigh(found[index].information)
    seen = vectors[:, sizes > 1e-9 * sizes[-1]]
    found[index] = replace(found[index], mean=found[index].mean + seen @ (seen.T @ np.array(x)))
    return found
