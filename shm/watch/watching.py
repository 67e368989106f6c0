"""The watch of a hanger: tests read, put through the engine, and at most one alert a test.

All is derived from the sequence of tests, so that the same tests give the same alerts.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
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
    Posterior,
    Reading,
    RepeatedMistake,
    WatchedTest,
)
from shm.watch.agreement import agreement
from shm.watch.alert_text import alert_of, message_of
from shm.watch.change_words import CAUSES, suspects
from shm.watch.conditions import (
    BASELINE,
    BEYOND,
    CALLS,
    DISAGREE,
    MODES,
    REPEAT,
    Condition,
    State,
    Way,
    conditions,
    way_of,
)
from shm.watch.history import History
from shm.watch.mistaken_modes import repeated_mistakes
from shm.watch.notices import alert_of_baseline, message_of_odd, notice_of
from shm.watch.options import WatchOptions
from shm.watch.readings import Reader
from shm.watch.watcher import Watch, Watcher, watch_of, watched

DatedTest = tuple[ModalTest, datetime]
"""A test, and its own time or that of its receipt."""


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

    def alert(self, hanger: Hanger) -> Alert | None:
        """What the newest test calls for, beyond what was told before."""
        return new_alert(self.watch.tests, hanger)


def watch_hanger(
    baseline: Posterior,
    baseline_tests: Sequence[DatedTest],
    later: Sequence[DatedTest],
    hanger: Hanger,
    options: WatchOptions,
    known: Mapping[str, WatchedTest] = MappingProxyType({}),
) -> Watched:
    """The watch of a hanger over the tests of its baseline and `later` ones, both by time.

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
    said = [known[test.id] for test, _ in later if test.id in known]
    begin = readings if len(said) < len(later) else readings[: len(baseline_tests)]
    watch = watched(begin, reader.quantities, reader.columns, hanger, options)
    if begin is not readings:
        watch = watch_of([*watch.tests, *said])
    tests = list(watch.tests)
    mistaken: tuple[RepeatedMistake, ...] = ()
    for n in range(len(baseline_tests), len(tests)):
        mistaken = repeated_mistakes(mistaken, readings[n], reader.modes)
        tests[n] = replace(tests[n], mistaken=mistaken)
    return Watched(reader, readings, replace(watch, tests=tuple(tests)))


def kept_of(baseline: Posterior, tests: Sequence[DatedTest]) -> tuple[DatedTest, ...]:
    """The tests of a baseline without what was left out of it as mistaken."""
    check = baseline.baseline_check
    if check is None:
        return tuple(tests)
    return tuple((check.kept(test), at) for test, at in tests if not check.leaves_out(test.id))


@dataclass(frozen=True, eq=False)
class Newest:
    """What the watch says after the newest test, the alert it calls for, and what to keep.

    `beyond` is what stands beyond its threshold, and the way that it went.
    """

    test: WatchedTest
    alert: Alert | None
    kept: bytes
    beyond: frozenset[tuple[str, Way]]


def watch_newest(
    baseline: Posterior,
    baseline_tests: Sequence[DatedTest],
    later: Sequence[DatedTest],
    hanger: Hanger,
    options: WatchOptions,
    kept: bytes | None = None,
    beside: Beside | None = None,
) -> Newest | None:
    """The last of what `watch_hanger` finds, from what was `kept` after the tests before it.

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
        history, begun = watcher.begin(readings)
        state, alert = State(), None
        for found in begun:
            state, alert = next_alert(state, found, hanger)
    else:
        history = History.from_bytes(kept)
        if history.key != watcher.key:
            return None
        state = State.from_text(history.conditions)
    since = max(time for _, time in baseline_tests)
    for test, time in later:
        reading = reader.reading(test, max(time, since))
        history, found = watcher.after(history, reading)
        found = replace(found, mistaken=repeated_mistakes(state.mistaken, reading, reader.modes))
        state, alert = next_alert(state, found, hanger)
    # A second test that agrees answers the notice that asks for one.
    if (alert is None or alert.kinds == (REPEAT,)) and beside is not None and later:
        agreed = agreement(reader, later[-1], beside, hanger, options, state.beyond)
        if agreed is not None:
            alert, state = agreed, _with_agreed(state, agreed)
    kept = replace(history, conditions=state.to_text()).to_bytes()
    return Newest(found, alert, kept, frozenset(state.beyond))


def _with_agreed(state: State, alert: Alert) -> State:
    """Return the state with what two tests that agree have reported."""
    news = frozenset(
        Condition(
            BEYOND,
            each.quantity,
            way_of(each.shift_mean),
            since=alert.time,
            improbable=True,
        )
        for each in alert.drifts
    )
    return replace(state, standing=state.standing - news | news)


def options_of(hanger: Hanger, baseline_tests: int, options: WatchOptions) -> WatchOptions:
    """How many tests precede every change, and how often this hanger may be called falsely."""
    own = hanger.thresholds.false_call_years
    limit_years = options.limit_years if own is None else own
    return replace(options, baseline_tests=baseline_tests, limit_years=limit_years)


def new_alert(watched: Sequence[WatchedTest], hanger: Hanger) -> Alert | None:
    """Return the alert that the newest of the tests of a hanger calls for, beyond those before.

    `watched` are all its tests since the baseline, the oldest first. The alert's key names hanger,
    rules, quantity, way and test: the same whenever it is asked for.
    """
    state, alert = State(), None
    for test in watched:
        state, alert = next_alert(state, test, hanger)
    return alert


def alerts_of(watched: Sequence[WatchedTest], hanger: Hanger) -> tuple[Alert, ...]:
    """Return all alerts of a history, the oldest test first."""
    state, alerts = State(), []
    for test in watched:
        state, alert = next_alert(state, test, hanger)
        alerts += [alert] if alert else []
    return tuple(alerts)


def next_alert(state: State, test: WatchedTest, hanger: Hanger) -> tuple[State, Alert | None]:
    """Return the state after one more test, and the alert of what is new in it, if anything is.

    The gravest is reported; what waits behind it is reported at a later test that shows it.
    """
    before = state
    state = state.with_test(test)
    holding = conditions(state, hanger.thresholds, test.time)
    news = holding - state.standing
    alert, reported = None, frozenset[Condition]()
    for kinds in ((BEYOND, *CALLS), (BASELINE,), (REPEAT, DISAGREE), (MODES,)):
        reported = frozenset(each for each in news if each.kind in kinds)
        if kinds == (MODES,) and _explains_modes(state):
            reported = frozenset()  # a mass or lost section is why modes go astray
        if reported:
            alert = _alert(before, state, reported, holding, hanger)
            break
    return state.with_reported(holding, reported), alert


def _explains_modes(state: State) -> bool:
    """Return whether a detected change is why modes do not fit."""
    return any(each.moved and each.moved[0].quantity in CAUSES for each in state.called)


def _alert(
    before: State,
    state: State,
    news: frozenset[Condition],
    holding: frozenset[Condition],
    hanger: Hanger,
) -> Alert:
    """Return the alert of conditions that are new."""
    test, kinds = state.latest, {each.kind for each in news}
    assert test is not None
    name = test.test, test.time
    if BASELINE in kinds or any(each.improbable for each in news):
        return alert_of_baseline(test, hanger, BASELINE if BASELINE in kinds else BEYOND)
    if kinds & {REPEAT, DISAGREE}:
        kind: AlertKind = DISAGREE if DISAGREE in kinds else REPEAT
        said = message_of_odd(test, hanger, state.odd)
        return alert_of(hanger, name, kind.replace(" ", "-"), said, (kind,))
    if MODES in kinds:
        told = {each.about for each in news}
        wrong = [
            each
            for each in test.mistaken
            if each.is_notable
            and (("test" in told and each.is_misfit) or f"{each.plane}-{each.order}" in told)
        ]
        return notice_of(test, hanger, wrong)
    return _alert_of_change(before, state, news, holding, hanger)


def _alert_of_change(
    before: State,
    state: State,
    news: frozenset[Condition],
    holding: frozenset[Condition],
    hanger: Hanger,
) -> Alert:
    """Return the alert of a detected change, or of shifts beyond their thresholds."""
    test = state.latest
    assert test is not None
    call = next((each for each in news if each.kind in CALLS), None)
    drifts = test.told if call else test.drifts
    new = {(each.about, each.way) for each in news if each.kind == BEYOND}
    beyond = tuple(each for each in drifts if (each.quantity, way_of(each.shift_mean)) in new)
    called = (*before.called, test.change) if test.change.called else before.called
    change = test.change if call else _explaining(beyond, called, test.change)
    kinds: tuple[AlertKind, ...] = ((BEYOND,) if beyond else ()) + ((call.kind,) if call else ())
    said = message_of(
        test,
        hanger,
        change,
        beyond,
        is_call=call is not None,
        is_further=call is not None and bool(before.called),
        standing=_standing(test, holding - news, hanger),
    )
    first = beyond[0] if beyond else test.change.moved[0] if test.change.moved else None
    lead = f"{first.quantity}-{way_of(first.shift_mean)}" if first else "unknown"
    what = f"{'+'.join(kinds)}:{lead}".replace(" ", "-")
    return alert_of(
        hanger, (test.test, test.time), what, said, kinds, beyond or _suspected(test), change
    )


def _explaining(beyond: Sequence[Drift], called: Sequence[Change], now: Change) -> Change | None:
    """Return the last called change of the same way as a shift; None where none explains it."""
    if not called:
        return now if now.probability > 0.5 else None
    shifts = {(drift.quantity, way_of(drift.shift_mean)) for drift in beyond}
    for change in reversed(called):
        moved = {(each.quantity, way_of(each.shift_mean)) for each in suspects(change)}
        if shifts & moved:
            chances = now.probability, now.outlier_probability
            return replace(change, probability=chances[0], outlier_probability=chances[1])
    return None


def _standing(test: WatchedTest, holding: frozenset[Condition], hanger: Hanger) -> list[Drift]:
    """Return what was reported to be beyond its threshold and still is: as sure as it was then."""
    level = hanger.thresholds.alert_probability
    told = {
        (each.about, each.way) for each in holding if each.kind == BEYOND and not each.improbable
    }
    return [
        replace(each, probability=max(each.probability, level))
        for each in test.drifts
        if (each.quantity, way_of(each.shift_mean)) in told
    ]


def _suspected(test: WatchedTest) -> tuple[Drift, ...]:
    """Return the shifts of what may have changed."""
    by_name = {drift.quantity: drift for drift in test.drifts}
    names = [each.quantity for each in suspects(test.change)]
    return tuple(by_name[name] for name in names if name in by_name)
