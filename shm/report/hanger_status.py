"""The state of a hanger in a word, by its watch, its alerts and what is doubtful."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from enum import Enum

from shm.values import Alert, Drift, Hanger

WATCH_PROBABILITY = 0.5  # likelier than not


_DOUBTS = frozenset({"check the modes", "check the baseline"})


class Status(Enum):
    """The state of a hanger in a word."""

    ALERT = "Alert"
    WATCH = "Watch"
    CHECK = "Check baseline"
    STEADY = "No change"
    FIRST = "First test"


def standing_at(alerts: Iterable[Alert], latest: str) -> tuple[Alert, ...]:
    """Of alerts whose condition has not ended those that speak of the `latest` test of a hanger.

    That a test was to be repeated is over once another came; a trial of the hooks says nothing.
    """
    return tuple(
        each
        for each in alerts
        if each.kinds != ("test",) and (each.kinds != ("repeat the test",) or each.test == latest)
    )


def status_of(
    drifts: Sequence[Drift],
    hanger: Hanger,
    *,
    is_first: bool,
    is_called: bool,
    warnings: Sequence[str] = (),
    standing: Sequence[Alert] = (),
) -> Status:
    """The state that the drifts of the latest test give, and whether a change was called.

    With open `warnings` no hanger is quiet: what it is compared with may be wrong. Nor is one of
    which an alert is `standing`: two tests that agree tell of a shift before the watch is sure.
    """
    highest = max((drift.probability for drift in drifts), default=math.nan)
    kinds = [each.kinds for each in standing]
    if highest >= hanger.thresholds.alert_probability or any(
        "beyond threshold" in k for k in kinds
    ):
        return Status.ALERT
    if (
        highest >= WATCH_PROBABILITY
        or is_called
        or any(not k or not _DOUBTS.issuperset(k) for k in kinds)
    ):
        return Status.WATCH
    if warnings or standing:
        return Status.CHECK
    return Status.FIRST if is_first else Status.STEADY
