"""Whether tests after works on a hanger show that what was told of it before is put right.

A person who says "repaired" may be wrong, or may give the day of a test from before the works. A
new baseline would make the loss the normal state, and nobody would hear of it again.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime

import numpy as np

from shm.values import Alert, Drift, Hanger, ModalTest
from shm.values.rounding import NINETY_PERCENT
from shm.watch.agreement import drifts_of
from shm.watch.baseline_state import known_modes
from shm.watch.change_words import quantity_words, size_words
from shm.watch.readings import Reader

_HALF = 0.5  # judgement: of what was told, so much may be left where it is repaired


@dataclass(frozen=True)
class Unrepaired:
    """What still stands of one alert after works: in words, `tension fell by 8.0 ± 1.1 %`."""

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
    """What stands of `alerts` (number, alert, its test) in the tests `since` the works, by time.

    `before` reads tests against the baseline of then, and holds its tests. Where works are to
    restore it (`restores`), more than half of what was told must be gone, with the probability that
    ends an alert; else it must be other than told, beyond the 90 % interval of both. Of an alert
    that names no quantity the frequencies must have come back half of the way.
    """
    reader, of_baseline = before
    now = {each.quantity: each for each in drifts_of(reader, since, hanger)}
    found = []
    for number, alert, test in alerts:
        drifts = [each for each in alert.drifts if each.quantity in now]
        if drifts:
            stands = [
                now[each.quantity]
                for each in drifts
                if _stands(each, now[each.quantity], hanger, restores=restores)
            ]
            words = [f"{quantity_words(each.quantity)} {size_words(each)}" for each in stands]
        elif alert.change is not None and test is not None:
            share = share_left(of_baseline, test, [each for each, _ in since])
            words = [f"{100 * share:.0f} % of what the frequencies had moved by is left"]
            words = [] if share < _HALF else words  # NaN is not known to be gone
        else:
            continue
        if words:
            found.append(Unrepaired(number, " and ".join(words)))
    return tuple(found)


def _stands(told: Drift, now: Drift, hanger: Hanger, *, restores: bool) -> bool:
    if not restores:
        apart = abs(now.shift_mean - told.shift_mean)
        return apart <= NINETY_PERCENT * math.hypot(told.shift_sd, now.shift_sd)
    way = math.copysign(1, told.shift_mean)
    off = way * now.shift_mean - _HALF * abs(told.shift_mean)
    left = 0.5 * math.erfc(-off / (math.sqrt(2) * now.shift_sd))
    return not left < hanger.thresholds.end_probability


def share_left(baseline: Sequence[ModalTest], told: ModalTest, now: Sequence[ModalTest]) -> float:
    """Of what the log frequencies of `told` are off the baseline's, the share that those of `now`
    are off the same way, in least squares over the modes in all; NaN where there is none."""
    then, at, after = (_log_frequencies(tests) for tests in (baseline, [told], now))
    keys = sorted(then.keys() & at.keys() & after.keys())
    moved = np.array([at[key] - then[key] for key in keys])
    left = np.array([after[key] - then[key] for key in keys])
    size = float(moved @ moved)
    return float(moved @ left) / size if size > 0 else math.nan


def _log_frequencies(tests: Sequence[ModalTest]) -> dict[tuple[str, int], float]:
    found: dict[tuple[str, int], list[float]] = {}
    for test in tests:
        for mode in known_modes(test):
            found.setdefault((mode.plane, mode.order), []).append(math.log(mode.frequency_hz))
    return {key: float(np.median(values)) for key, values in found.items()}
