"""The watch of one hanger as a whole: tests read, put through the sequential test, decided on.

When an owner is told: from what the watch says after each test to at most one alert a test.

Four rules. A change is called by the sequential test, whose rate of false calls is known: `sudden
change` or `slow drift`. A quantity is `beyond threshold` once the probability of that reaches the
level which the owner asked for. Two tests that agree are told whatever their clocks say, where
neither of the former rules has (`agreement`). A test that agrees with none before it is a notice:
repeat it; three of them in a row are an alert. A condition that stands is told once. It ends when
its probability falls below half that level, and only then can it be told again, so that a
probability which hovers about the level does not ring every week. A change that was called and then
passes the threshold is told again, since the owner must now do something else. A mode that three
tests in a row have wrong is a notice, once: its number may be.

All is derived from the sequence of tests, so that the same tests give the same alerts.
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
    Plane,
    Posterior,
    Reading,
    RepeatedMistake,
    WatchedTest,
)
from shm.values.drift import OF_ONE_VISIT
from shm.watch.agreement import Way, agreement, way_of
from shm.watch.alert_text import CAUSES, alert_of, message_of, suspects
from shm.watch.kept_state import from_bytes, to_bytes
from shm.watch.notices import (
    alert_of_baseline,
    message_of_odd,
    news_of,
    notice_of,
    repeated_mistakes,
)
from shm.watch.options import WatchOptions
from shm.watch.readings import Reader
from shm.watch.state_sums import WatchState
from shm.watch.watcher import Watch, Watcher, watched


@dataclass(frozen=True)
class AlertState:
    """The conditions in force: when each quantity was reported beyond its threshold, and a call.

    `called` are the changes that were called, told or not: after a call the sequential test speaks
    of a further change, no longer of that one. `mistaken` are the modes that the last tests have
    wrong, `noted` those of them that were told, `alone` whether it was told that the baseline
    stands alone. `agreed` are those of `beyond` that two tests told which agree: to the watch they
    were improbable all along. `fading` says since when those of `beyond` look over that must do so
    on another day, too.
    """

    beyond: Mapping[tuple[str, Way], datetime] = field(default_factory=dict)
    call: datetime | None = None
    called: tuple[Change, ...] = ()
    odd: int = 0
    mistaken: tuple[RepeatedMistake, ...] = ()
    noted: frozenset[tuple[Plane, int]] = frozenset()
    alone: bool = False
    agreed: frozenset[tuple[str, Way]] = frozenset()
    fading: Mapping[tuple[str, Way], datetime] = field(default_factory=dict)


def still(told: AlertState, test: WatchedTest, end: float) -> AlertState:
    """Return what still stands at a test: all but what tests of two visits have below `end`.

    A van that stands on the deck for a day ends nothing; neither do unknown shifts. What two tests
    that agree have told was improbable to the watch all along: it ends once the shift has come
    back, too.
    """
    over = {
        (drift.quantity, way)
        for drift in test.drifts
        for way in ("up", "down")
        if _probability(drift, way) < end
        and not (
            (drift.quantity, way) in told.agreed
            and drift.may_be_beyond(-1.0 if way == "down" else 1.0)
        )
    }
    fading = {each: told.fading.get(each, test.time) for each in told.beyond if each in over}
    ended = {each for each, since in fading.items() if test.time - since > OF_ONE_VISIT}
    beyond = {condition: at for condition, at in told.beyond.items() if condition not in ended}
    fading = {each: since for each, since in fading.items() if each in beyond}
    agreed = told.agreed - ended
    if test.change.probability < end:
        return AlertState(beyond, odd=told.odd, alone=told.alone, agreed=agreed, fading=fading)
    return replace(told, beyond=beyond, agreed=agreed, fading=fading)


def _probability(drift: Drift, way: Way) -> float:
    """That the shift is beyond its threshold in one way; nearly none is where it went the other."""
    return drift.probability * (way_of(drift.shift_mean) == way)


def with_beyond(told: AlertState, beyond: Sequence[Drift], at: datetime) -> AlertState:
    """Return the state with shifts that were told at a test to be beyond their threshold."""
    return replace(told, beyond={**told.beyond, **dict.fromkeys(conditions(beyond), at)})


def conditions(drifts: Sequence[Drift]) -> frozenset[tuple[str, Way]]:
    """Each quantity and the way that it went."""
    return frozenset((each.quantity, way_of(each.shift_mean)) for each in drifts)


DatedTest = tuple[ModalTest, datetime]
"""A test, and its own time or that of its receipt."""
_BEYOND: AlertKind = "beyond threshold"
_REPEAT: AlertKind = "repeat the test"
_ODD = 0.9  # nine to one: a notice that is wrong costs a test
_ODD_IN_A_ROW = 3  # tests that fit nothing: no longer bad luck


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
    baseline_tests = kept_of(baseline, baseline_tests)
    reader = Reader(baseline, [test for test, _ in baseline_tests], hanger)
    since = max(time for _, time in baseline_tests)
    dated = [*baseline_tests, *((test, max(time, since)) for test, time in later)]
    readings = tuple(reader.reading(test, time) for test, time in dated)
    options = options_of(hanger, len(baseline_tests), options)
    words = [known[test.id] for test, _ in later if test.id in known]
    begin = readings if len(words) < len(later) else readings[: len(baseline_tests)]
    watch = watched(begin, reader.quantities, reader.columns, hanger, options)
    if begin is not readings:
        watch = Watch((*watch.tests, *words))
    tests = list(watch.tests)
    mistaken: tuple[RepeatedMistake, ...] = ()
    for n in range(len(baseline_tests), len(tests)):
        mistaken = repeated_mistakes(mistaken, readings[n], reader.modes)
        tests[n] = replace(tests[n], mistaken=mistaken)
    return Watched(reader, readings, replace(watch, tests=tuple(tests)))


def kept_of(baseline: Posterior, tests: Sequence[DatedTest]) -> tuple[DatedTest, ...]:
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
    baseline_tests = kept_of(baseline, baseline_tests)
    reader = Reader(baseline, [test for test, _ in baseline_tests], hanger)
    options = options_of(hanger, len(baseline_tests), options)
    watcher = Watcher(reader.quantities, reader.columns, hanger, options)
    if kept is None:
        readings = [reader.reading(test, time) for test, time in baseline_tests]
        state, watch = watcher.begin(readings)
        reported, alert = AlertState(), None
        for found in watch.tests:
            reported, alert = after(reported, found, hanger)
    else:
        state, reported = from_bytes(tuple[WatchState, AlertState], kept)
        if state.key != watcher.key:
            return None
    since = max(time for _, time in baseline_tests)
    for test, time in later:
        reading = reader.reading(test, max(time, since))
        state, found = watcher.after(state, reading)
        found = replace(found, mistaken=repeated_mistakes(reported.mistaken, reading, reader.modes))
        reported, alert = after(reported, found, hanger)
    # A second test that agrees answers the notice that asks for one.
    if (alert is None or alert.kinds == (_REPEAT,)) and beside is not None and later:
        agreed = agreement(reader, later[-1], beside, hanger, options, reported.beyond)
        if agreed is not None:
            two_told = {(each.quantity, way_of(each.shift_mean)) for each in agreed.drifts}
            alert, reported = agreed, with_beyond(reported, agreed.drifts, agreed.time)
            reported = replace(reported, agreed=reported.agreed | two_told)
    return Newest(found, alert, to_bytes((state, reported)))


def options_of(hanger: Hanger, baseline_tests: int, options: WatchOptions) -> WatchOptions:
    """Return the options with a hanger's own baseline and mean time between false calls."""
    stated = hanger.thresholds.false_call_years
    limit_years = options.limit_years if stated is None else stated
    return replace(options, baseline_tests=baseline_tests, limit_years=limit_years)


def after(told: AlertState, test: WatchedTest, hanger: Hanger) -> tuple[AlertState, Alert | None]:
    """Return what stands after one more test, and the alert that it calls for, if any."""
    level = hanger.thresholds.alert_probability
    standing = still(told, test, hanger.thresholds.end_probability)
    beyond, is_call = _news(standing, test, level)
    call = test.time if is_call else standing.call
    called = (*standing.called, test.change) if test.change.called else standing.called
    odd = standing.odd + 1 if test.change.outlier_probability > _ODD else 0
    change = test.change if is_call else _explaining(beyond, called, test.change)
    alert = _alert(beyond, is_call, change, test, hanger, standing)
    alone = told.alone
    since_baseline: tuple[Drift, ...] = ()
    if alert is None and test.change.is_baseline_alone and not (alone or standing.beyond):
        alert, alone = alert_of_baseline(test, hanger), True
        since_baseline = alert.drifts
    alert = alert or _of_odd(test, hanger, odd)
    wrong = frozenset((each.plane, each.order) for each in test.mistaken if each.is_notable)
    noted = told.noted & wrong
    explained = any(each.moved and each.moved[0].quantity in CAUSES for each in called)
    if alert is None and not explained and (new := news_of(test.mistaken, noted)):
        # It waits while there is worse to tell; a mass or lost section is why modes go astray.
        alert, noted = notice_of(test, hanger, new), wrong
    in_force = replace(
        with_beyond(standing, (*beyond, *since_baseline), test.time),
        call=call,
        called=called,
        odd=odd,
        mistaken=test.mistaken,
        noted=noted,
        alone=alone,
        # Improbable to the watch, as what two tests tell: it ends once the shift has come back.
        agreed=standing.agreed | conditions(since_baseline),
    )
    return in_force, alert


def _of_odd(test: WatchedTest, hanger: Hanger, in_a_row: int) -> Alert | None:
    """Of a test that fits nothing: a notice of the first, an alert of the third in a row."""
    if in_a_row not in (1, _ODD_IN_A_ROW):
        return None
    kind: AlertKind = _REPEAT if in_a_row == 1 else "tests disagree"
    words = message_of_odd(test, hanger, in_a_row)
    return alert_of(hanger, (test.test, test.time), kind.replace(" ", "-"), words, (kind,))


def alerts_of(watched: Sequence[WatchedTest], hanger: Hanger) -> tuple[Alert, ...]:
    """Return all alerts of a history, the oldest test first.

    An alert's key names hanger, rules, quantity, way and test: the same whenever it is asked for.
    """
    reported, alerts = AlertState(), []
    for test in watched:
        reported, alert = after(reported, test, hanger)
        alerts += [alert] if alert else []
    return tuple(alerts)


def _news(standing: AlertState, test: WatchedTest, level: float) -> tuple[tuple[Drift, ...], bool]:
    """Return the shifts that are beyond their threshold by now, and if a change is called."""
    call = test.change.called and not _is_known(standing, test.change)
    drifts = test.published_drifts if call else test.drifts
    beyond = tuple(
        drift
        for drift in drifts
        if drift.probability >= level
        and (drift.quantity, way_of(drift.shift_mean)) not in standing.beyond
    )
    return beyond, call


def _is_known(standing: AlertState, change: Change) -> bool:
    """Return True if an alert that is in force has reported a called change already."""
    reported = [] if standing.call is None else [standing.call]
    named = _suspects(change)
    reported += [at for (quantity, _), at in standing.beyond.items() if quantity in named]
    return any(change.began_by <= at for at in reported)


def _suspects(change: Change) -> tuple[str, ...]:
    """Return what may have changed: the likeliest quantity, those with it, then those like it."""
    return tuple(each.quantity for each in suspects(change))


def _explaining(beyond: Sequence[Drift], called: Sequence[Change], now: Change) -> Change | None:
    """The last called change of the same way as a shift; None where none is known to explain it."""
    if not called:
        return now if now.probability > 0.5 else None
    shifts = {(drift.quantity, way_of(drift.shift_mean)) for drift in beyond}
    for change in reversed(called):
        suspects = {
            (moved.quantity, way_of(moved.shift_mean))
            for moved in change.moved
            if moved.quantity in _suspects(change)
        }
        if shifts & suspects:
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
    words = message_of(
        test,
        hanger,
        change,
        beyond,
        is_call=is_call,
        is_further=is_call and bool(standing.called),
        standing=_standing(test, standing, hanger),
    )
    first = beyond[0] if beyond else test.change.moved[0] if test.change.moved else None
    what = f"{first.quantity}-{way_of(first.shift_mean)}" if first else "unknown"
    key = f"{'+'.join(kinds)}:{what}".replace(" ", "-")
    by_name = {drift.quantity: drift for drift in test.drifts}
    suspected = tuple(by_name[name] for name in _suspects(test.change) if name in by_name)
    of_test = test.test, test.time
    return alert_of(hanger, of_test, key, words, tuple(kinds), beyond or suspected, change)


def _standing(test: WatchedTest, standing: AlertState, hanger: Hanger) -> list[Drift]:
    """Return what was said to be beyond its threshold and still is: as sure as it was then."""
    level = hanger.thresholds.alert_probability
    return [
        replace(each, probability=max(each.probability, level))
        for each in test.drifts
        if (each.quantity, way_of(each.shift_mean)) in standing.beyond.keys() - standing.agreed
    ]
