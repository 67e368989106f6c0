"""(A) of the living bridge: the records of its loggers, chunk by chunk in order of arrival.

Each mode is a first-order complex recursion z' = (-zeta w + i w) z + F, exact within blocks of a
second; frequency and damping of a block follow the tension of that second and the amplitude the
mode has reached, so softening, lock-in and passing trains act where they happen.
"""

import heapq
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from tests.worlds.living_physics import (
    DAY_S,
    MODULUS_PER_K,
    PLANES,
    REFERENCE_C,
    Array,
    Bridge,
    Change,
    Hanger,
    Modes,
    bridge,
    lines,
    moment,
    rng,
    seconds,
)

RATE_HZ = 200.0
CHANNELS = ("t1", "l1", "t2", "l2")
BLOCK = 200  # samples
SPLIT = 20  # of a block, for the powers of the pole
DECK_MODES = 5
GUESTS = 6  # modes of the neighbours seen in a record: three of either, each plane


@dataclass(frozen=True)
class Flags:
    """Every nuisance can be switched; `rate` scales how often faults come (1: as in service)."""

    rate: float = 1.0
    # of the world
    wind: bool = True
    lock_in: bool = True
    road: bool = True
    trains: bool = True
    knocks: bool = True
    softening: bool = True
    live_load: bool = True
    leaks: bool = True  # deck and neighbours in the record
    # of the sensors
    noise: bool = True
    resolution: bool = True  # steps and full scale
    mounting: bool = True  # one degree off, gains 1 %
    dead: bool = True
    drift: bool = True  # offset
    swapped: bool = True
    hum: bool = True
    # of the loggers
    clock: bool = True
    steps: bool = True
    lost: bool = True
    doubled: bool = True
    late: bool = True
    outages: bool = True
    temperature: bool = True

    @classmethod
    def none(cls, **on: Any) -> "Flags":
        """Wind, road and tremor on perfect sensors; and what is named."""
        names = [n for n in cls.__dataclass_fields__ if n not in ("rate", "wind", "road")]
        return replace(cls(**dict.fromkeys(names, False)), **on)


def _events(
    seed: int, number: int, what: str, per_day: float, start: float, stop: float, longest: float
) -> list[tuple[float, Array]]:
    """Random moments with six uniforms each, the same whatever the stretch asked for."""
    block, out = 5 * DAY_S, []
    for i in range(int((start - longest) // block), int(stop // block) + 1):
        r = rng(seed, what, number, i + 1000)
        for _ in range(r.poisson(per_day * 5)):
            when, more = (i + r.random()) * block, r.random(6)
            if start - longest <= when < stop:
                out.append((when, more))
    return sorted(out, key=lambda x: x[0])


def _active(
    events: Sequence[tuple[float, Array]], t: float, shortest: float, longest: float
) -> Array | None:
    """The event that lasts at t; lengths are spread evenly on a log scale by its first uniform."""
    for when, more in reversed(events):
        if when <= t < when + shortest * (longest / shortest) ** more[0]:
            return more
    return None


# --------------------------------------------------------------------------------------- bridge


@dataclass(eq=False)
class _Passing:
    """What the whole bridge does during one chunk."""

    road: Array  # (seconds,) level of the deck's motion
    weight: Array  # (seconds,) cars and lorries, mean that of the level
    rumble: Array  # (samples,) level of broad motion by trains
    forced: Array  # (samples,) axle passing, about 1 for a medium train
    flats: Array  # (samples,) m/s2, blows of flat wheels
    deck: Array  # (DECK_MODES, samples) m/s2
    trains: list[tuple[float, float, float, float]]


class _Deck:
    """Traffic and the modes of the deck, carried from chunk to chunk."""

    def __init__(self, b: Bridge, start: float, flags: Flags) -> None:
        self.b, self.flags = b, flags
        self.r = rng(b.seed, "deck", int(start))
        r = rng(b.seed, "deck modes")
        self.hz = np.sort(1.1 * np.cumprod(r.uniform(1.25, 1.75, DECK_MODES)))
        self.zeta = r.uniform(0.006, 0.015, DECK_MODES)
        self.size = r.uniform(0.4, 1.5, DECK_MODES)
        pole = np.exp((-self.zeta + 1j) * 2 * np.pi * self.hz / RATE_HZ)
        self.a = np.stack([np.ones(DECK_MODES), -2 * pole.real, np.abs(pole) ** 2], axis=1)
        self.scale = np.sqrt(4 * self.zeta * 2 * np.pi * self.hz / RATE_HZ)  # to unit variance
        self.zi = np.zeros((DECK_MODES, 2))
        self.cars = np.zeros(1)

    def chunk(self, t: float, n: int) -> _Passing:
        b, r = self.b, self.r
        whole = math.ceil(n / BLOCK)
        s = t + np.arange(whole) + 0.5
        level = b.road(s) if self.flags.road else np.zeros(whole)
        # A car or lorry is on the bridge for some seconds.
        came = r.poisson(0.35 * level) * r.lognormal(-0.5, 1.0, whole)
        smooth, self.cars = lfilter([0.25], [1, -0.75], came, zi=self.cars)
        weight = smooth / 0.35
        x = t + np.arange(n) / RATE_HZ
        rumble, forced, flats = np.zeros(n), np.zeros(n), np.zeros(n)
        trains = b.trains(t - 120, t + n / RATE_HZ) if self.flags.trains else []
        for when, speed, length, size in trains:
            lasts = (length + 130) / speed
            if when + lasts + 4 < t:
                continue
            q = rng(b.seed, "train", int(when * 10) % 2**31)
            ramp = np.clip((x - when) / 2, 0, 1) * np.clip((when + lasts - x) / 2, 0, 1)
            pitch = q.choice([19.0, 23.0, 26.4, 14.5])
            for k in range(1, 11):  # the cars' pitch and its multiples
                a = q.rayleigh(0.5) / math.sqrt(k)
                forced += (
                    a * ramp * size * np.sin(2 * np.pi * k * speed / pitch * x + 6.28 * q.random())
                )
            axle = speed / 2.5
            forced += 0.5 * ramp * size * np.sin(2 * np.pi * axle * x + 6.28 * q.random())
            rumble += ramp * size * q.uniform(6, 18)
            if q.random() < (0.5 if size > 1.5 else 0.12):  # a flat wheel, a blow each turn
                size_of = q.lognormal(math.log(2.0), 1.0)
                turns = np.floor(x * speed / 2.9)
                blow = np.flatnonzero(np.diff(turns, prepend=turns[0]))
                flats[blow] += size_of * ramp[blow] * np.where(turns[blow] % 2 > 0, 1.0, -0.7)
        drive = 0.012 * np.repeat(np.sqrt(0.02 + weight + 0.3 * level), BLOCK)[:n]
        drive = drive + 0.02 * rumble + 3e-4
        drive = drive + 2e-4 * float(b.weather(t, t + 60).of("wind", t)) ** 1.5
        deck = np.empty((DECK_MODES, n))
        for k in range(DECK_MODES):
            push = drive * r.standard_normal(n) + 0.02 * forced
            gain = self.scale[k] * self.size[k]
            deck[k], self.zi[k] = lfilter([gain, -gain], self.a[k], push, zi=self.zi[k])
        level = np.sqrt(level * (0.5 * level + 0.5 * weight))
        return _Passing(level, weight, rumble, forced, flats, deck, trains)


# --------------------------------------------------------------------------------------- hanger


def _powers(rate: Array) -> Array:
    """exp(rate j), j = 1..BLOCK, by an outer product; rate (modes,)."""
    fine = np.exp(rate[:, None] * np.arange(1, SPLIT + 1))
    coarse = np.exp(rate[:, None] * np.arange(0, BLOCK, SPLIT))
    both = coarse.astype(np.complex64)[:, :, None] * fine.astype(np.complex64)[:, None, :]
    return both.reshape(len(rate), BLOCK)


class _Moving:
    """One hanger's motion and sensors, from chunk to chunk."""

    def __init__(
        self, b: Bridge, number: int, start: float, changes: Sequence[Change], flags: Flags
    ) -> None:
        h = b.hangers[number]
        self.b, self.h, self.changes, self.flags = b, h, tuple(changes), flags
        self.r = rng(b.seed, "motion", number, int(start))
        self.electric = rng(b.seed, "electric", number, int(start))
        self.z = np.zeros(2 * h.orders, complex)
        self.low = [np.zeros(2), np.zeros(2)]
        pole = math.exp(-2 * math.pi * 14 / RATE_HZ)
        self.soft_b, self.soft_a = [(1 - pole) ** 2], [1, -2 * pole, pole**2]
        r = rng(b.seed, "leaks", number)
        self.deck_part = 0.15 * r.standard_normal((2, DECK_MODES))
        order = np.arange(DECK_MODES) + 1
        self.deck_part *= np.sin(np.pi * order * h.place)
        self.guest = np.zeros((2, GUESTS), complex)
        self.hum = r.uniform(0, 1, 6)
        self.dead_zero = r.random() < 0.5
        self.offset = 0.15 * r.standard_normal(4)
        self.lines = [
            lines(rng(b.seed, f"offset {c}", number), 6 * 3600.0, 20 * DAY_S, 20) for c in range(4)
        ]
        self.warm = False
        self.known: dict[str, tuple[int, list[tuple[float, Array]]]] = {}

    def _sensing(self, t: float) -> tuple[Array, Array, Array]:
        """Shapes at the places (2 places, 2 planes, orders), angles and gains."""
        h = self.h
        shift, angle, gain = 0.0, np.array(h.mount_rad), h.gain
        for i, c in enumerate(self.changes):
            if c.hanger == h.number and c.kind == "sensor_remounted" and t >= seconds(c.at):
                r = rng(self.b.seed, "remounted", h.number, i)
                shift += c.size
                angle, gain = np.radians(r.standard_normal(2)), 1 + 0.01 * r.standard_normal(4)
        if not self.flags.mounting:
            angle, gain = np.zeros(2), np.ones(4)
        modes = self.b.modes(h.number, self.b.state(h.number, t, self.changes))
        shape = np.stack([modes.shape_at((x + shift) / h.length_m) for x in h.sensors_m])
        return shape, angle, gain

    def _load(self, t: float, n: int, passing: _Passing) -> Array:
        """dT/T0 of trains, cars and lorries, each second."""
        h = self.h
        s = t + np.arange(n) + 0.5
        out = 4e-4 * h.live / 0.04 * passing.weight
        for when, speed, length, size in passing.trains:
            head = (s - when) * speed - 130 * h.place  # metres past the hanger
            covered = np.clip((head + 20) / 40, 0, 1) - np.clip((head - length + 20) / 40, 0, 1)
            out = out + h.live * size * np.maximum(covered, 0)
        return out if self.flags.live_load else 0 * out

    def chunk(self, t: float, n: int, passing: _Passing, dt: float) -> Array:
        """True acceleration at the sensors in their own axes, (4, samples)."""
        b, h, on = self.b, self.h, self.flags
        whole = math.ceil(n / BLOCK)
        padded = whole * BLOCK
        count = 2 * h.orders
        w = b.weather(t, t + 120)
        wind = (
            float(w.of("wind", t)) * math.exp(0.08 * self.r.standard_normal()) if on.wind else 1e-3
        )
        modes = b.modes(h.number, b.state(h.number, t, self.changes))
        load = self._load(t, whole, passing)
        ends = b.frequencies(h.number, [t, t + n / RATE_HZ], self.changes)
        hz = ends[0].ravel()
        modulus = 1 + MODULUS_PER_K * (float(w.of(f"rod{h.row}", t)) - REFERENCE_C)
        ratio = float(b.tension(h.number, [t], self.changes)[0]) / h.tension_n
        still = modes.at(np.array([ratio]), np.array([modulus]))
        lifted = (modes.at(ratio + load, np.full(whole, modulus)) / still).reshape(whole, count)
        omega = 2 * np.pi * hz * lifted  # (seconds, modes)
        omega = omega * np.linspace(1, ends[1].ravel() / hz, whole)

        grid = hz.reshape(2, -1)
        push = b.wind_push(h.number, grid, np.array(wind)).ravel()
        aero = b.aerodynamic(h.number, grid, np.array(wind)).ravel()
        near, locked = (
            x.ravel() for x in b.shedding(h.number, grid, np.array(wind), np.array([t]))
        )
        gust = np.exp(0.25 * self.r.standard_normal(whole))
        calm = 1.0 if on.wind else 0.0

        # Deck: broad motion of the traffic, its modes, axle passing.
        level = np.repeat(passing.road, BLOCK)[:n] + passing.rumble
        base = np.zeros((2, padded))
        for p in (0, 1):
            white = self.r.standard_normal(n) * math.sqrt(RATE_HZ / 2)
            white *= h.road[p] * level + h.tremor[p]
            base[p, :n], self.low[p] = lfilter(self.soft_b, self.soft_a, white, zi=self.low[p])
            base[p, :n] += h.train[p] * passing.forced
            if on.leaks:
                base[p, :n] += self.deck_part[p] @ passing.deck
            base[p, :n] += h.train[p] / 0.04 * passing.flats
        force = self.r.standard_normal((count, padded), dtype=np.float32) * (
            calm * np.sqrt(push * RATE_HZ / 2)[:, None]
        ).astype(np.float32)
        force *= np.repeat(gust, BLOCK).astype(np.float32)
        driven = np.zeros((count, 2))
        for p in (0, 1):
            driven[p * h.orders : (p + 1) * h.orders, p] = -modes.push[p]
        force += driven.astype(np.float32) @ base.astype(np.float32)
        if on.knocks:
            self._knocks(t, n, modes, hz, force)

        if not self.warm:  # as if it had always been swinging
            rms = np.sqrt(push * calm * np.pi * hz / (4 * (h.zeta.ravel() + aero)))
            draw = self.r.standard_normal((2, count)) * rms / (2 * np.pi * hz)
            self.z, self.warm = draw[0] + 1j * draw[1], True
        out = np.empty((count, padded), np.float32)
        soft, rub = h.softening.ravel(), h.rubbing.ravel()
        structural = h.zeta.ravel()
        for i in range(whole):
            amplitude = omega[i] * np.abs(self.z)
            slip = amplitude / (amplitude + h.half_amplitude) if on.softening else 0.0
            zeta = structural + aero + rub * slip
            if on.lock_in:
                zeta = zeta - 1.5 * near * (structural + aero) * (
                    1 - np.minimum((amplitude / locked) ** 2, 2.0)
                )
            o = omega[i] * (1 - soft * slip)
            rate = (-zeta + 1j) * o * dt
            power = _powers(rate)
            cut = slice(i * BLOCK, (i + 1) * BLOCK)
            z = np.cumsum(force[:, cut] / power, axis=1)
            z *= np.float32(dt)
            z += self.z[:, None].astype(np.complex64)
            z *= power
            self.z = z[:, -1].astype(complex)
            c = ((-zeta + 1j) * o) ** 2 / o
            out[:, cut] = (c[:, None].astype(np.complex64) * z).imag

        shape, angle, gain = self._sensing(t)
        c, s = math.cos(h.axis_rad), math.sin(h.axis_rad)
        guests = self._guests(t, whole, passing)[:, :n] if on.leaks else 0.0
        # The deck's force acts at once; that of the wind has no energy above its mode.
        axes = np.array([[c, -s], [s, c]])
        seen = np.empty((4, n))
        for k in (0, 1):
            mix = (axes[:, :, None] * shape[k]).reshape(2, count)
            low = 1 - h.sensors_m[k] / h.length_m
            swing = (
                mix.astype(np.float32) @ out[:, :n] + (mix @ driven + low * np.eye(2)) @ base[:, :n]
            )
            ca, sa = math.cos(angle[k]), math.sin(angle[k])
            seen[2 * k : 2 * k + 2] = np.array([[ca, sa], [-sa, ca]]) @ (swing + guests)
        return np.asarray(seen * gain[:, None])

    def _knocks(
        self, t: float, n: int, modes: Modes, hz: Array, force: NDArray[np.float32]
    ) -> None:
        """Maintenance by day in bursts, birds, stones."""
        b, h = self.b, self.h
        stop = t + n / RATE_HZ
        found = []
        for when, u in _events(b.seed, h.number, "knock", 1.5, t, stop, 0.0):
            found.append((when, 0.05 * 200 ** u[0], u[1], u[2], u[3]))
        for when, _ in _events(b.seed, h.number, "crew", 0.03, t, stop, 1800.0):
            if 7 < (when / 3600) % 24 < 16:
                r = rng(b.seed, "blows", h.number, int(when) % 2**31)
                for _ in range(60):
                    at = when + 1500 * r.random()
                    v = r.random(4)
                    if t <= at < stop:
                        found.append((at, 0.5 * 30 ** v[0], 0.12 * v[1], v[2], v[3]))
        for at, impulse, place, direction, hardness in found:
            i = int((at - t) * RATE_HZ)
            cut = 30 * 6**hardness
            angle = 2 * np.pi * direction
            part = np.array([[math.cos(angle)], [math.sin(angle)]])
            kick = impulse * part * modes.shape_at(place) / modes.mass_kg
            force[:, i] += kick.ravel() * np.exp(-((hz / cut) ** 2)) * RATE_HZ

    def _guests(self, t: float, whole: int, passing: _Passing) -> Array:
        """Modes of the neighbours as they come through the deck: narrow bands of their own."""
        b, h = self.b, self.h
        out = np.zeros((2, whole * BLOCK))
        rms = 0.04 * math.sqrt(0.05 + float(passing.weight.mean())) + 0.2 * float(
            passing.rumble.mean()
        )
        into = np.arange(BLOCK) / BLOCK
        for j, other in enumerate(b.neighbours(h.number)):
            f = b.frequencies(other, [t], self.changes)[0, :, :3]
            zeta = b.hangers[other].zeta[:, :3]
            count = f.shape[1]
            keep = np.exp(-zeta * 2 * np.pi * f)
            own = slice(3 * j, 3 * j + count)
            # Envelope: a complex Ornstein-Uhlenbeck process, a point a second.
            draw = self.r.standard_normal((2, whole, 2, count)) * np.sqrt(1 - keep**2)
            x = np.empty((whole + 1, 2, count), complex)
            x[0] = self.guest[:, own]
            for i in range(whole):
                x[i + 1] = keep * x[i] + draw[0, i] + 1j * draw[1, i]
            self.guest[:, own] = x[-1]
            start = np.exp(2j * np.pi * ((f * (t + np.arange(whole))[:, None, None]) % 1.0))
            wave = np.exp(2j * np.pi * f[:, :, None] * into)
            size = h.leak[:, own] * rms
            for p in (0, 1):
                first = size[p] * start[:, p] * x[:-1, p]
                rise = size[p] * start[:, p] * (x[1:, p] - x[:-1, p])
                out[p] += (first @ wave[p] + rise @ (wave[p] * into)).real.ravel()
        return out

    def sensed(self, t: float, clean: Array) -> NDArray[np.float32]:
        """What the logger writes."""
        h, on, r = self.h, self.flags, self.electric
        n = clean.shape[1]
        x = clean
        if on.noise:
            x = x + r.standard_normal((4, n), dtype=np.float32) * (
                h.noise * math.sqrt(RATE_HZ / 2)
            )[:, None].astype(np.float32)
        if on.drift:
            x = x + (self.offset + 0.04 * np.array([f(t)[0] for f in self.lines]))[:, None]
        if on.hum and self.hum[0] < 0.25:
            s = t % 1000 + np.arange(n) / RATE_HZ
            net = 50 + 0.02 * math.sin(t / 700 + 6 * self.hum[1])
            wave = np.sin(2 * np.pi * net * s) + 0.4 * np.sin(2 * np.pi * (200 - 3 * net) * s)
            x = x + 0.004 * self.hum[2] * np.array([1, 0.6, 0.2, 0.8])[:, None] * wave
        if on.resolution:
            x = np.clip(x, -h.full_scale, h.full_scale)
            step = h.full_scale / 2 ** (h.bits - 1)
            x = np.round(x / step) * step
        if on.dead:
            u = _active(self._faults("dead", 1 / 120, t, 15), t, 0.5 * DAY_S, 15 * DAY_S)
            if u is not None:
                x = np.array(x)
                x[int(4 * u[1])] = 0.0 if u[2] < 0.6 else h.full_scale * (2 * round(u[3]) - 1)
        if on.swapped:
            u = _active(self._faults("swap", 1 / 200, t, 20), t, 2 * DAY_S, 20 * DAY_S)
            if u is not None:
                order = [[1, 0, 2, 3], [2, 3, 0, 1], [0, 1, 3, 2]][int(3 * u[1])]
                x = x[order]
        return np.ascontiguousarray(x, dtype=np.float32)

    def _faults(
        self, what: str, per_day: float, t: float, days: float
    ) -> list[tuple[float, Array]]:
        hour = int(t // 3600)
        if what not in self.known or self.known[what][0] != hour:
            rate, start = per_day * self.flags.rate, hour * 3600.0
            found = _events(
                self.b.seed, self.h.number, what, rate, start, start + 3600, days * DAY_S
            )
            self.known[what] = (hour, found)
        return self.known[what][1]


# --------------------------------------------------------------------------------------- logger


class _Logger:
    """Clock, thermometer and line of one hanger."""

    def __init__(self, b: Bridge, h: Hanger, flags: Flags) -> None:
        self.b, self.h, self.flags = b, h, flags
        r = rng(b.seed, "logger", h.number)
        self.synchronised = r.random() < 0.6  # daily; the others run free
        self.first = r.normal(0, 0.5)
        self.late_by = r.uniform(0.5, 3.0)

    def faults(self, what: str, per_day: float, t: float, longest: float) -> list[Any]:
        rate = per_day * self.flags.rate
        return _events(self.b.seed, self.h.number, what, rate, t - 1, t + 3700, longest)

    def offset(self, t: float) -> float:
        """The logger's clock less the truth, s."""
        if not self.flags.clock:
            return 0.0
        last = (t - 3600 * 3) // DAY_S * DAY_S + 3600 * 3 if self.synchronised else None
        if last is None:
            last = t // (30 * DAY_S) * (30 * DAY_S)  # somebody sets it once a month
        out = self.h.ppm * 1e-6 * (t - last) + (0.02 if self.synchronised else 1.0) * self.first
        if self.flags.steps:
            rate = 0.1 * self.flags.rate
            for when, u in _events(self.b.seed, self.h.number, "step", rate, last, t, 0.0):
                if last <= when < t:
                    out += 3600.0 if u[0] < 0.03 else (2 * u[1] - 1) * 0.1 * 30 ** u[2]
        return out

    def temperature(self, t: float, r: np.random.Generator) -> float | None:
        w = self.b.weather(t, t + 120)
        air = float(w.of("air", t))
        value = air + 0.4 * (float(w.of(f"rod{self.h.row}", t)) - air)
        if not self.flags.temperature:
            return value
        if (
            _active(self.faults("no temperature", 1 / 100, t, 10 * DAY_S), t, DAY_S, 10 * DAY_S)
            is not None
        ):
            return None
        off = _active(self.faults("off by", 1 / 200, t, 60 * DAY_S), t, 5 * DAY_S, 60 * DAY_S)
        value += 0.1 * r.standard_normal() + (1.5 if off is not None else 0.0)
        return round(value, 1)


def raw(
    seed: int,
    hangers: int | Sequence[int] = 20,
    start: datetime | None = None,
    hours: float = 1.0,
    changes: Sequence[Change] = (),
    chunk_s: float = 60.0,
    flags: Flags | None = None,
    count: int | None = None,
) -> Iterator[dict[str, Any]]:
    """Chunks of the hangers (a number: that many make the bridge) in order of arrival."""
    if start is None:
        start = datetime.fromisoformat("2026-05-04T06:00:00+00:00")
    on = flags or Flags()
    wanted = list(range(1, hangers + 1)) if isinstance(hangers, int) else list(hangers)
    standing = count or (hangers if isinstance(hangers, int) else max(20, *wanted))
    b = bridge(seed, standing)
    begin, n = seconds(start), round(chunk_s * RATE_HZ)
    if n % BLOCK:
        raise ValueError("chunk_s is a whole number of seconds")
    deck = _Deck(b, begin, on)
    moving = {h: _Moving(b, h, begin, changes, on) for h in wanted}
    loggers = {h: _Logger(b, b.hangers[h], on) for h in wanted}
    net = {h: rng(seed, "net", h, int(begin)) for h in wanted}
    sequence = dict.fromkeys(wanted, 0)
    waiting: list[tuple[float, int, dict[str, Any]]] = []
    ticket = 0
    windy = rng(seed, "anemometer", int(begin))
    for k in range(math.ceil(hours * 3600 / chunk_s)):
        t = begin + k * chunk_s
        passing = deck.chunk(t, n)
        w = b.weather(t, t + 120)
        blown: float | None = round(
            float(w.of("wind", t)) * math.exp(0.1 * windy.standard_normal()), 1
        )
        if (
            _active(
                _events(seed, 0, "no wind", 0.01 * on.rate, t, t + 1, 4 * DAY_S), t, 3600, 4 * DAY_S
            )
            is not None
            and on.temperature
        ):
            blown = None
        for h in wanted:
            logger, r, hanger = loggers[h], net[h], b.hangers[h]
            real = 1 / (RATE_HZ * (1 + (hanger.ppm * 1e-6 if on.clock else 0.0)))
            clean = moving[h].chunk(t, n, passing, real)
            values = moving[h].sensed(t, clean)
            luck = r.random(6)
            warm = logger.temperature(t, r)
            chunk = {
                "stream": f"h{h:02d}",
                "hanger": h,
                "sequence": sequence[h],
                "time": moment(t + logger.offset(t)).isoformat(timespec="milliseconds"),
                "sampling_rate_hz": RATE_HZ,
                "channels": list(CHANNELS),
                "values": values,
                "temperature_c": warm,
                "wind_m_s": blown,
            }
            sequence[h] += 1
            arrives = t + chunk_s + logger.late_by * (0.5 + luck[0])
            if on.outages:
                cut = logger.faults("outage", 0.15, t, 8 * 3600.0)
                for when, u in cut:
                    until = when + 600.0 * 48 ** u[0]
                    if when <= t < until:
                        if u[1] < 0.4 or until - t > 4 * 3600:  # no memory, or only for 4 h
                            arrives = math.inf
                        else:
                            arrives = until + 5 + (t - when) / 40
                        if u[1] < 0.2 and t + chunk_s >= until:
                            sequence[h] = 0  # it was the logger that had failed
            if on.late and luck[1] < 0.004 * on.rate:
                arrives += 20 * 60 ** luck[2]
            if on.lost and luck[3] < 0.002 * on.rate:
                arrives = math.inf
            if math.isfinite(arrives):
                heapq.heappush(waiting, (arrives, ticket, chunk))
                ticket += 1
                if on.doubled and luck[4] < 0.002 * on.rate:
                    again = arrives + 1 + 120 * luck[5]
                    heapq.heappush(waiting, (again, ticket, {**chunk, "values": values.copy()}))
                    ticket += 1
        while waiting and waiting[0][0] <= t + chunk_s:
            yield heapq.heappop(waiting)[2]
    while waiting:
        yield heapq.heappop(waiting)[2]


def describe(
    seed: int, hangers: int | Sequence[int] = 20, count: int | None = None
) -> list[dict[str, Any]]:
    """What an owner would write, from drawings and a tape: near the truth, not it."""
    wanted = list(range(1, hangers + 1)) if isinstance(hangers, int) else list(hangers)
    b = bridge(seed, count or (hangers if isinstance(hangers, int) else max(20, *wanted)))
    out = []
    for number in wanted:
        h, r = b.hangers[number], rng(seed, "drawing", number)
        nominal = round(h.diameter_m * 200) / 200
        fill = 1.0 if h.kind == "rod" else 0.86
        area = fill * math.pi * nominal**2 / 4
        inertia = fill * math.pi * nominal**4 / 64
        out.append(
            {
                "id": number,
                "stream": f"h{number:02d}",
                "kind": h.kind,
                "length_m": round(
                    h.length_m * (1 + 0.001 * r.standard_normal()) + 0.008 * r.standard_normal(), 3
                ),
                "diameter_m": nominal,
                "area_m2": area,
                "second_moment_m4": inertia,
                "mass_kg_m": (7850.0 if h.kind == "rod" else 83e3 / 9.81) * area,
                "elastic_modulus_pa": 2.1e11 if h.kind == "rod" else 1.6e11,
                "density_kg_m3": 7850.0 if h.kind == "rod" else 83e3 / 9.81,
                "nominal_tension_n": float(
                    round(h.tension_n * math.exp(0.06 * r.standard_normal()), -3)
                ),
                "sensor_mass_kg": 0.2,
                "sensors": [
                    {
                        "channel": c,
                        "plane": PLANES[i % 2],
                        "x_m": round(h.sensors_m[i // 2] + 0.01 * q, 2),
                    }
                    for (i, c), q in zip(
                        enumerate(CHANNELS), r.standard_normal(2).repeat(2), strict=True
                    )
                ],
            }
        )
    return out


def truth(
    seed: int,
    hangers: int | Sequence[int],
    times: Sequence[datetime],
    changes: Sequence[Change] = (),
    count: int | None = None,
) -> dict[int, dict[str, Any]]:
    """Per hanger tension (times,) without live load and frequencies by plane (times, orders)."""
    wanted = list(range(1, hangers + 1)) if isinstance(hangers, int) else list(hangers)
    b = bridge(seed, count or (hangers if isinstance(hangers, int) else max(20, *wanted)))
    t = np.array([seconds(x) for x in times])
    out = {}
    for number in wanted:
        f = b.frequencies(number, t, changes)
        h = b.hangers[number]
        out[number] = {
            "tension_n": b.tension(number, t, changes),
            "frequency_hz": {p: f[:, i] for i, p in enumerate(PLANES)},
            "damping_ratio": {p: h.zeta[i] for i, p in enumerate(PLANES)},
            "axis_rad": h.axis_rad,
            "length_m": h.length_m,
            "area_m2": h.area_m2,
            "bending_nm2": h.bending_nm2,
            "mass_kg_m": h.mass_kg_m,
            "springs_nm": dict(zip(PLANES, h.springs_nm, strict=True)),
        }
    return out
