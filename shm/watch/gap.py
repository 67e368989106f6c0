"""The gap of an adopted class: how far its predictions lie off what was measured, and its growth.

An effect is adopted because it closes a gap. Where the gap opens again by more than chance would
have it, the hanger has changed in a way that the effect does not describe, or the effect was not
the cause: then it is time for another diagnosis.
"""

from __future__ import annotations

import math
from dataclasses import replace
from datetime import datetime

import numpy as np

from shm.models import is_adopted
from shm.values import Alert, Hanger, Posterior
from shm.watch.engine.limits import LIMITS


def gap_percent(posterior: Posterior) -> float:
    """Root mean square of predicted over measured frequencies less 1; NaN where none is known."""
    ratios = np.array([row.mean_hz / row.measured_hz for row in posterior.predicted])
    known = ratios[np.isfinite(ratios)]
    return 100 * float(np.sqrt(np.mean((known - 1) ** 2))) if len(known) else math.nan


def has_grown(before_percent: float, now_percent: float) -> bool:
    """Return True if a gap is more than three times what it was, and more than 0.1 %.

    Two gaps of one cause with eight degrees of freedom each, twelve modes less what is fitted, lie
    apart by a factor of three once in 370 tests, by two once in 30 (F distribution). Below 0.1 % a
    kelvin or a logger's clock makes as much.
    """
    return now_percent > max(LIMITS.grown * before_percent, LIMITS.visible_percent)


def watch_gap(
    baseline: Posterior, current: Posterior, hanger: Hanger, *, test: str, time: datetime
) -> Alert | None:
    """An alert where the gap of an adopted class has grown since its baseline."""
    before, now = gap_percent(baseline), gap_percent(current)
    if not is_adopted(current.model) or not has_grown(before, now):
        return None
    return Alert(
        key=f"hanger-{hanger.id}:gap-up",
        hanger=hanger.id,
        test=test,
        time=time,
        message=f"Hanger {hanger.id}: the frequencies that {current.model} predicts lie "
        f"{now:.2f} % off the measured ones, {before:.2f} % when it was adopted: its effects do "
        f"not describe this test. Diagnose the gap again within a week.",
        drifts=(),
        kinds=("gap",),
    )


def joined(first: Alert | None, second: Alert | None) -> Alert | None:
    """Two alerts of one test as one, whose key names both."""
    if first is None or second is None:
        return first or second
    key = f"{first.key}:{second.key.partition(':')[2]}"
    message = f"{first.message} {second.message}"
    return replace(first, key=key, message=message, kinds=(*first.kinds, *second.kinds))
