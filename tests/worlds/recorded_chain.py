"""From the motion of a point to the numbers in a file: sensor, cable, filter, converter.

In the order of the field: the sensor is turned and hears its other axis; the channel comes late by
its delay; the logger's filter cuts, or does not; hum, drift and noise join on the cable; the clock
runs wrong and shakes; the converter clips and rounds.
"""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from tests.worlds.recorded_motion import coloured

Array = NDArray[np.float64]
G = 9.80665
Filter = Literal["steep", "butterworth", "none"]


@dataclass(frozen=True)
class Wire:
    """One channel: what it adds and takes away, in its own unit (m/s2 or N)."""

    mixing: tuple[float, float]  # of the transverse and the longitudinal motion; a force: (1, 0)
    delay_s: float
    noise_density: float  # white, unit/sqrt(Hz), one-sided
    corner_hz: float  # below it the noise rises as 1/f in power
    hum: float  # amplitude of the mains' line
    drift: float  # size of the slow wandering
    offset: float
    full_scale: float
    gain: float = 1.0


@dataclass(frozen=True)
class Logger:
    """What all channels share."""

    rate_hz: float  # as the file says
    time_base_error: float  # the true rate is rate_hz * (1 + this)
    jitter_s: float
    filter: Filter
    bits: int
    mains_hz: float
    oversampling: int

    @property
    def true_rate_hz(self) -> float:
        return self.rate_hz * (1 + self.time_base_error)

    @property
    def step_s(self) -> float:
        """Of the grid on which motion is computed before the filter."""
        return 1 / (self.true_rate_hz * self.oversampling)


def random_logger(rng: np.random.Generator, rate_hz: float, oversampling: int) -> Logger:
    """Sigma-delta loggers mostly; an analogue filter of 8th order or none in older and cheap ones.

    Clocks: 5 to 50 ppm as crystals are, one in ten 300 ppm (a phone, an uncorrected RC clock).
    """
    kind: Filter = rng.choice(["steep", "butterworth", "none"], p=[0.7, 0.2, 0.1])
    ppm = 300.0 if rng.random() < 0.1 else rng.uniform(5, 50)
    return Logger(
        rate_hz=rate_hz,
        time_base_error=float(ppm * 1e-6 * rng.choice([-1, 1])),
        jitter_s=float(np.exp(rng.uniform(np.log(1e-8), np.log(5e-6)))),
        filter=kind,
        bits=int(rng.choice([16, 24])),
        mains_hz=float(50 * (1 + 4e-4 * rng.standard_normal())),
        oversampling=oversampling,
    )


def random_wires(
    rng: np.random.Generator, logger: Logger, places: int, one_axis: bool
) -> list[Wire]:
    """Accelerometers of `places`, of one or two axes: turned 1 to 5 degrees, 3 % cross-axis."""
    wires = []
    for _ in range(places):
        turn = np.deg2rad(rng.uniform(1, 5)) * rng.choice([-1, 1])
        cross = 0.03 if one_axis else rng.uniform(-0.03, 0.03)
        density = float(np.exp(rng.uniform(np.log(5e-5), np.log(1.5e-3))))
        corner, hum = float(rng.uniform(0.5, 10)), float(np.exp(rng.uniform(-9, -4.5)))
        axes = [(np.cos(turn), np.sin(turn) + cross), (-np.sin(turn) + cross, np.cos(turn))]
        for mixing in axes[: 1 if one_axis else 2]:
            gain = float(1 + 0.01 * rng.standard_normal())
            wires.append(
                Wire(
                    mixing=(float(mixing[0]), float(mixing[1])),
                    delay_s=0.0,
                    noise_density=density,
                    corner_hz=corner,
                    hum=hum * float(rng.uniform(0.5, 1.5)),
                    drift=float(np.exp(rng.uniform(np.log(1e-3), np.log(5e-2)))),
                    offset=float(rng.uniform(-0.3, 0.3)),
                    full_scale=np.inf,
                    gain=gain,
                )
            )
    return _delayed(rng, logger, wires)


def _delayed(rng: np.random.Generator, logger: Logger, wires: list[Wire]) -> list[Wire]:
    """All at once (within 2 us); or one after the other (a multiplexer); or by two modules."""
    count, kind = len(wires), rng.random()
    if kind < 0.6:
        delays = rng.uniform(0, 2e-6, count)
    elif kind < 0.85:
        delays = np.arange(1, count + 1) / (logger.rate_hz * (count + 1))
    else:
        late = float(rng.uniform(1e-4, 2e-3))
        delays = np.where(np.arange(count) >= count / 2, late, 0.0)
    return [replace(w, delay_s=float(d)) for w, d in zip(wires, delays, strict=True)]


def hammer_wire(rng: np.random.Generator) -> Wire:
    """The force channel of an instrumented hammer of 2 to 20 kN range."""
    return Wire(
        mixing=(1.0, 0.0),
        delay_s=0.0,
        noise_density=float(rng.uniform(0.005, 0.05)),
        corner_hz=float(rng.uniform(1, 10)),
        hum=float(rng.uniform(0.02, 0.5)),
        drift=float(rng.uniform(0.1, 2.0)),
        offset=float(rng.uniform(-2, 2)),
        full_scale=np.inf,
        gain=float(1 + 0.01 * rng.standard_normal()),
    )


def filter_gain(logger: Logger, frequency_hz: Array) -> NDArray[np.complex128]:
    """Of the anti-alias filter; the steep one has its delay already taken out."""
    if logger.filter == "steep":
        ramp = (frequency_hz / logger.true_rate_hz - 0.4) / 0.1
        return np.asarray(np.cos(np.pi / 2 * np.clip(ramp, 0, 1)) ** 2 + 0j)
    if logger.filter == "butterworth":
        order, s = 8, 1j * frequency_hz / (0.4 * logger.true_rate_hz)
        poles = np.exp(1j * np.pi * (2 * np.arange(order) + order + 1) / (2 * order))
        return np.asarray(1 / np.prod(s[:, None] - poles, axis=1))
    return np.ones(len(frequency_hz), complex)


def sampled(logger: Logger, wire: Wire, motion: Array, jitter: Array) -> Array:
    """Motion on the fine grid (count * oversampling,) -> what reaches the converter (count,)."""
    frequency = fft.rfftfreq(len(motion), logger.step_s)
    turned = np.exp(-2j * np.pi * frequency * wire.delay_s)
    spectrum = fft.rfft(motion) * filter_gain(logger, frequency) * turned * wire.gain
    kept = fft.irfft(spectrum, len(motion))[:: logger.oversampling]
    slope = fft.irfft(spectrum * 2j * np.pi * frequency, len(motion))[:: logger.oversampling]
    return np.asarray(kept + slope * jitter)


def disturbances(rng: np.random.Generator, logger: Logger, wire: Wire, count: int) -> Array:
    """Noise, hum with its third and fifth harmonic, drift and offset, (count,)."""
    step = 1 / logger.true_rate_hz
    frequency = np.maximum(fft.rfftfreq(count, step), 1 / (count * step))
    density = wire.noise_density * np.sqrt(1 + wire.corner_hz / frequency)
    t = step * np.arange(count)
    hum = np.zeros(count)
    for harmonic, share in ((1, 1.0), (3, 0.3), (5, 0.1)):
        if harmonic * logger.mains_hz < 0.5 * logger.true_rate_hz:
            phase = rng.uniform(0, 2 * np.pi)
            hum += share * np.sin(2 * np.pi * harmonic * logger.mains_hz * t + phase)
    walk = coloured(rng, count, step, np.where(frequency < 0.2, 1 / frequency, 0.0))
    walk *= wire.drift / max(float(np.std(walk)), 1e-300)
    noise = coloured(rng, count, step, density)
    return np.asarray(noise + wire.hum * hum + walk + wire.offset)


def chosen_range(peak: float) -> float:
    """The range that a careful crew sets: 2, 5, 10, 20, 50 ... at least 1.2 times the peak."""
    wanted = 1.2 * max(peak, 1e-9)
    decade = 10.0 ** np.floor(np.log10(wanted))
    return float(next(decade * s for s in (1, 2, 5, 10) if decade * s >= wanted))


def converted(logger: Logger, wire: Wire, voltage: Array) -> Array:
    """Clipped at the full scale, rounded to one step of the converter."""
    step = lsb(logger, wire)
    top = wire.full_scale - step
    return np.asarray(np.clip(np.round(voltage / step) * step, -wire.full_scale, top))


def lsb(logger: Logger, wire: Wire) -> float:
    return float(2 * wire.full_scale / 2**logger.bits)


@dataclass(frozen=True)
class Density:
    """One-sided power density of a trace, unit^2/Hz, at each of its lines."""

    frequency_hz: Array
    power: Array

    def around(self, centre_hz: float, width_hz: float) -> float:
        """The mean in a band, which holds ten lines at least."""
        step = self.frequency_hz[1]
        half = max(width_hz / 2, 5 * step)
        low, high = np.searchsorted(self.frequency_hz, [centre_hz - half, centre_hz + half])
        return float(np.mean(self.power[low:high]))


def density(trace: Array, rate_hz: float) -> Density:
    """A Hann window keeps drift and offset out of the bands of the modes."""
    count = len(trace)
    window = np.hanning(count)
    power = np.abs(fft.rfft((trace - np.mean(trace)) * window)) ** 2
    return Density(
        np.asarray(fft.rfftfreq(count, 1 / rate_hz)),
        np.asarray(power * 2 / (rate_hz * np.sum(window**2))),
    )
