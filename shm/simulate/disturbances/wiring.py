"""What goes wrong between sensor and file: saturation, cables, lost samples."""

from __future__ import annotations

from dataclasses import replace
from typing import TypeVar

import numpy as np

from shm.simulate.disturbances.base import Channels, Lines, Planted, Scene
from shm.values import NAN, FloatArray

T = TypeVar("T")
_OPEN_CONTACTS = 4  # judgement: a loose plug opens more than once while the hanger swings


def clipping(made: Lines, scene: Scene, rng: np.random.Generator) -> tuple[Lines, Planted]:
    """One accelerometer saturates at 10 to 40 % of its largest value."""
    return _saturated("clipping", made, scene, _accelerometer(made, rng), rng.uniform(0.1, 0.4))


def overload(made: Lines, scene: Scene, rng: np.random.Generator) -> tuple[Lines, Planted]:
    """The force saturates at 40 to 70 % of its largest value."""
    (row,) = (row for row, line in enumerate(made) if line.quantity == "force")
    return _saturated("overload", made, scene, row, rng.uniform(0.4, 0.7))


def _saturated(
    name: str, made: Lines, scene: Scene, row: int, share: float
) -> tuple[Lines, Planted]:
    line = made[row]
    limit = share * float(np.abs(line.values).max())
    parts = np.split(np.abs(line.values), _starts(scene)[1:])
    hits = tuple(hit for hit, part in enumerate(parts) if part.max(initial=0.0) > limit)
    changed = replace(line, limit=limit)
    return _with(made, row, changed), Planted(name, hits, (line.name,))


def cable(made: Lines, scene: Scene, rng: np.random.Generator) -> tuple[Lines, Planted]:
    """One accelerometer's cable: steps, bursts or an intermittent contact after some hits."""
    row = _accelerometer(made, rng)
    values = made[row].values.copy()
    fault = (_step, _burst, _open)[int(rng.integers(3))]
    count = int(rng.integers(1, len(scene.strikes) + 1))
    hits = sorted(rng.choice(len(scene.strikes), count, replace=False).tolist())
    for hit in hits:
        fault(values[_after(hit, scene, rng) :], float(np.std(values)), scene.rate_hz, rng)
    changed = replace(made[row], values=values)
    return _with(made, row, changed), Planted("cable", tuple(hits), (made[row].name,))


def _step(values: FloatArray, level: float, rate_hz: float, rng: np.random.Generator) -> None:
    """A jump that the coupling of the amplifier takes back."""
    seconds = np.arange(len(values)) / rate_hz
    values += level * rng.uniform(2.0, 8.0) * np.exp(-seconds / rng.uniform(0.2, 1.0))


def _burst(values: FloatArray, level: float, rate_hz: float, rng: np.random.Generator) -> None:
    """Crackle over 20 to 100 ms."""
    part = values[: int(rng.uniform(0.02, 0.1) * rate_hz)]
    part += level * rng.uniform(3.0, 10.0) * rng.standard_normal(len(part))


def _open(values: FloatArray, level: float, rate_hz: float, rng: np.random.Generator) -> None:
    """The contact opens a few times for 10 to 60 ms: the input goes off to the supply's side."""
    supply = level * rng.uniform(2.0, 8.0)
    for first in np.cumsum(rng.uniform(0.05, 0.2, _OPEN_CONTACTS) * rate_hz).astype(int):
        values[first : first + int(rng.uniform(0.01, 0.06) * rate_hz)] = supply


def drop_out(made: Channels, scene: Scene, rng: np.random.Generator) -> tuple[Channels, Planted]:
    """One channel misses 50 to 500 ms after a hit, as NaN or as repeated samples."""
    rows = [row for row, channel in enumerate(made) if channel.quantity == "acceleration"]
    row, hit = int(rng.choice(rows)), int(rng.integers(len(scene.strikes)))
    values = made[row].values.copy()
    first = _after(hit, scene, rng)
    stop = first + max(8, int(rng.uniform(0.05, 0.5) * scene.rate_hz))
    values[first:stop] = NAN if rng.random() < 0.5 else values[first]
    changed = replace(made[row], values=values)
    return _with(made, row, changed), Planted("drop_out", (hit,), (changed.name,))


def _accelerometer(made: Lines, rng: np.random.Generator) -> int:
    rows = [row for row, line in enumerate(made) if line.quantity == "acceleration"]
    return int(rng.choice(rows))


def _starts(scene: Scene) -> list[int]:
    return [int(strike.start_s * scene.rate_hz) for strike in scene.strikes]


def _after(hit: int, scene: Scene, rng: np.random.Generator) -> int:
    """A sample within the first half of the ring-down after a hit."""
    late_s = rng.uniform(0.05, 0.5) * (scene.plan.seconds_per_hit - scene.plan.pre_trigger_s)
    return _starts(scene)[hit] + int(late_s * scene.rate_hz)


def _with(made: tuple[T, ...], row: int, changed: T) -> tuple[T, ...]:
    return (*made[:row], changed, *made[row + 1 :])
