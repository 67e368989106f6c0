"""What is said of a test that agrees with none before it."""

from __future__ import annotations

from shm.values import Hanger, WatchedTest
from shm.values.messages import WEEK
from shm.watch.alert_action import look_again
from shm.watch.change_words import odd_frequencies


def message_of_odd(test: WatchedTest, hanger: Hanger, in_a_row: int) -> str:
    """Of a test that agrees with none before it, or of so many in a row."""
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
    """The same of days of sensors that stay: the next day is another test by itself."""
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
