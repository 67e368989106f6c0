"""Watch one hanger as a whole: tests read, put through the sequential test, decided on.

Each test calls for at most one alert: a change is called (`sudden change`, `slow drift`), a
quantity is `beyond threshold`, two tests agree (`agreement`), a test agrees with none before it, or
a mode is wrong three times in a row. A condition is reported once. It ends when its probability
falls below half the level that the owner asked for, and only then can it be reported again. All is
derived from the sequence of tests, so that the same tests give the same alerts.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from types import MappingProxyType

from shm.values import (
    Alert,
    AlertKind,
    Beside,
    Change,
    Drift,
    Hanger,
    ModalTest,
    Moved,
    Plane,
    Posterior,
    Reading,
    RepeatedMistake,
    WatchedTest,
)
from shm.values.drift import OF_ONE_VISIT
from shm.watch.agreement import Way, agreement, way_of
from shm.watch.engine.kept_state import from_bytes, to_bytes
from shm.watch.engine.limits import LIMITS
from shm.watch.engine.options import WatchOptions
from shm.watch.engine.readings import Reader
from shm.watch.state_sums import WatchState
from shm.watch.watcher import Watch, Watcher
from shm.watch.words.alert_text import alert_of, cause_of, message_of, suspects
from shm.watch.words.notices import (
    alert_of_agreement,
    alert_of_baseline,
    message_of_odd,
    news_of,
    notice_of,
    repeated_mistakes,
)

Condition = tuple[str, Way]
"""A quantity, and the way that it went."""
_WAYS: tuple[Way, Way] = ("down", "up")
DatedTest = tuple[ModalTest, datetime]
"""A test, and its time or that of its receipt."""
_BEYOND: AlertKind = "beyond threshold"
_REPEAT: AlertKind = "repeat the test"


def condition_of(each: Drift | Moved) -> Condition:
    """Return the quantity and the way that it went."""
    return each.quantity, way_of(each.shift_mean)


@dataclass(frozen=True)
class AlertState:
    """The conditions in force: when each quantity was reported beyond its threshold, and a call.

    `called` are the changes that were called, reported or not: after a call the sequential test
    speaks of a further change. `mistaken` are the modes that the last tests have wrong, `noted`
    those of them that were reported, `alone` whether it was reported that the baseline stands
    alone. `agreed` are those of `beyond` that two tests reported which agree: to the watch they
    were improbable all along. `fading` states since when those of `beyond` look over that must do
    so on another day, too.
    """

    beyond: Mapping[Condition, datetime] = field(default_factory=dict)
    call: datetime | None = None
    called: tuple[Change, ...] = ()
    odd: int = 0
    mistaken: tuple[RepeatedMistake, ...] = ()
    noted: frozenset[tuple[Plane, int]] = frozenset()
    alone: bool = False
    agreed: frozenset[Condition] = frozenset()
    fading: Mapping[Condition, datetime] = field(default_factory=dict)

    def still(self, test: WatchedTest, end: float) -> AlertState:
        """Return what is in force at a test: all but what tests of two visits have below `end`.

        A van that stands on the deck for a day ends nothing; neither do unknown shifts. A called
        change rests on two visits already. What two tests that agree have reported ends once the
        shift has come back, too.
        """
        fading = {
            condition: self.fading.get(condition, test.time)
            for drift in test.drifts
            for condition in ((drift.quantity, way) for way in _WAYS)
            if condition in self.beyond and self._looks_over(condition, drift, end)
        }
        is_called = test.change.called
        ended = {e for e, since in fading.items() if is_called or test.time - since > OF_ONE_VISIT}
        in_force = replace(
            self,
            beyond={each: at for each, at in self.beyond.items() if each not in ended},
            fading={each: since for each, since in fading.items() if each not in ended},
            agreed=self.agreed - ended,
        )
        if test.change.probability < end:
            in_force = replace(in_force, call=None, called=(), mistaken=(), noted=frozenset())
        return in_force

    def _looks_over(self, condition: Condition, drift: Drift, end: float) -> bool:
        probability = drift.probability * (condition == condition_of(drift))
        side = -1.0 if condition[1] == "down" else 1.0
        is_back = condition not in self.agreed or not drift.may_be_beyond(side)
        return probability < end and is_back

    def with_beyond(self, beyond: Sequence[Drift], at: datetime) -> AlertState:
        """Return the state with shifts that were reported at a test to be beyond a threshold."""
        return replace(self, beyond={**self.beyond, **dict.fromkeys(map(condition_of, beyond), at)})


@dataclass(frozen=True, eq=False)
class Watched:
    """All tests of a hanger since its baseline, the oldest first, and what the watch made of them.

    `watch` has a result for each of `readings`; the first of these are the baseline's.
    """

    reader: Reader
    readings: tuple[Reading, ...]
    watch: Watch

    @property
    def latest(self) -> WatchedTest:
        return self.watch.tests[-1]


def watch_hanger(
    baseline: Posterior,
    baseline_tests: Sequence[DatedTest],
    later: Sequence[DatedTest],
    hanger: Hanger,
    options: WatchOptions,
    known: Mapping[str, WatchedTest] = MappingProxyType({}),
) -> Watched:
    """Return the watch of a hanger over the tests of its baseline and `later` ones, both by time.

    `known` is what it has said before, by test: where that is of all later ones, none is judged
    again.
    How many tests precede every change follows from `baseline_tests`, whatever `options` say; how
    often it may be called falsely from the hanger's `false_call_years`, where it has its own.
    A test that is older than the baseline's counts as made right after them: all later ones are
    compared with the baseline. Raises BadInput where the baseline's tests hold no mode that its
    class describes.
    """
    accepted, reader, watcher, since = _begun(baseline, baseline_tests, hanger, options)
    first = [reader.reading(*each) for each in accepted]
    state, watch = watcher.begin(first)
    readings = [reader.reading(test, max(time, since)) for test, time in later]
    tests = [known[test.id] for test, _ in later if test.id in known]
    if len(tests) < len(later):
        tests = list(watcher.watch(state, readings)[1].tests)
    mistaken: tuple[RepeatedMistake, ...] = ()
    for n, reading in enumerate(readings):
        mistaken = repeated_mistakes(mistaken, reading, reader.columns)
        tests[n] = replace(tests[n], mistaken=mistaken)
    return Watched(reader, (*first, *readings), Watch((*watch.tests, *tests)))


def _begun(
    baseline: Posterior,
    baseline_tests: Sequence[DatedTest],
    hanger: Hanger,
    options: WatchOptions,
) -> tuple[tuple[DatedTest, ...], Reader, Watcher, datetime]:
    """Return a baseline's accepted tests, its reader and watcher, and when it ends."""
    tests = accepted_baseline_tests(baseline, baseline_tests)
    reader = Reader(baseline, [test for test, _ in tests], hanger)
    options = options_of(hanger, len(tests), options)
    watcher = Watcher(reader.quantities, reader.columns, hanger, options)
    return tests, reader, watcher, max(time for _, time in tests)


def accepted_baseline_tests(
    baseline: Posterior, tests: Sequence[DatedTest]
) -> tuple[DatedTest, ...]:
    """Return the tests of a baseline without what was left out of it as mistaken."""
    check = baseline.baseline_check
    if check is None:
        return tuple(tests)
    return tuple(
        (check.without_mistakes(test), at) for test, at in tests if not check.leaves_out(test.id)
    )


@dataclass(frozen=True, eq=False)
class Newest:
    """The result after the newest test, the alert it calls for, and the state to store."""

    test: WatchedTest
    alert: Alert | None
    kept: bytes


def watch_newest(
    baseline: Posterior,
    baseline_tests: Sequence[DatedTest],
    later: Sequence[DatedTest],
    hanger: Hanger,
    options: WatchOptions,
    kept: bytes | None = None,
    beside: Beside | None = None,
) -> Newest | None:
    """Return the last of what `watch_hanger` finds, from what was `kept` after the tests before it.

    `later` are then the tests since, the newest alone as a rule; without `kept` all of them. None
    where nothing can go on from what was kept, since rules, options or description have changed:
    then the watch must begin without it. Where the watch itself calls for no alert, the newest may
    yet agree with a test `beside` it.
    """
    accepted, reader, watcher, since = _begun(baseline, baseline_tests, hanger, options)
    alert: Alert | None = None
    if kept is None:
        state, watch = watcher.begin([reader.reading(*each) for each in accepted])
        reported, _ = replay(watch.tests, hanger)
        found = watch.tests[-1]
    else:
        state, reported = from_bytes(tuple[WatchState, AlertState], kept)
        if state.key != watcher.key:
            return None
    for test, time in later:
        reading = reader.reading(test, max(time, since))
        state, found = watcher.after(state, reading)
        mistaken = repeated_mistakes(reported.mistaken, reading, reader.columns)
        found = replace(found, mistaken=mistaken)
        reported, alert = after(reported, found, hanger)
    # A second test that agrees answers the notice that asks for one.
    if (alert is None or alert.kinds == (_REPEAT,)) and beside is not None and later:
        agreed = agreement(reader, later[-1], beside, hanger, watcher.options, reported.beyond)
        if agreed is not None:
            alert = alert_of_agreement(agreed, hanger)
            reported = reported.with_beyond(alert.drifts, alert.time)
            both = reported.agreed.union(map(condition_of, alert.drifts))
            reported = replace(reported, agreed=both)
    return Newest(found, alert, to_bytes((state, reported)))


def options_of(hanger: Hanger, baseline_tests: int, options: WatchOptions) -> WatchOptions:
    """Return the options with a hanger's own baseline and mean time between false calls."""
    stated = hanger.thresholds.false_call_years
    limit_years = options.limit_years if stated is None else stated
    return replace(options, baseline_tests=baseline_tests, limit_years=limit_years)


def after(before: AlertState, test: WatchedTest, hanger: Hanger) -> tuple[AlertState, Alert | None]:
    """Return what is in force after one more test, and the alert that it calls for, if any."""
    level = hanger.thresholds.alert_probability
    standing = before.still(test, hanger.thresholds.end_probability)
    is_call = test.change.called and not _is_known(standing, test.change)
    beyond = tuple(
        drift
        for drift in (test.published_drifts if is_call else test.drifts)
        if drift.probability >= level and condition_of(drift) not in standing.beyond
    )
    called = (*standing.called, test.change) if test.change.called else standing.called
    change = test.change if is_call else _explaining(beyond, called, test.change)
    alert = _alert(beyond, is_call, change, test, hanger, standing)
    alone, since_baseline = before.alone, tuple[Drift, ...]()
    if alert is None and test.change.is_baseline_alone and not (alone or standing.beyond):
        alert, alone = alert_of_baseline(test, hanger), True
        since_baseline = alert.drifts
    odd = standing.odd + 1 if test.change.outlier_probability > LIMITS.odd else 0
    if alert is None and odd in (1, LIMITS.odd_in_a_row):
        kind: AlertKind = _REPEAT if odd == 1 else "tests disagree"
        words, key = message_of_odd(test, hanger, odd), kind.replace(" ", "-")
        alert = alert_of(hanger, (test.test, test.time), key, words, (kind,))
    wrong = frozenset((each.plane, each.order) for each in test.mistaken if each.is_notable)
    noted = before.noted & wrong
    explained = any(each.moved and cause_of(each.moved[0].quantity) for each in called)
    if alert is None and not explained and (new := news_of(test.mistaken, noted)):
        # It waits while there is worse to report; a mass or lost section is why modes go astray.
        alert, noted = notice_of(test, hanger, new), wrong
    in_force = replace(
        standing.with_beyond((*beyond, *since_baseline), test.time),
        call=test.time if is_call else standing.call,
        called=called,
        odd=odd,
        mistaken=test.mistaken,
        noted=noted,
        alone=alone,
        # Improbable to the watch, as what two tests report: it ends once the shift has come back.
        agreed=standing.agreed.union(map(condition_of, since_baseline)),
    )
    return in_force, alert


def replay(watched: Sequence[WatchedTest], hanger: Hanger) -> tuple[AlertState, tuple[Alert, ...]]:
    """Return what is in force after a history, the oldest test first, and all alerts on the way.

    An alert's key names hanger, rules, quantity, way and test: the same whenever it is asked for.
    """
    reported, alerts = AlertState(), []
    for test in watched:
        reported, alert = after(reported, test, hanger)
        alerts += [alert] if alert else []
    return reported, tuple(alerts)


def _is_known(standing: AlertState, change: Change) -> bool:
    """Return True if an alert that is in force has reported a called change already."""
    named = {each.quantity for each in suspects(change)}
    reported = [at for (quantity, _), at in standing.beyond.items() if quantity in named]
    reported += [standing.call] if standing.call else []
    return any(change.began_by <= at for at in reported)


def _explaining(beyond: Sequence[Drift], called: Sequence[Change], now: Change) -> Change | None:
    """Return the last called change of the same way as a shift; None where none explains it."""
    if not called:
        return now if now.probability > 0.5 else None
    shifts = set(map(condition_of, beyond))
    for change in reversed(called):
        if shifts & set(map(condition_of, suspects(change))):
            chances = now.probability, now.outlier_probability
            return replace(change, probability=chances[0], outlier_probability=chances[1])
    return None


def _alert(
    beyond: tuple[Drift, ...],
    is_call: bool,
    change: Change | None,
    test: WatchedTest,
    hanger: Hanger,
    standing: AlertState,
) -> Alert | None:
    """Return the alert of what a test adds; None where it adds nothing."""
    kinds: list[AlertKind] = [_BEYOND] if beyond else []
    if is_call:
        kinds.append("sudden change" if test.change.sudden >= 0.5 else "slow drift")
    if not kinds:
        return None
    level = hanger.thresholds.alert_probability
    still_beyond = [
        replace(each, probability=max(each.probability, level))
        for each in test.drifts
        if condition_of(each) in standing.beyond.keys() - standing.agreed - standing.fading.keys()
    ]
    words = message_of(
        test,
        hanger,
        change,
        beyond,
        is_call=is_call,
        is_further=is_call and bool(standing.called),
        standing=still_beyond,
    )
    lead = beyond[0] if beyond else test.change.moved[0] if test.change.moved else None
    what = "-".join(condition_of(lead)) if lead else "unknown"
    key = f"{'+'.join(kinds)}:{what}".replace(" ", "-")
    names = [each.quantity for each in suspects(test.change)]
    by_name = {drift.quantity: drift for drift in test.drifts}
    suspected = tuple(by_name[name] for name in names if name in by_name)
    of_test = test.test, test.time
    return alert_of(hanger, of_test, key, words, tuple(kinds), beyond or suspected, change)
