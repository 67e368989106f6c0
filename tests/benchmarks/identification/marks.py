"""What the tests add up to: the rows of the table and the marks that must be met."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scoring import TestScore

NINETY = 1.645
EVERY = 100.0
COLUMNS = ("figure", "sound tests", "faulty tests", "all", "mark")


@dataclass(frozen=True)
class Mark:
    """A figure of all tests and the bounds it must keep, both included."""

    name: str
    value: float
    least: float = -np.inf
    most: float = np.inf

    @property
    def met(self) -> bool:
        return bool(self.least <= self.value <= self.most)

    @property
    def wanted(self) -> str:
        if np.isinf(self.least):
            return f"at most {self.most:g} %"
        return (
            f"{self.least:g} to {self.most:g} %"
            if self.most < 100
            else f"at least {self.least:g} %"
        )


def marks(scores: Sequence[TestScore]) -> list[Mark]:
    """The marks of the project, in percent."""
    errors = 100 * np.abs(_joined(s.frequency_errors for s in scores))
    told = [s.flagged for s in scores if s.flagged is not None]
    frequency, damping = ([getattr(s, z) for s in scores] for z in ("frequency_z", "damping_z"))
    return [
        Mark("modes above 20 dB found", _share(scores, "found", "expected"), 99.0, 100.0),
        Mark("false modes", _share(scores, "false", "reported"), most=0.5),
        Mark("median frequency error", _of(np.median, errors), most=0.02),
        Mark("largest frequency error", _of(np.max, errors), most=0.3),
        Mark("90 % intervals of frequency cover", coverage(frequency), 85.0, 95.0),
        Mark("90 % intervals of damping cover", coverage(damping), 80.0, 98.0),
        Mark("planted faults flagged", 100 * _of(np.mean, told), 100.0, 100.0),
        Mark("sound hits dropped", _share(scores, "sound_hits_dropped", "sound_hits"), most=2.0),
    ]


def table(scores: Sequence[TestScore]) -> list[tuple[str, ...]]:
    """Rows of `COLUMNS`."""
    groups = (
        [s for s in scores if not s.disturbance],
        [s for s in scores if s.disturbance],
        list(scores),
    )
    by_group = [marks(group) for group in groups]
    rows = [
        (own[0].name, *(_percent(mark.value) for mark in own), own[-1].wanted + _verdict(own[-1]))
        for own in zip(*by_group, strict=True)
    ]
    return rows + [(name, *(figure(group) for group in groups), "") for name, figure in _FIGURES]


def flags(scores: Sequence[TestScore]) -> list[tuple[str, str]]:
    """Each kind of disturbance, and of how many it was told."""
    kinds = dict.fromkeys(s.disturbance for s in scores if s.disturbance)
    rows = []
    for kind in kinds:
        told = [s.flagged for s in scores if s.disturbance == kind]
        heard = [flag for flag in told if flag is not None]
        unheard = f" ({len(told) - len(heard)} not to be heard)" if len(heard) < len(told) else ""
        rows.append((kind, f"{sum(heard)} of {len(heard)}{unheard}"))
    return rows


def alarms(scores: Sequence[TestScore]) -> list[tuple[str, int]]:
    """Checks that were not good in tests without a planted fault."""
    sound = [s for s in scores if not s.disturbance]
    return Counter(name for s in sound for name in s.alarms).most_common()


def coverage(z: Iterable[Sequence[float]]) -> float:
    """Percentage inside the 90 % interval; an unknown standard deviation covers nothing."""
    return 100 * _of(np.mean, np.abs(_joined(z)) < NINETY)


def _merged(scores: Sequence[TestScore]) -> str:
    found = sum(s.merged_found for s in scores)
    return f"{found} of {sum(s.merged_expected for s in scores)}"


def _seconds(scores: Sequence[TestScore]) -> str:
    seconds = [s.seconds for s in scores]
    return f"{np.median(seconds):.2f}, {np.max(seconds):.2f}" if seconds else "-"


def _median_damping(scores: Sequence[TestScore]) -> str:
    return _percent(100 * _of(np.median, np.abs(_joined(s.damping_errors for s in scores))))


_FIGURES: tuple[tuple[str, Callable[[Sequence[TestScore]], str]], ...] = (
    ("of these nearer than 0.1 % to one of the other plane", _merged),
    ("tests", lambda scores: str(len(scores))),
    ("modes above 20 dB", lambda scores: str(sum(s.expected for s in scores))),
    ("modes reported", lambda scores: str(sum(s.reported for s in scores))),
    ("wrong plane or order", lambda scores: str(sum(s.misplaced for s in scores))),
    ("tests refused", lambda scores: str(sum(bool(s.refused) for s in scores))),
    ("median damping error", _median_damping),
    ("seconds of one core a test: median, largest", _seconds),
)


def _of(statistic: Callable[[Any], Any], values: Any) -> float:
    """NaN where there is nothing to say."""
    return float(statistic(values)) if len(values) else np.nan


def _joined(lists: Iterable[Sequence[float]]) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    return np.array([value for each in lists for value in each], float)


def _share(scores: Sequence[TestScore], part: str, whole: str) -> float:
    total = sum(getattr(s, whole) for s in scores)
    return 100 * sum(getattr(s, part) for s in scores) / total if total else np.nan


def _percent(value: float) -> str:
    if np.isnan(value):
        return "-"
    return f"{value:.3g} %" if value < 10 else f"{value:.2f} %"


def _verdict(mark: Mark) -> str:
    if np.isnan(mark.value):
        return " **nothing to judge**"
    return "" if mark.met else " **missed**"
