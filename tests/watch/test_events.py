"""Which alerts an event explains: what it changes, and from when on."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta

import pytest

from shm.values import Alert, AlertKind, Change, Drift, Moved
from shm.watch.repair_check import EVENT_KINDS, is_explained

DAY = datetime(2026, 5, 1, tzinfo=UTC)
TENSION = Moved("tension", 0.9, -0.08, 0.01)
PIN = Moved("log10_k1", 0.9, -0.3, 0.05, "deck", "transverse")
MASS = Moved("point_mass", 0.9, -0.01, 0.001)
CLOCK = Moved("timebase", 0.9, -0.01, 0.001)
TENSION_OR_MASS = (
    Moved("tension", 0.6, -0.08, 0.01, alike=("point_mass",)),
    Moved("point_mass", 0.35, -0.01, 0.001, alike=("tension",)),
)


def alert(
    *moved: Moved, days: float = 2, kinds: tuple[AlertKind, ...] = ("sudden change",)
) -> Alert:
    time = DAY + timedelta(days=days)
    change = Change(500, 100, 0.99, 0.9, time - timedelta(days=1), time, moved) if moved else None
    drifts = ()
    if "beyond threshold" in kinds:
        drifts = (Drift(7, "t", time, "tension", 7e5, 6e5, -0.1, 0.01, 0.05, 0.99),)
    return Alert("key", 7, "t", time, "message", drifts, kinds, change)


@pytest.mark.parametrize(
    ("kind", "told", "explained"),
    [
        ("lamp mounted", alert(MASS), True),
        ("lamp mounted", alert(TENSION), False),
        ("lamp mounted", alert(*TENSION_OR_MASS), True),
        ("lamp mounted", alert(MASS, days=-2), False),  # it came before the lamp
        ("lamp mounted", alert(*TENSION_OR_MASS, kinds=("beyond threshold",)), False),
        ("sensor replaced", alert(CLOCK), True),
        ("sensor replaced", alert(PIN), False),
        ("retensioned", alert(TENSION), True),
        ("retensioned", alert(TENSION, days=-2), True),  # it was put right
        ("retensioned", alert(PIN), False),
        ("retensioned", alert(kinds=("beyond threshold",)), True),
        ("repaired", alert(PIN, days=-2), True),
        ("repaired", alert(CLOCK), False),
        ("lamp mounted", alert(kinds=("repeat the test",)), True),
        ("repaired", alert(kinds=("gap",)), False),
    ],
)
def test_an_event_explains_what_it_changes(kind: str, told: Alert, explained: bool) -> None:
    assert is_explained(told, EVENT_KINDS[kind], DAY) is explained
