"""The hangers of `road_bridge_seasons.py` under permanent sensors: mode vectors by the hour.

What changes a hanger is a `Change`; what a logger does is a `Logger`.  Times are absolute: the same
hour of a seed has the same weather, traffic and errors, whatever stretch is asked for.

Tension.  As of the seasons, by deck and hanger temperature.  Besides, up to 1.2 K (sd) of the
hanger's temperature are its own and not recorded (shadow, rain; correlated over 5 hours), and
traffic pulls by up to 0.08 % in the mean of a busy hour, scattering by a third of that.

Frequencies.  ln f is a cubic in ln T through seven solved tensions, one for each plane, before and
after an end loosened; steel softens by 3e-4 per K.  A box of 0.3 kg for each plane sits at a place.
One joint gives: by up to 0.05 % of frequency at the level of a gale.

Errors.  Random sd by the long-data law sqrt(zeta / (2 pi f duration)) (Au, Mech. Syst. Signal
Process. 48, 2014), 1 to 2 times by mode for the sensor's noise, more in calm hours; real over
stated 0.8 to 1.4 by hanger.  In one hour of 1000 a mode is a wrong peak; calm hours lose modes.

Not in it: raw samples, wind drag, sticking bearings, close planes that are exchanged by themselves.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from tests.worlds.road_bridge_seasons import (
    PLANES,
    REFERENCE_C,
    SOFTENING_PER_K,
    Hanger,
    bridge,
    weather,
)

Array = NDArray[np.float64]
EPOCH = datetime(2024, 1, 1, tzinfo=UTC)
YEARS = 3.0
ORDERS = 4
SENSOR_KG = 0.3


@dataclass(frozen=True)
class Change:
    """Something done to a hanger.

    tension_loss: `size` is the lost fraction, over `over_days` from `at` on (0: at once).
    end_loosened: the spring at `end` falls so far in `planes` that the first frequency there falls
    by the fraction `size`; ValueError where even a hinge moves it less.
    """

    kind: str
    hanger: int
    at: datetime
    size: float
    over_days: float = 0.0
    end: str = "deck"
    planes: tuple[str, ...] = ("longitudinal",)

    def __post_init__(self) -> None:
        known = self.kind in ("tension_loss", "end_loosened")
        if not known or self.end not in ("deck", "arch") or not set(self.planes) <= set(PLANES):
            raise ValueError(f"no such change: {self}")


@dataclass(frozen=True)
class Logger:
    """Minutes of each hour that are recorded, and a silence."""

    minutes: float = 60.0
    silent_from: datetime | None = None
    silent_days: float = 0.0


@dataclass(frozen=True, eq=False)
class _Drive:
    """What moves a hanger in each hour from `EPOCH` on."""

    air_c: Array
    warm_c: Array
    tension: Array  # relative to that built, without changes
    wind_m_s: Array
    level: Array  # relative to the median hour


def describe(seed: int, numbers: Sequence[int]) -> list[dict[str, Any]]:
    """Return what the owner states of some hangers (0 to 23)."""
    every = bridge(seed)
    found = []
    for number in numbers:
        own = every[number].description
        d = own.get("diameter_m")
        section = {
            "area_m2": own["area_m2"] if d is None else math.pi * d**2 / 4,
            "second_moment_m4": own["second_moment_m4"] if d is None else math.pi * d**4 / 64,
            "mass_kg_m": own["mass_per_length_kg_m"] if d is None else 7850 * math.pi * d**2 / 4,
        }
        found.append({**own, **section, "id": number, "diameter_m": math.nan if d is None else d})
    return found


@lru_cache(maxsize=32)
def _drive(seed: int, number: int) -> _Drive:
    hanger, sky = bridge(seed)[number], weather(seed, 0.0, YEARS)
    days = np.arange(int(YEARS * 8766)) / 24
    rng = np.random.default_rng([seed, number, 1])
    air, warm, deck = (sky.at(series, days) for series in (sky.air, sky.hanger, sky.deck))
    size = len(days)
    warm = warm + rng.uniform(0.4, 1.2) * _wander(rng, size, 5.0)
    hour, weekday = days * 24 % 24, days.astype(int) % 7
    busy = np.clip(np.sin(np.pi * (hour - 5) / 16), 0, None) * np.where(weekday < 5, 1.0, 0.5)
    load = rng.uniform(2e-4, 8e-4) * busy * (1 + rng.standard_normal(size) / 3)
    # One wind for the bridge, whichever hanger is asked for.
    wind = 3.5 * np.exp(0.5 * _wander(np.random.default_rng([seed, 2]), size, 14.0))
    tension = 1 + hanger.per_k * (deck - REFERENCE_C) + hanger.warmer_per_k * (warm - deck) + load
    return _Drive(air, warm, tension, wind, (wind / 3.5) ** 1.5 * (0.5 + busy))


def _wander(rng: np.random.Generator, size: int, hours: float) -> Array:
    """Return a stationary process of unit variance, correlated over some hours."""
    kept = math.exp(-1 / hours)
    steps = rng.standard_normal(size) * math.sqrt(1 - kept**2)
    return np.asarray(lfilter([1.0], [1.0, -kept], steps))


def _masses(hanger: Hanger) -> list[tuple[float, float]]:
    place = min(0.3 * hanger.bar.length_m, 3.5)
    return [(place, 2 * SENSOR_KG)]


@lru_cache(maxsize=256)
def _laws(seed: int, number: int, plane: str, springs: tuple[float, float]) -> tuple[Array, Array]:
    """Return cubics of ln f in ln (T/T0), (4, orders), and d ln f / d ln E."""
    hanger = bridge(seed)[number]
    solver = hanger.bar.plane(PLANES.index(plane))
    tensions = np.linspace(0.7, 1.3, 7)

    def solved(part: float, stiffer: float = 1.0) -> Array:
        return np.log(
            solver.solve(
                hanger.tension_n * part, springs, stiffer=stiffer,
                masses=_masses(hanger), count=ORDERS,
            )
        )  # fmt: skip

    rows = np.array([solved(part) for part in tensions])
    law = np.polyfit(np.log(tensions), rows, 3)
    softer = (solved(1.0, 1.01) - solved(1.0, 0.99)) / 0.02
    return law, softer


def loosened(seed: int, number: int, plane: str, end: str, size: float) -> tuple[float, float]:
    """Return the springs with which the first frequency is lower by the fraction `size`."""
    hanger = bridge(seed)[number]
    held = hanger.springs[PLANES.index(plane)].tolist()
    at = ("deck", "arch").index(end)
    solver = hanger.bar.plane(PLANES.index(plane))

    def first(factor: float) -> float:
        springs = [each * factor if n == at else each for n, each in enumerate(held)]
        found = solver.solve(
            hanger.tension_n, (springs[0], springs[1]), masses=_masses(hanger), count=1
        )
        return float(found[0])

    whole, low, high = first(1.0), -20.0, 0.0
    if first(0.0) > (1 - size) * whole:
        raise ValueError(f"hanger {number}: a hinge at the {end} moves the first mode by less")
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (
            (middle, high) if first(math.exp(middle)) < (1 - size) * whole else (low, middle)
        )
    springs = [each * math.exp(low) if n == at else each for n, each in enumerate(held)]
    return springs[0], springs[1]


def largest_loosening(seed: int, number: int, plane: str, end: str) -> float:
    """Return the fraction by which the first frequency falls if the end becomes a hinge."""
    hanger = bridge(seed)[number]
    p, at = PLANES.index(plane), ("deck", "arch").index(end)
    held, hinged = hanger.springs[p].copy(), hanger.springs[p].copy()
    hinged[at] = 0.0
    solver = hanger.bar.plane(PLANES.index(plane))
    with_end, without = (
        solver.solve(hanger.tension_n, (s[0], s[1]), masses=_masses(hanger), count=1)[0]
        for s in (held, hinged)
    )
    return float(1 - without / with_end)


def draw_loosening(seed: int, at: datetime, size: float) -> Change:
    """Draw a hanger, a plane and an end that can loosen by `size`, as `Change` has it."""
    able = [
        Change("end_loosened", number, at, size, end=end, planes=(plane,))
        for number in range(1, 21)
        for plane in PLANES
        for end in ("deck", "arch")
        if largest_loosening(seed, number, plane, end) > size
    ]
    return able[int(np.random.default_rng([seed, 6]).integers(len(able)))]


def true_tension(
    seed: int, number: int, moments: Sequence[datetime], changes: Sequence[Change] = ()
) -> Array:
    """Return the tension in N at moments."""
    hours = np.array([(each - EPOCH).total_seconds() / 3600 for each in moments])
    drive = _drive(seed, number)
    built = bridge(seed)[number].tension_n
    passing = np.interp(hours, np.arange(len(drive.tension)), drive.tension)
    return np.asarray(built * passing * _kept(number, hours, changes))


def _kept(number: int, hours: Array, changes: Sequence[Change]) -> Array:
    """Return the part of the tension that losses leave."""
    left = np.ones(len(hours))
    for each in changes:
        if each.kind == "tension_loss" and each.hanger == number:
            since = hours - _hours(each.at)
            grown = np.clip(since / (24 * each.over_days), 0, 1) if each.over_days else since >= 0
            left -= each.size * grown
    return left


def _hours(moment: datetime) -> float:
    return (moment - EPOCH).total_seconds() / 3600


def hourly(
    seed: int,
    number: int,
    years: float,
    changes: Sequence[Change] = (),
    start: datetime = EPOCH,
    logger: Logger = Logger(),
) -> list[dict[str, Any]]:
    """Return the readings of each recorded hour, as an honest identification would have them.

    An hour without any mode is no entry. `true_hz` is not for the program under trial.
    """
    drive, hanger = _drive(seed, number), bridge(seed)[number]
    first = round(_hours(start))
    at = np.arange(first, min(first + round(years * 8766), len(drive.tension)))
    if not len(at) or first < 0:
        raise ValueError(f"this world knows {YEARS:g} years from {EPOCH:%Y-%m-%d} on")
    tension = np.log(drive.tension[at] * _kept(number, at.astype(float) + 0.5, changes))
    softened = SOFTENING_PER_K * (drive.warm_c[at] - REFERENCE_C)
    rng = np.random.default_rng([seed, number, 3])
    noise = rng.uniform(1.0, 2.0, (2, ORDERS))
    zeta = rng.uniform(0.0015, 0.005, (2, ORDERS))
    real, gives = rng.uniform(0.8, 1.4), rng.uniform(0, 5e-4)
    ratio = rng.uniform(0.3, 1.5, (2, ORDERS))
    every = np.random.default_rng([seed, number, 4])
    shape = (len(drive.tension), 2, ORDERS)
    error = every.standard_normal(shape)[at]
    seen, wrong = every.uniform(size=shape)[at], every.uniform(size=shape)[at]
    loud = drive.level[at][:, None, None]
    true = np.empty((len(at), 2, ORDERS))
    for p, plane in enumerate(PLANES):
        held = hanger.springs[p]
        states = [(held[0], held[1])] * len(at)
        for each in changes:
            if each.kind == "end_loosened" and each.hanger == number and plane in each.planes:
                loose = loosened(seed, number, plane, each.end, each.size)
                states = [
                    loose if hour + 0.5 >= _hours(each.at) else state
                    for hour, state in zip(at.tolist(), states, strict=True)
                ]
        for state in set(states):
            here = np.array([each == state for each in states])
            law, softer = _laws(seed, number, plane, state)
            powers = np.stack([tension[here] ** n for n in (3, 2, 1, 0)], 1)
            true[here, p] = np.exp(powers @ law + softened[here, None] * softer)
    true *= 1 - gives * np.clip(loud / 8, 0, 1)
    duration = 60 * logger.minutes
    stated = noise * np.sqrt(zeta / (2 * np.pi * true * duration)) * np.clip(loud, 0.1, 4) ** -0.25
    measured = true * (1 + real * stated * error)
    measured = np.where(wrong < 1e-3, measured * (1 + 0.02 * np.sign(error)), measured)
    lost = seen < 0.02 + 0.15 * (loud < 0.25)
    silent = np.zeros(len(at), bool)
    if logger.silent_from is not None:
        begins = _hours(logger.silent_from)
        silent = (at >= begins) & (at < begins + 24 * logger.silent_days)
    read_c = drive.air_c[at] + np.random.default_rng([seed, number, 5]).normal(0, 0.5)
    found = []
    for i, hour in enumerate(at.tolist()):
        modes = [
            {
                "plane": PLANES[p], "order": k + 1, "frequency_hz": float(measured[i, p, k]),
                "frequency_sd_hz": float(stated[i, p, k] * measured[i, p, k]),
                "damping_ratio": float(zeta[p, k]),
                "windows": max(1, round(logger.minutes / 10)),
                "level_m_s2": float(0.01 * drive.level[hour]),
                "shape_ratio": float(ratio[p, k]), "true_hz": float(true[i, p, k]),
            }
            for p in range(2) for k in range(ORDERS) if not lost[i, p, k]
        ]  # fmt: skip
        if modes and not silent[i]:
            found.append({
                "hanger": number, "time": EPOCH + timedelta(hours=hour),
                "temperature_c": float(read_c[i]), "wind_m_s": float(drive.wind_m_s[hour]),
                "modes": modes,
            })  # fmt: skip
    return found
