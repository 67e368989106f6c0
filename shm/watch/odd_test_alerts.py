"""Alerts of tests that agree with none before them, and of a baseline that agrees with none since.

A baseline that agrees with none of the tests since: a change right after it, or a disturbed day. No
test can tell which. One baseline in twelve has a vehicle next to the hanger, and hardly one change
in a thousand comes right after it: what a load may do is a notice that states both. What no load
does is an alert, since a loss in a notice is silent for as long as nobody looks.
"""

from __future__ import annotations

from shm.values import (
    TENSION,
    Alert,
    AlertKind,
    Drift,
    Hanger,
    WatchedTest,
)
from shm.values.messages import WEEK
from shm.values.rounding import force_unit
from shm.watch.agreement import (
    BY_A_LOAD,
)
from shm.watch.alert_text import against_baseline_words, alert_of
from shm.watch.change_words import (
    is_stiffness,
    look_again,
    odd_frequencies,
    quantity_words,
    size_words,
)

_KIND: AlertKind = "check the baseline"
_CLEAR_DRIFT = 2.0  # judgement: that tests and baseline disagree is known by then


def alert_of_baseline(test: WatchedTest, hanger: Hanger) -> Alert:
    """Return an alert where the tension moved further than by any load, else a notice.

    One mistaken mode of the only test before passes for an end that moved.
    """
    clear = [each for each in test.drifts if _deviations(each) > _CLEAR_DRIFT]
    lead = max(clear, key=_deviations, default=None)
    message = message_of_baseline(test, hanger)
    if lead is not None and hanger.is_modelled:
        message = _message(hanger, lead, test.change.against_baseline)
    is_alert = lead is not None and _is_no_load(lead)
    drifts = (lead,) if lead is not None and is_alert else ()
    kind: AlertKind = "beyond threshold" if is_alert else _KIND
    return alert_of(hanger, (test.test, test.time), "check-the-baseline", message, (kind,), drifts)


def _is_no_load(lead: Drift) -> bool:
    """Return True if a tension is clearly off, and by more than a load on the deck does."""
    is_far = abs(lead.shift_mean) > max(BY_A_LOAD, lead.threshold)
    return lead.quantity == TENSION and lead.is_clearly_beyond and is_far


def _deviations(drift: Drift) -> float:
    return abs(drift.shift_mean) / drift.shift_sd if drift.shift_sd > 0 else 0.0


def _message(hanger: Hanger, lead: Drift, tests: int) -> str:
    """Return both causes, what to do about either, how far it is and how many tests show it."""
    if is_stiffness(lead.quantity):
        look = "inspect both ends"
    elif lead.shift_mean < 0:
        look = "inspect its anchorages and the rod"
    else:
        look = "compare the hangers beside it (`shm drift bridge`)"
    now = ""
    if lead.quantity == TENSION:
        unit = force_unit(lead.value, lead.baseline)
        was, value = unit.with_unit(lead.baseline), unit.with_unit(lead.value)
        now = f"Tension was {was} at the baseline, {value} since. "
    return (
        f"Hanger {hanger.id}: either {quantity_words(lead.quantity)} {size_words(lead)} since its "
        f"baseline, or the baseline was disturbed. Within a week, {look}, and find out what was "
        f"different on the day of the baseline. {now}The last {tests} tests agree with each other "
        "and not with it; no test tells which. If it was disturbed, set another (`shm drift "
        "rebaseline`)."
    )


def message_of_baseline(test: WatchedTest, hanger: Hanger) -> str:
    """Return the message of a baseline that agrees with none of the tests since."""
    return (
        f"{against_baseline_words(test.change, hanger)} Either the baseline was disturbed, by a "
        "load on the deck for one, or the hanger changed right after it; no test shows which."
    )


def message_of_odd(test: WatchedTest, hanger: Hanger, in_a_row: int) -> str:
    """Return the message of a test that agrees with none before it, or of so many in a row."""
    if not hanger.is_modelled:
        return odd_frequencies(test, hanger, in_a_row)
    if hanger.has_sensors:
        return _odd_days(test, hanger, in_a_row)
    if in_a_row == 1:
        return (
            f"Hanger {hanger.id}: test {test.test} agrees with no test before it. Repeat it within "
            "a week; it does not count until another test agrees with it. Another hanger may have "
            "been hit, a sensor moved or the order of a mode mistaken; or the hanger has changed."
        )
    return (
        f"Hanger {hanger.id}: {in_a_row} tests in a row agree neither with those before nor with "
        "each other. Repeat the hammer test within a week, with the same people and sensors as at "
        "the baseline. Until then the state of this hanger rests on older tests."
    )


def _odd_days(test: WatchedTest, hanger: Hanger, in_a_row: int) -> str:
    """Return that of days of permanent sensors: the next day is another test by itself."""
    state = (
        f"test {test.test} agrees with no test before it"
        if in_a_row == 1
        else f"{in_a_row} tests in a row agree neither with those before nor with each other"
    )
    return (
        f"Hanger {hanger.id}: {state}. {look_again(hanger)} {WEEK}. Until tests agree again, its "
        "state rests on older ones. A sensor may have moved or the order of a mode been mistaken; "
        "or the hanger has changed."
    )
