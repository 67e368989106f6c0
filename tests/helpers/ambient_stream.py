"""Ambient motion of a hanger on permanent sensors: modes that white force moves, exactly.

The force is noise of a strength that gusts change; the response to it is multiplied in the
frequency domain, over twice the length, so that no end of the record is felt.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from datetime import UTC, datetime

import numpy as np

from shm.values import FloatArray, Mode, Plane, ShapePoint
from shm.values.stream import Piece, Stream, StreamChannel

RATE_HZ = 200.0
START = datetime(2026, 11, 25, tzinfo=UTC)
LENGTH_M = 12.0
PLACES_M = (2.1, 4.6)


def stream(name: str = "h3") -> Stream:
    channels = tuple(
        StreamChannel(f"{plane[0]}{number}", plane, x_m, 20.0)
        for number, x_m in enumerate(PLACES_M)
        for plane in ("transverse", "longitudinal")
    )
    return Stream(name, 3, RATE_HZ, channels)


@dataclass(frozen=True)
class Motion:
    """What moves: `frequency_hz` and `damping` by (plane, order); `force` (m/s^2)^2/Hz on each."""

    frequency_hz: dict[tuple[Plane, int], float]
    damping: dict[tuple[Plane, int], float]
    force: float = 1e-8
    noise: float = 2e-4
    gusts: float = 0.0
    turned: float = 0.0
    temperature_c: float = 10.0
    extra: dict[str, float] = field(default_factory=dict)

    def scaled(self, factor: float) -> Motion:
        return replace(self, frequency_hz={k: f * factor for k, f in self.frequency_hz.items()})

    def known(self) -> tuple[Mode, ...]:
        return tuple(
            Mode(plane, order, hz, 1e-4 * hz, self.damping[plane, order], shape=tuple(
                ShapePoint(x, float(shape(order, x) / max(abs(shape(order, p)) for p in PLACES_M)))
                for x in PLACES_M
            ))
            for (plane, order), hz in self.frequency_hz.items()
        )  # fmt: skip


def shape(order: int, x_m: float) -> float:
    return float(np.sin(np.pi * order * x_m / LENGTH_M))


def drawn(rng: np.random.Generator, orders: int = 5) -> Motion:
    """A hanger with a first frequency of 3 to 8 Hz, its planes 0.3 to 1 % apart."""
    first, stiff = rng.uniform(3, 8), rng.uniform(0.002, 0.01)
    hz: dict[tuple[Plane, int], float] = {}
    damping: dict[tuple[Plane, int], float] = {}
    for order in range(1, orders + 1):
        base = first * order * np.sqrt(1 + stiff * order**2)
        hz["transverse", order] = base
        hz["longitudinal", order] = base * (1 + rng.uniform(0.003, 0.01))
        for plane in ("transverse", "longitudinal"):
            damping[plane, order] = float(np.exp(rng.uniform(np.log(8e-4), np.log(4e-3))))
    return Motion(hz, damping, turned=rng.uniform(-0.05, 0.05), gusts=rng.uniform(0, 0.5))


def values(motion: Motion, rng: np.random.Generator, seconds: float = 600.0) -> FloatArray:
    """Samples (channels, samples) of `stream()`."""
    wanted = int(seconds * RATE_HZ)
    count = 1 << int(np.ceil(np.log2(2 * wanted)))
    hz = np.fft.rfftfreq(count, 1 / RATE_HZ)
    slow = np.exp(-0.5 * (hz * 60.0) ** 2)
    gust = np.fft.irfft(np.fft.rfft(rng.normal(size=count)) * slow, count)
    strength = np.exp(motion.gusts * gust / gust.std())
    sigma = np.sqrt(motion.force * RATE_HZ / 2)
    both = rng.normal(size=(2, count))
    found = motion.noise * np.sqrt(RATE_HZ / 2) * rng.normal(size=(2 * len(PLACES_M), wanted))
    for (plane, order), f in motion.frequency_hz.items():
        # The planes' forces are of one wind, partly.
        own = 0.6 * both[0] + 0.8 * rng.normal(size=count)
        spectrum = np.fft.rfft(sigma * strength * own)
        response = hz**2 / (f**2 - hz**2 + 2j * motion.damping[plane, order] * f * hz)
        moved = np.fft.irfft(spectrum * response, count)[:wanted]
        inside, across = np.cos(motion.turned), np.sin(motion.turned)
        for place, x_m in enumerate(PLACES_M):
            own_row = 2 * place + (plane == "longitudinal")
            sign = 1 if plane == "transverse" else -1
            found[own_row] += inside * shape(order, x_m) * moved
            found[4 * place + 1 - own_row] += sign * across * shape(order, x_m) * moved
    return found


def piece(samples: FloatArray, start: datetime = START, temperature_c: float = 10.0) -> Piece:
    names = tuple(channel.name for channel in stream().channels)
    return Piece("h3", start, RATE_HZ, names, samples, temperature_c)
