"""Check that tests after works show what was reported before to be put right.

And which alerts an event explains: a lamp explains frequencies that fell as by a mass from that day
on; works that put a hanger right explain alerts from before them, too.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import TYPE_CHECKING

import numpy as np

from shm.values import TENSION, Alert, Drift, Hanger, ModalTest
from shm.values.rounding import NINETY_PERCENT
from shm.watch.engine.limits import LIMITS
from shm.watch.words.alert_text import is_stiffness, probable_groups, quantity_words, size_words

if TYPE_CHECKING:
    from shm.watch.engine.readings import Reader


@dataclass(frozen=True)
class Unrepaired:
    """An alert that is in force after works: in words, `tension fell by 8.0 ± 1.1 %`."""

    alert: int
    words: str


def unrepaired(
    before: tuple[Reader, Sequence[ModalTest]],
    alerts: Sequence[tuple[int, Alert, ModalTest | None]],
    since: Sequence[tuple[ModalTest, datetime]],
    hanger: Hanger,
    *,
    restores: bool,
) -> tuple[Unrepaired, ...]:
    """Return what is in force of `alerts` (number, alert, its test) in the tests `since` the works.

    `before` reads tests against the baseline of then, and holds its tests. Where works are to
    restore it (`restores`), more than half of what was told must be gone, with the probability that
    ends an alert; else it must be other than told, beyond the 90 % interval of both. Of an alert
    that names no quantity the frequencies must have come back half of the way.
    """
    from shm.watch.agreement import drifts_of  # who lists the kinds of events needs no engine

    reader, of_baseline = before
    now = {each.quantity: each for each in drifts_of(reader, since, hanger)}
    found = []
    for number, alert, test in alerts:
        drifts = [each for each in alert.drifts if each.quantity in now]
        if drifts:
            in_force = [
                now[each.quantity]
                for each in drifts
                if _persists(each, now[each.quantity], hanger, restores=restores)
            ]
            words = [f"{quantity_words(each.quantity)} {size_words(each)}" for each in in_force]
        elif alert.change is not None and test is not None:
            share = share_left(of_baseline, test, [each for each, _ in since])
            words = [f"{100 * share:.0f} % of what the frequencies had moved by is left"]
            words = [] if share < LIMITS.half else words  # NaN is not known to be gone
        else:
            continue
        if words:
            found.append(Unrepaired(number, " and ".join(words)))
    return tuple(found)


def _persists(drift: Drift, now: Drift, hanger: Hanger, *, restores: bool) -> bool:
    if not restores:
        apart = abs(now.shift_mean - drift.shift_mean)
        return apart <= NINETY_PERCENT * math.hypot(drift.shift_sd, now.shift_sd)
    way = math.copysign(1, drift.shift_mean)
    off = way * now.shift_mean - LIMITS.half * abs(drift.shift_mean)
    left = 0.5 * math.erfc(-off / (math.sqrt(2) * now.shift_sd))
    return not left < hanger.thresholds.end_probability


def share_left(
    baseline: Sequence[ModalTest], alerted: ModalTest, now: Sequence[ModalTest]
) -> float:
    """Of what the log frequencies of `alerted` are off the baseline's, the share that those of
    `now` are off the same way, in least squares over the modes in all; NaN where there is none."""
    then, at, after = (_log_frequencies(tests) for tests in (baseline, [alerted], now))
    keys = sorted(then.keys() & at.keys() & after.keys())
    moved = np.array([at[key] - then[key] for key in keys])
    left = np.array([after[key] - then[key] for key in keys])
    size = float(moved @ moved)
    return float(moved @ left) / size if size > 0 else math.nan


def _log_frequencies(tests: Sequence[ModalTest]) -> dict[tuple[str, int], float]:
    from shm.watch.baseline_check import known_modes  # it computes: not before it is needed

    found: dict[tuple[str, int], list[float]] = {}
    for test in tests:
        for mode in known_modes(test):
            found.setdefault((mode.plane, mode.order), []).append(math.log(mode.frequency_hz))
    return {key: float(np.median(values)) for key, values in found.items()}


_SPRINGS = "end stiffness"


@dataclass(frozen=True)
class EventKind:
    """A kind of event. `explains` are quantities and causes that it changes, `end stiffness` for
    all springs; `is_remedy` says whether it ends what was found before it, `restores` whether
    that is gone then and not only other than it was. Who `accepts` a state explains all of it."""

    name: str
    explains: frozenset[str]
    is_remedy: bool = False
    restores: bool = False
    accepts: bool = False


EVENT_KINDS = {
    each.name: each
    for each in (
        EventKind("lamp mounted", frozenset({"point_mass"})),
        EventKind("sensor replaced", frozenset({"sensor_mass", "timebase"})),
        EventKind("retensioned", frozenset({TENSION}), is_remedy=True),
        EventKind(
            "repaired",
            frozenset({TENSION, _SPRINGS, "section_loss", "bending_stiffness"}),
            is_remedy=True,
            restores=True,
        ),
        EventKind("accepted as it is", frozenset(), is_remedy=True, accepts=True),
    )
}
"""A small vocabulary: each word decides which alerts end; `--why` tells the rest."""


_OF_OTHERS = {"gap", "held", "limit", "silent"}
"""Alerts that are not against a baseline's tension and ends: no new baseline ends them."""


def is_explained(alert: Alert, kind: EventKind, since: datetime) -> bool:
    """Return True if an event of that time explains an alert of the watch.

    Of what is beyond its threshold the event must change all; of causes that the tests do not tell
    apart it must be one. Tests that agree with none need no further explanation.
    """
    began_by = alert.change.began_by if alert.change else alert.time
    if not kind.is_remedy and began_by < since:
        return False
    if kind.accepts:
        return not _OF_OTHERS & set(alert.kinds)
    if "beyond threshold" in alert.kinds:
        return all(_is_of(each.quantity, kind) for each in alert.drifts)
    if alert.change is None:
        return not _OF_OTHERS & set(alert.kinds)
    groups = probable_groups(alert.change)
    return any(all(_is_of(each.quantity, kind) for each in group) for group in groups)


def _is_of(quantity: str, kind: EventKind) -> bool:
    return (_SPRINGS if is_stiffness(quantity) else quantity) in kind.explains
