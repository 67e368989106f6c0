"""The watch of one hanger, test by test: what stands after each rests on the tests up to it alone.

After a call the called change is part of what is known, and a further one is looked for.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from shm.errors import BadInput
from shm.values import (
    Change,
    CreepRate,
    FloatArray,
    Hanger,
    IntArray,
    ModeReading,
    Reading,
    WatchedQuantity,
    WatchedTest,
)
from shm.values.drift import ENOUGH_AGAINST
from shm.watch.engine.causes import Columns, DetectedChange, Structure, structure_of
from shm.watch.engine.change_point import Evidence, evidence_of
from shm.watch.engine.frequencies import structure_of_frequencies
from shm.watch.engine.kept_state import to_bytes
from shm.watch.engine.limits import LIMITS
from shm.watch.engine.options import OF_ONE_VISIT_YEARS, WatchOptions, reference_of
from shm.watch.engine.persistence import (
    bound_by_recurrence,
    outlier_probability,
    select_consistent_tests,
)
from shm.watch.engine.posterior_summary import (
    SummaryContext,
    probability_of_change,
    summarize_change,
    summarize_drifts,
)
from shm.watch.state_sums import StateSums, WatchState, detected_change


@dataclass(frozen=True, eq=False)
class Call:
    """A change that was called after the test at `index` of the watch; `change` as it was then."""

    index: int
    change: Change


@dataclass(frozen=True, eq=False)
class Watch:
    """The result after each reading, in the order of time."""

    tests: tuple[WatchedTest, ...]

    @property
    def calls(self) -> tuple[Call, ...]:
        """The changes that were called on the way."""
        every = (Call(n, test.change) for n, test in enumerate(self.tests))
        return tuple(each for each in every if each.change.called)


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
        """Return a digest of what a state rests on but the readings: rules, options, quantities."""
        given = to_bytes((LIMITS.version, self.options, self.quantities))
        return hashlib.sha256(given).hexdigest()

    @cached_property
    def structure(self) -> Structure:
        """The hypotheses."""
        if not self.hanger.is_modelled:
            return structure_of_frequencies(len(self.quantities), self.options)
        return structure_of(self.quantities, self.columns, self.options)

    @cached_property
    def sums(self) -> StateSums:
        """Return what the tests of a state are to the evidence."""
        return StateSums(self.quantities, self.columns.modes, self.structure, self.options)

    def begin(self, readings: Sequence[Reading]) -> tuple[WatchState, Watch]:
        """The state after the readings of the baseline, by time, and a result for each of them.

        Where they are fewer than the options' `baseline_tests`, the state cannot go on.
        """
        n, q = self.structure.layout.n, self.structure.layout.q
        coefficients = q * self.structure.thermal_laws
        state = WatchState(
            self.key,
            reference_of([reading.temperature_c for reading in readings]),
            np.zeros(coefficients),
            self.structure.layout.prior_sd[n + q :][:coefficients],
            self.structure.scatter_variance,
        )
        return self.watch(state, readings)

    def watch(self, state: WatchState, readings: Sequence[Reading]) -> tuple[WatchState, Watch]:
        """Return the state after more readings, by time, and a result for each of them."""
        tests = []
        for reading in readings:
            state, found = self.after(state, reading)
            tests.append(found)
        return state, Watch(tuple(tests))

    def after(self, state: WatchState, reading: Reading) -> tuple[WatchState, WatchedTest]:
        """Return the state after one more reading, and the result.

        Raises BadInput where the reading is older than the last, or of other quantities.
        """
        if state.tests and reading.time < state.readings[-1].time:
            raise BadInput(
                f"The watch was given test {reading.test} after one that is later.",
                remedy="Sort the tests by time.",
            )
        state, evidence = self._limit_last_visit(self._with(state, reading))
        if not state.counted[-1]:
            evidence = self._evidence(state, _counting(state))
        evidence, causes, against = self._apply_recurrence_bound(state, evidence)
        if against >= ENOUGH_AGAINST:
            # Else everything since would be one change, and hide the next.
            state = self._with_baseline(state, counts=False)
            evidence, causes, _ = self._bounded(state)
        its = slice(self.options.baseline_tests)
        since, all_causes = evidence, causes
        if np.isfinite(state.modes.variances[its]).any() and not state.counted[its].any():
            against = int(state.counted.sum())
            # How far it is since the baseline stays open all the same.
            since, all_causes, _ = self._bounded(self._with_baseline(state, counts=True))
        found = self._summarize(state, reading, (evidence, causes, against), (since, all_causes))
        coefficients, coefficient_sd = self._coefficients(evidence)
        if found.change.called and state.counted[-1]:
            still = state.still_same * (1 - probability_of_change(evidence, self.options))
            call = detected_change(causes, _counting(state), found.change)
            state = replace(state, called=(*state.called, call), still_same=still)
        state = replace(state, coefficients=coefficients, coefficient_sd=coefficient_sd)
        return state, found

    def _bounded(self, state: WatchState) -> tuple[Evidence, Evidence, int]:
        """Return the evidence of the tests that count, as `_apply_recurrence_bound` does."""
        return self._apply_recurrence_bound(state, self._evidence(state, _counting(state)))

    def _apply_recurrence_bound(
        self, state: WatchState, evidence: Evidence
    ) -> tuple[Evidence, Evidence, int]:
        """Return the bounded evidence, that for weighing causes, and tests against the baseline."""
        # Technical: of the limit: below it nobody asks which cause it was
        if evidence.log_evidence <= math.log(0.1 * self.options.limit_years):
            return evidence, evidence, 0
        # How sure it is that anything changed is bounded; which cause it was is for all to say.
        rows = _counting(state)
        causes = evidence
        if (state.weight[rows] != 1).any():
            causes = self._evidence(replace(state, weight=np.ones_like(state.weight)), rows)
        course = self.sums.course(state, rows, causes.called)
        log_years, against = bound_by_recurrence(causes, course, self.options.limit_years)
        return replace(evidence, log_most=log_years), causes, 0 if causes.called else against

    def _with_baseline(self, state: WatchState, *, counts: bool) -> WatchState:
        """Return the state in which the baseline counts, no change being called; or does not."""
        counted = state.counted.copy()
        counted[: self.options.baseline_tests] = counts
        return replace(state, counted=counted, called=() if counts else state.called)

    def _summarize(
        self,
        state: WatchState,
        reading: Reading,
        changes: tuple[Evidence, Evidence, int],
        shifts: tuple[Evidence, Evidence],
    ) -> WatchedTest:
        """Summarize the newest test.

        By the evidence of changes, that by which causes are weighed, and tests against the
        baseline; and that of shifts since the baseline.
        """
        evidence, causes, against_baseline = changes
        of_baseline = float(state.years[: self.options.baseline_tests].mean())
        subject = SummaryContext(
            self.quantities,
            self.hanger,
            self.options,
            state.readings[0].time,
            of_baseline,
            *self.sums.effects,
        )
        outlier = outlier_probability(
            self.sums.seen(state),
            state.counted,
            state.tests - 1,
            self.options.outlier_probability,
        )
        return WatchedTest(
            test=reading.test,
            time=reading.time,
            temperature_c=reading.temperature_c,
            drifts=summarize_drifts(
                subject, *shifts, reading, is_baseline=state.tests <= self.options.baseline_tests
            ),
            change=summarize_change(
                subject,
                evidence,
                causes,
                reading,
                1 - state.still_same,
                outlier,
                against_baseline=against_baseline,
            ),
            creep_per_year=self._creep(evidence),
        )

    def _limit_last_visit(self, state: WatchState) -> tuple[WatchState, Evidence]:
        """The newest visit with what is left of its weight: alone it speaks for no change by more
        than it may, whether it counts by now or only once another agrees with it. And the evidence
        as if it counted."""
        visit = state.years >= state.years[-1] - OF_ONE_VISIT_YEARS
        rows = np.union1d(np.flatnonzero(state.counted), [state.tests - 1])
        most = math.log(self.options.most_of_one_test * self.options.limit_years)
        evidence = self._evidence(state, rows)
        for _ in range(LIMITS.most_repeats):
            factor, mass = evidence.of_last_visit
            if mass <= most + LIMITS.nearly or factor <= 0:  # the latter at a limit of days
                break
            weight = state.weight.copy()
            weight[visit] *= max(factor - (mass - most), LIMITS.nearly) / factor
            state = replace(state, weight=weight)
            evidence = self._evidence(state, rows)
        return state, evidence

    def _with(self, state: WatchState, reading: Reading) -> WatchState:
        """Return the state with one more test in it, and who counts now."""
        n, q = self.structure.layout.n, self.structure.layout.q
        if reading.mean.shape != (q,):
            raise BadInput(f"The reading of test {reading.test} is not of {q} quantities.")
        if reading.modes is None:
            nothing, unknown = np.zeros(n), np.full(n, np.inf)
            blind = ModeReading(nothing, unknown, nothing, np.zeros(n, bool))
            reading = replace(reading, modes=blind)
        is_known = state.reference_c == state.reference_c
        later = replace(
            state,
            readings=(*state.readings, reading),
            weight=np.append(state.weight, 1.0),
            reference_c=state.reference_c if is_known else reading.temperature_c,
        )
        counts = select_consistent_tests(
            self.sums.seen(later), state.counted, self.options.baseline_tests
        )
        later = replace(later, counted=counts)
        return replace(later, scatter_variance=self.sums.scatter(later))

    def _evidence(self, state: WatchState, rows: IntArray) -> Evidence:
        """Of the tests `rows`."""
        first = int((rows < self.options.baseline_tests).sum())
        return evidence_of(
            self.sums.sums(state, rows),
            state.years[rows],
            max(first, 1),
            self.structure.layout,
            self.structure.directions,
            _called(state, rows),
            self.options.beginnings,
        )

    def _coefficients(self, evidence: Evidence) -> tuple[FloatArray, FloatArray]:
        """Return what a kelvin does to each quantity (laws q,), its sd, by the best scatter."""
        n, count = self.structure.layout.n, self.structure.layout.q * self.structure.thermal_laws
        best, its = int(evidence.log_null.argmax()), slice(n, n + count)
        variance = np.diag(evidence.null_covariance[best])[its]
        return np.asarray(evidence.null_mean[best, its]), np.sqrt(np.maximum(variance, 0.0))

    def _creep(self, evidence: Evidence) -> CreepRate | None:
        """The tension's creep if nothing but what was called changes; None where that is unlikely.

        It is the last covariate of the null, before the called changes.
        """
        is_likely = probability_of_change(evidence, self.options) > 0.5
        if is_likely or not self.hanger.is_modelled:
            return None
        at, weights = len(self.structure.layout.null) - 1, np.exp(evidence.log_null)
        means, variances = evidence.null_mean[:, at], evidence.null_covariance[:, at, at]
        mean = float(weights @ means)
        variance = float(weights @ (variances + (means - mean) ** 2))
        return CreepRate(mean, math.sqrt(variance), self.options.creep_per_year_sd)


def _counting(state: WatchState) -> IntArray:
    """Return the tests that count; as long as none does, the newest, which then says nothing."""
    rows = np.flatnonzero(state.counted)
    return rows if len(rows) else np.array([state.tests - 1])


def _called(state: WatchState, rows: IntArray) -> list[DetectedChange]:
    """Return the called changes, as the tests `rows` see them."""
    return [replace(c, first=int(np.searchsorted(rows, c.first))) for c in state.called]
