"""Write notices: a baseline or tests that agree with no other, and modes that tests keep wrong.

A baseline that agrees with none of the tests since: no test can tell a change right after it from a
disturbed day. What a load may do is a notice, what no load does an alert. The same mode wrong in
three tests in a row is numbered wrongly, or the hanger has changed as its class does not know.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import replace
from datetime import timedelta

import numpy as np

from shm.values import (
    TENSION,
    Alert,
    AlertKind,
    BoolArray,
    Change,
    Drift,
    Hanger,
    Plane,
    Reading,
    RepeatedMistake,
    WatchedTest,
)
from shm.values.drift import ENOUGH_FITS
from shm.values.messages import WEEK
from shm.values.rounding import listed
from shm.values.stream import StreamEvent
from shm.watch.agreement import BY_A_LOAD, Agreement, way_of
from shm.watch.engine.causes import Columns
from shm.watch.engine.limits import LIMITS
from shm.watch.engine.mistaken_modes import MOST_MISTAKEN
from shm.watch.words.alert_text import (
    against_baseline_words,
    alert_of,
    is_stiffness,
    look_again,
    message_of_agreeing,
    quantity_words,
    size_words,
    structure_words,
)

_CHECK: AlertKind = "check the baseline"


# ---------------------------------------------------------------- the baseline


def alert_of_baseline(test: WatchedTest, hanger: Hanger) -> Alert:
    """Return an alert where the tension moved further than by any load, else a notice.

    One mistaken mode of the only test before passes for an end that moved.
    """
    clear = [each for each in test.drifts if _deviations(each) > LIMITS.clear_drift]
    lead = max(clear, key=_deviations, default=None)
    kind, drifts = _CHECK, tuple[Drift, ...]()
    if lead is None or not hanger.is_modelled:
        message = (
            f"{against_baseline_words(test.change, hanger)} Either the baseline was disturbed, by "
            "a load on the deck for one, or the hanger changed right after it; no test shows which."
        )
    else:
        look = "inspect its anchorages and the rod"
        if is_stiffness(lead.quantity):
            look = "inspect both ends"
        elif lead.shift_mean >= 0:
            look = "compare the hangers beside it (`shm drift bridge`)"
        message = (
            f"Hanger {hanger.id}: either {quantity_words(lead.quantity)} {size_words(lead)} since "
            f"its baseline, or the baseline was disturbed. Within a week, {look}, and find out "
            "what was different on the day of the baseline. The last "
            f"{test.change.against_baseline} tests agree with each other and not with it; no test "
            "tells which. If it was disturbed, set another (`shm drift rebaseline`)."
        )
        is_far = abs(lead.shift_mean) > max(BY_A_LOAD, lead.threshold)
        if lead.quantity == TENSION and lead.is_clearly_beyond and is_far:
            kind, drifts = "beyond threshold", (lead,)
    return alert_of(hanger, (test.test, test.time), "check-the-baseline", message, (kind,), drifts)


def _deviations(drift: Drift) -> float:
    return abs(drift.shift_mean) / drift.shift_sd if drift.shift_sd > 0 else 0.0


def alert_of_agreement(found: Agreement, hanger: Hanger) -> Alert:
    """Return the alert of two tests that agree."""
    drift = found.drift
    what = f"two-tests-agree:{drift.quantity}-{way_of(drift.shift_mean)}"
    words = message_of_agreeing(drift, hanger, found.tests, is_held=found.is_held)
    of_test = drift.test, drift.time
    return alert_of(hanger, of_test, what, words, ("beyond threshold",), (drift,))


# ---------------------------------------------------------------- tests that agree with none


def message_of_odd(test: WatchedTest, hanger: Hanger, in_a_row: int) -> str:
    """Return the message of a test that agrees with none before it, or of so many in a row."""
    name = f"Hanger {hanger.id}"
    action, what = f"{look_again(hanger)} {WEEK}", "the hanger"
    if not hanger.is_modelled:
        name, action = structure_words(hanger), f"Look at sensors and clock {WEEK}"
        what = "the structure"
    elif not hanger.has_sensors and in_a_row == 1:
        action = f"Repeat it {WEEK}"
    state = f"{in_a_row} tests in a row agree neither with those before nor with each other"
    counts = "Until tests agree again, its state rests on older ones."
    if in_a_row == 1:
        state = f"test {test.test} agrees with no test before it"
        counts = "It does not count until another test agrees with it."
    return (
        f"{name}: {state}. {action}. {counts} The order of a mode may be mistaken, a sensor or a "
        f"clock wrong, or another hanger measured; or {what} has changed."
    )


# ---------------------------------------------------------------- modes that are wrong again


def repeated_mistakes(
    before: Sequence[RepeatedMistake], reading: Reading, columns: Columns
) -> tuple[RepeatedMistake, ...]:
    """Return the modes that are wrong by a reading, or were of late.

    `columns` are of the baseline's modes, as the reading is; `before` is the same by the test
    before.
    """
    if reading.modes is None:
        return tuple(before)
    known = {(each.plane, each.order): each for each in before}
    misfit = off_the_baseline(reading, columns)
    is_wrong = reading.modes.mistaken | misfit
    found = []
    for key, wrong, off, variance in zip(
        columns.modes, is_wrong.tolist(), misfit.tolist(), reading.modes.variances, strict=True
    ):
        run = known.get(key)
        if wrong:
            since, tests = (run.since, run.tests) if run else (reading.time, 0)
            found.append(RepeatedMistake(*key, since, tests + 1, is_misfit=off))
        elif run and math.isinf(variance):  # this test does not have the mode
            found.append(run)
        elif run and run.is_notable and run.fits + 1 < ENOUGH_FITS:
            found.append(replace(run, fits=run.fits + 1))
    return tuple(found)


def off_the_baseline(reading: Reading, columns: Columns) -> BoolArray:
    """Return which modes (modes,) lie off the state that a reading fits best.

    None where these are few enough to be misnamed.
    """
    modes = reading.modes
    if modes is None:
        return np.zeros(0, bool)
    measured = np.isfinite(modes.variances)
    off = measured & (np.abs(modes.values - columns.slopes @ reading.mean) > LIMITS.notices_off)
    can_tell = measured.sum() > len(reading.mean) + 1
    are_too_many = can_tell and off.sum() > MOST_MISTAKEN * measured.sum()
    return off if are_too_many else np.zeros(len(off), bool)


def news_of(
    mistaken: Sequence[RepeatedMistake], noted: Collection[tuple[Plane, int]]
) -> tuple[RepeatedMistake, ...]:
    """Return the modes that a notice is due for, `noted` being those of which one was given.

    A further mode of tests that do not fit is no further cause.
    """
    notable = [each for each in mistaken if each.is_notable]
    is_announced = any((each.plane, each.order) in noted for each in notable if each.is_misfit)
    return tuple(
        each
        for each in notable
        if (each.plane, each.order) not in noted and not (is_announced and each.is_misfit)
    )


def notice_of(test: WatchedTest, hanger: Hanger, news: Sequence[RepeatedMistake]) -> Alert:
    """Return the notice of the modes `news` that tests keep having wrong."""
    kind: AlertKind = "check the modes"
    names = "+".join(f"{each.plane}-{each.order}" for each in news)
    what = f"{kind.replace(' ', '-')}:{names}"
    return alert_of(hanger, (test.test, test.time), what, notice_words(news, hanger), (kind,))


def notice_words(mistaken: Sequence[RepeatedMistake], hanger: Hanger) -> str:
    """Return the notice of them."""
    return f"Hanger {hanger.id}: {' '.join(_words(mistaken))}"


def warning_words(mistaken: Sequence[RepeatedMistake], hanger: Hanger) -> str:
    """Return the same as one of several warnings of a report, without the reason."""
    return f"Hanger {hanger.id}: {' '.join(_words(mistaken)[:2])}"


def _words(mistaken: Sequence[RepeatedMistake]) -> tuple[str, str, str]:
    """Return state, action and reason."""
    since = f"{min(each.since for each in mistaken):%Y-%m-%d}"
    if any(each.is_misfit for each in mistaken):
        return (
            f"since {since} more of its modes miss the baseline's than one wrong number explains.",
            "At the next planned test, compare how the modes were numbered then and now, and "
            "look for new fittings.",
            "No tension and no end stiffness of the baseline's model explains them, so these tests "
            "count for little until another baseline is set (`shm drift rebaseline`).",
        )
    names, many = [str(each) for each in mistaken], len(mistaken) > 1
    have, numbers, them = ("have", "their numbers", "them") if many else ("has", "its number", "it")
    return (
        f"{listed(names)} {have} not fitted the other modes since {since}.",
        f"Check {numbers} at the next planned test.",
        f"The watch leaves {them} out: another order or a machine's tone may be taken for {them}, "
        "or one end alone has loosened.",
    )


# ---------------------------------------------------------------- events of a stream

_HINTS = ("logger", "swapped", "saturated", "drifting", "dead", "lost modes", "clock step")
"""Kinds of events that may be behind frequencies that move, the likeliest first."""
_NEAR_A_CHANGE = timedelta(hours=3)
"""Judgement: before a change and behind it: who exchanges a sensor works for an hour or two, and
when a change began is known to about as much."""
_LATELY = timedelta(hours=1)  # the hour of the alert itself


def led_by(alert: Alert, events: Sequence[StreamEvent]) -> Alert:
    """The alert, led by what was noticed at the time of its change, and by that its temperature is
    not known; as it is where nothing was.
    """
    if alert.change is None:
        return alert
    words = " ".join(filter(None, (_near(alert.change, events), _unknown(alert, events))))
    if not words:
        return alert
    hanger, _, rest = alert.message.partition(": ")
    return replace(alert, message=f"{hanger}: {words} {rest[:1].upper()}{rest[1:]}")


def _near(change: Change, events: Sequence[StreamEvent]) -> str:
    first, last = change.began_after - _NEAR_A_CHANGE, change.began_by + _NEAR_A_CHANGE
    near = [
        event
        for event in events
        if event.kind in _HINTS and event.start <= last and event.end >= first
    ]
    if not near:
        return ""
    event = min(near, key=lambda each: _HINTS.index(each.kind))
    reported = f"{event.channel}: {event.detail}" if event.channel else event.detail
    whose = "the logger said" if event.kind == "logger" else f"event '{event.kind}':"
    return (
        f"check the sensors first, at {event.start:%Y-%m-%d %H:%M} {whose} {reported.rstrip('.')}."
    )


def _unknown(alert: Alert, events: Sequence[StreamEvent]) -> str:
    reported = [e for e in events if e.kind == "thermometer" and e.end > alert.time - _LATELY]
    if not reported:
        return ""
    why = reported[-1].detail.partition(": ")[0]
    return f"the temperature is not known ({why}): part of this may be the weather's."
