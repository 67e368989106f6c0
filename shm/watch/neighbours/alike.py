"""What could move all hangers, or all of one logger, by a common fraction."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from shm.values import FloatArray
from shm.watch.neighbours.nouns import HangerShift

_SWING_K = 5.0
_SPREAD = 0.2
_FEWEST = 3


@dataclass(frozen=True, eq=False)
class AlikeCause:
    """A common cause: the fractions (n,) that it moves hangers by, largest about 1; what to do."""

    fractions: FloatArray
    name: str
    remedy: str


def alike_causes(shifts: Sequence[HangerShift]) -> tuple[AlikeCause, ...]:
    """Every common cause that the data could tell from another.

    All by one fraction; each as its temperature went, where those differ; each logger's hangers,
    where there are several loggers. A rate that is off by e moves frequencies by e, tensions by 2e.
    """
    return (_common(shifts), *_by_temperature(shifts), *_by_logger(shifts))


def _common(shifts: Sequence[HangerShift]) -> AlikeCause:
    changes = _changes(shifts)
    everywhere = np.ones(len(shifts))
    clocks = "compare the loggers' clocks and sampling rates"
    if _swing(changes) < _SWING_K:
        return AlikeCause(
            everywhere,
            "a clock or a load on the whole deck",
            f"the temperatures hardly changed; {clocks}, and ask for new surfacing or works",
        )
    if np.isfinite(changes).all() and changes.std() <= _SPREAD * _swing(changes):
        return AlikeCause(
            everywhere,
            "a temperature or a clock",
            f"all tests lie about {changes.mean():+.0f} K from their baselines; "
            f"check the temperature readings, and {clocks}",
        )
    return AlikeCause(
        everywhere,
        "a temperature or a clock",
        f"{clocks}, and the temperatures of the tests",
    )


def _by_temperature(shifts: Sequence[HangerShift]) -> tuple[AlikeCause, ...]:
    changes = _changes(shifts)
    swing = _swing(changes)
    if not (swing >= _SWING_K and changes.std() > _SPREAD * swing):
        return ()
    remedy = "the shifts go with the temperatures of the tests; check those readings"
    return (AlikeCause(changes / np.abs(changes).max(), "the temperature", remedy),)


def _by_logger(shifts: Sequence[HangerShift]) -> tuple[AlikeCause, ...]:
    names = np.array([each.logger for each in shifts])
    known = sorted({name for name in names.tolist() if name})
    if len(set(names.tolist())) < 2:
        return ()
    return tuple(
        AlikeCause(
            (names == name).astype(float),
            f"logger {name}",
            f"only hangers of logger {name} moved; check its clock, sampling rate and sensors",
        )
        for name in known
        if np.count_nonzero(names == name) >= _FEWEST
    )


def _changes(shifts: Sequence[HangerShift]) -> FloatArray:
    return np.array([each.temperature_change_k for each in shifts])


def _swing(changes: FloatArray) -> float:
    """Root mean square of the changes in K; NaN where one is unknown."""
    return float(np.sqrt(np.mean(changes**2)))
