"""Readings of a hanger straight from a linear normal model of its log frequencies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from functools import cache

import numpy as np

from shm.models import described
from shm.values import PLANES, End, FloatArray, ModeReading, Plane, Reading, WatchedQuantity
from shm.watch.engine.causes import Columns, columns_of
from shm.watch.engine.options import WatchOptions
from shm.watch.watcher import Watch, Watcher
from tests.helpers.hangers import HANGER_3

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


FREQUENCY_SD = 3e-4
_MODES_A_PLANE = 6
MODES = tuple((plane, order) for plane in PLANES for order in range(1, _MODES_A_PLANE + 1))


def slopes(q: int) -> FloatArray:
    """Of the log frequencies (12, q) of `MODES`: 1, 3, or 5 quantities, the last of rank 3.

    Tension moves the lower modes a little more, springs the higher ones; the two ends of a plane
    move all frequencies alike.
    """
    rows = [
        [0.5 * (1 - 0.03 * order), *(2 * order / _MODES_A_PLANE * (plane == own) for own in PLANES)]
        for plane, order in MODES
    ]
    return np.array(rows)[:, [0, 1, 2, 1, 2][:q]]


@cache
def columns(q: int) -> Columns:
    """What other causes do to the frequencies of a thick rod on springs of 10^7 N m/rad."""
    base = np.array([1.0, 1.0, 7.0, 7.0, 7.0, 7.0])
    found = columns_of(described("beam2", HANGER_3), base, HANGER_3, MODES)
    return replace(found, slopes=slopes(q))


def watcher(
    quantities: tuple[WatchedQuantity, ...], options: WatchOptions | None = None
) -> Watcher:
    return Watcher(quantities, columns(len(quantities)), HANGER_3, options or WatchOptions())


def watch_of(
    readings: Sequence[Reading],
    quantities: tuple[WatchedQuantity, ...],
    options: WatchOptions | None = None,
) -> Watch:
    chosen = options or WatchOptions.of(HANGER_3.assumptions)
    watcher = Watcher(quantities, columns(len(quantities)), HANGER_3, chosen)
    if not readings:
        return Watch(())
    state, begun = watcher.begin(readings[: chosen.baseline_tests])
    later = watcher.watch(state, readings[chosen.baseline_tests :])[1]
    return Watch((*begun.tests, *later.tests))


@dataclass(frozen=True, eq=False)
class History:
    """What happens to a hanger. `scatter` is of the tension, of springs in proportion to it.

    From the test `change_at` on, `step` (q,) is added, and `ramp` (q,) for each year since, and
    `mode_step` (12,) to the log frequencies by themselves. `mode_scatter` is theirs, a mode each.
    """

    quantities: tuple[WatchedQuantity, ...] = TENSION_ALONE
    tests: int = 60
    days_between: float = 20.0
    scatter: float = 0.003
    mode_scatter: float = 3e-4
    per_kelvin: float = 0.001
    seasons_k: float = 15.0
    days_k: float = 5.0
    temperatures_missing: float = 0.0
    outliers: float = 0.01
    change_at: int = 10**6
    step: Sequence[float] = (0.0,)
    ramp: Sequence[float] = (0.0,)
    mode_step: Sequence[float] = (0.0,)

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
        own = self.mode_scatter * rng.standard_normal((self.tests, len(MODES)))
        own[after] += np.array(self.mode_step)
        return [
            reading(f"t{i}", years[i], x[i], 10 + kelvin[i] if known[i] else np.nan, rng, own[i])
            for i in range(self.tests)
        ]


def reading(
    test: str,
    years: float,
    x: FloatArray,
    temperature_c: float,
    rng: np.random.Generator,
    own: FloatArray | float = 0.0,
) -> Reading:
    """What a test at `years` from the start says, identification errors included.

    `own` (12,) is what the log frequencies do beside the quantities `x` (q,).
    """
    n = len(MODES)
    values = slopes(len(x)) @ x + own + FREQUENCY_SD * rng.standard_normal(n)
    modes = ModeReading(
        values=values,
        variances=np.full(n, FREQUENCY_SD**2),
        per_kelvin=np.zeros(n),
        mistaken=np.zeros(n, bool),
    )
    when = START + timedelta(days=float(years) * DAYS_PER_YEAR)
    blank = Reading(test, when, float(temperature_c), np.zeros(len(x)), np.zeros((len(x),) * 2))
    return with_modes(blank, modes)


def with_modes(given: Reading, modes: ModeReading) -> Reading:
    """The same of other modes: mean and information are what these say together."""
    its = slopes(len(given.mean))
    weighted = its / modes.variances[:, None]
    information = weighted.T @ its
    mean = np.linalg.pinv(information, rcond=1e-9) @ (weighted.T @ modes.values)
    return replace(given, modes=modes, mean=mean, information=information)


def off_by(given: Reading, by: FloatArray | float) -> Reading:
    """The same with `by` (12,) added to its log frequencies."""
    assert given.modes is not None
    return with_modes(given, replace(given.modes, values=given.modes.values + by))


def without_modes(given: Reading, lacking: Sequence[int]) -> Reading:
    """The same where some modes were not measured."""
    assert given.modes is not None
    variances, values = given.modes.variances.copy(), given.modes.values.copy()
    variances[list(lacking)], values[list(lacking)] = np.inf, 0.0
    return with_modes(given, replace(given.modes, variances=variances, values=values))


def shifted(readings: Sequence[Reading], index: int, x: Sequence[float]) -> list[Reading]:
    """The readings, `x` (q,) added to that at `index` alone."""
    found = list(readings)
    found[index] = off_by(found[index], slopes(len(x)) @ np.array(x))
    return found
