"""Simulate hangers in wind and traffic, where nobody hits and no force is recorded.

One test, or a bridge whose sensors stay for days of wind, traffic, trains and knocks, in chunks.

Each mode is driven by independent impulses at the samples, in a test equally strong in all modes:
white, spatially uncorrelated forces. Sampled so, a mode is an autoregression with the exact pole.

Of a bridge, weather and trains are the same for all its hangers. The strength of the impulses
follows the wind; the states of modes go on from chunk to chunk, so that a stream has no seam. The
tension follows temperature and what is planted, hour by hour.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from datetime import datetime, timedelta

import numpy as np
import scipy

from shm.simulate.modes import make_bar, plane_modes
from shm.simulate.response import Line, PlaneModes, logged, poles_of
from shm.simulate.state import HammerPlan, HangerState, check, spread_places_m
from shm.values import NAN, PLANES, ComplexArray, FloatArray, Hanger, Recording
from shm.values.stream import Chunk, Stream, StreamChannel

_HIGHEST = 0.4  # of the sampling rate: what the logger passes
_ALONG = 401  # places along the hanger at which the largest deflection is looked for


@dataclass(frozen=True)
class AmbientPlan:
    """Define how long ambient motion is recorded, with which sensors and logger.

    `acceleration_m_s2` is the rms value at the sensor and in the plane that move most. The rest
    is as in `HammerPlan`.
    """

    seconds: float = 600.0
    sampling_rate_hz: float = 512.0
    sensors_x_m: tuple[float, ...] = ()
    acceleration_m_s2: float = 0.05
    acceleration_noise_m_s2: float = 0.002
    adc_bits: int = 24
    acceleration_range_m_s2: float = 200.0


def ambient_test(
    hanger: Hanger, state: HangerState, plan: AmbientPlan, rng: np.random.Generator
) -> Recording:
    """Return a recording of `acc_1` (transverse), `acc_2` (longitudinal) and so on, without force.

    Modes up to 0.4 of the sampling rate take part, in steady state from the first sample on.
    Raises UsageError for a state or plan that cannot be.
    """
    listening = _as_one_hit(plan)
    check(hanger, state, listening)
    places = listening.sensor_places_m(hanger)
    modes = plane_modes(make_bar(hanger, state), _HIGHEST * plan.sampling_rate_hz)
    moved = np.array([_moved(hanger, state, each, listening, rng) for each in modes])
    moved *= plan.acceleration_m_s2 / np.sqrt(np.mean(moved**2, axis=2)).max()
    lines = [
        Line(f"acc_{2 * index + number + 1}", "acceleration", moved[number, index], plane, x_m,
             plan.acceleration_noise_m_s2, plan.acceleration_range_m_s2)
        for index, x_m in enumerate(places)
        for number, plane in enumerate(PLANES)
    ]  # fmt: skip
    channels = tuple(logged(line, plan.adc_bits, rng) for line in lines)
    return Recording("simulated", channels, plan.sampling_rate_hz, hanger.id)


def _as_one_hit(plan: AmbientPlan) -> HammerPlan:
    """Return the same sensors and logger over one slot, for what both kinds of test share."""
    return replace(
        HammerPlan(hits=1, sensors_x_m=plan.sensors_x_m, adc_bits=plan.adc_bits),
        seconds_per_hit=plan.seconds,
        sampling_rate_hz=plan.sampling_rate_hz,
        acceleration_noise_m_s2=plan.acceleration_noise_m_s2,
        acceleration_range_m_s2=plan.acceleration_range_m_s2,
    )


def _moved(
    hanger: Hanger, state: HangerState, modes: PlaneModes, plan: HammerPlan,
    rng: np.random.Generator,
) -> FloatArray:  # fmt: skip
    """Return accelerations of a plane under forces of any strength, (sensors, samples)."""
    highest_hz = _HIGHEST * plan.sampling_rate_hz
    seen = modes.at(np.array(plan.sensor_places_m(hanger)))
    ratio = state.damping_ratio + modes.added_damping_ratio
    poles = poles_of(modes.angular_frequency_rad_s, ratio)
    out = np.zeros((len(seen), plan.samples))
    for mode in np.flatnonzero(np.abs(poles) < 2 * math.pi * highest_hz):
        pole = complex(poles[mode])
        state_of_mode = _steady_state(pole / plan.sampling_rate_hz, plan.samples, rng)
        out += np.outer(seen[:, mode], (pole**2 * state_of_mode).imag / pole.imag)
    return out


def _steady_state(exponent: complex, samples: int, rng: np.random.Generator) -> ComplexArray:
    """Return z[k + 1] = exp(exponent) z[k] + a unit normal impulse in steady state, (samples,).

    Before the first sample z has the covariance that the recursion keeps: E|z|^2 = 1/(1 -
    |a|^2) and E z^2 = 1/(1 - a^2), a = exp(exponent).
    """
    factor = np.exp(exponent)
    power, pseudo = 1 / (1 - abs(factor) ** 2), 1 / (1 - factor**2)
    covariance = 0.5 * np.array(
        [[power + pseudo.real, pseudo.imag], [pseudo.imag, power - pseudo.real]]
    )
    real, imaginary = np.linalg.cholesky(covariance) @ rng.standard_normal(2)
    first = factor * (real + 1j * imaginary)
    impulses = rng.standard_normal(samples).astype(complex)
    return np.asarray(scipy.signal.lfilter([1.0], [1.0, -factor], impulses, zi=[first])[0], complex)


_TRAIN_S, _TRAIN_TIMES = 25.0, 8.0
"""judgement: a train of 200 m at 60 km/h on a span of 200 m, and how much louder than calm air."""
_KNOCK_M_S = 0.002
"""judgement: the impulse that a stone leaves in each mode, as modal velocity in sqrt(kg) m/s."""
_CALM_M_S2 = 0.004
"""judgement: rms acceleration of a hanger in a wind of 5 m/s."""


@dataclass(frozen=True)
class Loss:
    """A hanger that loses a fraction of its tension at a moment."""

    hanger: int
    fraction: float
    at: datetime


@dataclass(frozen=True)
class MonitoringPlan:
    """Define the loads and changes of the bridge, and how it is measured.

    `per_kelvin` is the spread over the hangers of how tension follows temperature, as a
    fraction.
    """

    chunk_s: float = 60.0
    trains_a_day: float = 40.0
    knocks_a_day: float = 2.0
    noise_m_s2: float = 3e-4
    per_kelvin: float = 5e-4
    damping_ratio: float = 0.001
    losses: tuple[Loss, ...] = ()


class Weather:
    """Temperature, wind and trains of a bridge at any moment, by its seed alone."""

    def __init__(self, seed: int, plan: MonitoringPlan):
        self._seed, self._plan = seed, plan

    def temperature_c(self, at: datetime) -> float:
        """Return a year of 20 K, a day of 8 K that is warmest at three, and weather of 3 K."""
        day, hour = at.timetuple().tm_yday, at.hour + at.minute / 60
        of_year = -10 * math.cos(2 * math.pi * (day - 20) / 365.25)
        of_day = 4 * math.cos(2 * math.pi * (hour - 15) / 24)
        return 10 + of_year + of_day + 3 * self._wander(at, 24.0, 1)

    def wind_m_s(self, at: datetime) -> float:
        return 5 * math.exp(0.5 * self._wander(at, 6.0, 2))

    def trains(self, start: datetime, seconds: float) -> tuple[float, ...]:
        """Return the times of trains within a stretch, in seconds from its start; none at night."""
        return self._events(start, seconds, self._plan.trains_a_day, 3, at_night=False)

    def knocks(self, start: datetime, seconds: float, hanger: int) -> tuple[float, ...]:
        return self._events(start, seconds, self._plan.knocks_a_day, 100 + hanger, at_night=True)

    def _wander(self, at: datetime, hours: float, kind: int) -> float:
        """Return a smooth course of unit variance with random knots each so many hours."""
        place = at.timestamp() / (3600 * hours)
        knot, share = int(place // 1), place % 1
        before, after = (self._rng(kind, knot + n).standard_normal() for n in (0, 1))
        weight = 0.5 - 0.5 * math.cos(math.pi * share)
        return float(((1 - weight) * before + weight * after) / math.hypot(1 - weight, weight))

    def _events(
        self, start: datetime, seconds: float, a_day: float, kind: int, *, at_night: bool
    ) -> tuple[float, ...]:
        if not at_night and not 5 <= start.hour < 23:
            return ()
        rng = self._rng(kind, int(start.timestamp()))
        a_second = a_day / (86400 if at_night else 18 * 3600)
        return tuple(rng.uniform(0, seconds, rng.poisson(a_second * seconds)))

    def _rng(self, kind: int, number: int) -> np.random.Generator:
        return np.random.default_rng([self._seed, kind, number])


def streamed(
    hanger: Hanger,
    stream: Stream,
    plan: MonitoringPlan,
    start: datetime,
    seconds: float,
    seed: int,
) -> Iterator[Chunk]:
    """Yield the chunks that a logger sends from `start` on; the same seed, the same bridge.

    Raises UsageError where the hanger cannot be simulated.
    """
    weather, bar = Weather(seed, plan), _Ringing(hanger, stream, plan, seed)
    count = round(plan.chunk_s * stream.sampling_rate_hz)
    for number in range(math.ceil(seconds / plan.chunk_s)):
        at = start + timedelta(seconds=number * plan.chunk_s)
        values = bar.moved(at, count, weather)
        values += plan.noise_m_s2 * bar.rng.standard_normal(values.shape)
        yield Chunk(
            stream.name,
            number,
            at,
            stream.sampling_rate_hz,
            tuple(channel.name for channel in stream.channels),
            values.astype(np.float32),
            round(weather.temperature_c(at), 2),
            round(weather.wind_m_s(at), 2),
        )


class _Ringing:
    """A hanger whose modes ring on from chunk to chunk."""

    def __init__(self, hanger: Hanger, stream: Stream, plan: MonitoringPlan, seed: int):
        self.rng = np.random.default_rng([seed, 4, hanger.id])
        self._hanger, self._stream, self._plan = hanger, stream, plan
        self._per_kelvin = plan.per_kelvin * float(self.rng.standard_normal())
        self._hour: datetime | None = None
        self._modes: dict[str, PlaneModes] = {}
        self._states: dict[str, ComplexArray] = {}
        self._largest = 0.0

    def moved(self, at: datetime, count: int, weather: Weather) -> FloatArray:
        """Return accelerations of all channels, (channels, samples), without the logger's noise."""
        self._follow(at, weather)
        rate, channels = self._stream.sampling_rate_hz, self._stream.channels
        strength = self._strength(at, count, weather)
        knocks = weather.knocks(at, count / rate, self._hanger.id)
        out = np.zeros((len(channels), count))
        for plane in PLANES:
            mine = [n for n, channel in enumerate(channels) if channel.plane == plane]
            modes = self._modes[plane]
            seen = modes.at(np.array([channels[n].x_m for n in mine]))
            poles = poles_of(modes.angular_frequency_rad_s, self._plan.damping_ratio)
            for mode in np.flatnonzero(np.abs(poles) < 2 * math.pi * _HIGHEST * rate):
                pushed = strength * self.rng.standard_normal(count)
                for knock in knocks:
                    pushed[min(int(knock * rate), count - 1)] += _KNOCK_M_S
                ringing = self._rung(plane, int(mode), complex(poles[mode]), pushed)
                out[mine] += np.outer(seen[:, mode], ringing)
        return out

    def _follow(self, at: datetime, weather: Weather) -> None:
        """Solve the modes of this hour's tension."""
        hour = at.replace(minute=0, second=0, microsecond=0)
        if hour == self._hour:
            return
        self._hour = hour
        fraction = self._per_kelvin * (weather.temperature_c(hour) - 10)
        fraction -= sum(
            loss.fraction
            for loss in self._plan.losses
            if loss.hanger == self._hanger.id and loss.at <= at
        )
        tension_n = self._hanger.nominal_tension_n * (1 + fraction)
        state = HangerState(tension_n, damping_ratio=self._plan.damping_ratio)
        highest_hz = _HIGHEST * self._stream.sampling_rate_hz
        for index, plane in enumerate(PLANES):
            # No bar is round to the last digit, nor are its ends: planes lie 0.4 % apart.
            apart = 1.0 if plane == PLANES[0] else 1.008
            there = replace(state, tension_n=tension_n * apart)
            modes = plane_modes(make_bar(self._hanger, there), highest_hz)[index]
            count, self._modes[plane] = len(modes.angular_frequency_rad_s), modes
            known = self._states.get(plane, np.zeros(0, complex))
            self._states[plane] = np.resize(np.append(known, np.zeros(count, complex)), count)
        along_m = np.linspace(0, self._hanger.length_m, _ALONG)
        self._largest = float(np.abs(self._modes[PLANES[0]].at(along_m)).max())

    def _strength(self, at: datetime, count: int, weather: Weather) -> FloatArray:
        """Return the excitation at each sample, as sd of the step of modal velocity."""
        rate, plan = self._stream.sampling_rate_hz, self._plan
        lowest = float(self._modes[PLANES[0]].angular_frequency_rad_s[0])
        # A mode driven so has an rms acceleration of w sqrt(rate / (4 z w)) times this.
        unit = lowest * math.sqrt(rate / (4 * plan.damping_ratio * lowest))
        wind = _CALM_M_S2 * (weather.wind_m_s(at) / 5) ** 2
        level = np.full(count, wind / unit / self._largest)
        for train in weather.trains(at, count / rate):
            first = int(train * rate)
            level[first : first + int(_TRAIN_S * rate)] *= _TRAIN_TIMES
        return level

    def _rung(self, plane: str, mode: int, pole: complex, pushed: FloatArray) -> FloatArray:
        """Return the modal acceleration at each sample; the state goes on with the next chunk."""
        factor = np.exp(pole / self._stream.sampling_rate_hz)
        before = self._states[plane][mode]
        states, _ = scipy.signal.lfilter(
            [1.0], [1.0, -factor], pushed.astype(complex), zi=[factor * before]
        )
        self._states[plane][mode] = states[-1]
        return np.asarray((pole**2 * states).imag / pole.imag)


def described_stream(hanger: Hanger, sampling_rate_hz: float = 200.0) -> Stream:
    """Return a stream of two positions with a sensor in each plane, as an owner mounts them."""
    places = spread_places_m(hanger, 2)
    channels = tuple(
        StreamChannel(f"acc_{2 * number + index + 1}", plane, round(x_m, 3), NAN)
        for number, x_m in enumerate(places)
        for index, plane in enumerate(PLANES)
    )
    return Stream(f"hanger{hanger.id:02d}", hanger.id, sampling_rate_hz, channels)
