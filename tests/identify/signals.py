"""Recordings made of modes that are stated one by one: what is planted is known exactly."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from shm.values import Channel, FloatArray, Plane, Recording, ResponsePoint

PULSE_S = 0.004


@dataclass(frozen=True)
class Planted:
    """One mode: its shape at each sensor channel, and how a hit drives it (modal mass 1 kg)."""

    frequency_hz: float
    damping_ratio: float
    shape: tuple[float, ...]
    drive: float = 1.0


@dataclass(frozen=True)
class Sensor:
    plane: Plane | None = "transverse"
    x_m: float = 1.0


BIAXIAL = (Sensor("transverse", 2.0), Sensor("longitudinal", 2.0))


def half_sine(rate_hz: float, peak_n: float, seconds: float = PULSE_S) -> FloatArray:
    samples = max(2, round(seconds * rate_hz))
    return np.asarray(peak_n * np.sin(np.pi * (np.arange(samples) + 0.5) / samples))


def force_signal(
    starts: Sequence[int], samples: int, rate_hz: float, peaks_n: Sequence[float]
) -> FloatArray:
    force = np.zeros(samples)
    for start, peak in zip(starts, peaks_n, strict=True):
        pulse = half_sine(rate_hz, peak)
        force[start : start + len(pulse)] += pulse
    return force


def response(modes: Sequence[Planted], force: FloatArray, rate_hz: float) -> FloatArray:
    """Accelerations (channels, samples): each pole by its exact recursion, force by trapezia."""
    total = np.zeros((len(modes[0].shape), len(force)))
    for mode in modes:
        omega = 2 * np.pi * mode.frequency_hz
        damped = omega * np.sqrt(1 - mode.damping_ratio**2)
        pole = -mode.damping_ratio * omega + 1j * damped
        step = np.exp(pole / rate_hz)
        push = mode.drive * force
        state = lfilter(np.array([1, step]) / (2 * rate_hz), [1, -step], push.astype(complex))
        total += np.outer(mode.shape, np.imag(pole**2 * state) / damped + push)
    return total


def recording(
    modes: Sequence[Planted],
    sensors: Sequence[Sensor] = BIAXIAL,
    *,
    hits: int = 5,
    seconds: float = 8.0,
    rate_hz: float = 1024.0,
    noise: float = 0.0,
    lead_s: float = 0.3,
    seed: int = 0,
) -> Recording:
    """`hits` hits, one a slot of `seconds`; `noise` is a standard deviation in m/s^2."""
    rng = np.random.default_rng(seed)
    slot = round(seconds * rate_hz)
    starts = [round(lead_s * rate_hz) + hit * slot for hit in range(hits)]
    force = force_signal(starts, hits * slot, rate_hz, rng.uniform(1500, 2500, hits))
    accelerations = response(modes, force, rate_hz)
    accelerations += noise * rng.standard_normal(accelerations.shape)
    force = force + 0.2 * rng.standard_normal(len(force))
    return as_recording(force, accelerations, rate_hz, sensors)


def as_recording(
    force: FloatArray,
    accelerations: FloatArray,
    rate_hz: float,
    sensors: Sequence[Sensor] = BIAXIAL,
) -> Recording:
    channels = [Channel("force", "force", force)]
    for number, (sensor, values) in enumerate(zip(sensors, accelerations, strict=True), 1):
        channels.append(Channel(f"acc_{number}", "acceleration", values, sensor.plane, sensor.x_m))
    return Recording("test.csv", tuple(channels), rate_hz)


def points(sensors: Sequence[Sensor]) -> tuple[ResponsePoint, ...]:
    return tuple(ResponsePoint(f"acc_{n}", s.plane, s.x_m) for n, s in enumerate(sensors, 1))


def hanger_modes(skew_deg: float = 0.0) -> list[Planted]:
    """Four modes a plane of a hanger, 0.5 to 3 % apart, seen by one biaxial sensor."""
    cosine, sine = np.cos(np.radians(skew_deg)), np.sin(np.radians(skew_deg))
    transverse = [(6.0, 0.002), (13.5, 0.003), (23.0, 0.001), (34.5, 0.004)]
    longitudinal = [(6.18, 0.003), (13.7, 0.002), (23.115, 0.002), (34.9, 0.003)]
    return [
        *(Planted(f, z, (cosine, sine)) for f, z in transverse),
        *(Planted(f, z, (-sine, cosine), 0.8) for f, z in longitudinal),
    ]
