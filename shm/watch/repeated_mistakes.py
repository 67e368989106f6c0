"""Modes that tests keep having wrong: how long, and the notice of it.

One slip of a test is left out and forgotten. The same mode wrong in three tests in a row is
numbered wrongly each time, or the hanger has changed in a way that its model class does not know.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from shm.values import Alert, AlertKind, Hanger, Reading, RepeatedMistake, WatchedTest
from shm.watch.alert_text import short_name
from shm.watch.quantities import MeasuredMode


def repeated_mistakes(
    before: Sequence[RepeatedMistake], reading: Reading, modes: Sequence[MeasuredMode]
) -> tuple[RepeatedMistake, ...]:
    """The modes that are wrong by a reading, or were in the last test that had them.

    `modes` are those of the baseline, in the order of the reading's; `before` is the same by the
    test before.
    """
    if reading.modes is None:
        return tuple(before)
    known = {(each.plane, each.order): each for each in before}
    found = []
    for key, wrong, variance in zip(
        modes, reading.modes.mistaken, reading.modes.variances, strict=True
    ):
        run = known.get(key)
        if wrong:
            since, tests = (run.since, run.tests) if run else (reading.time, 0)
            found.append(RepeatedMistake(*key, since, tests + 1))
        elif run and math.isinf(variance):  # this test does not have the mode
            found.append(run)
    return tuple(found)


def notice_of(test: WatchedTest, hanger: Hanger) -> Alert:
    """A notice of the modes that tests keep having wrong."""
    kind: AlertKind = "check the modes"
    notable = [each for each in test.mistaken if each.is_notable]
    names = "+".join(f"{each.plane}-{each.order}" for each in notable)
    return Alert(
        key=f"hanger-{hanger.id}:{kind.replace(' ', '-')}:{names}:{short_name(test.test)}",
        hanger=hanger.id,
        test=test.test,
        time=test.time,
        message=f"Hanger {hanger.id}: {_words(notable)}",
        drifts=(),
        kinds=(kind,),
    )


def _words(mistaken: Sequence[RepeatedMistake]) -> str:
    """Of modes that tests keep having wrong: which, since when, what to do, and why."""
    since, many = min(each.since for each in mistaken), len(mistaken) > 1
    have, number, them = ("have", "their numbers", "them") if many else ("has", "its number", "it")
    return (
        f"{' and '.join(map(str, mistaken))} {have} not fitted the other modes since "
        f"{since:%Y-%m-%d}. Check {number} at the next planned test. The watch leaves {them} out: "
        f"another order or a machine's tone may be taken for {them}, or one end alone has loosened."
    )
