"""Check the time of a test: loggers lose their clocks, files keep them.

Only what cannot be, or what the watch could not see through, is a doubt. An hour off (summer time)
or a day off between two tests moves nothing that is computed from them, and passes.
"""

from __future__ import annotations

import math
from datetime import date, datetime, timedelta
from datetime import time as clock_time

from shm.documents import format_time
from shm.errors import UsageError
from shm.plausibility.candidate import Candidate, implied_shift
from shm.values import Doubt

FIRST_DAY = date(1980, 1, 1)
"""No logger that writes files of ours is older; clocks without a battery begin at 1970 or 1980."""

RESET_DAYS = (date(1980, 1, 1), date(1980, 1, 6), date(2000, 1, 1))
"""Where clocks begin to count after they lost power: DOS, the GPS, most real-time clock chips."""

_ONE_TEST = timedelta(days=1)  # the hits and set-ups of one test take hours, whatever the zone
_BETWEEN_CAMPAIGNS = timedelta(days=20 * 365)  # main inspections are six years apart at most
_SET_RIGHT = "Confirm it with its true time, or discard it"


def refuse_impossible(time: datetime | None, built: date | None) -> None:
    """Raises UsageError where a person gives a time that is that of no recording."""
    first = max(FIRST_DAY, built or FIRST_DAY)
    if time is not None and time.date() < first:
        why = "the bridge was built" if first == built else "any recording"
        raise UsageError(
            f"that time is before {why} ({first:%Y-%m-%d}).",
            remedy="Give the true time, or none: then that of its receipt counts.",
        )


def before_the_bridge(candidate: Candidate) -> Doubt | None:
    """A time before there was a logger, before the bridge, or of a clock that began to count."""
    time = candidate.test.time
    if time is None:
        return None
    day, built = time.date(), candidate.built
    if day < FIRST_DAY:
        why = f"No recording is older than {FIRST_DAY:%Y}."
    elif day in RESET_DAYS:
        why = "Clocks that lost their power begin to count on this day."
    elif built is not None and day < built:
        why = f"The bridge was built on {built}."
    else:
        return None
    return _unknown_time("clock before the bridge", candidate, why)


def ahead(candidate: Candidate) -> Doubt | None:
    """A time after the receipt by more than any time zone explains."""
    time = candidate.test.time
    if time is None or time <= candidate.received_at + candidate.tolerance:
        return None
    why = f"It was received on {_shown(candidate.received_at)}."
    return _unknown_time("clock ahead", candidate, why)


def ambiguous(candidate: Candidate) -> Doubt | None:
    """Doubt a time whose day can be read in several orders."""
    if not candidate.possible_times:
        return None
    days = " or ".join(f"{each:%Y-%m-%d}" for each in candidate.possible_times)
    why = (
        "Its file writes the day in figures that can be read in several orders, and its "
        "logger's profile does not say which: your answer is kept there."
    )
    state = f"its day may be {days}"
    return Doubt("clock ambiguous", state, _SET_RIGHT, why, time_unknown=True)


def scattered(candidate: Candidate) -> Doubt | None:
    """Parts of one test that claim to be days apart, or a test far from all others of its file."""
    times, time = candidate.file_times, candidate.test.time
    if times and max(times) - min(times) > _ONE_TEST:
        state = f"its parts are dated {_shown(min(times))} and {_shown(max(times))}"
        why = "The hits of one test take hours, not days."
        return Doubt("clock scattered", state, _SET_RIGHT, why)
    if time is None or len(candidate.neighbours) < 2:
        return None
    nearest = min(candidate.neighbours, key=lambda each: abs(each - time))
    if abs(nearest - time) <= _BETWEEN_CAMPAIGNS:
        return None
    why = f"The nearest other test of its file is dated {_shown(nearest)}."
    return Doubt("clock scattered", f"it is dated {_shown(time)}", _SET_RIGHT, why)


def stuck(candidate: Candidate) -> Doubt | None:
    """The very same time as another recording of the hanger; a mere date says nothing of it."""
    time, others = candidate.test.time, candidate.same_time
    if time is None or not others or time.time() == clock_time.min:
        return None
    state = f"its time, {_shown(time)}, is to the second that of test {others[0].id}"
    why = "Two tests of one hanger are not made at once: the logger's clock may stand still."
    return Doubt("clock stuck", state, _SET_RIGHT, why)


def before_the_baseline(candidate: Candidate) -> Doubt | None:
    """A time that hides a shift: what is dated before the baseline can raise no alert."""
    time, since = candidate.test.time, candidate.reference_at
    if time is None or since is None or time > since or before_the_bridge(candidate):
        return None
    shift = implied_shift(candidate.test, candidate.reference, candidate.hanger)
    if math.isnan(shift) or abs(shift) < candidate.hanger.thresholds.tension_shift_fraction:
        return None
    state = f"it is dated {_shown(time)}, before the hanger's baseline of {_shown(since)}"
    why = "It differs from the baseline, and a test from before it raises no alert."
    return Doubt("clock before the baseline", state, _SET_RIGHT, why)


def _unknown_time(check: str, candidate: Candidate, why: str) -> Doubt:
    time, written = candidate.test.time, candidate.modified_at
    assert time is not None
    if written is not None and written.date() >= FIRST_DAY:
        why += f" The file was last written on {_shown(written)}."
    return Doubt(check, f"its time cannot be {_shown(time)}", _SET_RIGHT, why, time_unknown=True)


def _shown(time: datetime) -> str:
    return str(format_time(time)).replace("T", " ").removesuffix("Z")[:16]
