"""The watch of one hanger, test by test: each result rests on the tests up to it alone.

After a call the called change is part of what is known, and a further one is looked for.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property

import numpy as np

from shm.errors import BadInput, UsageError
from shm.values import BoolArray, Change, FloatArray, Hanger, Reading, WatchedQuantity, WatchedTest
from shm.watch.causes import Columns, Hypotheses, hypotheses_of
from shm.watch.changepoint import ChangePoint, Evidence
from shm.watch.history import History, LinearModel
from shm.watch.options import WatchOptions, reference_of
from shm.watch.summary import Summary

# To be raised whenever the same readings give other results than before: kept states are void then.
_VERSION = 14
_LEAST_SHARE = 1e-6  # judgement: of a cause in a call, which later tests may yet speak for
_CLEARLY_NATS = 3.0  # 20 to 1


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
        """Names what a history rests on beside the readings: version, options and quantities."""
        given = [_VERSION, asdict(self.options), [_digest(each) for each in self.quantities]]
        return hashlib.sha256(json.dumps(given).encode()).hexdigest()

    @cached_property
    def hypotheses(self) -> Hypotheses:
        """What may happen to the hanger."""
        return hypotheses_of(self.quantities, self.columns, self.options)

    @cached_property
    def model(self) -> LinearModel:
        """The linear model of the tests."""
        return LinearModel(self.hypotheses, self.options)

    def begin(self, readings: Sequence[Reading]) -> tuple[History, tuple[WatchedTest, ...]]:
        """Return the history of the readings of the baseline, by time, and a result for each.

        Raises UsageError where these are more than the options' `baseline_tests`, or none. Where
        they are fewer, the history cannot go on.
        """
        if not 0 < len(readings) <= self.options.baseline_tests:
            raise UsageError(
                f"The watch was to begin with {len(readings)} readings; its baseline has "
                f"{self.options.baseline_tests}."
            )
        reference_c = reference_of([reading.temperature_c for reading in readings])
        history = History.before_any(self.key, readings[0].time, reference_c, self.hypotheses)
        tests = []
        for reading in readings:
            history, found = self._advance(history, reading)
            tests.append(found)
        return history, tuple(tests)

    def after(self, history: History, reading: Reading) -> tuple[History, WatchedTest]:
        """Return the history with one more reading, and the result.

        Raises BadInput where the reading is older than the last, or of other quantities, UsageError
        where the history is that of another watch, or its baseline is not complete.
        """
        if history.key != self.key or history.tests < self.options.baseline_tests:
            raise UsageError(
                "This state of a watch is not of this hanger, baseline and options.",
                remedy="Begin the watch anew.",
            )
        return self._advance(history, reading)

    def _advance(self, history: History, reading: Reading) -> tuple[History, WatchedTest]:
        if reading.time < history.last_time:
            raise BadInput(
                f"The watch was given test {reading.test} after one that is later.",
                remedy="Sort the tests by time.",
            )
        history = history.with_reading(reading)
        history = replace(history, scatter_variance=self.model.scatter(history))
        history = self._reclassified(history)
        first = max([self.options.baseline_tests, *(int(n) + 1 for n in history.called[:, 0])])
        search = ChangePoint(self.hypotheses, self.options)
        evidence = search.evidence(self.model.sums(history), history.labels, first)
        thermal, null = self.hypotheses.thermal, evidence.null
        history = replace(
            history,
            labels=null.labels,
            coefficients=null.mean[thermal],
            coefficient_sd=np.sqrt(np.maximum(np.diag(null.covariance)[thermal], 0.0)),
        )
        summary = Summary(
            self.hypotheses,
            self.options,
            self.hanger,
            history,
            evidence,
            self.model.effects(history),
        )
        outlier = self._outlier_probability(evidence, summary.probability)
        change = summary.change(reading, outlier, self._against_baseline(history))
        found = WatchedTest(
            test=reading.test,
            time=reading.time,
            temperature_c=reading.temperature_c,
            drifts=summary.drifts(reading),
            change=change,
            creep_per_year=summary.creep(),
        )
        if change.called:
            history = self._with_call(history, evidence, change, summary.probability)
        return history, found

    def _outlier_probability(self, evidence: Evidence, probability: float) -> float:
        """Return the probability that the last visit is disturbed so that it is to be repeated:
        so that it does not pass, or at all while no visit is sound."""
        labels = evidence.null.labels
        is_any_sound = bool((labels[:, 0] > 0.5).any())
        passes = [each.passes and is_any_sound for each in self.hypotheses.disturbances]
        is_odd = ~np.array([True, *passes])
        found = float(labels[-1, is_odd].sum())
        if not (evidence.is_open and evidence.changes):
            return found
        changed = float(evidence.changes[0].fit.labels[-1, is_odd].sum())
        return probability * changed + (1 - probability) * found

    def _against_baseline(self, history: History) -> int:
        """Return how many sound visits there are since a baseline all of whose tests are disturbed;
        0 where one is sound."""
        sound: BoolArray = np.asarray(history.sound > 0.5)
        first = self.options.baseline_tests
        is_measured: BoolArray = np.asarray(np.isfinite(history.variances).any(axis=1))
        if sound[:first].any() or not is_measured[:first].any():
            return 0
        agreeing = np.flatnonzero(sound & is_measured)
        return len(np.unique(history.visit[agreeing[agreeing >= first]]))

    def _with_call(
        self, history: History, evidence: Evidence, change: Change, probability: float
    ) -> History:
        """Return the history in which a called change is part of what is known."""
        at = int(evidence.shares.sum(axis=(1, 2, 3)).argmax())
        first = int(evidence.beginnings[at])
        begun = [float(first), float(evidence.years[first - 1]), float(change.sudden < 0.5)]
        return replace(
            history,
            labels=evidence.changes[0].fit.labels,
            called=np.append(history.called, [begun], axis=0),
            called_precision=np.append(history.called_precision, [self._size(evidence)], axis=0),
            unchanged=history.unchanged * (1 - probability),
        )

    def _size(self, evidence: Evidence) -> FloatArray:
        """Return the precision (n + q, n + q) of a called change: each cause as probable as now."""
        n, steps = self.hypotheses.n, [each.step_sd for each in self.quantities]
        least = np.concatenate([np.full(n, 1e-5), 1e-3 * np.array(steps)])
        covariance = np.diag(least**2)
        shares = evidence.shares.sum(axis=(0, 1))
        shares[:, 0] = np.maximum(shares[:, 0], _LEAST_SHARE)
        for direction, by_size in zip(evidence.directions, shares, strict=True):
            for share, size in zip(by_size, self.options.sizes, strict=True):
                covariance += share * size**2 * direction.factor @ direction.factor.T
        return np.asarray(np.linalg.inv(covariance))

    def _reclassified(self, history: History) -> History:
        """Return the history with the last called change as a step or a ramp, as the tests since
        make clear: at its call a ramp has hardly begun."""
        if not len(history.called):
            return history
        other = replace(history, called=history.called.copy())
        other.called[-1, 2] = 1 - other.called[-1, 2]
        search = ChangePoint(self.hypotheses, self.options)
        as_it_is, otherwise = (
            search.fit_null(self.model.sums(each), each.labels).log_evidence
            for each in (history, other)
        )
        return other if otherwise - as_it_is > _CLEARLY_NATS else history


def watched(
    readings: Sequence[Reading],
    quantities: tuple[WatchedQuantity, ...],
    columns: Columns,
    hanger: Hanger,
    options: WatchOptions | None = None,
) -> Watch:
    """Return a result for each reading, which rests on the readings up to it alone.

    The same as a Watcher finds test by test. Raises BadInput where readings are not in the order of
    time or not of these quantities.
    """
    watcher = Watcher(quantities, columns, hanger, options or WatchOptions.of(hanger.assumptions))
    if not readings:
        return Watch((), ())
    count = watcher.options.baseline_tests
    history, begun = watcher.begin(readings[:count])
    tests = list(begun)
    for reading in readings[count:]:
        history, found = watcher.after(history, reading)
        tests.append(found)
    return watch_of(tests)


def watch_of(tests: Sequence[WatchedTest]) -> Watch:
    """Return the results of a watch with the changes that they call."""
    calls = (Call(n, test.change) for n, test in enumerate(tests) if test.change.called)
    return Watch(tuple(tests), tuple(calls))


def _digest(quantity: WatchedQuantity) -> list[object]:
    """Return all of a quantity, its table as a digest."""
    table = np.array([quantity.coordinates, quantity.values]).tobytes()
    plain = (getattr(quantity, name) for name in ("name", "baseline", "step_sd", "end", "plane"))
    return [*plain, *quantity.parameters, hashlib.sha256(table).hexdigest()]
