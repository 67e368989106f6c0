"""Modes that tests keep having wrong: when a notice of them is due, and its words.

One slip of a test is left out and forgotten. The same mode wrong in three tests in a row is
numbered wrongly each time, or the hanger has changed in a way that its model class does not know.
Where more modes are off the baseline than can be misnamed, it is the tests that do not fit it.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from shm.values import (
    Alert,
    AlertKind,
    BoolArray,
    Hanger,
    Plane,
    Reading,
    RepeatedMistake,
    WatchedTest,
)
from shm.values.drift import ENOUGH_FITS
from shm.values.rounding import listed
from shm.watch.alert_text import alert_of
from shm.watch.mistaken_modes import MOST_MISTAKEN
from shm.watch.quantities import MeasuredMode

# Of a log frequency: more than sensors, joints and traffic do to a mode by itself (judgement).
_OFF = 0.01


def repeated_mistakes(
    before: Sequence[RepeatedMistake], reading: Reading, modes: Sequence[MeasuredMode]
) -> tuple[RepeatedMistake, ...]:
    """Return the modes that are wrong by a reading, or were of late.

    `modes` are those of the baseline, in the order of the reading's; `before` is the same by the
    test before.
    """
    if reading.modes is None:
        return tuple(before)
    known = {(each.plane, each.order): each for each in before}
    misfit = off_the_baseline(reading)
    is_wrong = reading.modes.mistaken | misfit
    found = []
    for key, wrong, off, variance in zip(
        modes, is_wrong.tolist(), misfit.tolist(), reading.modes.variances, strict=True
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


def off_the_baseline(reading: Reading) -> BoolArray:
    """Return which modes (modes,) lie off the state that a reading fits best.

    None where these are few enough to be misnamed.
    """
    modes = reading.modes
    if modes is None:
        return np.zeros(0, bool)
    measured = np.isfinite(modes.variances)
    off = measured & (np.abs(modes.values - modes.slopes @ reading.mean) > _OFF)
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
    is_told = any((each.plane, each.order) in noted for each in notable if each.is_misfit)
    return tuple(
        each
        for each in notable
        if (each.plane, each.order) not in noted and not (is_told and each.is_misfit)
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
