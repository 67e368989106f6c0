"""Physics of the living bridge: hangers, weather, traffic, tension and frequencies, as functions.

All is a function of seed and absolute time (seconds since EPOCH), so any two stretches of one
bridge agree where they overlap.  See `living_bridge` for the assumptions and their sources.
"""

import math
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from functools import cache, lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tests.worlds.bars import (
    GRAVITY_M_S2,
    POISSON,
    Array,
    Bar,
    cowper,
    natural_frequencies_hz,
    solve_modes,
)
from tests.worlds.seasons import ENDS, PLANES, REFERENCE_C, lagged

KINDS = ("tension_loss", "end_loosened", "ice", "sensor_remounted")
EPOCH = datetime(2020, 1, 1, tzinfo=UTC)
DAY_S, YEAR_S = 86400.0, 365.25 * 86400.0
EXPANSION = 1.2e-5
MODULUS_PER_K = -3.0e-4
AIR_KG_M3 = 1.25
HIGHEST_HZ = 85.0
MOST_MODES = 12  # per plane
STEP_S = 1800.0  # of the weather
LEAD_S = 8 * DAY_S
RATIOS = 0.95 + 0.65 * np.cos(np.pi * (np.arange(8) + 0.5) / 8)  # T/T0 of the frequency tables


def rng(seed: int, what: str, *numbers: int) -> np.random.Generator:
    """A stream of its own for each purpose."""
    return np.random.Generator(
        np.random.SFC64(np.random.SeedSequence([seed, zlib.crc32(what.encode()), *numbers]))
    )


def seconds(when: datetime) -> float:
    """Time of this world."""
    return (when - EPOCH).total_seconds()


def moment(t: float) -> datetime:
    """Inverse of `seconds`."""
    return EPOCH + timedelta(seconds=float(t))


@dataclass(frozen=True)
class Change:
    """Something done to the plant.

    tension_loss: `size` is the lost part of the hanger's tension, over `over_days` from `at` on
    (0: sudden); half of it goes to the two next hangers of the row.  end_loosened: `size` is the
    lost part of the rotational stiffness at `end` in `planes`.  ice: `size` in kg at `place` (part
    of the length), growing over `over_days`, gone at `until`.  sensor_remounted: `size` is the
    shift in metres of both places; angles and gains are new, the structure is as it was.
    """

    kind: str
    hanger: int
    at: datetime
    size: float = 0.0
    over_days: float = 0.0
    until: datetime | None = None
    place: float = 0.5
    end: str = "deck"
    planes: tuple[str, ...] = PLANES

    def __post_init__(self) -> None:
        if self.kind not in KINDS or self.end not in ENDS or not set(self.planes) <= set(PLANES):
            raise ValueError(f"no such change: {self}")

    def part(self, t: ArrayLike) -> Array:
        """How much of it has come, 0 to 1."""
        since = np.asarray(t, float) - seconds(self.at)
        grown = np.clip((since + 1e-3) / max(self.over_days * DAY_S, 1e-3), 0.0, 1.0)
        if self.until is not None:
            grown = np.where(np.asarray(t, float) < seconds(self.until), grown, 0.0)
        return np.asarray(grown)


# ---------------------------------------------------------------------------------------- bar


@dataclass(frozen=True, eq=False)
class Modes:
    """Modes of one hanger in one state: rows are planes, columns orders."""

    hz: Array  # (2, orders), at T0 and 10 deg C
    polynomial: Array  # (powers, 2, orders) of ln f by ln T/T0, highest power first
    shape: Array  # (2, orders, 201), at T0, largest value 1
    mass_kg: Array  # (2, orders)
    push: Array  # (2, orders): part of the deck's lateral acceleration that drives the mode

    def at(self, ratio: Array, modulus: Array) -> Array:
        """Frequencies (times, 2, orders) for T/T0 and E/E0 (times,)."""
        x = np.log(ratio / modulus)[:, None, None]
        out = np.zeros((len(x), *self.hz.shape))
        for c in self.polynomial:
            out = out * x + c
        return np.exp(out) * np.sqrt(modulus)[:, None, None]

    def shape_at(self, part: float) -> Array:
        """(2, orders) at a part of the length."""
        x = np.clip(part, 0, 1) * 200
        i = min(int(x), 199)
        return np.asarray(
            self.shape[..., i] + (x - i) * (self.shape[..., i + 1] - self.shape[..., i])
        )


# --------------------------------------------------------------------------------------- hangers

State = tuple[tuple[float, float], tuple[float, float], float, float]  # loosened t, l; ice kg, at
SOUND: State = ((0.0, 0.0), (0.0, 0.0), 0.0, 0.5)


@dataclass(frozen=True, eq=False)
class Hanger:
    """One hanger as it really is."""

    number: int
    row: int  # 0 is the side of the morning sun
    place: float  # part of the span
    length_m: float
    kind: str  # rod, strand
    diameter_m: float
    area_m2: float
    bending_nm2: float
    modulus_pa: float
    density_kg_m3: float
    tension_n: float  # at 10 deg C, without traffic
    springs_nm: tuple[tuple[float, float], tuple[float, float]]  # transverse, longitudinal
    orders: int
    zeta: Array  # structural, (2, orders)
    softening: Array  # (2, orders), lost part of the frequency at large amplitude
    rubbing: Array  # (2, orders), damping gained at large amplitude
    half_amplitude: float  # m/s2 where half of both has come
    axis_rad: float  # of the first plane against the transverse
    thermal: Array  # per K of deck, arch - deck, row - row, hanger - arch
    wander: Array  # (2,) relative sd of the frequency by seating of the joints
    sensors_m: tuple[float, float]
    sensor_kg: float
    mount_rad: tuple[float, float]
    gain: Array  # (4,)
    noise: Array  # (4,) m/s2/sqrt(Hz)
    bits: int
    full_scale: float  # m/s2
    ppm: float
    road: Array  # (2,) deck's lateral motion by traffic, m/s2/sqrt(Hz) by day
    tremor: Array  # (2,) the same without traffic
    train: Array  # (2,) m/s2 of forced motion by a medium train
    live: float  # part of the tension a medium train adds
    leak: Array  # (2, neighbour modes) part of the neighbours' motion in the record
    temperature_lag_s: float

    @property
    def mass_kg_m(self) -> float:
        return self.density_kg_m3 * self.area_m2


def _sections(r: np.random.Generator, kind: str) -> tuple[float, float, float, float, float]:
    """Diameter, area, EI, E, density."""
    if kind == "rod":
        d = float(r.choice([60, 70, 80, 85, 90, 100, 110, 120, 130])) / 1000
        d *= 1 + 0.004 * r.standard_normal()
        modulus = 2.1e11 * (1 + 0.012 * r.standard_normal())
        area = math.pi * d**2 / 4
        return d, area, modulus * math.pi * d**4 / 64, modulus, 7850.0
    d = float(r.choice([60, 70, 80, 90, 100])) / 1000 * (1 + 0.004 * r.standard_normal())
    fill = 0.86 + 0.015 * r.standard_normal()
    modulus = 1.6e11 * (1 + 0.03 * r.standard_normal())
    area = fill * math.pi * d**2 / 4
    stick = r.uniform(0.35, 0.85)  # sticking part of the bending stiffness of the full section
    return d, area, stick * modulus * fill * math.pi * d**4 / 64, modulus, 83e3 / GRAVITY_M_S2


def _draw(seed: int, number: int, count: int) -> Hanger:
    r = rng(seed, "hanger", number, count)
    in_row = (count + 1) // 2
    row, index = divmod(number - 1, in_row)
    place = (index + 1) / (in_row + 1)
    rise = 4 * place * (1 - place)
    low, span = (rng(seed, "arch").uniform([4.0, 15.0], [5.0, 19.5]) * 1).tolist()
    length = low + (span - low) * rise**1.3 + r.uniform(-0.2, 0.2)
    kind = "rod" if rng(seed, "kind").random() < 0.75 else "strand"
    section = _sections(rng(seed, "section", number), kind)
    diameter, area, bending, modulus, density = section
    tension = float(np.clip(r.uniform(45e6, 150e6) * area, 150e3, 1200e3))
    first = r.uniform(0.05, 0.97)
    if r.random() < 0.5:  # a fork: the pin turns freely in one plane
        second = r.uniform(0.02, 0.35)
    else:
        second = float(np.clip(first + 0.03 * r.standard_normal(), 0.02, 0.98))
    end = math.sqrt(tension * bending) + bending / length
    fixities = [np.clip(f + 0.05 * r.standard_normal(2), 0.01, 0.98) for f in (first, second)]
    springs = tuple(tuple((2 * end * f / (1 - f)).tolist()) for f in fixities)
    sensors = (length * r.uniform(0.14, 0.24), length * r.uniform(0.27, 0.42))
    sensors = (min(sensors[0], 3.0), min(sensors[1], 4.5))
    kg = r.uniform(0.15, 0.3)
    zeta = np.exp(r.uniform(math.log(5e-4), math.log(3e-3)) + 0.25 * r.standard_normal((2, 12)))
    soft = np.exp(r.uniform(math.log(2e-4), math.log(2e-3), (2, 1))) * r.uniform(0.6, 1, (2, 12))
    stress = tension / area
    stiff = EXPANSION * modulus / stress  # of a bar held fast, per K
    thermal = (
        stiff * np.array([0.012, 0.05, 0.02, 0.0]) * r.standard_normal(4) * math.sqrt(9 / length)
    )
    thermal[3] = -stiff * r.uniform(0.02, 0.08)
    hanger = Hanger(
        number=number,
        row=row,
        place=place,
        length_m=length,
        kind=kind,
        diameter_m=diameter,
        area_m2=area,
        bending_nm2=bending,
        modulus_pa=modulus,
        density_kg_m3=density,
        tension_n=tension,
        springs_nm=springs,  # type: ignore[arg-type]
        orders=MOST_MODES,
        zeta=np.clip(zeta, 5e-4, 5e-3),
        softening=soft,
        rubbing=r.uniform(2e-4, 2e-3) * np.ones((2, 12)),
        half_amplitude=float(np.exp(r.uniform(math.log(0.15), math.log(1.5)))),
        axis_rad=math.radians(4.0) * r.standard_normal(),
        thermal=thermal,
        wander=r.uniform(2e-5, 1e-4, 2),
        sensors_m=sensors,
        sensor_kg=kg,
        mount_rad=tuple(np.radians(r.standard_normal(2)).tolist()),
        gain=1 + 0.01 * r.standard_normal(4),
        noise=r.uniform(20e-6, 60e-6) * GRAVITY_M_S2 * r.uniform(0.85, 1.2, 4),
        bits=int(r.choice([16, 24])),
        full_scale=float(r.choice([2.0, 2.5, 5.0])) * GRAVITY_M_S2,
        ppm=float(r.choice([-1, 1]) * np.exp(r.uniform(0, math.log(20)))),
        road=np.exp(r.uniform(math.log(1.5e-4), math.log(1.2e-3), 2)),
        tremor=np.exp(r.uniform(math.log(1.5e-6), math.log(8e-6), 2)),
        train=np.exp(r.uniform(math.log(0.01), math.log(0.08), 2)),
        live=r.uniform(0.015, 0.07),
        leak=np.exp(r.uniform(math.log(0.002), math.log(0.02), (2, 6))),
        temperature_lag_s=float(np.clip(2.7e4 * diameter, 1500, 4000)),
    )
    hz = np.array([natural_frequencies_hz(bar(hanger, p), MOST_MODES) for p in (0, 1)])
    orders = max(2, int(np.sum(hz.max(axis=0) < HIGHEST_HZ)))
    cut = {k: getattr(hanger, k)[:, :orders] for k in ("zeta", "softening", "rubbing")}
    return Hanger(**{**hanger.__dict__, **cut, "orders": orders})


def bar(h: Hanger, plane: int, state: State = SOUND, ratio: float = 1.0) -> Bar:
    """The hanger's bar in one plane, with the boxes of its sensors."""
    loosened, spring = state[plane], h.springs_nm[plane]
    masses = [(x, h.sensor_kg) for x in h.sensors_m]
    if state[2] > 0:
        masses.append((state[3] * h.length_m, state[2]))
    inertia = math.pi * h.diameter_m**4 / 64
    return Bar(
        length_m=h.length_m,
        tension_n=h.tension_n * ratio,
        bending_stiffness_n_m2=h.bending_nm2,
        mass_per_length_kg_m=h.mass_kg_m,
        shear_stiffness_n=cowper() * h.modulus_pa / (2 * (1 + POISSON)) * h.area_m2,
        rotary_inertia_kg_m=h.density_kg_m3 * inertia * h.area_m2 / (math.pi * h.diameter_m**2 / 4),
        rotation_n_m_rad=(spring[0] * (1 - loosened[0]), spring[1] * (1 - loosened[1])),
        gravity_along_m_s2=GRAVITY_M_S2,
        masses=tuple(masses),
    )


# --------------------------------------------------------------------------------------- weather


@dataclass(frozen=True, eq=False)
class Lines:
    """A stationary random function of unit variance: many sines, evaluable at any time."""

    rate: Array
    phase: Array
    weight: Array

    def __call__(self, t: ArrayLike) -> Array:
        x = np.atleast_1d(np.asarray(t, float))
        if len(x) <= 64:
            return np.asarray(np.sin(x[:, None] * self.rate + self.phase) @ self.weight)
        out = np.zeros(len(x))
        for a, b, w in zip(self.rate, self.phase, self.weight, strict=True):
            out += w * np.sin(a * x + b)
        return out


def lines(r: np.random.Generator, shortest_s: float, longest_s: float, count: int = 40) -> Lines:
    """Periods spread evenly on a log scale."""
    u = (np.arange(count) + r.random(count)) / count
    period = shortest_s * (longest_s / shortest_s) ** u
    weight = r.rayleigh(1.0, count)
    weight *= math.sqrt(2) / np.linalg.norm(weight)
    return Lines(2 * np.pi / period, r.uniform(0, 2 * np.pi, count), weight)


@dataclass(frozen=True, eq=False)
class Weather:
    """On a grid of half hours; `of` interpolates."""

    t: Array
    columns: dict[str, Array]

    def of(self, name: str, t: ArrayLike) -> Array:
        return np.interp(np.asarray(t, float), self.t, self.columns[name])


@dataclass(frozen=True, eq=False)
class Bridge:
    """All that stands and blows, for one seed."""

    seed: int
    count: int
    hangers: dict[int, Hanger] = field(repr=False)

    @lru_cache(maxsize=16)  # noqa: B019
    def _weather(self, first: int, last: int) -> Weather:
        t = np.arange(first, last + 1) * STEP_S
        s = self.seed
        year = 2 * np.pi * t / YEAR_S
        hour = (t / 3600) % 24
        clear = 1 / (1 + np.exp(-1.6 * lines(rng(s, "clear"), DAY_S, 12 * DAY_S)(t)))
        declination = math.radians(23.44) * np.sin(year - 2 * np.pi * 80 / 365.25)
        angle = 2 * np.pi * (hour - 12) / 24
        high = math.sin(math.radians(50)) * np.sin(declination) + math.cos(
            math.radians(50)
        ) * np.cos(declination) * np.cos(angle)
        up = np.maximum(high, 0)
        sun = up * (0.2 + 0.8 * clear)  # of 1000 W/m2
        side = np.clip(0.5 - 0.9 * np.sin(angle), 0.05, 1.0)  # row 0 looks east
        air = 10 - 9.5 * np.cos(year - 2 * np.pi * 18 / 365.25)
        air += 3.6 * lines(rng(s, "synoptic"), 2 * DAY_S, 22 * DAY_S)(t)
        air += lagged(14 * sun, 3.5 * 3600, STEP_S) - 4 * up.clip(0, 0.4) - 1.5 * clear * (high < 0)
        speed = math.log(3.0) + 0.22 * np.cos(year) + 0.45 * np.clip(high, -0.3, 0.6)
        speed += 0.50 * lines(rng(s, "wind"), 1.5 * DAY_S, 22 * DAY_S, 50)(t)
        speed += 0.22 * lines(rng(s, "breeze"), 3600.0, 10 * 3600.0, 40)(t)
        speed -= 0.55 * clear * (high < -0.1)
        deck = lagged(air + 12 * sun, 14 * 3600, STEP_S)
        columns = {
            "air": air,
            "sun": sun,
            "wind": np.exp(speed),
            "deck": deck,
            "arch0": lagged(air + 13 * sun * side * 1.4, 2 * 3600, STEP_S),
            "arch1": lagged(air + 13 * sun * (1.05 - side) * 1.4, 2 * 3600, STEP_S),
            "rod0": lagged(air + 6 * sun * side * 1.4, 2400, STEP_S),
            "rod1": lagged(air + 6 * sun * (1.05 - side) * 1.4, 2400, STEP_S),
        }
        return Weather(t, columns)

    def weather(self, start: float, stop: float) -> Weather:
        """Covers start to stop; the lags have settled, so stretches agree."""
        day = round(DAY_S / STEP_S)
        first = int((start - LEAD_S) // DAY_S) * day
        return self._weather(first, (int((stop + STEP_S) // DAY_S) + 1) * day)

    @cache  # noqa: B019
    def modes(self, number: int, state: State = SOUND) -> Modes:
        """Solved once for each state."""
        h = self.hangers[number]
        x = np.log(RATIOS)
        hz, shapes, coefficients = [], [], []
        for p in (0, 1):
            found = solve_modes(bar(h, p, state), h.orders, np.linspace(0, h.length_m, 201))
            rows = [natural_frequencies_hz(bar(h, p, state, float(q)), h.orders) for q in RATIOS]
            coefficients.append(np.polyfit(x, np.log(np.array(rows)), len(x) - 1))
            hz.append(found.frequencies_hz)
            shapes.append(found.shapes.T)
        shape = np.array(shapes)
        top = np.abs(shape).argmax(axis=-1)[..., None]
        shape /= np.take_along_axis(shape, top, axis=-1)  # largest value 1
        part = np.linspace(0, 1, 201)
        dx = h.length_m / 200
        mass = h.mass_kg_m * np.trapezoid(shape**2, dx=dx, axis=-1)
        for place, kg in bar(h, 0, state).masses:
            mass = mass + kg * shape[..., round(place / h.length_m * 200)] ** 2
        push = h.mass_kg_m * np.trapezoid(shape * (1 - part), dx=dx, axis=-1) / mass
        return Modes(
            hz=np.array(hz),
            polynomial=np.moveaxis(np.array(coefficients), 0, 1),
            shape=shape,
            mass_kg=mass,
            push=push,
        )

    def state(self, number: int, t: float, changes: Sequence[Change] = ()) -> State:
        """What holds at a time (slow growth in tenths)."""
        loosened = [[0.0, 0.0], [0.0, 0.0]]
        ice, place = 0.0, 0.5
        for c in changes:
            if c.hanger != number or c.kind not in ("end_loosened", "ice"):
                continue
            part = math.floor(float(c.part(t)) * 10 + 1e-9) / 10
            if c.kind == "ice" and part > 0:
                ice, place = c.size * part, c.place
            elif c.kind == "end_loosened":
                for p, plane in enumerate(PLANES):
                    if plane in c.planes:
                        loosened[p][ENDS.index(c.end)] = min(0.999, c.size * part)
        return (tuple(loosened[0]), tuple(loosened[1]), ice, place)  # type: ignore[return-value]

    @cache  # noqa: B019
    def to_tension(self, number: int) -> Array:
        """d ln f / d ln T, (2, orders)."""
        one, both = np.ones(1), (np.array([1.001]), np.array([0.999]))
        m = self.modes(number)
        up, down = (np.log(m.at(x, one)[0]) for x in both)
        return np.asarray((up - down) / math.log(1.001 / 0.999))

    def live_road(self, number: int, t: ArrayLike) -> Array:
        """Mean dT/T0 by cars and lorries."""
        return 4e-4 * self.hangers[number].live / 0.04 * self.road(t)

    def neighbours(self, number: int) -> list[int]:
        """The next ones in the row."""
        row = self.hangers[number].row
        both = (number - 1, number + 1)
        return [n for n in both if n in self.hangers and self.hangers[n].row == row]

    @cache  # noqa: B019
    def _flow(self) -> Lines:
        return lines(rng(self.seed, "smooth flow"), 2 * 3600.0, 6 * DAY_S)

    @cache  # noqa: B019
    def _own(self, number: int, what: str) -> Lines:
        if what == "local":  # K, of the temperature nobody records
            return lines(rng(self.seed, what, number), 4 * 3600.0, 72 * 3600.0)
        return lines(rng(self.seed, what, number), 1 * DAY_S, 60 * DAY_S)

    def tension(self, number: int, t: ArrayLike, changes: Sequence[Change] = ()) -> Array:
        """True tension in N without live load."""
        x = np.atleast_1d(np.asarray(t, float))
        h = self.hangers[number]
        w = self.weather(float(x.min()), float(x.max()))
        deck, arch = w.of("deck", x), w.of(f"arch{h.row}", x)
        local = 0.5 * self._size(number) * self._own(number, "local")(x)
        part = h.thermal[0] * (deck - REFERENCE_C) + h.thermal[1] * (arch - deck + local)
        part += h.thermal[2] * (w.of("arch0", x) - w.of("arch1", x))
        part += h.thermal[3] * (w.of(f"rod{h.row}", x) - arch + local)
        out = h.tension_n * (1 + part)
        for c in changes:
            if c.kind != "tension_loss":
                continue
            lost = c.size * self.hangers[c.hanger].tension_n * c.part(x)
            if c.hanger == number:
                out -= lost
            elif c.hanger in self.neighbours(number):
                out += lost / 4
        return np.asarray(out)

    def _size(self, number: int) -> float:
        """Twice the sd in K of the local temperature: 2 to 4."""
        return float(rng(self.seed, "local size", number).uniform(2, 4))

    def frequencies(
        self,
        number: int,
        t: ArrayLike,
        changes: Sequence[Change] = (),
        live: ArrayLike = 0.0,
    ) -> Array:
        """True frequencies at small amplitude, (times, 2, orders); `live` is dT/T0 of traffic."""
        x = np.atleast_1d(np.asarray(t, float))
        h = self.hangers[number]
        ratio = self.tension(number, x, changes) / h.tension_n + np.asarray(live)
        w = self.weather(float(x.min()), float(x.max()))
        modulus = 1 + MODULUS_PER_K * (w.of(f"rod{h.row}", x) - REFERENCE_C)
        out = np.empty((len(x), 2, h.orders))
        for where, state in self.stretches(number, x, changes):
            out[where] = self.modes(number, state).at(ratio[where], modulus[where])
        for p in (0, 1):
            seat = h.wander[p] * self._own(number, f"seat{p}")(x)
            out[:, p] *= 1 + seat[:, None]
        return out

    def stretches(
        self, number: int, t: Array, changes: Sequence[Change]
    ) -> list[tuple[NDArray[np.bool_], State]]:
        """Times of equal state."""
        mine = [c for c in changes if c.hanger == number and c.kind in ("end_loosened", "ice")]
        if not mine:
            return [(np.ones(len(t), bool), SOUND)]
        key = np.zeros((len(t), len(mine)))
        for i, c in enumerate(mine):
            key[:, i] = np.floor(c.part(t) * 10 + 1e-9)
        _, first, which = np.unique(key, axis=0, return_index=True, return_inverse=True)
        flat = which.ravel()
        return [(flat == i, self.state(number, t[j], changes)) for i, j in enumerate(first)]

    # ------------------------------------------------------------------------------ excitation

    def wind_push(self, number: int, hz: Array, speed: Array) -> Array:
        """PSD (m/s2)^2/Hz of modal force over modal mass by buffeting, as `hz` (..., 2, orders)."""
        h = self.hangers[number]
        u = np.asarray(speed, float)[..., None, None]
        reduced = hz * 60.0 / u  # EN 1991-1-4, B.1; L = 60 m
        turbulence = (0.17 * u) ** 2 / hz * 6.8 * reduced / (1 + 10.2 * reduced) ** (5 / 3)
        admitted = 1 / (1 + (2 * hz * h.diameter_m / u) ** (4 / 3)) ** 2
        drag = (AIR_KG_M3 * 1.1 * h.diameter_m * u) ** 2 * np.array([[1.0], [0.4]]) ** 2
        span = 2 * u / (10 * hz)  # correlated length, decay 10
        mass = self.modes(number).mass_kg
        return np.asarray(drag * turbulence * admitted * span / (h.mass_kg_m * mass))

    def aerodynamic(self, number: int, hz: Array, speed: Array) -> Array:
        """Aerodynamic damping ratio: quasi-steady, half of it across the wind."""
        h = self.hangers[number]
        u = np.asarray(speed, float)[..., None, None]
        along = AIR_KG_M3 * 1.1 * h.diameter_m * u / (2 * h.mass_kg_m * 2 * np.pi * hz)
        return np.asarray(along * np.array([[1.0], [0.5]]))

    def shedding(self, number: int, hz: Array, speed: Array, t: ArrayLike) -> tuple[Array, Array]:
        """Lock-in: 0 to 1 how near, and the amplitude in m/s2 it grows to (EN 1991-1-4, E.7).

        Across the wind, which blows across the bridge: the longitudinal plane.  Only in smooth
        flow, a twelfth of the time.
        """
        h = self.hangers[number]
        flow = self._flow()(t)[..., None, None] - 1.4
        u = np.asarray(speed, float)[..., None, None]
        near = np.exp(-(((0.2 * u / h.diameter_m) / hz - 1) ** 2) / 0.04**2)
        near = near * np.array([[0.15], [1.0]]) / (1 + np.exp(-12 * flow))
        scruton = 4 * np.pi * h.zeta * h.mass_kg_m / (AIR_KG_M3 * h.diameter_m**2)
        size = h.diameter_m / (0.04 * scruton) * 0.1 * 0.6 * 0.3  # c_lat 0.7, turbulent: 0.3
        return near, np.asarray(np.minimum(size, 0.05 * h.diameter_m) * (2 * np.pi * hz) ** 2)

    def road(self, t: ArrayLike) -> Array:
        """Level of road traffic, 0.02 to 1."""
        x = np.atleast_1d(np.asarray(t, float))
        hour = (x / 3600 + 1) % 24  # local time
        day = np.exp(-(((hour - 8) / 2.2) ** 2)) + np.exp(-(((hour - 17) / 2.8) ** 2))
        day += 0.8 * np.exp(-(((hour - 12.5) / 4) ** 2))
        week = (np.floor(x / DAY_S).astype(int) + 2) % 7  # 2020-01-01 was a Wednesday; 0 is Monday
        share = np.array([1, 1, 1, 1, 1.05, 0.6, 0.45])[week]
        return np.asarray(np.clip(0.02 + 0.75 * day * share, 0.02, 1.1))

    def trains_per_hour(self, t: ArrayLike) -> Array:
        """Of the timetable."""
        x = np.atleast_1d(np.asarray(t, float))
        hour = (x / 3600 + 1) % 24
        pace = float(rng(self.seed, "timetable").choice([1, 2, 3, 4]))
        return np.where((hour > 5) & (hour < 24), pace, 0.25)

    def trains(self, start: float, stop: float) -> list[tuple[float, float, float, float]]:
        """(when the head comes, speed m/s, length m, weight; 1 is a medium passenger train)."""
        days = range(int((start - DAY_S) // DAY_S), int(stop // DAY_S) + 1)
        near = [x for day in days for x in self._trains(day)]
        return sorted(x for x in near if start - 120 <= x[0] < stop)

    @lru_cache(maxsize=64)  # noqa: B019
    def _trains(self, day: int) -> list[tuple[float, float, float, float]]:
        found = []
        r = rng(self.seed, "trains", day + 10000)
        pace = float(self.trains_per_hour(day * DAY_S + 12 * 3600)[0])
        minute = np.arange(4 * 60, 23 * 60, 60 / pace)
        keep = r.random(len(minute)) < (0.6 if (day + 2) % 7 >= 5 else 0.95)
        late = r.exponential(1.5, len(minute))
        kind = r.random((len(minute), 3))
        for m, on, d, k in zip(minute, keep, late, kind, strict=True):
            if on:
                when = day * DAY_S + 60 * (m + 7 + d)
                found.append((when, 22 + 18 * k[0], 75 + 150 * k[1], 0.6 + 0.8 * k[2]))
        for _ in range(r.poisson(3)):  # goods, mostly by night
            hour = r.normal(2, 4) % 24
            size = r.uniform(1.2, 3.0)
            found.append((day * DAY_S + 3600 * hour, r.uniform(16, 26), 450.0, size))
        return found


@lru_cache(maxsize=16)
def bridge(seed: int, count: int = 20) -> Bridge:
    """Draw it; the thermal sensitivities are in equilibrium within a row."""
    drawn = {n: _draw(seed, n, count) for n in range(1, count + 1)}
    for row in (0, 1):
        of = [h for h in drawn.values() if h.row == row]
        if len(of) > 2:
            weight = np.array([h.tension_n for h in of])
            mean = np.average([h.thermal for h in of], axis=0, weights=weight)
            for h in of:
                h.thermal[:3] -= mean[:3]
    return Bridge(seed, count, drawn)
