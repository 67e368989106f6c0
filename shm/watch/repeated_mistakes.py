"""Modes that tests keep having wrong: how long, and the notice of it.

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
from shm.watch.alert_text import short_name
from shm.watch.mistaken_modes import MOST_MISTAKEN
from shm.watch.mistakes_text import notice_words
from shm.watch.quantities import MeasuredMode

# Of a log frequency: more than sensors, joints and traffic do to a mode by itself (judgement).
_OFF = 0.01


def repeated_mistakes(
    before: Sequence[RepeatedMistake], reading: Reading, modes: Sequence[MeasuredMode]
) -> tuple[RepeatedMistake, ...]:
    """The modes that are wrong by a reading, or were of late.

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
    """Which of the baseline's modes (modes,) lie off the state that a reading fits best, where
    these are too many to be misnamed; else none.
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
    """The modes that a notice is due for, `noted` being those of which one was given.

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
    """A notice of the modes `news` that tests keep having wrong."""
    kind: AlertKind = "check the modes"
    names = "+".join(f"{each.plane}-{each.order}" for each in news)
    return Alert(
        key=f"hanger-{hanger.id}:{kind.replace(' ', '-')}:{names}:{short_name(test.test)}",
        hanger=hanger.id,
        test=test.test,
        time=test.time,
        message=notice_words(news, hanger),
        drifts=(),
        kinds=(kind,),
    )
