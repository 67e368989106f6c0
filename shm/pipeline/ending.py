"""When the condition that an alert told of has ended, so that those who were told hear of it.

Nothing here imports what computes: the daemon decides it when it keeps what the watch said.
"""

from __future__ import annotations

import math

from shm.values import Alert, Drift, Hanger, Posterior, WatchedTest

_HALF = 0.5  # judgement: of a shift below the threshold, so much must be left of it


def why_over(alert: Alert, test: WatchedTest, hanger: Hanger, *, gap_stands: bool) -> str:
    """Why the condition of an alert has ended at a later test; empty while it stands or is unknown.

    A shift beyond its threshold has ended once its probability is below half the level. A change
    that was detected below the threshold has ended once less than half of it is left, by the same
    level. Where no change is behind it, as of two tests that agree while their clocks left the
    watch no time for a change, the probability was low all along: the shift must have come back,
    too. A held test ends by a decision, never here; a mode that does not fit, once it does; a
    baseline that stands alone, once another is set.
    """
    if test.time <= alert.time or "held" in alert.kinds:
        return ""
    if "check the modes" in alert.kinds and not alert.drifts:
        stands = any(each.is_notable for each in test.mistaken)
        return "" if stands else f"all modes of test {test.test} fit again"
    if "check the baseline" in alert.kinds and not test.change.is_baseline_alone:
        return f"test {test.test} does not speak against the baseline any more"
    if "gap" in alert.kinds and gap_stands:
        return ""
    if "gap" not in alert.kinds and not alert.drifts:
        return ""
    now = {drift.quantity: drift for drift in test.drifts}
    level = hanger.thresholds.end_probability
    for told in alert.drifts:
        later = now.get(told.quantity)
        if later is None or not _left(told, later) < level:
            return ""
        if alert.change is None and later.may_be_beyond(told.shift_mean):
            return ""
    return f"test {test.test} reads as the baseline does again"


def _left(told: Drift, later: Drift) -> float:
    """The probability that what was told is still there; NaN where it is not known."""
    same_way = math.copysign(1, told.shift_mean) == math.copysign(1, later.shift_mean)
    if abs(told.shift_mean) >= told.threshold:
        return later.probability if same_way else 0.0 * later.probability
    way = math.copysign(1, told.shift_mean)
    off = way * later.shift_mean - _HALF * abs(told.shift_mean)
    return (
        0.5 * math.erfc(-off / (math.sqrt(2) * later.shift_sd)) if later.shift_sd > 0 else math.nan
    )


def gap_stands(baseline: Posterior, current: Posterior) -> bool:
    """Whether the gap of an adopted class is still larger than when it was adopted."""
    from shm.watch.gap import gap_percent, has_grown  # it computes: not before it is needed

    return has_grown(gap_percent(baseline), gap_percent(current))
