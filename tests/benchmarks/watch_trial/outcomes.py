"""What a trial of the watch counted: false alarms a year, delays in tests, what was named."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from scipy.stats import gamma

from tests.benchmarks.shares import interval
from tests.benchmarks.watch_trial.rivals import DAYS_A_YEAR

Row = dict[str, Any]
"""One hanger's seasons: as `watch_worlds.solved` writes them."""

QUIET = ("quiet", "creep")
BEGINS = 540.0
"""The day of every event: a baseline and a year before it, a year and a half after."""
NOTICES = {"repeat the test", "check the modes", "check the baseline"}
RIVALS = ("CUSUM", "EWMA")
TRUE_CAUSE = {
    "springs": ("stiffness", "log10_k"),
    "lamp": ("point_mass",),
    "clock": ("timebase",),
    "section": ("section_loss", "bending_stiffness", "point_mass"),
    "sensor": ("sensor_mass", "point_mass"),
}
"""What the first name of an alert may be; a mass and lost section are one group to frequencies."""


def is_alert(alert: dict[str, Any]) -> bool:
    return not set(alert["kinds"]) <= NOTICES


def alarm_by(rule: str, limit: float) -> Callable[[Row], int | None]:
    """The number of the test at which a rival first exceeds its limit."""

    def first(row: Row) -> int | None:
        return next((n for n, value in enumerate(row["rivals"][rule]) if value > limit), None)

    return first


def ours(row: Row) -> int | None:
    """The number of the test of our first alert."""
    return next((a["at"] for a in row["alerts"] if is_alert(a)), None)


def false_alarms(rows: Sequence[Row], first: Callable[[Row], int | None]) -> tuple[int, float]:
    """First alarms of quiet hangers, and the years watched until these."""
    count, years = 0, 0.0
    for row in rows:
        at = first(row)
        end = row["days"][-1] if at is None else row["days"][at]
        years += (end - row["days"][row["baseline"] - 1]) / DAYS_A_YEAR
        count += at is not None
    return count, years


def limit_at(rows: Sequence[Row], rule: str, rate: float) -> float:
    """The lowest limit of a rival that keeps its false alarms a year at `rate` or below."""
    values = np.unique([v for row in rows for v in row["rivals"][rule]])
    low, high = 0, len(values) - 1
    while low < high:
        middle = (low + high) // 2
        count, years = false_alarms(rows, alarm_by(rule, float(values[middle])))
        low, high = (low, middle) if count / years <= rate else (middle + 1, high)
    return float(values[low])


def delays(rows: Sequence[Row], first: Callable[[Row], int | None]) -> np.ndarray:
    """Tests from the event to the alarm, its own among them; endless where none came, and none of
    hangers on which there was one before the event."""
    found = []
    for row in rows:
        begun = next((n for n, day in enumerate(row["days"]) if day >= BEGINS), None)
        at = first(row)
        if begun is None or (at is not None and at < begun):
            continue
        found.append(np.inf if at is None else at - begun + 1)
    return np.array(found)


def first_alert(row: Row) -> dict[str, Any] | None:
    """Our first alert after the event."""
    begun = next((n for n, day in enumerate(row["days"]) if day >= BEGINS), len(row["days"]))
    return next((a for a in row["alerts"] if is_alert(a) and a["at"] >= begun), None)


def named_first(row: Row) -> str:
    """What our first alert after the event names first; empty without one."""
    alert = first_alert(row)
    if alert is None:
        return ""
    return str(alert["moved"][0][0]) if alert["moved"] else "beyond threshold"


def is_right(row: Row) -> bool:
    """Whether that is the truth, or among what it says the data fit as well."""
    alert = first_alert(row)
    if alert is None or not alert["moved"]:
        return False
    said = [alert["moved"][0][0], *alert["moved"][0][3]]
    true = TRUE_CAUSE.get(row["scenario"], ("tension",))
    return any(part in name for name in said for part in true)


def covers(row: Row) -> bool:
    """Whether the 90 % interval of the last shift of the tension holds the true one."""
    mean, sd = row["shift"]
    return abs(row["true_shift"] - mean) <= 1.645 * sd


def quantile(found: np.ndarray, share: float) -> float:
    """A delay that so many do not exceed."""
    return float(np.quantile(found, share, method="higher")) if len(found) else float("nan")


def share(hits: int, count: int) -> str:
    """A share with its 90 % interval."""
    low, high = interval(hits, count)
    return f"{hits} of {count}: {hits / max(count, 1):.2f} ({low:.2f} to {high:.2f})"


def rate(hits: int, years: float) -> str:
    """Events a year with a 90 % interval (Garwood)."""
    low = gamma.ppf(0.05, hits) / years if hits else 0.0
    high = gamma.ppf(0.95, hits + 1) / years
    return f"{hits} in {years:.0f}: {hits / years:.3f} ({low:.3f} to {high:.3f})"
