"""What goes wrong with a record: the blows, when it begins and ends, and what happens between
sensor and file: saturation, cables, lost samples.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TypeVar

import numpy as np

from shm.simulate.response import Schedule, Strike
from shm.values import NAN, FloatArray
from tests.worlds.simulated.disturbances.base import Channels, Lines, Planted, Scene

_LEAST_GAP_S = 0.6  # blows closer than half a second are one swing of the hammer


def double_hit(made: Schedule, scene: Scene, rng: np.random.Generator) -> tuple[Schedule, Planted]:
    """A second, lighter blow 15 to 200 ms after one hit."""
    hit = int(rng.integers(len(made.strikes)))
    bounced = replace(
        made.strikes[hit], rebound_s=rng.uniform(0.015, 0.2), rebound_share=rng.uniform(0.1, 0.6)
    )
    return _with(made, hit, bounced), Planted("double_hit", (hit,))


def soft_hit(made: Schedule, scene: Scene, rng: np.random.Generator) -> tuple[Schedule, Planted]:
    """All blows through a soft tip: 20 to 30 ms long, so their force ends below 75 Hz."""
    seconds = rng.uniform(0.020, 0.030)
    strikes = tuple(replace(strike, seconds=seconds) for strike in made.strikes)
    return replace(made, strikes=strikes), Planted("soft_hit", tuple(range(len(strikes))))


def outlier_hit(made: Schedule, scene: Scene, rng: np.random.Generator) -> tuple[Schedule, Planted]:
    """One hit elsewhere, in another direction, or while somebody holds the hanger."""
    hit = int(rng.integers(len(made.strikes)))
    odd = (_elsewhere, _aslant, _held)[int(rng.integers(3))](made.strikes[hit], scene, rng)
    return _with(made, hit, odd), Planted("outlier_hit", (hit,))


def _elsewhere(strike: Strike, scene: Scene, rng: np.random.Generator) -> Strike:
    length_m = scene.state.effective_length_m(scene.hanger)
    upward = strike.x_m < 0.4 * length_m
    moved = rng.uniform(0.15, 0.3) * length_m
    return replace(strike, x_m=strike.x_m + moved if upward else strike.x_m - moved)


def _aslant(strike: Strike, scene: Scene, rng: np.random.Generator) -> Strike:
    return replace(strike, angle_deg=strike.angle_deg + rng.uniform(60.0, 120.0))


def _held(strike: Strike, scene: Scene, rng: np.random.Generator) -> Strike:
    return replace(strike, damping_ratio=scene.state.damping_ratio + rng.uniform(0.01, 0.03))


def no_pre_trigger(
    made: Schedule, scene: Scene, rng: np.random.Generator
) -> tuple[Schedule, Planted]:
    """The record begins within the pulse of its first hit."""
    first = made.strikes[0]
    begin_s = first.start_s + rng.uniform(0.2, 0.7) * first.seconds
    return replace(made, begin_s=begin_s), Planted("no_pre_trigger", (0,))


def cut_off(made: Schedule, scene: Scene, rng: np.random.Generator) -> tuple[Schedule, Planted]:
    """The record ends too early after the last hit, or the next hit comes too soon."""
    gap_s = max(_LEAST_GAP_S, rng.uniform(0.03, 0.12) * scene.plan.seconds_per_hit)
    last = len(made.strikes) - 1
    if last == 0 or rng.random() < 0.5:
        end_s = made.strikes[last].start_s + gap_s
        return replace(made, end_s=min(end_s, made.end_s)), Planted("cut_off", (last,))
    hit = int(rng.integers(last))
    hurried = replace(made.strikes[hit + 1], start_s=made.strikes[hit].start_s + gap_s)
    return _with(made, hit + 1, hurried), Planted("cut_off", (hit,))


def noise_only(made: Schedule, scene: Scene, rng: np.random.Generator) -> tuple[Schedule, Planted]:
    """Nobody hit."""
    return replace(made, strikes=()), Planted("noise_only")


def _with(made: Schedule, hit: int, strike: Strike) -> Schedule:
    return replace(made, strikes=_with_values(made.strikes, hit, strike))


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
    return _with_values(made, row, changed), Planted(name, hits, (line.name,))


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
    return _with_values(made, row, changed), Planted("cable", tuple(hits), (made[row].name,))


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
    return _with_values(made, row, changed), Planted("drop_out", (hit,), (changed.name,))


def _accelerometer(made: Lines, rng: np.random.Generator) -> int:
    rows = [row for row, line in enumerate(made) if line.quantity == "acceleration"]
    return int(rng.choice(rows))


def _starts(scene: Scene) -> list[int]:
    return [int(strike.start_s * scene.rate_hz) for strike in scene.strikes]


def _after(hit: int, scene: Scene, rng: np.random.Generator) -> int:
    """A sample within the first half of the ring-down after a hit."""
    late_s = rng.uniform(0.05, 0.5) * (scene.plan.seconds_per_hit - scene.plan.pre_trigger_s)
    return _starts(scene)[hit] + int(late_s * scene.rate_hz)


def _with_values(made: tuple[T, ...], row: int, changed: T) -> tuple[T, ...]:
    return (*made[:row], changed, *made[row + 1 :])
