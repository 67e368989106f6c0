"""Check that signals can be what their channels state: "right unit?", "right channel?".

A hit's impulse J (N s) over the velocity v (m/s) with which the hanger swings right after it is a
mass: v is that of some N modes, each J/(M/2) times its shape at hammer and sensor, so that J/v is
close to the hanger's mass M, whatever tension and ends. A unit that is wrong by 1000 puts it at
grams or kilotonnes. A hammer's signal is over when it has left the bar, an accelerometer's rings
on.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from shm.identify.measuring.hits import Pulse, find_pulses
from shm.values import NAN, Channel, FloatArray, Hanger, Recording

# judgement, a factor of ten beyond what is usual:
PEAK_FORCE_N = 10.0, 50e3
PEAK_ACCELERATION_M_S2 = 1e-3, 1e4
"""From a tap with a pencil to a sledge; from the noise of a seismic sensor to a shock sensor."""

MASS_OVER_DESCRIBED = 0.02, 50.0
"""J/v over the hanger's mass: 0.3 to 2.7 in 120 tests of tests/benchmarks/right_signals.py, widened
by more than 15 for sensors near a node, hits that slip and parts that nobody described."""

SENSORS_APART = 100.0
"""Factor between the velocities of sensors of one plane, at places that a crew reaches."""

RINGS_MORE = 2.0
"""Factor of the ringing after the largest excursion: of accelerometers 4.9 times and more that
of a hammer, double hits included (40 tests of tests/benchmarks/right_signals.py)."""

# judgement: from where the softest pulse is over, for some periods of the first mode; the band of
# hangers' modes that carry velocity. tests/benchmarks/right_signals.py counts what comes of them
_AFTER_S, _RING_S = 0.02, 0.5
_LOWEST_HZ, _HIGHEST_HZ = 2.0, 200.0


@dataclass(frozen=True)
class SignalDoubt:
    """That a channel is not what it says; `text` is for a person."""

    kind: Literal["unit", "channels"]
    channel: str
    text: str


def signal_doubts(
    records: Sequence[Recording], hanger: Hanger | None = None
) -> tuple[SignalDoubt, ...]:
    """Return what is doubtful in the records of one test; empty without hits.

    g for m/s^2, a factor of 9.81, holds no test: no tension depends on it; the check `gain`
    warns.
    """
    found: dict[tuple[str, str], SignalDoubt] = {}
    for record in records:
        swapped = _not_a_hammer(record)
        for doubt in swapped or _units(record, hanger):
            found.setdefault((doubt.kind, doubt.channel), doubt)
    return tuple(found.values())


def apparent_mass_kg(record: Recording) -> float:
    """Return J/v by the sensor that moves most, the median over the hits; NaN without hits."""
    velocities = _velocities(record)
    fastest = max(velocities[np.isfinite(velocities)], default=NAN)
    if math.isnan(fastest):
        return NAN
    return 1 / float(fastest) if fastest > 0 else math.inf


def _units(record: Recording, hanger: Hanger | None) -> list[SignalDoubt]:
    doubts = list(_unlike_its_neighbours(record)) or [
        doubt for channel in record.channels if (doubt := _outside_bounds(channel))
    ]
    if doubts or record.force is None or hanger is None:
        return doubts
    mass_kg = apparent_mass_kg(record)
    usual = hanger.mass_per_length_kg_m * hanger.length_m
    low, high = (usual * each for each in MASS_OVER_DESCRIBED)
    if math.isnan(mass_kg) or low <= mass_kg <= high:
        return []
    times = max(mass_kg / usual, usual / mass_kg)
    side = "less" if mass_kg > usual else "more"
    text = (
        f"The hanger moves {times:.2g} times {side} for the force than by its description: "
        f"right units and sensitivities of {record.force.name} and the accelerometers?"
    )
    return [SignalDoubt("unit", record.force.name, text)]


def _outside_bounds(channel: Channel) -> SignalDoubt | None:
    force = channel.quantity == "force"
    low, high = PEAK_FORCE_N if force else PEAK_ACCELERATION_M_S2
    values = channel.values[np.isfinite(channel.values)]
    peak = float(np.abs(values - np.median(values)).max(initial=0.0)) if len(values) else 0.0
    if low <= peak <= high or peak == 0:  # a dead channel is another check's
        return None
    what, unit = ("hammer hits", "N") if force else ("a hit hanger", "m/s^2")
    text = (
        f"{channel.name} peaks at {peak:.3g} {unit}, {'below' if peak < low else 'above'} what "
        f"{what} give ({low:g} to {high:g} {unit}): right unit and sensitivity?"
    )
    return SignalDoubt("unit", channel.name, text)


def _unlike_its_neighbours(record: Recording) -> Iterator[SignalDoubt]:
    """Yield sensors that move 100 times as much, or as little, as all others of their plane."""
    velocities, channels = _velocities(record), record.accelerations
    for row, channel in enumerate(channels if len(velocities) else ()):
        rest = [
            velocities[n]
            for n, c in enumerate(channels)
            if n != row and c.plane == channel.plane and np.isfinite(velocities[n])
        ]
        if not rest or not velocities[row] > 0 or min(rest) == 0:
            continue
        above, below = velocities[row] / max(rest), min(rest) / velocities[row]
        if max(above, below) > SENSORS_APART:
            text = (
                f"{channel.name} moves {max(above, below):.2g} times "
                f"{'more' if above > below else 'less'} than the other sensors of its plane: right "
                "unit and sensitivity?"
            )
            yield SignalDoubt("unit", channel.name, text)


def _velocities(record: Recording) -> FloatArray:
    """Return the velocity for an impulse of 1 N s (channels,), rms over 0.5 s after a hit.

    The median over the hits after which a channel has samples, NaN without; empty without hits.
    """
    force = record.force
    pulses = [] if force is None else find_pulses(force.values, record.sampling_rate_hz)
    rows = np.array([_velocity(record, pulse) for pulse in pulses])
    known = [column[np.isfinite(column)] for column in rows.T]
    return np.array([np.median(column) if len(column) else NAN for column in known])


def _velocity(record: Recording, pulse: Pulse) -> FloatArray:
    rate, force = record.sampling_rate_hz, record.force
    assert force is not None
    push = force.values[pulse.start : pulse.end]
    impulse = abs(float(np.nansum(push - np.nanmedian(force.values)))) / rate
    first = pulse.end + int(_AFTER_S * rate)
    rings = np.array([c.values[first : first + int(_RING_S * rate)] for c in record.accelerations])
    known = np.isfinite(rings).any(axis=1)
    velocity = np.full(len(rings), NAN)
    if not known.any() or impulse == 0:
        return velocity
    rings = rings[known]
    rest = np.nan_to_num(rings - np.nanmean(rings, axis=1, keepdims=True))
    samples = rest.shape[1]
    lines = np.fft.rfft(rest * np.hanning(samples), axis=1)
    hz = np.fft.rfftfreq(samples, 1 / rate)
    band = (hz >= _LOWEST_HZ) & (hz <= min(_HIGHEST_HZ, 0.4 * rate))
    power = (np.abs(lines[:, band] / (2 * np.pi * hz[band])) ** 2).sum(axis=1)
    # Parseval, and 3/8 of the power that a Hann window lets through.
    velocity[known] = np.sqrt(2 * power / samples**2 / 0.375) / impulse
    return velocity


def _not_a_hammer(record: Recording) -> list[SignalDoubt]:
    """Return doubts where the force channel rings on longer than an accelerometer."""
    force, rate = record.force, record.sampling_rate_hz
    if force is None:
        return []
    share = ringing(force.values, rate)
    least = min(record.accelerations, key=lambda c: ringing(c.values, rate), default=None)
    if least is None or not share > RINGS_MORE * ringing(least.values, rate):
        return []
    text = (
        f"{force.name} rings on after the hits as an accelerometer does, {least.name} is over as a "
        "hammer's force is: right channels?"
    )
    return [SignalDoubt("channels", force.name, text)]


def ringing(values: FloatArray, sampling_rate_hz: float) -> float:
    """Return the rms from 0.02 to 0.5 s after the largest excursion, over it; inf where dead."""
    above = np.nan_to_num(values - np.nanmedian(values)) if np.isfinite(values).any() else values
    peak = int(np.abs(np.nan_to_num(above)).argmax())
    first = peak + int(_AFTER_S * sampling_rate_hz)
    ring = above[first : first + int(_RING_S * sampling_rate_hz)]
    size = float(abs(above[peak]))
    if not len(ring) or not size > 0:
        return math.inf
    return float(np.sqrt(np.mean(ring**2))) / size
