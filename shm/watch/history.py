"""The tests of one hanger so far, in arrays, and the linear model of their log frequencies.

A test of a visit with label j is y = Z a + H d + e: `a` are the modes' levels and how they go with
temperature, excitation and creep; `d` is a change; e is normal with the covariance of a sound test
and that of the disturbance j.

What tests of one state scatter by is learnt from the differences of sound tests that follow each
other, which a lasting change touches once (Dempster, Laird and Rubin 1977).
"""

from __future__ import annotations

import io
import zipfile
from dataclasses import dataclass, fields, replace
from datetime import datetime
from functools import cached_property
from typing import Any

import numpy as np

from shm.errors import BadInput
from shm.values import BoolArray, FloatArray, IntArray, Reading, is_ratio
from shm.watch.causes import Hypotheses
from shm.watch.options import (
    OF_ONE_VISIT_YEARS,
    Warmth,
    WatchOptions,
    frost_of,
    warmth_of,
    years_between,
)

_ABSENT = 1e8  # technical: the variance of a mode that was not measured; no log frequency is 1e4


@dataclass(frozen=True, eq=False)
class History:
    """All that the next result rests on, of T tests so far, in plain arrays.

    It goes on only where `key` is that of the watch which is to go on. `sound` (T,) are the
    probabilities that a test's visit is not disturbed if nothing more has changed, `labels`
    (visits, J) those of each disturbance, the sound one first. `coefficients` are how quantities go
    with the temperature, `scatter_variance` what tests scatter by. `called` (calls, 3) holds the
    first test of each called change, the years of the one before, and whether it is a ramp,
    `called_precision` (calls, n + q, n + q) that of its size. `unchanged` is the probability that
    nothing had changed before the last call. `conditions` is text that goes with it.
    """

    key: str
    start: datetime
    last_time: datetime
    reference_c: float
    values: FloatArray
    variances: FloatArray
    slopes: FloatArray
    per_kelvin: FloatArray
    years: FloatArray
    temperature_c: FloatArray
    log_amplitude: FloatArray
    labels: FloatArray
    coefficients: FloatArray
    coefficient_sd: FloatArray
    scatter_variance: FloatArray
    called: FloatArray
    called_precision: FloatArray
    unchanged: float = 1.0
    conditions: str = ""

    @classmethod
    def before_any(
        cls, key: str, start: datetime, reference_c: float, hypotheses: Hypotheses
    ) -> History:
        """Return the history of no test yet."""
        n, q = hypotheses.n, hypotheses.q
        coefficient_sd = hypotheses.null_sd[hypotheses.thermal]
        return cls(
            key=key,
            start=start,
            last_time=start,
            reference_c=reference_c,
            values=np.zeros((0, n)),
            variances=np.zeros((0, n)),
            slopes=np.zeros((0, n, q)),
            per_kelvin=np.zeros((0, n)),
            years=np.zeros(0),
            temperature_c=np.zeros(0),
            log_amplitude=np.zeros(0),
            labels=np.zeros((0, 1 + len(hypotheses.disturbances))),
            coefficients=np.zeros(len(coefficient_sd)),
            coefficient_sd=coefficient_sd,
            scatter_variance=hypotheses.scatter_variance,
            called=np.zeros((0, 3)),
            called_precision=np.zeros((0, n + q, n + q)),
        )

    @property
    def tests(self) -> int:
        """How many tests there are."""
        return len(self.years)

    @property
    def visit(self) -> IntArray:
        """The visit of each test (T,), counted from 0: tests of a day and a half are of one."""
        if not self.tests:
            return np.zeros(0, int)
        return np.cumsum(np.diff(self.years, prepend=self.years[0]) > OF_ONE_VISIT_YEARS)

    @property
    def sound(self) -> FloatArray:
        """The probability of each test (T,) to be of an undisturbed visit; 1 while not known."""
        visit, known = self.visit, np.ones(self.tests)
        is_known = visit < len(self.labels)
        known[is_known] = self.labels[visit[is_known], 0]
        return known

    def with_reading(self, reading: Reading) -> History:
        """Return the history with one more test."""
        n, q = self.slopes.shape[1:]
        if reading.mean.shape != (q,):
            raise BadInput(f"The reading of test {reading.test} is not of {q} quantities.")
        modes = reading.modes
        level = np.log(reading.amplitude) if reading.amplitude > 0 else np.nan
        row = {
            "values": np.zeros(n) if modes is None else modes.values,
            "variances": np.full(n, np.inf) if modes is None else modes.variances,
            "slopes": np.zeros((n, q)) if modes is None else modes.slopes,
            "per_kelvin": np.zeros(n) if modes is None else modes.per_kelvin,
            "years": years_between(self.start, reading.time),
            "temperature_c": reading.temperature_c,
            "log_amplitude": level,
        }
        grown: dict[str, Any] = {
            name: np.concatenate([getattr(self, name), np.asarray(value)[None]])
            for name, value in row.items()
        }
        known = [each for each in (self.reference_c, reading.temperature_c) if each == each]
        reference_c = known[0] if known else np.nan
        return replace(self, last_time=reading.time, reference_c=reference_c, **grown)

    def to_bytes(self) -> bytes:
        """Return the history as a file of numpy arrays, without any pickled object."""
        file = io.BytesIO()
        plain: dict[str, Any] = {
            each.name: np.asarray(value.isoformat() if isinstance(value, datetime) else value)
            for each in fields(self)
            for value in [getattr(self, each.name)]
        }
        np.savez_compressed(file, **plain)
        return file.getvalue()

    @classmethod
    def from_bytes(cls, content: bytes) -> History:
        """Return the history of a file; raises BadInput where it is none."""
        try:
            with np.load(io.BytesIO(content), allow_pickle=False) as file:
                found = dict(file)
            for name in ("key", "conditions"):
                found[name] = str(found[name])
            for name in ("start", "last_time"):
                found[name] = datetime.fromisoformat(str(found[name]))
            for name in ("reference_c", "unchanged"):
                found[name] = float(found[name])
            return cls(**found)
        except (ValueError, KeyError, TypeError, EOFError, OSError, zipfile.BadZipFile) as error:
            raise BadInput(
                f"A kept state of the watch cannot be read: {error}.",
                remedy="Drop it: the watch then goes over all tests again.",
            ) from error


@dataclass(frozen=True, eq=False)
class Sums:
    """The normal equations of each test under each label: Z'WZ (T, J, p, p), Z'Wy (T, J, p) and the
    constant of the log density (T, J).

    The first `null` columns are those of no further change, with the prior `precision` (null,
    null); the others (n + q) are those of which a change is made. `visit` and `years` (T,) are the
    tests'.
    """

    square: FloatArray
    cross: FloatArray
    constant: FloatArray
    null: int
    precision: FloatArray
    visit: IntArray
    years: FloatArray

    @property
    def visits(self) -> int:
        """How many visits there are."""
        return int(self.visit[-1]) + 1

    @cached_property
    def blocks(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Z'WZ (T J, ...) of the null's columns, of these with the change's, of the change's."""
        square, null = self.square.reshape(-1, *self.square.shape[2:]), self.null
        parts = square[:, :null, :null], square[:, :null, null:], square[:, null:, null:]
        one, other, last = map(np.ascontiguousarray, parts)
        return one, other, last

    def expected(self, labels: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return Z'WZ (T, p, p), Z'Wy (T, p) and the constant (T,) with labels (visits, J)."""
        weight = labels[self.visit]
        return (
            np.einsum("tj,tjab->tab", weight, self.square),
            np.einsum("tj,tja->ta", weight, self.cross),
            (weight * self.constant).sum(axis=1),
        )


@dataclass(frozen=True, eq=False)
class LinearModel:
    """The linear model of the tests of one hanger."""

    hypotheses: Hypotheses
    options: WatchOptions

    def sums(self, history: History) -> Sums:
        """Return the normal equations of all tests; tests of one visit say no more than one."""
        hypotheses, n = self.hypotheses, self.hypotheses.n
        design, values = self._design(history), self._softened(history)
        disturbed = self._disturbances(history)
        visit = history.visit
        of_visit = np.bincount(visit)[visit]
        shared = self._shared(history)[:, None] + disturbed
        shared = of_visit[:, None, None, None] * shared
        if hypotheses.wander.size:
            apart = np.abs(history.years[:, None] - history.years)
            together = (apart < hypotheses.wander_years).sum(axis=1)
            slow = hypotheses.wander @ hypotheses.wander.T
            shared = shared + together[:, None, None, None] * slow
        own = np.where(np.isfinite(history.variances), history.variances, _ABSENT)
        weight = np.linalg.inv(shared + own[:, None, :, None] * np.eye(n))
        weighted = weight @ design
        of_values = np.einsum("tjik,tk->tji", weight, values)
        constant = np.linalg.slogdet(weight)[1] - np.einsum("tji,ti->tj", of_values, values)
        is_error = np.array([False, *(each.is_error for each in hypotheses.disturbances)])
        begins = np.flatnonzero(np.diff(visit, prepend=-1))
        ends = np.append(begins[1:], history.tests)
        checked = begins[ends <= self.options.baseline_tests]
        constant[np.ix_(checked, is_error)] += 2 * np.log(self.options.checked_errors)
        null = design.shape[3] - n - hypotheses.q
        return Sums(
            square=np.swapaxes(design, 2, 3) @ weighted,
            cross=np.einsum("tjiz,tji->tjz", design, of_values),
            constant=constant / 2,
            null=null,
            precision=self._precision(history),
            visit=visit,
            years=history.years,
        )

    def _design(self, history: History) -> FloatArray:
        """Return the columns (T, J, n, p): of the null, of called changes, of what recurs, of a
        further change."""
        hypotheses, slopes = self.hypotheses, history.slopes
        tests = history.tests
        level = np.nan_to_num(_levels(history.log_amplitude))[:, None, None]
        levels = np.broadcast_to(np.eye(hypotheses.n), (tests, hypotheses.n, hypotheses.n))
        creeping = [is_ratio(each.name) for each in hypotheses.quantities]
        creep = slopes[:, :, creeping].sum(axis=2, keepdims=True) * history.years[:, None, None]
        change = np.concatenate([levels, slopes], axis=2)
        parts = [
            levels,
            *(slopes * law.kelvin[:, None, None] for law in self._thermal_laws(history)),
            slopes * level,
            hypotheses.stiffening[:, None] * level,
            creep,
        ]
        for first, years, is_ramp in history.called.tolist():
            since = np.where(np.arange(tests) >= first, 1.0, 0.0)
            parts.append(change * since[:, None, None])
            if is_ramp:
                parts.append(change * (since * (history.years - years))[:, None, None])
        before = np.concatenate(parts, axis=2)[:, None]
        labels = 1 + len(hypotheses.disturbances)
        return np.concatenate(
            [
                np.broadcast_to(each, (tests, labels, *each.shape[2:]))
                for each in (before, self._recurring(history), change[:, None])
            ],
            axis=3,
        )

    def _recurring(self, history: History) -> FloatArray:
        """Return the columns (T, J, n, r) of disturbances that are alike each time."""
        hypotheses, found = self.hypotheses, []
        labels = 1 + len(hypotheses.disturbances)
        for label, each in enumerate(hypotheses.disturbances, 1):
            if each.recurs:
                factor = each.recurs * each.factor(hypotheses.quantities, hypotheses.loosening)
                moved = factor[: hypotheses.n] + history.slopes @ factor[hypotheses.n :]
                own = np.zeros((history.tests, labels, *moved.shape[1:]))
                own[:, label] = moved
                found.append(own)
        none = np.zeros((history.tests, labels, hypotheses.n, 0))
        return np.concatenate([none, *found], axis=3)

    def _precision(self, history: History) -> FloatArray:
        """Return the prior precision of the null's columns and those of called changes."""
        blocks = [np.diag(self.hypotheses.null_sd**-2.0)]
        for (_, _, is_ramp), precision in zip(
            history.called.tolist(), history.called_precision, strict=True
        ):
            blocks += [precision] * (2 if is_ramp else 1)
        blocks.append(np.eye(self._recurring(history).shape[3]))
        size = sum(map(len, blocks))
        joint, at = np.zeros((size, size)), 0
        for block in blocks:
            joint[at : at + len(block), at : at + len(block)] = block
            at += len(block)
        return joint

    def _softened(self, history: History) -> FloatArray:
        """Return log frequencies (T, n) less what a softer steel does."""
        return np.asarray(
            history.values - self._warmth(history).kelvin[:, None] * history.per_kelvin
        )

    # ------------------------------------------------------------ conditions

    def _warmth(self, history: History) -> Warmth:
        return warmth_of(history.temperature_c, history.years, history.reference_c, self.options)

    def _thermal_laws(self, history: History) -> tuple[Warmth, ...]:
        """Return what quantities go with, each by a coefficient of its own."""
        laws: tuple[Warmth, ...] = (self._warmth(history),)
        if self.hypotheses.thermal_laws > 1:
            laws += (frost_of(history.temperature_c, self.options.thermometer_sd_k),)
        return laws

    def _by_law(self, values: FloatArray) -> FloatArray:
        """Return coefficients (laws q,) by law (laws, q)."""
        return values.reshape(self.hypotheses.thermal_laws, self.hypotheses.q)

    def _unknown_warmth(self, history: History, *, of_season: bool) -> FloatArray:
        """Return factors (T, n, laws (1 + q)) of what a temperature that is not known, or not well,
        does: by what a kelvin does as far as that is known, and as far as it is not.

        Tests `of_season` share what they miss.
        """
        coefficients = self._by_law(history.coefficients)
        sds = self._by_law(history.coefficient_sd)
        softening, parts = history.per_kelvin, []
        for law, mean, sd in zip(self._thermal_laws(history), coefficients, sds, strict=True):
            known = softening + history.slopes @ mean
            per_kelvin = np.concatenate([known[:, :, None], history.slopes * sd], axis=2)
            off = law.sd * np.sqrt(law.shared) if of_season else law.sd
            parts.append(off[:, None, None] * per_kelvin)
            softening = np.zeros_like(softening)  # steel's goes with the first law
        return np.concatenate(parts, axis=2)

    def _unknown_level(self, history: History) -> FloatArray:
        """Return factors (T, n, q + 1) of what an excitation that was not measured does."""
        hypotheses = self.hypotheses
        per_level = hypotheses.null_sd[hypotheses.thermal.stop : -1]
        stiffening = np.broadcast_to(
            hypotheses.stiffening[:, None], (history.tests, hypotheses.n, 1)
        )
        moving = np.concatenate([history.slopes, stiffening], axis=2)
        unknown = moving * (self.options.unknown_log_amplitude_sd * per_level)
        unknown[np.isfinite(history.log_amplitude)] = 0.0
        return np.asarray(unknown)

    # ------------------------------------------------------------ covariances

    def _shared(self, history: History) -> FloatArray:
        """Return the covariance (T, n, n) of a sound test beside that of its identification."""
        unknown = np.concatenate(
            [self._unknown_level(history), self._unknown_warmth(history, of_season=True)], axis=2
        )
        scatter = self._scattering(history) * np.sqrt(history.scatter_variance)
        return np.asarray(
            unknown @ np.swapaxes(unknown, 1, 2) + scatter @ np.swapaxes(scatter, 1, 2)
        )

    def _scattering(self, history: History) -> FloatArray:
        """Return along what each test scatters (T, n, q + c)."""
        fixed = self.hypotheses.scattering
        fixed = np.broadcast_to(fixed, (history.tests, *fixed.shape))
        return np.concatenate([history.slopes, fixed], axis=2)

    def _disturbances(self, history: History) -> FloatArray:
        """Return the covariances (T, J, n, n) that labels add; the first, of sound ones, is 0."""
        hypotheses, n = self.hypotheses, self.hypotheses.n
        found = [np.zeros((history.tests, n, n))]
        for each in hypotheses.disturbances:
            along = history.slopes * each.quantity_sds(hypotheses.quantities)
            joint = each.springs**2 * hypotheses.loosening @ hypotheses.loosening.T
            alike = each.common**2 * np.ones((n, n)) + each.each**2 * np.eye(n)
            found.append(along @ np.swapaxes(along, 1, 2) + joint + alike)
        return np.stack(found, axis=1)

    def scatter(self, history: History) -> FloatArray:
        """Return what sound tests say of the scatter (q + c,); of a visit one test does."""
        sound: BoolArray = history.sound > 0.5
        rows = np.flatnonzero(sound)
        rows = rows[np.diff(history.visit[rows], prepend=-1) > 0]
        laws, coefficients = self._thermal_laws(history), self._by_law(history.coefficients)
        at_rest = self._softened(history)
        for law, mean in zip(laws, coefficients, strict=True):
            at_rest = at_rest - law.kelvin[:, None] * (history.slopes @ mean)
        unknown = self._unknown_warmth(history, of_season=False)[rows]
        variances = history.variances[rows]
        spread = variances[1:] + variances[:-1]
        known = np.isfinite(spread)
        of_both = np.concatenate([unknown[1:], unknown[:-1]], axis=2) * known[:, :, None]
        own = np.where(known, spread, _ABSENT)
        covariance = own[:, :, None] * np.eye(self.hypotheses.n)
        return learn_scatter(
            np.where(known, np.diff(at_rest[rows], axis=0), 0.0),
            covariance + of_both @ np.swapaxes(of_both, 1, 2),
            np.where(known[:, :, None], self._scattering(history)[rows][1:], 0.0),
            (self.hypotheses.scatter_variance, history.scatter_variance),
            self.options,
        )

    def effects(self, history: History) -> FloatArray:
        """Return what a change does to each plane's first frequency and to its mean (r, n + q), or
        to every mode."""
        measured = np.isfinite(history.variances)
        count = np.maximum(measured.sum(axis=0), 1)[:, None]
        slopes = np.where(measured[:, :, None], history.slopes, 0.0).sum(axis=0) / count
        of_modes = np.hstack([np.eye(self.hypotheses.n), slopes])
        if self.hypotheses.every_mode:
            return of_modes
        planes = np.array(self.hypotheses.planes)
        rows = [of_modes[planes == plane] for plane in dict.fromkeys(planes.tolist())]
        return np.vstack([row for own in rows for row in (own[0], own.mean(axis=0))])


def learn_scatter(
    values: FloatArray,
    covariance: FloatArray,
    factors: FloatArray,
    variance: tuple[FloatArray, FloatArray],
    options: WatchOptions,
) -> FloatArray:
    """Return the variance (c,) of tests along each factor, by expectation and maximisation.

    `values` (d, n) are differences of tests that follow each other, which differ along `factors`
    (d, n, c) and otherwise by `covariance` (d, n, n); `variance` are those before any test and to
    begin from. A difference beyond several of its standard deviations is a change, and no scatter
    (Hampel 1974).
    """
    prior, now = variance[0], np.maximum(variance[1], 1e-12)
    if not len(values):
        return prior
    there = np.abs(factors).max(axis=1) > 0
    for _ in range(options.scatter_rounds):
        scaled = factors * np.sqrt(2 * now)
        weight = np.linalg.inv(scaled @ np.swapaxes(scaled, 1, 2) + covariance)
        weighted = weight @ scaled
        # Of a unit normal along each factor: its mean given the difference, and what that explains.
        along = np.einsum("dic,di->dc", weighted, values)
        explained = np.einsum("dic,dic->dc", scaled, weighted)
        far = np.abs(along) / np.sqrt(np.maximum(explained, 1e-12))
        up_to, change_from = options.scatter_up_to_sds, options.change_from_sds
        left = np.clip((change_from - far) / (change_from - up_to), 0.0, 1.0)
        square = explained * np.minimum(far, up_to) ** 2
        expected = there * (left * square + (1 - left) * explained + 1 - explained)
        tests = options.scatter_prior_tests
        now = (tests * prior + now * expected.sum(axis=0)) / (tests + there.sum(axis=0))
    return np.asarray(now)


def _levels(log_amplitude: FloatArray) -> FloatArray:
    """Return levels over the usual one, NaN where unknown."""
    known = np.isfinite(log_amplitude)
    return log_amplitude - (float(np.median(log_amplitude[known])) if known.any() else 0.0)
