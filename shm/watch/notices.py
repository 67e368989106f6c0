"""Messages of notices: a test to repeat, a baseline that does not fit, modes that are wrong."""

from __future__ import annotations

from collections.abc import Sequence

from shm.values import TENSION, Alert, AlertKind, Drift, Hanger, RepeatedMistake, WatchedTest
from shm.values.messages import WEEK
from shm.values.rounding import force_unit, listed
from shm.watch.alert_text import against_baseline_words, alert_of
from shm.watch.change_words import (
    is_stiffness,
    look_again,
    odd_frequencies,
    quantity_words,
    size_words,
)
from shm.watch.conditions import BASELINE, BEYOND, MODES

_CLEAR = 2.0  # judgement: that tests and baseline disagree is known by then


def alert_of_baseline(test: WatchedTest, hanger: Hanger, kind: AlertKind) -> Alert:
    """Return the alert, or the notice, of a baseline that agrees with none of the tests since.

    One mistaken mode of the only test before passes for an end that moved.
    """
    clear = [each for each in test.drifts if _deviations(each) > _CLEAR]
    lead = max(clear, key=_deviations, default=None)
    drifts: tuple[Drift, ...] = ()
    if kind == BEYOND:
        lead = next(each for each in test.drifts if each.quantity == TENSION)
        drifts = (lead,)
    message = (
        f"{against_baseline_words(test.change, hanger)} Either the baseline was disturbed, by a "
        "load on the deck for one, or the hanger changed right after it; no test shows which."
    )
    if lead is not None and hanger.is_modelled:
        message = _either(hanger, lead, test.change.against_baseline)
    key = BASELINE.replace(" ", "-")
    return alert_of(hanger, (test.test, test.time), key, message, (kind,), drifts)


def _deviations(drift: Drift) -> float:
    return abs(drift.shift_mean) / drift.shift_sd if drift.shift_sd > 0 else 0.0


def _either(hanger: Hanger, lead: Drift, tests: int) -> str:
    """Return both that may be, what to do about either, how far it is and how many tests say so."""
    if is_stiffness(lead.quantity):
        look = "inspect both ends"
    elif lead.shift_mean < 0:
        look = "inspect its anchorages and the rod"
    else:
        look = "compare the hangers beside it (`shm drift bridge`)"
    now = ""
    if lead.quantity == TENSION:
        unit = force_unit(lead.value, lead.baseline)
        was, value = unit.told(lead.baseline), unit.told(lead.value)
        now = f"Tension was {was} at the baseline, {value} since. "
    return (
        f"Hanger {hanger.id}: either {quantity_words(lead.quantity)} {size_words(lead)} since its "
        f"baseline, or the baseline was disturbed. Within a week, {look}, and find out what was "
        f"different on the day of the baseline. {now}The last {tests} tests agree with each other "
        "and not with it; no test tells which. If it was disturbed, set another (`shm drift "
        "rebaseline`)."
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
    """Return the same of days of sensors that stay: the next day is another test by itself."""
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


def notice_of(test: WatchedTest, hanger: Hanger, news: Sequence[RepeatedMistake]) -> Alert:
    """Return a notice of the modes `news` that tests keep having wrong."""
    names = "+".join(f"{each.plane}-{each.order}" for each in news)
    what = f"{MODES.replace(' ', '-')}:{names}"
    return alert_of(hanger, (test.test, test.time), what, notice_words(news, hanger), (MODES,))


def notice_words(mistaken: Sequence[RepeatedMistake], hanger: Hanger) -> str:
    """Return the notice of modes that tests keep having wrong."""
    return f"Hanger {hanger.id}: {' '.join(_words(mistaken))}"


def warning_words(mistaken: Sequence[RepeatedMistake], hanger: Hanger) -> str:
    """Return the same as one of several warnings of a report, without the reason."""
    return f"Hanger {hanger.id}: {' '.join(_words(mistaken)[:2])}"


def _words(mistaken: Sequence[RepeatedMistake]) -> tuple[str, str, str]:
    """Return state, action and why."""
    since = f"{min(each.since for each in mistaken):%Y-%m-%d}"
    if any(each.is_misfit for each in mistaken):
        return _of_misfit(since)
    names, many = [str(each) for each in mistaken], len(mistaken) > 1
    have, numbers, them = ("have", "their numbers", "them") if many else ("has", "its number", "it")
    return (
        f"{listed(names)} {have} not fitted the other modes since {since}.",
        f"Check {numbers} at the next planned test.",
        f"The watch leaves {them} out: another order or a machine's tone may be taken for {them}, "
        "or one end alone has loosened.",
    )


def _of_misfit(since: str) -> tuple[str, str, str]:
    return (
        f"since {since} more of its modes miss the baseline's than one wrong number explains.",
        "At the next planned test, compare how the modes were numbered then and now, and "
        "look for new fittings.",
        "No tension and no end stiffness of the baseline's model explains them, so these tests "
        "count for little until another baseline is set (`shm drift rebaseline`).",
    )
