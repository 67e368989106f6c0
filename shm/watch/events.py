"""What a person did to a hanger, and which alerts that explains.

A lamp explains frequencies that fell as by a mass from that day on; it does not explain lost
tension. Works that put a hanger right explain alerts from before them, too.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime

from shm.values import TENSION, Alert
from shm.watch.change_words import is_stiffness, probable_groups

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
    """Whether an event of that time explains an alert of the watch.

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
