"""Keep the state of the watch of one hanger, and sum its tests for the evidence.

What differs from test to test goes along a few known columns, each by an amount that is the
hanger's own. It is learnt from the differences of tests that follow each other, by expectation and
maximisation (Dempster, Laird and Rubin 1977), about a prior worth a few tests.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from functools import cached_property

import numpy as np

from shm.values import (
    BoolArray,
    Change,
    FloatArray,
    IntArray,
    ModeReading,
    Reading,
    WatchedQuantity,
    is_ratio,
)
from shm.watch.engine.causes import DetectedChange, Structure
from shm.watch.engine.change_point import (
    RAMP,
    SIZES,
    STEP,
    Evidence,
    Sums,
    joint_covariance,
    select_null,
    sums_of,
)
from shm.watch.engine.limits import LIMITS
from shm.watch.engine.options import (
    OF_ONE_VISIT_YEARS,
    Warmth,
    WatchOptions,
    frost_of,
    temperature_offsets,
    years_between,
)
from shm.watch.engine.persistence import Course, Seen
from shm.watch.engine.quantities import MeasuredMode


@dataclass(frozen=True, eq=False)
class WatchState:
    """All that the next result rests on: T readings so far, and what was made of them.

    It goes on only where `key` is that of the watch which is to go on. `still_same` is the
    probability that nothing had changed before the last call.
    `weight` (T,) is what is left of tests that alone would say more than one test may.
    `called` are the changes that were called, by numbers of tests. `scatter_variance` is what tests
    scatter by.
    """

    key: str
    reference_c: float
    coefficients: FloatArray
    coefficient_sd: FloatArray
    scatter_variance: FloatArray
    readings: tuple[Reading, ...] = ()
    weight: FloatArray = field(default_factory=lambda: np.zeros(0))
    counted: BoolArray = field(default_factory=lambda: np.zeros(0, bool))
    called: tuple[DetectedChange, ...] = ()
    still_same: float = 1.0

    @property
    def tests(self) -> int:
        return len(self.readings)

    @cached_property
    def modes(self) -> ModeReading:
        """Return the readings mode by mode in one: arrays (T, ...)."""
        rows = [each.modes for each in self.readings]
        names = [each.name for each in fields(ModeReading)]
        return ModeReading(*(np.array([getattr(row, name) for row in rows]) for name in names))

    @cached_property
    def years(self) -> FloatArray:
        """Times (T,) since the first."""
        start = self.readings[0].time
        return np.array([years_between(start, each.time) for each in self.readings])

    @property
    def temperature_c(self) -> FloatArray:
        return np.array([each.temperature_c for each in self.readings])

    @property
    def log_amplitude(self) -> FloatArray:
        """Logarithms (T,), NaN where an amplitude is not known."""
        amplitude = np.array([each.amplitude for each in self.readings])
        return np.log(np.where(amplitude > 0, amplitude, np.nan))


@dataclass(frozen=True, eq=False)
class StateSums:
    """Of one hanger's watch, whose `modes` are those of the baseline."""

    quantities: tuple[WatchedQuantity, ...]
    modes: Sequence[MeasuredMode]
    structure: Structure
    options: WatchOptions

    @cached_property
    def _factors(self) -> FloatArray:
        """Along what tests scatter (n, q + c)."""
        return np.hstack([self.structure.slopes, self.structure.scattering])

    def _warmth(self, state: WatchState) -> Warmth:
        return temperature_offsets(
            state.temperature_c, state.years, state.reference_c, self.options
        )

    def _thermal(self, state: WatchState) -> tuple[Warmth, ...]:
        """Return the kelvin that quantities go with, and those of frost where they are a law."""
        frost = frost_of(state.temperature_c, self.options.thermometer_sd_k)
        return (self._warmth(state), frost)[: self.structure.thermal_laws]

    def _by_law(self, values: FloatArray) -> FloatArray:
        """Coefficients (laws q,), or their sds, by law (laws, q)."""
        return values.reshape(self.structure.thermal_laws, self.structure.layout.q)

    def _doubt(self, state: WatchState, *, of_season: bool = False) -> FloatArray:
        """Factors (T, n, laws (1 + q)) of what a temperature that is not known, or not well, leaves
        open: what a kelvin does as far as that is known, and as far as it is not. Tests `of_season`
        share what they miss."""
        its, sds = self._by_law(state.coefficients), self._by_law(state.coefficient_sd)
        softening, slopes, parts = state.modes.per_kelvin, self.structure.slopes, []
        for law, mean, sd in zip(self._thermal(state), its, sds, strict=True):
            known = (softening + slopes @ mean)[:, :, None]
            unknown = np.broadcast_to(slopes * sd, (state.tests, *slopes.shape))
            per_kelvin = np.concatenate([known, unknown], axis=2)
            off = law.sd * np.sqrt(law.shared) if of_season else law.sd
            parts.append(off[:, None, None] * per_kelvin)
            softening = np.zeros_like(softening)  # steel's goes with the first law
        return np.concatenate(parts, axis=2)

    def seen(self, state: WatchState) -> Seen:
        """All tests so far, their swing with the temperature taken off as far as it is known."""
        variance = np.maximum(state.scatter_variance, self.structure.scatter_variance)
        return Seen(
            values=self._at_rest(state),
            variances=state.modes.variances,
            doubt=self._doubt(state),
            factors=self._factors,
            sds=np.sqrt(variance),
        )

    def _at_rest(self, state: WatchState) -> FloatArray:
        laws, its = self._thermal(state), self._by_law(state.coefficients)
        variation = laws[0].kelvin[:, None] * state.modes.per_kelvin
        for law, mean in zip(laws, its, strict=True):
            variation = variation + law.kelvin[:, None] * (self.structure.slopes @ mean)
        return np.asarray(state.modes.values - variation)

    def scatter(self, state: WatchState) -> FloatArray:
        """Return the variances (q + c,) along each factor by the counted tests, one of each day.

        Of one test, half of those of a difference; a mode that one of two lacks says nothing.
        """
        rows = np.flatnonzero(state.counted)
        rows = rows[np.diff(state.years[rows], prepend=-1.0) > OF_ONE_VISIT_YEARS]
        prior = self.structure.scatter_variance
        if len(rows) < 2:
            return prior
        variances, doubt = state.modes.variances[rows], self._doubt(state)[rows]
        spread = variances[1:] + variances[:-1]
        known = np.isfinite(spread)[:, :, None]
        values = np.where(known, np.diff(self._at_rest(state)[rows], axis=0)[:, :, None], 0.0)
        factors = np.where(known, self._factors, 0.0)
        open_left = np.concatenate([doubt[1:], doubt[:-1]], axis=2) * known
        its = np.minimum(spread, LIMITS.unmeasured)[:, :, None] * np.eye(len(spread.T))
        covariance = its + open_left @ np.swapaxes(open_left, 1, 2)
        there = np.abs(factors).max(axis=1) > 0
        variance = np.maximum(state.scatter_variance, 1e-12)
        # Technical: begun from what the tests before gave, it has nearly settled
        for _ in range(4):
            scaled = factors * np.sqrt(2 * variance)
            weight = np.linalg.inv(scaled @ np.swapaxes(scaled, 1, 2) + covariance)
            weighted = weight @ scaled
            # Of a unit normal along each factor: its mean given the difference, what that explains.
            along = (weighted * values).sum(axis=1)
            explained = (scaled * weighted).sum(axis=1)
            far = np.abs(along) / np.sqrt(np.maximum(explained, 1e-12))
            left = np.clip(
                (LIMITS.change_from - far) / (LIMITS.change_from - LIMITS.scatter_up_to), 0.0, 1.0
            )
            square = explained * np.minimum(far, LIMITS.scatter_up_to) ** 2
            expected = there * (left * square + (1 - left) * explained + 1 - explained)
            variance = (LIMITS.prior_tests * prior + variance * expected.sum(axis=0)) / (
                LIMITS.prior_tests + there.sum(axis=0)
            )
        return np.asarray(variance)

    def _columns(self, state: WatchState, rows: IntArray) -> FloatArray:
        """Of the tests `rows` (T, n, columns): modes, quantities, covariates."""
        layout = self.structure.layout
        level = np.nan_to_num(_levels(state.log_amplitude[rows]))[:, None, None]
        slopes = np.broadcast_to(self.structure.slopes, (len(rows), layout.n, layout.q))
        creeping = [is_ratio(each.name) for each in self.quantities]
        return np.concatenate(
            [
                np.broadcast_to(np.eye(layout.n), (len(rows), layout.n, layout.n)),
                slopes,
                *(slopes * each.kelvin[rows, None, None] for each in self._thermal(state)),
                slopes * level,
                self.structure.stiffening[:, None] * level,
                slopes[:, :, creeping].sum(axis=2, keepdims=True) * state.years[rows, None, None],
            ],
            axis=2,
        )

    def _softened(self, state: WatchState, rows: IntArray) -> FloatArray:
        """Log frequencies (T, n) less what a softer steel does."""
        kelvin = self._warmth(state).kelvin
        return np.asarray(
            state.modes.values[rows] - kelvin[rows, None] * state.modes.per_kelvin[rows]
        )

    def sums(self, state: WatchState, rows: IntArray) -> Sums:
        """Of the tests `rows`; those of one day scatter together, and say no more than one."""
        wider = 1 / state.weight[rows]
        return sums_of(
            self._columns(state, rows),
            self._softened(state, rows),
            wider[:, None] * state.modes.variances[rows],
            wider[:, None, None, None] * self._covariance(state, rows),
        )

    def _covariance(self, state: WatchState, rows: IntArray) -> FloatArray:
        """Return by what the tests `rows` differ beside their errors (T, K, n, n)."""
        structure, years = self.structure, state.years[rows]
        apart = np.abs(years[:, None] - years)
        of_a_day = (apart < OF_ONE_VISIT_YEARS).sum(axis=1)
        of_level = structure.layout.prior_sd[-2 - structure.layout.q : -1]  # before creep
        moving = np.hstack([structure.slopes, structure.stiffening[:, None]])
        moving = moving * (self.options.unknown_log_amplitude_sd * of_level)
        is_known = np.isfinite(state.log_amplitude[rows])[:, None, None]
        unknown = np.where(is_known, 0.0, moving)
        doubt = self._doubt(state, of_season=True)[rows]
        open_left = np.concatenate([unknown, doubt], axis=2)
        common = open_left @ np.swapaxes(open_left, 1, 2)
        squares = structure.scales[:, None, None] ** 2
        scatter = squares * ((self._factors * state.scatter_variance) @ self._factors.T)
        covariance = of_a_day[:, None, None, None] * (common[:, None] + scatter)
        together = (apart < structure.wander_years).sum(axis=1)
        slow = squares * (structure.wander @ structure.wander.T)
        return np.asarray(covariance + together[:, None, None, None] * slow)

    def course(self, state: WatchState, rows: IntArray, called: Sequence[DetectedChange]) -> Course:
        """Return the tests `rows` with what the null says of each, called changes included."""
        layout, columns = self.structure.layout, self._columns(state, rows)
        return Course(
            columns @ select_null(state.years[rows], layout, called),
            columns[:, :, layout.change],
            self._softened(state, rows),
            joint_covariance(state.modes.variances[rows], self._covariance(state, rows)),
            np.minimum(
                state.modes.variances[rows] + self.options.mode_scatter**2, LIMITS.unmeasured
            ),
            int((rows < self.options.baseline_tests).sum()),
        )

    @cached_property
    def effects(self) -> tuple[FloatArray, FloatArray]:
        """Return what a change does to what owners look at, and to every mode (`effects_of`)."""
        if not self.structure.is_modelled:
            every = np.eye(self.structure.layout.n)
            return np.hstack([every, every]), np.hstack([every, every])
        return effects_of(self.modes, self.structure.slopes)


def effects_of(modes: Sequence[MeasuredMode], slopes: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return what a change does to each plane's first frequency and mean, and to every mode.

    Arrays (r, n + q) and (n, n + q), by `slopes` (n, q) of the modes.
    """
    of_modes = np.hstack([np.eye(len(modes)), slopes])
    planes = np.array([plane for plane, _ in modes])
    of_planes = [of_modes[planes == plane] for plane in dict.fromkeys(planes.tolist())]
    rows = np.vstack([row for its in of_planes for row in (its[0], its.mean(axis=0))])
    return rows, of_modes


def _levels(log_amplitude: FloatArray) -> FloatArray:
    """Over the usual one, NaN where unknown."""
    known = np.isfinite(log_amplitude)
    return log_amplitude - (float(np.median(log_amplitude[known])) if known.any() else 0.0)


def detected_change(evidence: Evidence, rows: IntArray, change: Change) -> DetectedChange:
    """Return a called change, each cause as probable as it was then.

    Of the kind that is called, it begins where that is likeliest: the other kind may begin where
    this one is out of the question.
    """
    layout = evidence.layout
    least = np.concatenate(
        [np.full(layout.n, 1e-5), 1e-3 * layout.prior_sd[layout.n :][: layout.q]]
    )
    covariance = np.diag(least**2)
    shares = np.maximum(evidence.shares.sum(axis=(0, 1, 2)), LIMITS.state_sums_least_share)
    for direction, by_size in zip(evidence.directions, shares, strict=True):
        for share, size in zip(by_size, SIZES, strict=True):
            covariance += share * size**2 * direction.factor @ direction.factor.T
    is_ramp = bool(change.sudden < 0.5)
    of_kind = evidence.shares[:, :, RAMP if is_ramp else STEP].sum(axis=(1, 2, 3))
    first = int(evidence.beginnings[int(of_kind.argmax())])
    years = float(evidence.years[first - 1])
    return DetectedChange(int(rows[first]), years, is_ramp, np.linalg.inv(covariance))
