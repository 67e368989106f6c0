"""Steady vibration that is there whether the hammer hits or not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from shm.simulate.disturbances.base import Lines, Planted, Scene
from shm.simulate.logger import Line
from shm.values import FloatArray

_MAINS_HZ = 50.0
_MAINS_ORDERS = (1, 2, 3, 5)
_MACHINE_HZ = (8.0, 80.0)
_NEAR_MAINS_HZ = 3.0


def mains(made: Lines, scene: Scene, rng: np.random.Generator) -> tuple[Lines, Planted]:
    """The grid's 50 Hz and harmonics hum in all cables, the hammer's too."""
    frequency_hz = _MAINS_HZ + rng.uniform(-0.05, 0.05)
    changed = tuple(
        replace(line, values=line.values + _hum(line, frequency_hz, scene.rate_hz, rng))
        for line in made
    )
    return changed, Planted("mains", (), tuple(line.name for line in made), frequency_hz)


def _hum(line: Line, frequency_hz: float, rate_hz: float, rng: np.random.Generator) -> FloatArray:
    share = rng.uniform(0.02, 0.05) if line.quantity == "force" else rng.uniform(0.05, 0.2)
    hum = np.zeros(len(line.values))
    for order in _MAINS_ORDERS:
        if order * frequency_hz < 0.4 * rate_hz:
            height = 1.0 if order == 1 else rng.uniform(0.1, 0.5)
            hum += height * _sine(len(hum), order * frequency_hz / rate_hz, rng.uniform(0, 1))
    return np.asarray(share * float(np.std(line.values)) * hum)


def machine(made: Lines, scene: Scene, rng: np.random.Generator) -> tuple[Lines, Planted]:
    """A machine on the bridge shakes all accelerometers at one frequency, not the mains'."""
    frequency_hz = _MAINS_HZ
    while abs(frequency_hz - _MAINS_HZ) < _NEAR_MAINS_HZ:
        frequency_hz = rng.uniform(_MACHINE_HZ[0], min(_MACHINE_HZ[1], 0.35 * scene.rate_hz))
    names = tuple(line.name for line in made if line.quantity == "acceleration")
    phase = rng.uniform(0, 1)
    level = max(float(np.std(line.values)) for line in made if line.name in names)
    changed = tuple(
        replace(line, values=line.values + level * rng.uniform(0.05, 0.2) * _sine(
            len(line.values), frequency_hz / scene.rate_hz, phase))
        if line.name in names else line
        for line in made
    )  # fmt: skip
    return changed, Planted("machine", (), names, frequency_hz)


def _sine(samples: int, turns_a_sample: float, phase: float) -> FloatArray:
    return np.asarray(np.sin(2 * np.pi * (turns_a_sample * np.arange(samples) + phase)))
