"""Sound bars with ends alike in both planes, hit askew: accelerations of two-axis sensors.

Planes differ by what a workshop leaves: ends by up to 3 %, bending stiffness by up to 0.6 % to
either side, in axes that are those of the sensors or lie anywhere. So modes come in pairs 0 to
0.6 % apart, which no hit tells apart. Sensors are turned by a degree and off by 0.5 % (both
standard deviations); the first may be turned by more. The motion is the sum of the modes of `bars`,
driven by half sines.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tests.worlds.bars import Bar, cowper, solve_modes

Array = NDArray[np.float64]
MODULUS_PA, DENSITY_KG_M3, RATE_HZ = 2.1e11, 7850.0, 512.0
SECONDS, HITS, SENSORS, MODES = 16.0, 5, 3, 30


@dataclass(frozen=True)
class RoundBar:
    """What is true of a bar, and what its sensors hear of it.

    `acceleration_m_s2` (2, sensors, samples) and `force_n` (samples,) hold all hits in a row.
    """

    length_m: float
    diameter_m: float
    tension_n: float
    places_m: Array
    hammer_m: float
    acceleration_m_s2: Array
    force_n: Array


def make_bar(seed: int, turned_deg: float = 0.0) -> RoundBar:
    """Return the bar of a seed with its record; those of odd seeds have axes of their own.

    The first sensor is turned by `turned_deg` beside its error.
    """
    rng = np.random.default_rng(seed)
    diameter_m, length_m = rng.uniform(0.05, 0.11), rng.uniform(6, 16)
    area = math.pi * diameter_m**2 / 4
    tension_n = rng.uniform(40e6, 160e6) * area
    bending = MODULUS_PA * math.pi * diameter_m**4 / 64
    usual = 4 * bending / length_m + math.sqrt(bending * tension_n)
    springs = usual * 10 ** rng.uniform(-0.5, 1.2, 2)
    apart = 10 ** rng.uniform(-4, -1.5)
    axes = rng.uniform(0, math.pi) if seed % 2 else 0.0
    oval = rng.uniform(0, 0.006)
    bars = [
        Bar(
            length_m,
            tension_n,
            bending * (1 + side * oval),
            DENSITY_KG_M3 * area,
            shear_stiffness_n=cowper() * MODULUS_PA / 2.6 * area,
            rotary_inertia_kg_m=DENSITY_KG_M3 * bending / MODULUS_PA,
            rotation_n_m_rad=tuple(springs * (1 + apart * rng.standard_normal(2))),
        )
        for side in (-1, 1)
    ]
    places_m = np.sort(rng.uniform(0.08, 0.45, SENSORS)) * length_m
    hammer_m = float(rng.uniform(0.1, 0.3) * length_m)
    force, moved = _hit(rng, bars, np.append(places_m, hammer_m), axes)
    heard = _sensed(rng, moved, turned_deg)
    return RoundBar(length_m, diameter_m, tension_n, places_m, hammer_m, heard, force)


def _hit(
    rng: np.random.Generator, bars: list[Bar], at_m: Array, axes: float
) -> tuple[Array, Array]:
    """Return the force (samples,) and the motion (2, sensors, samples) in the sensors' axes."""
    count, aim = int(RATE_HZ * SECONDS), math.radians(rng.uniform(15, 75))
    damping = 10 ** rng.uniform(-3.3, -2.5)
    hz: Array = np.asarray(np.fft.rfftfreq(2 * count, 1 / RATE_HZ), dtype=np.float64)
    gains = [_gain(bar, at_m, damping * (1, 1.3)[plane], hz) for plane, bar in enumerate(bars)]
    direction = np.array([[math.cos(axes), -math.sin(axes)], [math.sin(axes), math.cos(axes)]])
    forces, motions = [], []
    for _ in range(HITS):
        angle = aim + math.radians(6) * rng.standard_normal() - axes
        since_s = np.arange(count) / RATE_HZ - rng.uniform(0.5, 0.7)
        lasts_s, impulse = rng.uniform(0.004, 0.007), rng.uniform(3, 9)
        on = (since_s >= 0) & (since_s < lasts_s)
        pulse = np.where(on, np.sin(np.pi * since_s / lasts_s), 0.0)
        pulse *= impulse * RATE_HZ / pulse.sum()
        driven = np.fft.rfft(pulse, 2 * count)
        own = [
            part * np.fft.irfft(gain * driven, 2 * count)[:, :count]
            for part, gain in zip((math.cos(angle), math.sin(angle)), gains, strict=True)
        ]
        forces.append(pulse)
        motions.append(np.einsum("ap,psn->asn", direction, np.array(own)))
    return np.concatenate(forces), np.concatenate(motions, axis=2)


def _gain(bar: Bar, at_m: Array, damping: float, hz: Array) -> NDArray[np.complex128]:
    """Return acceleration over force (sensors, frequencies); the last place is the hammer's."""
    modes = solve_modes(bar, MODES, at_m.tolist())
    s = 2j * np.pi * hz
    found = np.zeros((len(at_m) - 1, len(hz)), dtype=np.complex128)
    for mode in np.flatnonzero(modes.frequencies_hz < RATE_HZ / 2):
        omega = 2 * np.pi * modes.frequencies_hz[mode]
        answer = s**2 / (s**2 + 2 * damping * omega * s + omega**2)
        found += np.outer(modes.shapes[:-1, mode] * modes.shapes[-1, mode], answer)
    return found


def _sensed(rng: np.random.Generator, moved: Array, turned_deg: float) -> Array:
    """Return what sensors hear that are a little turned, off and noisy."""
    turn = math.radians(1) * rng.standard_normal((moved.shape[1], 1))
    turn[0] += math.radians(turned_deg)
    heard = np.stack(
        [
            np.cos(turn) * moved[0] - np.sin(turn) * moved[1],
            np.sin(turn) * moved[0] + np.cos(turn) * moved[1],
        ]
    )
    heard *= 1 + 0.005 * rng.standard_normal((*moved.shape[:2], 1))
    noise = 10 ** rng.uniform(-2.5, -1.3)
    return np.asarray(heard + noise * rng.standard_normal(moved.shape))
