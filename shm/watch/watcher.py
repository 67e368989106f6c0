"""The watch of one hanger, test by test: what stands after each rests on the tests up to it alone.

After a call the called change is part of what is known, and a further one is looked for.
"""

from __future__ import annotations

import hashlib
import io
import json
import math
import zipfile
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from datetime import datetime
from functools import cached_property
from typing import Any

import numpy as np

from shm.errors import BadInput, UsageError
from shm.values import (
    BoolArray,
    Change,
    CreepRate,
    FloatArray,
    Hanger,
    IntArray,
    Reading,
    WatchedQuantity,
    WatchedTest,
    is_ratio,
)
from shm.watch.causes import Columns, Structure, structure_of
from shm.watch.change_point import (
    SIZES,
    Evidence,
    Sums,
    Told,
    evidence_of,
    sums_of,
)
from shm.watch.conditions import (
    OF_ONE_VISIT_YEARS,
    Warmth,
    reference_of,
    warmth_of,
    years_between,
)
from shm.watch.isolated_tests import Seen, counted, outlier_probability
from shm.watch.options import WatchOptions
from shm.watch.persistence import Course, most_evidence
from shm.watch.posterior_summary import Subject, changed, drifted, probability_of_change
from shm.watch.scatter import differences, learnt

# To be raised whenever the same readings give other results than before: kept states are void then.
_VERSION = 4
_LOOKED_AT = 0.1  # technical: of the limit: below it nobody asks which cause it was
# Technical: what a test says goes nearly in proportion to its weight.
_MOST_REPEATS, _NEARLY = 6, 0.5
_LEAST_SHARE = 1e-6  # judgement: of a cause in a call, which later tests may yet speak for


@dataclass(frozen=True, eq=False)
class Call:
    """A change that was called after the test at `index` of the watch; `change` as it was then."""

    index: int
    change: Change


@dataclass(frozen=True, eq=False)
class Watch:
    """The result after each reading, and the changes called on the way, in the order of time."""

    tests: tuple[WatchedTest, ...]
    calls: tuple[Call, ...]


@dataclass(frozen=True, eq=False)
class WatchState:
    """All that the next result rests on, of T tests so far, in plain arrays.

    It goes on only where `key` is that of the watch which is to go on. `told` is text that goes
    with it, `still_same` the probability that nothing had changed before the last call.
    `weight` (T,) is what is left of tests that alone would say more than one test may.
    `called` (calls, 3) are the first test, years, and whether it is a ramp, `called_precision`
    (calls, n + q, n + q) what called it. `scatter_variance` is what tests scatter by.
    """

    key: str
    start: datetime
    last_time: datetime
    reference_c: float
    values: FloatArray
    variances: FloatArray
    slopes: FloatArray
    per_kelvin: FloatArray
    coordinates: FloatArray
    years: FloatArray
    temperature_c: FloatArray
    log_amplitude: FloatArray
    weight: FloatArray
    counted: BoolArray
    coefficients: FloatArray
    coefficient_sd: FloatArray
    scatter_variance: FloatArray
    called: FloatArray
    called_precision: FloatArray
    still_same: float = 1.0
    told: str = ""

    @property
    def tests(self) -> int:
        return len(self.years)

    def to_bytes(self) -> bytes:
        """The state as a file of numpy arrays, without any pickled object."""
        kept = io.BytesIO()
        plain: dict[str, Any] = {
            each.name: np.asarray(value.isoformat() if isinstance(value, datetime) else value)
            for each in fields(self)
            for value in [getattr(self, each.name)]
        }
        np.savez_compressed(kept, **plain)
        return kept.getvalue()

    @classmethod
    def from_bytes(cls, content: bytes) -> WatchState:
        """The state back; raises BadInput where the content is no such state."""
        try:
            with np.load(io.BytesIO(content), allow_pickle=False) as kept:
                found = dict(kept)
            for name in ("key", "told"):
                found[name] = str(found[name])
            for name in ("start", "last_time"):
                found[name] = datetime.fromisoformat(str(found[name]))
            for name in ("reference_c", "still_same"):
                found[name] = float(found[name])
            return cls(**found)
        except (ValueError, KeyError, TypeError, EOFError, OSError, zipfile.BadZipFile) as error:
            raise BadInput(
                f"A kept state of the watch cannot be read: {error}.",
                remedy="Drop it: the watch then goes over all tests again.",
            ) from error


@dataclass(frozen=True, eq=False)
class Watcher:
    """Watches one hanger, test by test: `begin` with its baseline, `after` for each one later.

    Raises BadInput without any quantity.
    """

    quantities: tuple[WatchedQuantity, ...]
    columns: Columns
    hanger: Hanger
    options: WatchOptions = field(default_factory=WatchOptions)

    def __post_init__(self) -> None:
        if not self.quantities:
            raise BadInput("The watch was given no quantity.", remedy="Watch the tension at least.")

    @cached_property
    def key(self) -> str:
        """Names what a state rests on beside the readings: the rules, options and quantities."""
        given = [_VERSION, asdict(self.options), [_told(each) for each in self.quantities]]
        return hashlib.sha256(json.dumps(given).encode()).hexdigest()

    @cached_property
    def structure(self) -> Structure:
        """The hypotheses."""
        return structure_of(self.quantities, self.columns, self.options)

    def begin(self, readings: Sequence[Reading]) -> tuple[WatchState, Watch]:
        """The state after the readings of the baseline, by time, and a result for each of them.

        Raises UsageError where these are more than the options' `baseline_tests`, or none. Where
        they are fewer, the state cannot go on.
        """
        if not 0 < len(readings) <= self.options.baseline_tests:
            raise UsageError(
                f"The watch was to begin with {len(readings)} readings; its baseline has "
                f"{self.options.baseline_tests}."
            )
        time, n, q = readings[0].time, self.structure.layout.n, self.structure.layout.q
        state = WatchState(
            key=self.key,
            start=time,
            last_time=time,
            reference_c=reference_of([reading.temperature_c for reading in readings]),
            values=np.zeros((0, n)),
            variances=np.zeros((0, n)),
            slopes=np.zeros((0, n, q)),
            per_kelvin=np.zeros((0, n)),
            coordinates=np.zeros((0, q)),
            years=np.zeros(0),
            temperature_c=np.zeros(0),
            log_amplitude=np.zeros(0),
            weight=np.zeros(0),
            counted=np.zeros(0, bool),
            coefficients=np.zeros(q * self.structure.thermal_laws),
            coefficient_sd=self._prior_of_coefficients,
            scatter_variance=self.structure.scatter_variance,
            called=np.zeros((0, 3)),
            called_precision=np.zeros((0, n + q, n + q)),
        )
        tests = []
        for reading in readings:
            state, found = self._next(state, reading)
            tests.append(found)
        return state, Watch(tuple(tests), ())

    def after(self, state: WatchState, reading: Reading) -> tuple[WatchState, WatchedTest]:
        """The state after one more reading, and the result.

        Raises BadInput where the reading is older than the last, or of other quantities, UsageError
        where the state is that of another watch, or its baseline is not complete.
        """
        if state.key != self.key or state.tests < self.options.baseline_tests:
            raise UsageError(
                "This state of a watch is not of this hanger, baseline and options.",
                remedy="Begin the watch anew.",
            )
        return self._next(state, reading)

    def _next(self, state: WatchState, reading: Reading) -> tuple[WatchState, WatchedTest]:
        if reading.time < state.last_time:
            raise BadInput(
                f"The watch was given test {reading.test} after one that is later.",
                remedy="Sort the tests by time.",
            )
        state = self._with(state, reading)
        state = self._bounded(state)
        rows = _counting(state)
        evidence = self._evidence(state, rows)
        causes = evidence
        if evidence.log_evidence > math.log(_LOOKED_AT * self.options.limit_years):
            # How sure it is that anything changed is bounded; which cause it was is for all to say.
            causes = self._evidence(replace(state, weight=np.ones_like(state.weight)), rows)
            stays = most_evidence(causes, self._course(state, rows, causes.called))
            evidence = replace(evidence, log_most=stays)
        of_baseline = float(state.years[: self.options.baseline_tests].mean())
        subject = Subject(self.quantities, self.hanger, self.options, state.start, of_baseline)
        last, effects = state.tests - 1, self._effects(state)
        outlier = self._outlier(state, last)
        found = WatchedTest(
            test=reading.test,
            time=reading.time,
            temperature_c=reading.temperature_c,
            drifts=drifted(
                subject,
                evidence,
                causes,
                reading,
                effects,
                is_baseline=state.tests <= self.options.baseline_tests,
            ),
            change=changed(
                subject,
                evidence,
                causes,
                reading,
                1 - state.still_same,
                outlier,
                effects,
            ),
            creep_per_year=self._creep(evidence),
        )
        coefficients, coefficient_sd = self._coefficients(evidence)
        if found.change.called and state.counted[-1]:
            still = state.still_same * (1 - probability_of_change(evidence, self.options))
            begun = np.append(state.called, [_begun(causes, rows, found.change)], axis=0)
            sizes = np.append(state.called_precision, [_size_of(causes)], axis=0)
            state = replace(state, called=begun, called_precision=sizes, still_same=still)
        state = replace(state, coefficients=coefficients, coefficient_sd=coefficient_sd)
        return state, found

    def _bounded(self, state: WatchState) -> WatchState:
        """The newest visit with what is left of its weight: alone it speaks for no change by more
        than it may, whether it counts by now or only once another agrees with it."""
        visit = state.years >= state.years[-1] - OF_ONE_VISIT_YEARS
        rows = np.union1d(np.flatnonzero(state.counted), [state.tests - 1])
        most = math.log(self.options.most_of_one_test * self.options.limit_years)
        for _ in range(_MOST_REPEATS):
            factor, mass = self._evidence(state, rows).of_last_visit
            if mass <= most + _NEARLY:
                break
            weight = state.weight.copy()
            weight[visit] *= max(factor - (mass - most), _NEARLY) / factor
            state = replace(state, weight=weight)
        return state

    def _with(self, state: WatchState, reading: Reading) -> WatchState:
        """The state with one more test in it, and who counts now."""
        n, q = self.structure.layout.n, self.structure.layout.q
        if reading.mean.shape != (q,):
            raise BadInput(f"The reading of test {reading.test} is not of {q} quantities.")
        years = years_between(state.start, reading.time)
        known = [value for value in (state.reference_c, reading.temperature_c) if value == value]
        modes = reading.modes
        values = np.zeros(n) if modes is None else modes.values
        variances = np.full(n, np.inf) if modes is None else modes.variances
        slopes = np.zeros((n, q)) if modes is None else modes.slopes
        softening = np.zeros(n) if modes is None else modes.per_kelvin
        level = math.log(reading.amplitude) if reading.amplitude > 0 else math.nan
        rows = {
            "values": values,
            "variances": variances,
            "slopes": slopes,
            "per_kelvin": softening,
            "coordinates": reading.mean,
            "years": years,
            "temperature_c": reading.temperature_c,
            "log_amplitude": level,
            "weight": 1.0,
        }
        grown: dict[str, Any] = {
            name: np.concatenate([getattr(state, name), np.asarray(row)[None]])
            for name, row in rows.items()
        }
        reference_c = known[0] if known else math.nan
        later = replace(state, last_time=reading.time, reference_c=reference_c, **grown)
        counts = counted(self._seen(later), state.counted, self.options.baseline_tests)
        later = replace(later, counted=counts)
        return replace(later, scatter_variance=self._scatter(later))

    def _factors(self, state: WatchState) -> FloatArray:
        """Along what each test scatters (T, n, q + c)."""
        fixed = np.broadcast_to(
            self.structure.scattering, (state.tests, *self.structure.scattering.shape)
        )
        return np.concatenate([state.slopes, fixed], axis=2)

    def _warmth(self, state: WatchState) -> Warmth:
        return warmth_of(state.temperature_c, state.years, state.reference_c, self.options)

    def _thermal(self, state: WatchState) -> tuple[Warmth, ...]:
        """What quantities go with, each with a coefficient of its own: kelvin, as many laws as the
        structure has."""
        return (self._warmth(state),)

    @property
    def _prior_of_coefficients(self) -> FloatArray:
        first = self.structure.layout.n + self.structure.layout.q
        count = self.structure.layout.q * self.structure.thermal_laws
        return self.structure.layout.prior_sd[first : first + count]

    def _doubt(self, state: WatchState, *, of_season: bool = False) -> FloatArray:
        """Factors (T, n, laws (1 + q)) of what a temperature that is not known, or not well, leaves
        open: what a kelvin does as far as that is known, and as far as it is not. Tests `of_season`
        share what they miss."""
        laws, q = self._thermal(state), self.structure.layout.q
        parts = []
        for law, own in enumerate(laws):
            chosen = slice(law * q, (law + 1) * q)
            known = state.slopes @ state.coefficients[chosen]
            if law == 0:
                known = state.per_kelvin + known
            unknown = state.slopes * state.coefficient_sd[chosen]
            per_kelvin = np.concatenate([known[:, :, None], unknown], axis=2)
            sd = own.sd * np.sqrt(own.shared) if of_season else own.sd
            parts.append(sd[:, None, None] * per_kelvin)
        return np.concatenate(parts, axis=2)

    def _seen(self, state: WatchState) -> Seen:
        """All tests so far, their swing with the temperature taken off as far as it is known."""
        factors = self._factors(state)
        measured = np.flatnonzero(np.isfinite(state.variances).any(axis=1))
        variance = np.maximum(state.scatter_variance, self.structure.scatter_variance)
        return Seen(
            values=self._at_rest(state),
            variances=state.variances,
            doubt=self._doubt(state),
            factors=factors[measured[-1]] if len(measured) else factors[-1],
            sds=np.sqrt(variance),
        )

    def _at_rest(self, state: WatchState) -> FloatArray:
        laws, q = self._thermal(state), self.structure.layout.q
        swing = laws[0].kelvin[:, None] * state.per_kelvin
        for law, own in enumerate(laws):
            coefficients = state.coefficients[law * q : (law + 1) * q]
            swing = swing + own.kelvin[:, None] * (state.slopes @ coefficients)
        return np.asarray(state.values - swing)

    def _scatter(self, state: WatchState) -> FloatArray:
        """What the counted tests so far say of the scatter (q + c,); of a day one alone does."""
        rows = np.flatnonzero(state.counted)
        rows = rows[np.diff(state.years[rows], prepend=-1.0) > OF_ONE_VISIT_YEARS]
        found = differences(
            self._at_rest(state)[rows],
            state.variances[rows],
            self._factors(state)[rows],
            self._doubt(state)[rows],
        )
        return learnt(found, self.structure.scatter_variance, state.scatter_variance)

    def _columns(self, state: WatchState, rows: IntArray) -> FloatArray:
        """Of the tests `rows` (T, n, columns): modes, quantities, covariates."""
        layout = self.structure.layout
        slopes, level = state.slopes[rows], _levels(state.log_amplitude[rows])
        creeping = [is_ratio(each.name) for each in self.quantities]
        return np.concatenate(
            [
                np.broadcast_to(np.eye(layout.n), (len(rows), layout.n, layout.n)),
                slopes,
                *(slopes * each.kelvin[rows, None, None] for each in self._thermal(state)),
                slopes * np.nan_to_num(level)[:, None, None],
                slopes[:, :, creeping].sum(axis=2, keepdims=True) * state.years[rows, None, None],
            ],
            axis=2,
        )

    def _softened(self, state: WatchState, rows: IntArray) -> FloatArray:
        """Log frequencies (T, n) less what a softer steel does."""
        kelvin = self._warmth(state).kelvin
        return np.asarray(state.values[rows] - kelvin[rows, None] * state.per_kelvin[rows])

    def _sums(self, state: WatchState, rows: IntArray) -> Sums:
        """Of the tests `rows`; those of one day scatter together, and say no more than one."""
        structure, layout = self.structure, self.structure.layout
        years = state.years[rows]
        apart = np.abs(years[:, None] - years)
        of_a_day = (apart < OF_ONE_VISIT_YEARS).sum(axis=1)
        of_level = layout.prior_sd[-1 - layout.q : -1]
        unknown = state.slopes[rows] * (self.options.unknown_log_amplitude_sd * of_level)
        unknown[np.isfinite(state.log_amplitude[rows])] = 0.0
        doubt = self._doubt(state, of_season=True)[rows]
        open_left = np.concatenate([unknown, doubt], axis=2)
        common = open_left @ np.swapaxes(open_left, 1, 2)
        factors = self._factors(state)[rows] * np.sqrt(state.scatter_variance)
        spread = factors @ np.swapaxes(factors, 1, 2)
        scatter = structure.scales[:, None, None] ** 2 * spread[:, None]
        covariance = of_a_day[:, None, None, None] * (common[:, None] + scatter)
        if structure.wander.any():
            together = (apart < structure.wander_years).sum(axis=1)
            slow = structure.scales[:, None, None] ** 2 * structure.wander @ structure.wander.T
            covariance = covariance + together[:, None, None, None] * slow
        wider = 1 / state.weight[rows]
        return sums_of(
            self._columns(state, rows),
            self._softened(state, rows),
            wider[:, None] * state.variances[rows],
            wider[:, None, None, None] * covariance,
        )

    def _course(self, state: WatchState, rows: IntArray, called: Sequence[Told]) -> Course:
        """The tests `rows` with what the null says of each, called changes included."""
        layout = self.structure.layout
        columns = self._columns(state, rows)
        changing, years = columns[:, :, layout.change], state.years[rows]
        parts = [columns[:, :, layout.null]]
        for each in called:
            since = np.where(np.arange(len(rows)) >= each.first, 1.0, 0.0)
            for _ in range(2 if each.is_ramp else 1):
                parts.append(changing * since[:, None, None])
                since = since * (years - each.years)
        own = self.options.mode_scatter**2
        return Course(
            np.concatenate(parts, axis=2),
            changing,
            self._softened(state, rows),
            state.variances[rows] + own,
        )

    def _evidence(self, state: WatchState, rows: IntArray) -> Evidence:
        """Of the tests `rows`."""
        called = [
            Told(int(np.searchsorted(rows, first)), years, bool(is_ramp), precision)
            for (first, years, is_ramp), precision in zip(
                state.called.tolist(), state.called_precision, strict=True
            )
        ]
        first = int((rows < self.options.baseline_tests).sum())
        return evidence_of(
            self._sums(state, rows),
            state.years[rows],
            max(first, 1),
            self.structure.layout,
            self.structure.directions,
            called,
            self.options.beginnings,
        )

    def _effects(self, state: WatchState) -> FloatArray:
        """What a change does to each plane's first frequency and to the mean (r, n + q)."""
        measured = np.isfinite(state.variances)
        count = np.maximum(measured.sum(axis=0), 1)[:, None]
        slopes = np.where(measured[:, :, None], state.slopes, 0.0).sum(axis=0) / count
        of_modes = np.hstack([np.eye(self.structure.layout.n), slopes])
        planes = [plane for plane, _ in self.columns.modes]
        firsts = [planes.index(plane) for plane in dict.fromkeys(planes)]
        return np.vstack([of_modes[firsts], of_modes.mean(axis=0)])

    def _coefficients(self, evidence: Evidence) -> tuple[FloatArray, FloatArray]:
        """How far each quantity goes with a kelvin (laws q,), and its sd; by the likeliest scatter."""
        n, count = self.structure.layout.n, len(self._prior_of_coefficients)
        likeliest, own = int(evidence.log_null.argmax()), slice(n, n + count)
        variance = np.diag(evidence.null_covariance[likeliest])[own]
        return np.asarray(evidence.null_mean[likeliest, own]), np.sqrt(np.maximum(variance, 0.0))

    def _creep(self, evidence: Evidence) -> CreepRate | None:
        """The tension's creep if nothing but what was called changes; None where that is unlikely.

        It is the last covariate of the null, before the called changes.
        """
        if probability_of_change(evidence, self.options) > 0.5:
            return None
        at, weights = len(self.structure.layout.null) - 1, np.exp(evidence.log_null)
        means, variances = evidence.null_mean[:, at], evidence.null_covariance[:, at, at]
        mean = float(weights @ means)
        variance = float(weights @ (variances + (means - mean) ** 2))
        return CreepRate(mean, math.sqrt(variance), self.options.creep_per_year_sd)

    def _outlier(self, state: WatchState, test: int) -> float:
        prior = self.options.outlier_probability
        return outlier_probability(self._seen(state), state.counted, test, prior)


def watched(
    readings: Sequence[Reading],
    quantities: tuple[WatchedQuantity, ...],
    columns: Columns,
    hanger: Hanger,
    options: WatchOptions | None = None,
) -> Watch:
    """One result a reading, each of which rests on the readings up to it alone.

    The same as a Watcher finds test by test. Raises BadInput where readings are not in the order of
    time or not of these quantities.
    """
    watcher = Watcher(quantities, columns, hanger, options or WatchOptions())
    if not readings:
        return Watch((), ())
    count = watcher.options.baseline_tests
    state, begun = watcher.begin(readings[:count])
    tests = list(begun.tests)
    for reading in readings[count:]:
        state, found = watcher.after(state, reading)
        tests.append(found)
    calls = (Call(n, test.change) for n, test in enumerate(tests) if test.change.called)
    return Watch(tuple(tests), tuple(calls))


def _levels(log_amplitude: FloatArray) -> FloatArray:
    """Over the usual one, NaN where unknown."""
    known = np.isfinite(log_amplitude)
    return log_amplitude - (float(np.median(log_amplitude[known])) if known.any() else 0.0)


def _counting(state: WatchState) -> IntArray:
    """The tests that count; as long as none does, the newest, which then says nothing."""
    rows = np.flatnonzero(state.counted)
    return rows if len(rows) else np.array([state.tests - 1])


def _begun(evidence: Evidence, rows: IntArray, change: Change) -> list[float]:
    """The likeliest first test of a called change, when it began, and whether it goes on."""
    share = evidence.shares.sum(axis=(1, 2, 3, 4))
    first = int(evidence.beginnings[int(share.argmax())])
    is_ramp = bool(change.sudden < 0.5)
    return [float(rows[first]), float(evidence.years[first - 1]), float(is_ramp)]


def _size_of(evidence: Evidence) -> FloatArray:
    """Precision (n + q, n + q) of a called change's size: each cause as probable as it was then."""
    layout = evidence.layout
    least = np.concatenate(
        [np.full(layout.n, 1e-5), 1e-3 * layout.prior_sd[layout.n :][: layout.q]]
    )
    covariance = np.diag(least**2)
    shares = np.maximum(evidence.shares.sum(axis=(0, 1, 2)), _LEAST_SHARE)
    for direction, by_size in zip(evidence.directions, shares, strict=True):
        for share, size in zip(by_size, SIZES, strict=True):
            covariance += share * size**2 * direction.factor @ direction.factor.T
    return np.asarray(np.linalg.inv(covariance))


def _told(quantity: WatchedQuantity) -> list[object]:
    """All of a quantity, its table as a digest."""
    table = np.array([quantity.coordinates, quantity.values]).tobytes()
    plain = (getattr(quantity, name) for name in ("name", "baseline", "step_sd", "end", "plane"))
    return [*plain, *quantity.parameters, hashlib.sha256(table).hexdigest()]
