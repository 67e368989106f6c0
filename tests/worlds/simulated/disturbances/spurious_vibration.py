"""What rings without being a bending mode of the hanger: after a hit, or steadily whether the
hammer hits or not.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from shm.simulate.response import (
    Line,
    Stretch,
    driven_states,
    driven_unit_states,
    poles_of,
    state_of,
)
from shm.values import NAN, PLANES, ComplexArray, FloatArray
from tests.worlds.simulated.disturbances.base import Lines, Motion, Planted, Scene
from tests.worlds.simulated.elements import PlaneModes

_HIGHEST = 0.4  # of the sampling rate: what the logger passes
_DECK_CLEARANCE = 0.03
_DECK_ORDERS = 6
_MAINS_HZ = 50.0
_MAINS_ORDERS = (1, 2, 3, 5)
_MACHINE_HZ = (8.0, 80.0)
_NEAR_MAINS_HZ = 3.0


def harmonic(made: Motion, scene: Scene, rng: np.random.Generator) -> tuple[Motion, Planted]:
    """The mode that deflects most also rings at 2f, at 5 to 30 % of its acceleration.

    Stretching the hanger goes with the square of its deflection, so the part at 2f is made of the
    squared state z^2, which has the pole 2 s: the same damping ratio, the same shape.
    """
    plane, mode, pole = _farthest(made, scene, _HIGHEST / 2 * scene.rate_hz)
    state = _state(made, scene, plane, mode, pole)
    largest = float(np.abs(state).max())
    seen = made.modes[plane].at(np.array(scene.plan.sensor_places_m(scene.hanger)))[:, mode]
    level = rng.uniform(0.05, 0.3) * largest * abs(pole) ** 2 / pole.imag
    added = made.accelerations.copy()
    added[plane] += np.outer(seen, level * (state**2).real / largest**2)
    loudest = float(np.abs(seen).max() * level)
    planted = Planted(
        "harmonic", frequency_hz=2 * abs(pole) / (2 * math.pi), acceleration_m_s2=loudest
    )
    return replace(made, accelerations=added), planted


def deck(made: Motion, scene: Scene, rng: np.random.Generator) -> tuple[Motion, Planted]:
    """A resonance of the deck, of 0.5 to 1.5 % damping, swings the hanger about its arch end."""
    frequency_hz, ratio = _deck_frequency(made, rng), rng.uniform(0.005, 0.015)
    pole = poles_of(np.array([2 * math.pi * frequency_hz]), ratio)
    driven = [driven_unit_states(pole, pulse, scene.rate_hz)[:, 0] for pulse in made.pulses]
    state = _over_all(complex(pole[0]), made, driven, scene)
    length_m = scene.state.effective_length_m(scene.hanger)
    swing = 1 - np.array(scene.plan.sensor_places_m(scene.hanger)) / length_m
    loudest, angle = rng.uniform(0.3, 1.0) * _loudest(made, scene), rng.uniform(0, math.pi / 2)
    course = loudest / swing.max() * state.imag / float(np.abs(state).max())
    added = made.accelerations + np.einsum(
        "p,s,t->pst", [math.cos(angle), math.sin(angle)], swing, course
    )
    planted = Planted("deck", frequency_hz=frequency_hz, acceleration_m_s2=loudest)
    return replace(made, accelerations=added), planted


def _farthest(made: Motion, scene: Scene, below_hz: float) -> tuple[int, int, complex]:
    """Plane, mode and pole of the mode that deflects the sensors most."""
    candidates = [
        (level / omega**2, plane, mode)
        for plane in range(len(PLANES))
        for mode, (omega, level) in enumerate(_levels(made, scene, plane))
        if omega < 2 * math.pi * below_hz
    ]
    _, plane, mode = max(candidates)
    return plane, mode, complex(_poles(made.modes[plane], scene)[mode])


def _poles(modes: PlaneModes, scene: Scene) -> ComplexArray:
    ratio = scene.state.damping_ratio + modes.added_damping_ratio
    return poles_of(modes.angular_frequency_rad_s, ratio)


def _loudest(made: Motion, scene: Scene) -> float:
    """Acceleration in m/s^2 with which the strongest of the lowest modes begins to ring."""
    levels = [_levels(made, scene, plane)[:_DECK_ORDERS, 1] for plane in range(len(PLANES))]
    return float(np.max(levels))


def _levels(made: Motion, scene: Scene, plane: int) -> FloatArray:
    """Angular frequency and acceleration at the best sensor of each mode, (modes, 2)."""
    modes, pulse = made.modes[plane], made.pulses[0]
    omega = modes.angular_frequency_rad_s
    poles = _poles(modes, scene)
    driven = driven_states(poles, modes, PLANES[plane], pulse, scene.rate_hz)
    elapsed = np.arange(len(driven))[:, None] / scene.rate_hz
    impulse = np.abs(np.sum(driven * np.exp(-poles * elapsed), axis=0))
    seen = np.abs(modes.at(np.array(scene.plan.sensor_places_m(scene.hanger)))).max(axis=0)
    return np.column_stack([omega, impulse * seen * omega])


def _state(made: Motion, scene: Scene, plane: int, mode: int, pole: complex) -> ComplexArray:
    modes = made.modes[plane]
    poles = np.full(len(modes.angular_frequency_rad_s), pole)
    driven = [
        driven_states(poles, modes, PLANES[plane], pulse, scene.rate_hz)[:, mode]
        for pulse in made.pulses
    ]
    return _over_all(pole, made, driven, scene)


def _over_all(
    pole: complex, made: Motion, driven: Sequence[ComplexArray], scene: Scene
) -> ComplexArray:
    """A state over the samples of the record."""
    samples = made.accelerations.shape[2]
    begin = min(0, made.pulses[0].first)
    stretch = Stretch(begin, samples, NAN, made.pulses)
    return state_of(pole, stretch, driven, scene.rate_hz)[-begin:]


def _deck_frequency(made: Motion, rng: np.random.Generator) -> float:
    """Among the hanger's lowest, 3 % or more from each where there is such a gap."""
    lowest = [modes.angular_frequency_rad_s[:_DECK_ORDERS] / (2 * math.pi) for modes in made.modes]
    taken = np.concatenate(lowest)
    drawn = np.exp(rng.uniform(np.log(taken.min()), np.log(taken.max()), 100))
    clearance = np.abs(np.log(drawn[:, None] / taken)).min(axis=1)
    clear = np.flatnonzero(clearance > _DECK_CLEARANCE)
    return float(drawn[clear[0] if len(clear) else clearance.argmax()])


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
