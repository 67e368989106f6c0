"""Estimate tension and end stiffness over time: local levels with the temperature as regressor.

level_t = level_{t-1} + N(0, rate^2 dt), reading_t = level_t + coefficient (temperature_t -
reference) + scatter + the reading's own error, of all quantities jointly (Harvey 1989, chapters 2
to 4; Durbin and Koopman 2012, sections 4.3 and 4.4). What the sequential test has found goes in:
outliers get a wide noise, at a called change the level is set free.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime

import numpy as np
import scipy

from shm.assumptions import DEFAULTS
from shm.errors import NothingThere, UsageError
from shm.values import FloatArray
from shm.values.drift import TENSION, Change, Reading, TemperatureCoefficient, WatchedQuantity
from shm.values.kinds import NAN
from shm.values.rounding import NINETY_PERCENT
from shm.watch.engine.limits import LIMITS
from shm.watch.engine.options import Assumed, reference_of
from shm.watch.engine.quantities import value_at


@dataclass(frozen=True, eq=False)
class Band:
    """Median and 90 % interval of a quantity at each test, each (n,); NaN where nothing is known.

    The tension is in N, a stiffness is log10 of it in the unit of its parameter.
    """

    low: FloatArray
    middle: FloatArray
    high: FloatArray

    @classmethod
    def of(cls, quantity: WatchedQuantity, mean: FloatArray, sd: FloatArray) -> Band:
        ends = [value_at(quantity, mean + sign * NINETY_PERCENT * sd) for sign in (-1, 1)]
        return cls(np.minimum(*ends), value_at(quantity, mean), np.maximum(*ends))


@dataclass(frozen=True)
class StateOptions(Assumed):
    """Weak priors of the state over time; one to three tests leave them as they are.

    `reference_temperature_c` NaN is the mean of the known ones. In units of a quantity's `step_sd`:
    the level wanders by `rate_of_step` in a year, readings scatter by `scatter_of_step` beyond
    their errors (medians of log-normal priors), the level lies within `jump_of_step` before the
    first test and after a called change. A temperature that is not known lies
    `unknown_temperature_sd_k` off the reference where fewer than five are known, else by the sd of
    those. The variance of an outlier's noise grows by `largest_inflation` at most.
    """

    reference_temperature_c: float = NAN
    rate_of_step: float = 0.1
    rate_log_sd: float = 1.5
    scatter_of_step: float = 0.04
    scatter_log_sd: float = 1.0
    tension_per_kelvin_sd: float = DEFAULTS.tension_per_kelvin_sd.value
    spring_per_kelvin_sd_of_step: float = DEFAULTS.spring_per_kelvin_sd_of_step.value
    unknown_temperature_sd_k: float = DEFAULTS.unknown_temperature_sd_k.value
    jump_of_step: float = 3.0
    largest_inflation: float = 1e4


@dataclass(frozen=True, eq=False)
class StateHistory:
    """Levels of all watched quantities over the tests of a hanger, in the watch's coordinates.

    `filtered_mean` (n, q) and `filtered_covariance` (n, q, q) rest on the tests up to each, the
    smoothed ones on all, at `reference_temperature_c`. `coefficient_mean` and `coefficient_sd` (q,)
    are of the coordinates per kelvin, `coefficient_prior_sd` is the sd before any test;
    `level_rate` (q,) is the sd by which a level wanders in a year.
    """

    quantities: tuple[WatchedQuantity, ...]
    readings: tuple[Reading, ...]
    reference_temperature_c: float
    filtered_mean: FloatArray
    filtered_covariance: FloatArray
    smoothed_mean: FloatArray
    smoothed_covariance: FloatArray
    coefficient_mean: FloatArray
    coefficient_sd: FloatArray
    coefficient_prior_sd: FloatArray
    level_rate: FloatArray

    @property
    def times(self) -> tuple[datetime, ...]:
        return tuple(reading.time for reading in self.readings)

    @property
    def temperatures_c(self) -> FloatArray:
        """Return those of the tests (n,), NaN where a test has none."""
        return _temperatures_c(self.readings)

    def filtered(self, name: str) -> Band:
        """Return what was known of a quantity at each test, from that test and those before."""
        return self._level(name, self.filtered_mean, self.filtered_covariance)

    def smoothed(self, name: str) -> Band:
        """Return what is known today of a quantity at each test."""
        return self._level(name, self.smoothed_mean, self.smoothed_covariance)

    def read(self, name: str) -> Band:
        """Return what each test by itself says of a quantity at the reference temperature.

        A test may not tell all quantities apart, so the others are taken as smoothed and their
        uncertainty is added. The interval holds the reading's own error, not the scatter.
        """
        j = self._index(name)
        mean, sd = np.full((2, len(self.readings)), np.nan)
        for t, reading in enumerate(self.readings):
            row, its = np.delete(reading.information[j], j), reading.information[j, j]
            if its > 0 and np.all(np.isfinite(reading.mean)):
                warmth = np.nan_to_num(reading.temperature_c - self.reference_temperature_c)
                rest = reading.mean - self.coefficient_mean * warmth  # at the reference
                others = np.delete(np.delete(self.smoothed_covariance[t], j, 0), j, 1)
                off = np.delete(self.smoothed_mean[t] - rest, j)
                mean[t] = rest[j] - row @ off / its
                sd[t] = math.sqrt(1 / its + row @ others @ row / its**2)
        return Band.of(self.quantities[j], mean, sd)

    def temperature_coefficients(self) -> tuple[TemperatureCoefficient, ...]:
        """Return those per kelvin, at the baseline: a fraction of the tension, or decades."""
        columns = self.coefficient_mean, self.coefficient_sd, self.coefficient_prior_sd
        return tuple(
            TemperatureCoefficient(each.name, *(float(_slope_at_baseline(each) * v) for v in row))
            for each, row in zip(self.quantities, np.array(columns).T, strict=True)
        )

    def _index(self, name: str) -> int:
        names = [quantity.name for quantity in self.quantities]
        if name not in names:
            raise UsageError(f"{name} is not watched.", remedy=f"Watched: {', '.join(names)}.")
        return names.index(name)

    def _level(self, name: str, mean: FloatArray, covariance: FloatArray) -> Band:
        j = self._index(name)
        sd = np.sqrt(np.maximum(covariance[:, j, j], 0))
        return Band.of(self.quantities[j], mean[:, j], sd)


def _slope_at_baseline(quantity: WatchedQuantity) -> float:
    """Return the fraction of the tension, or the decades, per unit of the coordinate.

    Over a step's sd to either side: at an end that is as good as clamped the slope at one point
    has no bounds.
    """
    if quantity.name == TENSION:
        return 1.0
    inside = quantity.coordinates[0], quantity.coordinates[-1]
    low, high = np.clip([-quantity.step_sd, quantity.step_sd], *inside).tolist()
    return float((value_at(quantity, high) - value_at(quantity, low)) / (high - low))


def states(
    readings: Sequence[Reading],
    quantities: Sequence[WatchedQuantity],
    weights: FloatArray | None = None,
    changes: Sequence[datetime] = (),
    options: StateOptions | None = None,
) -> StateHistory:
    """Return filtered and smoothed levels of all quantities at n readings, oldest first.

    `weights` (n,) are probabilities of being an outlier (None: no outliers; NaN: not known, taken
    as 0). At each of `changes` the level is set free just before the first reading at that time or
    after it (see `set_free`). Raises NothingThere without readings.
    """
    chosen = options or StateOptions()
    if not readings:
        raise NothingThere("No test has a reading.", remedy="Ingest tests of this hanger first.")
    outlier = np.zeros(len(readings)) if weights is None else np.nan_to_num(weights, nan=0.0)
    model = LocalLevels.of(readings, quantities, outlier, changes, chosen)
    z = model.fitted()
    before, before_cov, after, after_cov = model.states(z)
    step, q = model.step, model.q
    rate, _ = model.rate_and_scatter(z)
    return StateHistory(
        quantities=tuple(quantities),
        readings=tuple(readings),
        reference_temperature_c=model.reference_c,
        filtered_mean=step * before[:, :q],
        filtered_covariance=np.outer(step, step) * before_cov[:, :q, :q],
        smoothed_mean=step * after[:, :q],
        smoothed_covariance=np.outer(step, step) * after_cov[:, :q, :q],
        coefficient_mean=step * after[-1, q:],
        coefficient_sd=step * np.sqrt(np.maximum(np.diag(after_cov[-1])[q:], 0)),
        coefficient_prior_sd=step * model.coefficient_sd,
        level_rate=step * rate,
    )


def set_free(calls: Sequence[Change], readings: Sequence[Reading]) -> tuple[datetime, ...]:
    """Return the `changes` of `states` that called changes make.

    A step that began within three tests frees the level at each of them; of one whose beginning is
    less clear at the last alone, since a level that is free at every test knows nothing but that
    test. A ramp frees nothing: the level follows it as it wanders.
    """
    free: list[datetime] = []
    for call in calls:
        times = [each.time for each in readings if call.began_after < each.time <= call.began_by]
        if call.sudden > LIMITS.a_step:
            free += times if len(times) <= LIMITS.state_clear else times[-1:]
    return tuple(sorted(set(free)))


def _temperatures_c(readings: Sequence[Reading]) -> FloatArray:
    return np.array([reading.temperature_c for reading in readings], np.float64)


@dataclass(frozen=True, eq=False)
class LocalLevels:
    """The model of n tests of q quantities, in units of each one's `step` (q,).

    `mean` (n, q) and `information` (n, q, q) are the readings', `warmth_k` (n,) the temperature
    above the reference, 0 where unknown, and `unknown_k` (n,) the sd of that. `inflation` (n,) is
    of the whole noise, for outliers, `years` (n,) those to the test before, `jump` (n,) the
    variance of the level just before each test. Parameters z (2 q,) are standard normal before any
    data: how many prior sds the logarithms of the q rates, then of the q scatters, lie above their
    prior medians.
    """

    mean: FloatArray
    information: FloatArray
    warmth_k: FloatArray
    unknown_k: FloatArray
    inflation: FloatArray
    years: FloatArray
    jump: FloatArray
    coefficient_sd: FloatArray
    step: FloatArray
    reference_c: float
    options: StateOptions

    @classmethod
    def of(
        cls,
        readings: Sequence[Reading],
        quantities: Sequence[WatchedQuantity],
        outlier: FloatArray,
        changes: Sequence[datetime],
        options: StateOptions,
    ) -> LocalLevels:
        step = np.array([quantity.step_sd for quantity in quantities])
        coefficient_sd = np.array(
            [
                options.tension_per_kelvin_sd / quantity.step_sd
                if quantity.name == TENSION
                else options.spring_per_kelvin_sd_of_step
                for quantity in quantities
            ]
        )
        mean = np.array([each.mean for each in readings]) / step
        information = np.array([each.information for each in readings]) * np.outer(step, step)
        is_blind = ~(np.isfinite(mean).all(axis=1) & np.isfinite(information).all(axis=(1, 2)))
        mean[is_blind], information[is_blind] = 0.0, 0.0
        temperature_c = _temperatures_c(readings)
        known = temperature_c[np.isfinite(temperature_c)]
        reference_c = options.reference_temperature_c
        if not math.isfinite(reference_c):
            reference_c = reference_of(temperature_c.tolist())
        spread_k = known.std() if len(known) >= LIMITS.few else options.unknown_temperature_sd_k
        seconds = [reading.time.timestamp() for reading in readings]
        times, jump = [reading.time for reading in readings], np.zeros(len(readings))
        free = [0, *(bisect_left(times, change) for change in changes)]
        jump[[at for at in free if at < len(times)]] = options.jump_of_step**2
        return cls(
            mean,
            (information + np.swapaxes(information, 1, 2)) / 2,
            np.nan_to_num(temperature_c - reference_c),
            np.where(np.isfinite(temperature_c), 0.0, spread_k),
            1 / np.clip(1 - outlier, 1 / options.largest_inflation, 1.0),
            np.diff(seconds, prepend=seconds[0]) / LIMITS.seconds_a_year,
            jump,
            coefficient_sd,
            step,
            reference_c,
            options,
        )

    @property
    def q(self) -> int:
        return len(self.step)

    def rate_and_scatter(self, z: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return both (..., q) of z (..., 2 q), in steps; rates per square root of a year."""
        rates, scatters = np.split(z, 2, axis=-1)
        given = self.options
        return (
            given.rate_of_step * np.exp(given.rate_log_sd * rates),
            given.scatter_of_step * np.exp(given.scatter_log_sd * scatters),
        )

    def misfit(self, z: FloatArray) -> FloatArray:
        """Return minus the log (m,) of the posterior density of z (m, 2 q), but for a constant."""
        return np.asarray((z**2).sum(axis=1) / 2 - self._filtered(z)[0])

    def fitted(self) -> FloatArray:
        """Return z (2 q,) of the largest posterior density: the likelihood times the weak prior."""
        steps = LIMITS.slope_step * np.eye(2 * self.q)

        def misfit_and_slope(z: FloatArray) -> tuple[float, FloatArray]:
            here, *nearby = self.misfit(z + np.vstack([0 * steps[:1], steps, -steps]))
            ahead, behind = np.split(np.array(nearby), 2)
            return float(here), (ahead - behind) / (2 * LIMITS.slope_step)

        found = scipy.optimize.minimize(
            misfit_and_slope,
            np.zeros(2 * self.q),
            jac=True,
            method="L-BFGS-B",
            bounds=[(-LIMITS.widest, LIMITS.widest)] * 2 * self.q,
            options={"ftol": 1e-7, "maxiter": 60},
        )
        return np.asarray(found.x)

    def states(self, z: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return means (n, 2 q) and covariances (n, 2 q, 2 q) at `z` (2 q,), filtered, smoothed."""
        made = self._filtered(z[None])[1]
        before, before_cov = (np.array([each[k][0] for each in made]) for k in (2, 3))
        after, after_cov = self._smoothed(made)
        return before, before_cov, after[0], after_cov[0]

    def _filtered(self, z: FloatArray) -> tuple[FloatArray, list[tuple[FloatArray, ...]]]:
        """Return the log likelihood (m,) of z (m, 2 q) and the steps, one for each test.

        A step is the state before and after it, what it pulls and how surely (m, 2 q, 2 q).

        A test of information L that sees H of a state with covariance P, through scatter of
        covariance S, has the weight (1 + L (H P H' + S))^-1 L: also where L is singular.
        """
        (rate, scatter), eye = self.rate_and_scatter(z), np.eye(self.q)
        mean = np.zeros((len(z), 2 * self.q))
        first = np.append(np.zeros(self.q), self.coefficient_sd**2)
        covariance = np.broadcast_to(np.diag(first), (len(z), 2 * self.q, 2 * self.q))
        log_likelihood: FloatArray = np.zeros(len(z))
        made: list[tuple[FloatArray, ...]] = []
        for t, information in enumerate(self.information / self.inflation[:, None, None]):
            wandered = np.append(rate**2 * self.years[t] + self.jump[t], 0 * rate, axis=1)
            covariance = covariance + wandered[:, :, None] * np.eye(2 * self.q)
            sees = np.hstack([eye, self.warmth_k[t] * eye])
            noise = scatter**2 + (self.unknown_k[t] * self.coefficient_sd) ** 2
            spread = sees @ covariance @ sees.T + self.inflation[t] * noise[:, :, None] * eye
            core = eye + information @ spread
            weight = np.linalg.solve(core, np.broadcast_to(information, core.shape))
            off = self.mean[t] - mean @ sees.T
            pull = np.einsum("mij,mj->mi", sees.T @ weight, off)
            surely = sees.T @ weight @ sees
            log_likelihood -= np.einsum("mi,mij,mj->m", off, weight, off) / 2
            log_likelihood -= np.linalg.slogdet(core)[1] / 2
            after = mean + np.einsum("mij,mj->mi", covariance, pull)
            left = covariance - covariance @ surely @ covariance
            made.append((mean, covariance, after, left, pull, surely))
            mean, covariance = after, (left + np.swapaxes(left, 1, 2)) / 2
        return log_likelihood, made

    def _smoothed(self, made: list[tuple[FloatArray, ...]]) -> tuple[FloatArray, FloatArray]:
        """Return means (m, n, 2 q) and covariances, backwards over the steps."""
        pulled, certainty = np.zeros_like(made[0][0]), np.zeros_like(made[0][1])
        means, covariances = [], []
        for mean, covariance, _, _, pull, surely in reversed(made):
            back = np.eye(mean.shape[1]) - surely @ covariance
            pulled = pull + np.einsum("mij,mj->mi", back, pulled)
            certainty = surely + back @ certainty @ np.swapaxes(back, 1, 2)
            means.append(mean + np.einsum("mij,mj->mi", covariance, pulled))
            covariances.append(covariance - covariance @ certainty @ covariance)
        return np.stack(means[::-1], axis=1), np.stack(covariances[::-1], axis=1)
