"""(B) of the living bridge: hourly pooled readings over years, without records."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tests.worlds.living_physics import (
    DAY_S,
    PLANES,
    YEAR_S,
    Array,
    Bridge,
    Change,
    Hanger,
    bridge,
    lines,
    moment,
    rng,
    seconds,
)

START = datetime(2024, 1, 1, tzinfo=UTC)
ORDERS = 5  # reported at most
WINDOW_S = 600.0
DULLEST = 1.5e-3  # relative sd of one window beyond which an identifier reports nothing
FAINTEST = 4.0  # peak of the mode over the noise floor, likewise


@dataclass(frozen=True)
class HourlyFlags:
    """What separates the readings from the truth; every one is on."""

    scatter: bool = True  # random error, by the Cramer-Rao bound times the factor
    misstated: bool = True  # real sd / stated sd in 0.8 to 1.3; off: 1
    amplitude: bool = True  # joints slip: lower at large amplitude
    wind_bias: bool = True
    live_load: bool = True  # mean tension of road traffic in the windows kept
    swaps: bool = True  # close planes mistaken for each other
    gaps: bool = True  # missing hours and days
    quiet: bool = True  # modes in the noise are not reported; off: they are, with large sd
    clock: bool = True
    temperature: bool = True  # sensor missing, off by 1.5 K, noisy
    outliers: bool = True  # an hour in 2000 pooled a wrong peak


@dataclass(frozen=True, eq=False)
class Hourly:
    """Arrays (hours,) or (hours, 2 planes, orders); NaN is not reported."""

    hanger: int
    time_s: Array  # beginning of the hour, seconds since EPOCH
    frequency_hz: Array
    frequency_sd_hz: Array
    damping_ratio: Array
    level_m_s2: Array
    shape_ratio: Array  # place 2 over place 1
    windows: NDArray[np.int64]  # (hours, 2, orders)
    temperature_c: Array
    wind_m_s: Array
    true_hz: Array  # small amplitude; not for the software under trial
    true_sd_hz: Array
    true_tension_n: Array

    def readings(self) -> list[dict[str, Any]]:
        """What the software sees, an entry per hour with something in it."""
        out = []
        nan = np.isnan
        for i in np.flatnonzero(~nan(self.frequency_hz).all(axis=(1, 2))):
            modes = [
                {
                    "plane": PLANES[p],
                    "order": k + 1,
                    "frequency_hz": float(self.frequency_hz[i, p, k]),
                    "frequency_sd_hz": float(self.frequency_sd_hz[i, p, k]),
                    "damping_ratio": float(self.damping_ratio[i, p, k]),
                    "windows": int(self.windows[i, p, k]),
                    "level_m_s2": float(self.level_m_s2[i, p, k]),
                    "shape_ratio": float(self.shape_ratio[i, p, k]),
                }
                for p, k in np.argwhere(~nan(self.frequency_hz[i])).tolist()
            ]
            warm, wind = float(self.temperature_c[i]), float(self.wind_m_s[i])
            out.append(
                {
                    "hanger": self.hanger,
                    "time": moment(self.time_s[i]),
                    "temperature_c": None if math.isnan(warm) else warm,
                    "wind_m_s": None if math.isnan(wind) else wind,
                    "modes": modes,
                }
            )
        return out


@cache
def _information() -> tuple[Array, Array]:
    """Fisher information on the frequency of a peak over white noise, as part of that without.

    Whittle: I = T int (dS'/S)^2 df with S = 1/(1+u^2) + nu; the bound is zeta/(2 pi n_c) at nu = 0
    over all frequencies (Au 2014) - here over a band of +-12 half widths.
    """
    nu = np.logspace(-7, 3, 81)
    u = np.linspace(-12, 12, 4801)
    peak = 1 / (1 + u**2)
    part = (2 * u * peak**2 / (peak + nu[:, None])) ** 2
    return np.log(nu), np.trapezoid(part, u, axis=1) / (2 * np.pi)


def bound(hz: Array, zeta: Array, nu: Array, duration_s: float = WINDOW_S) -> Array:
    """Cramer-Rao bound of the relative sd; nu is noise over the height of the peak."""
    x, part = _information()
    share = np.interp(np.log(np.clip(nu, 1e-7, 1e3)), x, part)
    return np.sqrt(zeta / (2 * np.pi * hz * duration_s * share))


def _spans(b: Bridge, number: int, what: str, per_day: float, days: float, t: Array) -> Array:
    """Hours within random spans of mean length `days`; the same whatever the stretch asked for."""
    hit = np.zeros(len(t), bool)
    block = 30 * DAY_S
    for i in range(int(t[0] // block) - 2, int(t[-1] // block) + 1):
        r = rng(b.seed, what, number, i + 1000)
        for _ in range(r.poisson(per_day * 30)):
            start = (i + r.random()) * block
            hit |= (t >= start) & (t < start + min(r.exponential(days), 30.0) * DAY_S)
    return hit


def _motion(
    b: Bridge, h: Hanger, t: Array, hz: Array, wind: Array, flags: HourlyFlags
) -> tuple[Array, Array, Array]:
    """Amplitude of the modes (m/s2, at the antinode, rms), damping, PSD of push at resonance."""
    modes = b.modes(h.number)
    road = (
        b.road(t)[:, None, None]
        * np.exp(0.3 * lines(rng(b.seed, "jams"), 3600.0, 20 * 3600.0)(t))[:, None, None]
    )
    deck = (h.road[:, None] * road) ** 2 / (1 + (hz / 12) ** 4) + h.tremor[:, None] ** 2
    push = b.wind_push(h.number, hz, wind) + modes.push**2 * deck
    aero = b.aerodynamic(h.number, hz, wind)
    near, locked = b.shedding(h.number, hz, wind, t)
    # Lock-in comes and goes within the hour: a third of it at most.
    steady = 0.33 * near**2 * locked
    rms = np.zeros_like(hz)
    zeta = h.zeta[None, :, : hz.shape[2]] + aero
    for _ in range(4):  # friction feeds back on the amplitude
        rms = np.sqrt(push * np.pi * hz / (4 * zeta))
        grown = np.sqrt(2 * rms**2 + steady**2)
        rub = grown / (grown + h.half_amplitude)
        zeta = h.zeta[None, :, : hz.shape[2]] + aero
        zeta = zeta + h.rubbing[None, :, : hz.shape[2]] * rub
    return np.sqrt(rms**2 + steady**2 / 2), zeta, push


def hourly_arrays(
    seed: int,
    hanger: int,
    years: float,
    changes: Sequence[Change] = (),
    *,
    start: datetime = START,
    count: int = 20,
    flags: HourlyFlags | None = None,
) -> Hourly:
    """One hanger's hours, vectorised: about a tenth of a second a year."""
    on = flags or HourlyFlags()
    b = bridge(seed, count)
    h = b.hangers[hanger]
    hours = round(years * YEAR_S / 3600)
    t = seconds(start) + 3600.0 * np.arange(hours)
    middle = t + 1800
    r = rng(seed, "hourly", hanger, int(t[0] // 3600))
    w = b.weather(t[0], t[-1] + 3600)
    wind = w.of("wind", middle)
    number = min(ORDERS, h.orders)
    size = (hours, 2, number)
    full = b.frequencies(hanger, middle, changes)
    true = full[..., :number]
    tension = b.tension(hanger, middle, changes)
    rms, zeta, push = (x[..., :number] for x in _motion(b, h, middle, full, wind, on))

    # Windows kept: trains and knocks spoil some.
    trains = r.poisson(b.trains_per_hour(middle))
    windows = r.binomial(6, 0.97 * np.exp(-0.12 * trains))
    spoilt = r.binomial(1, 0.04, size)
    kept = np.maximum(windows[:, None, None] - spoilt, 0)

    # Both places of a plane see the mode; noise of the two is alike.
    modes = b.modes(hanger)
    seen = np.stack([modes.shape_at(x / h.length_m)[:, :number] for x in h.sensors_m])
    floor = np.mean(h.noise) ** 2 + (h.full_scale / 2 ** (h.bits - 1)) ** 2 / 12 / 100
    floor += 0.02 * (h.road[:, None] * b.road(middle)[:, None, None]) ** 2  # the deck's own motion
    height = (seen**2).sum(axis=0) * push / (4 * zeta**2)
    one = bound(true, zeta, floor / height)
    gap = np.abs(true[:, :1] - true[:, 1:]) / (2 * zeta * true)
    one = one * np.sqrt(1 + 0.5 * np.exp(-(gap**2)))  # close planes disturb each other
    honest = one / np.sqrt(np.maximum(kept, 1))
    off = rng(seed, "stated", hanger).uniform(0.8, 1.3, (2, number)) if on.misstated else 1.0
    stated = honest * np.exp(0.08 * r.standard_normal(size))
    found = (kept > 0) & (r.random(size) > 0.03)
    if on.quiet:
        found &= (one < DULLEST) & (height / floor > FAINTEST)

    reading = true.copy()
    scatter = r.standard_normal(size)
    if on.scatter:
        reading *= 1 + honest * off * scatter
    if on.amplitude:
        amplitude = math.sqrt(2) * rms
        slip = h.softening[:, :number] * amplitude / (amplitude + h.half_amplitude)
        reading *= 1 - slip
    if on.wind_bias:
        lean = rng(seed, "lean", hanger).normal(0, 5e-5, (2, number))
        gust = 1 + 0.5 * lines(rng(seed, "gust", hanger), 3 * 3600.0, 40 * 3600.0)(t)
        reading *= 1 + lean * (np.minimum(wind / 10, 2.5) ** 2 * gust)[:, None, None]
    if on.live_load:
        mean = b.live_road(hanger, middle) * r.uniform(0.5, 1.5, hours)
        reading *= 1 + b.to_tension(hanger)[:, :number] * mean[:, None, None]
    if on.clock:
        warm = w.of("air", middle) - 25
        ppm = h.ppm - 0.035 * warm**2 + 1.0 * (middle - seconds(START)) / YEAR_S
        reading /= 1 + 1e-6 * ppm[:, None, None]
    damping = zeta * np.exp(
        r.standard_normal(size)
        * np.minimum(1.2 / np.sqrt(2 * np.pi * zeta * true * WINDOW_S * np.maximum(kept, 1)), 1)
    )
    ratio = seen[1] / np.where(np.abs(seen[0]) < 0.02, 0.02, seen[0])
    gains = h.gain[2:] / h.gain[:2]
    shape = np.broadcast_to(ratio * gains[:, None], size).copy()
    for i, c in enumerate(changes):
        if c.hanger == hanger and c.kind == "sensor_remounted":
            moved = np.stack(
                [modes.shape_at((x + c.size) / h.length_m)[:, :number] for x in h.sensors_m]
            )
            other = rng(seed, "remounted", hanger, i).normal(1, 0.01, (2, 1))
            new = moved[1] / np.where(np.abs(moved[0]) < 0.02, 0.02, moved[0]) * other
            shape[t >= seconds(c.at)] = new
    shape *= 1 + 3 * honest * r.standard_normal(size) + 0.002 * r.standard_normal(size)

    if on.outliers:
        wrong = r.random(size) < 5e-4
        reading = np.where(wrong, reading * (1 + r.normal(0, 0.01, size)), reading)
    if on.swaps:
        near = np.abs(true[:, 0] / true[:, 1] - 1) < 0.006
        mistaken = near & (r.random(near.shape) < 0.01)
        for x in (reading, stated, damping, found, shape):
            x[:, 0], x[:, 1] = (
                np.where(mistaken, x[:, 1], x[:, 0]),
                np.where(mistaken, x[:, 0], x[:, 1]),
            )
    if on.gaps:
        lost = r.random(hours) < 0.01
        lost |= _spans(b, hanger, "gap hours", 0.1, 0.15, t)
        lost |= _spans(b, hanger, "gap days", 0.012, 2.5, t)
        lost |= _spans(b, 0, "gap all", 0.006, 1.0, t)
        found &= ~lost[:, None, None]

    warm = w.of("air", middle) + 0.4 * (w.of(f"rod{h.row}", middle) - w.of("air", middle))
    if on.temperature:
        warm = warm + 0.15 * r.standard_normal(hours)
        warm[_spans(b, hanger, "thermometer off", 0.002, 20.0, t)] += 1.5
        warm[_spans(b, hanger, "thermometer gone", 0.006, 5.0, t)] = np.nan
    blown = wind * np.exp(0.1 * r.standard_normal(hours))
    blown[_spans(b, 0, "anemometer gone", 0.004, 4.0, t)] = np.nan

    gone = ~found
    for x in (reading, stated, damping, shape):
        x[gone] = np.nan
    level = rms * np.sqrt((seen**2).mean(axis=0))
    level = np.where(gone, np.nan, level * np.exp(0.1 * r.standard_normal(size)))
    return Hourly(
        hanger=hanger,
        time_s=t,
        frequency_hz=reading,
        frequency_sd_hz=stated * reading,
        damping_ratio=damping,
        level_m_s2=level,
        shape_ratio=shape,
        windows=np.where(found, kept, 0),
        temperature_c=warm,
        wind_m_s=blown,
        true_hz=true,
        true_sd_hz=honest * off * true,
        true_tension_n=tension,
    )


def hourly(
    seed: int, hanger: int, years: float, changes: Sequence[Change] = (), **options: Any
) -> list[dict[str, Any]]:
    """As `hourly_arrays`, a dict per hour; hours without any mode are missing."""
    return hourly_arrays(seed, hanger, years, changes, **options).readings()


def true_tension(
    seed: int,
    hanger: int,
    times: Sequence[datetime] | datetime,
    changes: Sequence[Change] = (),
    *,
    count: int = 20,
) -> Array:
    """N, at given times, without live load."""
    many = [times] if isinstance(times, datetime) else times
    return bridge(seed, count).tension(hanger, [seconds(x) for x in many], changes)


__all__ = ["Hourly", "HourlyFlags", "bound", "hourly", "hourly_arrays", "true_tension"]
