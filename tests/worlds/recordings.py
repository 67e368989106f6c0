"""Recordings of hammer tests and of ambient vibration, from physics, with the field's nuisances on.

`case(kind, seed)` gives one `Recording`: the numbers as a logger would hand them over, what the
crew wrote down, and the truth.  `KINDS` says of each kind which physical reason is behind it.
Structures are in `recorded_structures`, motion in `recorded_motion`, sensors and loggers in
`recorded_chain`; nothing comes from the software under test.

What is in no world: modes above the 16th of a plane, torsion, sag, temperature drift within a
record, and motion of the arch.  Ambient records are computed at the logger's own rate: no aliasing.

Times in the truth are those of the file (index / rate).  Frequencies in the truth are physical: a
clock that runs fast by `time_base_error` shows them lower by that share.
"""

import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from tests.worlds import recorded_chain as chain
from tests.worlds import recorded_structures as structures
from tests.worlds.recorded_chain import G, Logger, Wire
from tests.worlds.recorded_kinds import KINDS, Plan
from tests.worlds.recorded_motion import (
    Law,
    Modes,
    Push,
    Ringing,
    answer,
    band_limited,
    coloured,
)
from tests.worlds.recorded_structures import PLANES, Frame, Hanger

Array = NDArray[np.float64]
FINE_HZ = 4000.0  # a contact of 0.5 ms has two steps at least before the filter
SAMPLES = 100_000  # on the fine grid: a third of a second of work
MODES = 16  # of a plane
RATE_OVER_FIRST = 5  # the slowest logger that still shows two modes of a plane
PAD = 64  # samples at each end that the filter may spoil; they are cut off


@dataclass(frozen=True)
class Channel:
    """What a crew knows of a column."""

    name: str
    quantity: Literal["force", "acceleration"]
    unit: str
    plane: str | None  # transverse, longitudinal, vertical or x; None for an unknown hammer
    place_m: float | None  # from the deck end, or along the structure
    full_scale: float  # in `unit`
    bits: int


@dataclass(frozen=True)
class Hit:
    """One contact, in the file's time; also those that no force channel shows.

    Of a quick release the contact time is that in which the rope parts, the peak its pull.
    `peak_n` is physical: the logger's filter leaves less of a contact that is short for its rate.
    """

    time_s: float
    peak_n: float
    contact_s: float
    plane: str
    off_plane_deg: float
    place_m: float
    rebound: bool  # the second contact of a double hit


@dataclass(frozen=True)
class ModeTruth:
    """One mode below half the sampling rate.

    `snr_db`: energy of the mode's own acceleration over that of all else (noise, hum, drift, wind,
    deck; not the other modes) in its half-power band 2 z f during the record, at the best channel.
    """

    plane: str
    order: int
    frequency_hz: float  # undamped, at small amplitude, with the sensors on
    mean_frequency_hz: float  # averaged over the record with the squared amplitude
    change_at_peak: float  # relative, at the largest amplitude of the record
    bare_frequency_hz: float  # without the sensors' masses
    damping_ratio: float
    snr_db: float
    shape: tuple[float, ...]  # at each acceleration channel, 1/sqrt(kg), as the sensor is turned
    noise: tuple[float, ...]  # of each such channel: density of all else there, (m/s2)^2/Hz
    rings: tuple[complex, ...]  # acceleration after each contact of `hits`, as a turning phasor


@dataclass(frozen=True)
class Line:
    """A frequency in the record that is no mode of the structure."""

    frequency_hz: float
    cause: str


@dataclass(frozen=True)
class Truth:
    modes: tuple[ModeTruth, ...]
    hits: tuple[Hit, ...]
    lines: tuple[Line, ...]
    clipped: tuple[str, ...]  # channels that reach their full scale
    faulty: tuple[str, ...]  # dead, with a gap, stuck or mis-scaled
    fault: str
    gap_s: tuple[float, float] | None  # of the faulty channel, in the file's time
    wrong_factor: float  # the faulty channel is recorded times this
    delays_s: tuple[float, ...]  # a channel each
    time_base_error: float
    modulation_hz: float
    description: dict[str, float]


@dataclass(frozen=True)
class Recording:
    """`data` is (samples, channels), in each channel's unit."""

    kind: str
    seed: int
    data: Array
    channels: tuple[Channel, ...]
    rate_hz: float
    start: datetime
    temperature_c: float
    length_m: float
    truth: Truth

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(c.name for c in self.channels)

    @property
    def units(self) -> tuple[str, ...]:
        return tuple(c.unit for c in self.channels)

    @property
    def time_s(self) -> Array:
        return np.arange(len(self.data)) / self.rate_hz


@dataclass(frozen=True)
class _Scene:
    """A structure with its sensors on: arrays (modes,) and (modes, points)."""

    modes: Modes
    planes: tuple[str, ...]
    orders: tuple[int, ...]
    bare_hz: Array
    direction: Array  # (modes, 2): part in the transverse and the longitudinal plane
    places_m: tuple[float, ...]
    at_sensors: Array
    shape_at: Callable[[float], Array]
    length_m: float
    description: dict[str, float]


def _damping(rng: np.random.Generator, count: int) -> Array:
    """0.0005 to 0.01, each hanger of its own level, each mode of its own value."""
    level = np.exp(rng.uniform(np.log(0.0008), np.log(0.006)))
    return np.asarray(np.clip(level * np.exp(0.5 * rng.standard_normal(count)), 0.0005, 0.01))


def _drawn_hanger(rng: np.random.Generator, plan: Plan) -> Hanger:
    """Of those that the plan's rates can record."""
    while True:
        drawn = structures.random_hanger(rng)
        if plan.close:
            drawn = structures.with_close_planes(drawn, 0.003)
        hanger = structures.with_mode_at(drawn, 50.0) if plan.hum_at_mode else drawn
        if hanger is None:
            continue
        first_hz = structures.bar_shapes(hanger.transverse, 1).frequency_hz[0]
        low, high = plan.first_hz
        if low <= first_hz <= min(high, max(plan.rates_hz) / RATE_OVER_FIRST):
            return hanger


def _hanger_scene(rng: np.random.Generator, plan: Plan) -> _Scene:
    bare = _drawn_hanger(rng, plan)
    length_m = bare.transverse.length_m
    count = int(rng.integers(1, 5))
    places = tuple(float(x) for x in np.sort(rng.uniform(0.08, 0.45, count)) * min(length_m, 9.0))
    masses = [] if plan.quiet else [(x, float(rng.uniform(*plan.sensor_kg))) for x in places]
    hanger = bare.with_masses(masses)
    if plan.hum_at_mode:  # once more, now that the sensors have moved it a little
        hanger = structures.with_mode_at(hanger, 50.0) or hanger
        bare = bare.with_tension(hanger.transverse.tension_n)
    shapes = [structures.bar_shapes(bar, MODES) for bar in hanger.planes()]

    def shape_at(place_m: float) -> Array:
        return np.concatenate([s.at([place_m])[:, 0] for s in shapes])

    first = hanger.transverse
    return _Scene(
        modes=Modes(np.concatenate([s.frequency_hz for s in shapes]), _damping(rng, 2 * MODES)),
        planes=tuple(np.repeat(PLANES, MODES).tolist()),
        orders=tuple(range(1, MODES + 1)) * 2,
        bare_hz=np.concatenate(
            [structures.bar_shapes(bar, MODES).frequency_hz for bar in bare.planes()]
        ),
        direction=np.repeat(np.eye(2), MODES, axis=0),
        places_m=places,
        at_sensors=np.vstack([s.at(places) for s in shapes]),
        shape_at=shape_at,
        length_m=length_m,
        description={
            "length_m": length_m,
            "diameter_m": first.diameter_m,
            "tension_n": first.tension_n,
            **{
                f"{end}_{plane}_nm_per_rad": spring
                for plane, bar in zip(PLANES, hanger.planes(), strict=True)
                for end, spring in zip(("deck", "arch"), bar.springs_nm, strict=True)
            },
            "sensors_kg": float(sum(kg for _, kg in masses)),
        },
    )


def _frame_scene(rng: np.random.Generator, plan: Plan) -> _Scene:
    if plan.structure == "five":
        frame: Frame = structures.five_modes(rng)
    elif plan.structure == "frame":
        mass, first = float(rng.uniform(5e3, 5e4)), float(rng.uniform(0.8, 3.0))
        frame = structures.shear_frame(
            5, mass, mass * (2 * np.pi * first / (2 * np.sin(np.pi / 22))) ** 2
        )
    else:
        frame = structures.bridge_deck(rng)
    count = len(frame.frequency_hz)
    plane = "vertical" if plan.structure == "bridge" else "x"
    return _Scene(
        modes=Modes(frame.frequency_hz, np.asarray(rng.uniform(0.003, 0.01, count))),
        planes=(plane,) * count,
        orders=tuple(range(1, count + 1)),
        bare_hz=frame.frequency_hz,
        direction=np.tile([1.0, 0.0], (count, 1)),
        places_m=frame.places_m,
        at_sensors=frame.shapes,
        shape_at=lambda place_m: np.zeros(count),
        length_m=max(frame.places_m),
        description={},
    )


@dataclass(frozen=True)
class _Grid:
    """The fine grid: `pad` + `count` samples of the file and what fills up a quick transform."""

    logger: Logger
    count: int

    @property
    def size(self) -> int:
        over = self.logger.oversampling
        return over * int(fft.next_fast_len(self.count + 2 * PAD, real=True))

    @property
    def start_s(self) -> float:
        return -PAD / self.logger.true_rate_hz

    @property
    def seconds(self) -> float:
        return self.count / self.logger.true_rate_hz

    @property
    def inside(self) -> slice:
        over = self.logger.oversampling
        return slice(PAD * over, (PAD + self.count) * over)


def _grid(rng: np.random.Generator, plan: Plan, scene: _Scene) -> _Grid:
    fit = [r for r in plan.rates_hz if r >= RATE_OVER_FIRST * scene.modes.frequency_hz[0]]
    rate = float(rng.choice(fit))
    ambient = plan.excitation in ("wind", "trucks")
    over = 1 if ambient else int(np.clip(round(FINE_HZ / rate), 2, 16))
    logger = chain.random_logger(rng, rate, over)
    if plan.quiet:
        logger = replace(logger, time_base_error=0.0, jitter_s=0.0, filter="steep", bits=40)
    seconds = min(float(rng.uniform(*plan.seconds)), SAMPLES / (rate * over))
    return _Grid(logger, int(seconds * rate))


@dataclass(frozen=True)
class _Blow:
    """A contact before it meets the modes; `at_s` is physical time."""

    at_s: float
    contact_s: float
    peak_n: float
    place_m: float
    plane: int
    off_deg: float
    rebound: bool = False

    @property
    def direction(self) -> Array:
        turn = np.deg2rad(self.off_deg)
        along = np.array([np.cos(turn), np.sin(turn)])
        return along if self.plane == 0 else along[::-1]


def _blows(rng: np.random.Generator, plan: Plan, scene: _Scene, seconds: float) -> list[_Blow]:
    """Hits all along the record; the ring-down of each is cut by the next."""
    if plan.excitation in ("wind", "trucks"):
        return []
    count = int(rng.integers(plan.hits[0], plan.hits[1] + 1))
    count = max(plan.hits[0], min(count, int(seconds / 3)))
    contact_s = float(np.exp(rng.uniform(np.log(4e-4), np.log(6e-3))))  # steel tip to soft rubber
    pause = min(float(rng.uniform(0.3, 2.0)), 0.1 * seconds)
    edges = pause + (seconds - pause) * np.cumsum(np.r_[0, rng.uniform(0.6, 1.4, count)]) / (
        1.1 * count
    )
    times = np.minimum(edges[:count], seconds * (1 - 0.4 / count))
    if not plan.pre_trigger:
        times = times - times[0] - contact_s * rng.uniform(0.1, 0.6)
    place = float(rng.uniform(0.08, 0.42)) * min(scene.length_m, 5.0)
    planes = [[0] * count, [1] * count, [int(i >= count / 2) for i in range(count)]]
    chosen = planes[int(rng.choice(3, p=[0.25, 0.15, 0.6]))]
    blows = []
    for at_s, plane in zip(times, chosen, strict=True):
        peak = float(np.exp(rng.uniform(np.log(200), np.log(3000)))) * plan.force
        off = float(rng.uniform(0, 20) * rng.choice([-1, 1]))
        touch = contact_s * float(rng.uniform(0.9, 1.15))
        spot = place + 0.02 * float(rng.standard_normal())
        blow = _Blow(float(at_s), touch, peak, spot, plane, off)
        blows.append(blow)
        if plan.excitation != "release" and rng.random() < plan.rebounds:
            later = blow.at_s + touch + float(rng.uniform(0.008, 0.04))
            weaker = peak * float(rng.uniform(0.1, 0.5))
            blows.append(replace(blow, at_s=later, peak_n=weaker, rebound=True))
    return blows


def _push(scene: _Scene, plan: Plan, blow: _Blow) -> Push:
    modal = blow.peak_n * scene.shape_at(blow.place_m) * (scene.direction @ blow.direction)
    if plan.excitation != "release":
        return Push(blow.at_s, blow.contact_s, modal)
    # The rope parts within the contact time: modes quicker than that are let down, not let go.
    return Push(blow.at_s, 0.0, modal * np.sinc(scene.modes.frequency_hz * blow.contact_s))


@dataclass
class _Motion:
    """Accelerations on the fine grid, (points, 2, size), and each mode's own energy."""

    ringing: Array
    background: Array
    energy: Array  # (modes,): the integral of q''^2 over the record
    mean_hz: Array
    change: Array  # of the frequency at the largest amplitude
    lines: list[Line]
    rings: list[tuple[complex, ...]]  # a mode each


def _ring(
    rng: np.random.Generator, plan: Plan, scene: _Scene, grid: _Grid, blows: Sequence[_Blow]
) -> _Motion:
    count, step = grid.size, grid.logger.step_s
    pushes = [_push(scene, plan, blow) for blow in blows]
    change = plan.change * np.exp(rng.uniform(np.log(2e-4), np.log(2e-3), len(scene.orders)))
    modes = scene.modes
    ringing = Ringing(modes, pushes, Law(change, power=1 if plan.change < 0 else 2))
    motion = _still(scene, grid)
    motion.change = change
    motion.rings = [ringing.accelerations_after(k) for k in range(len(scene.orders))]
    kept = [k for k, hz in enumerate(modes.frequency_hz) if hz < 0.45 / step]
    for k in kept:
        own = ringing.acceleration(k, grid.start_s, step, count)
        _add(motion.ringing, scene, k, own)
        motion.energy[k] = np.sum(own[grid.inside] ** 2) * step
        motion.mean_hz[k] = ringing.mean_frequency_hz(k, grid.seconds)
    for push in pushes:
        if push.contact_s > 0:
            first, pulse = band_limited(push, grid.start_s, step, count)
            share = scene.at_sensors[kept].T @ (scene.direction * push.modal[:, None])[kept]
            motion.ringing[:, :, first : first + len(pulse)] += share[:, :, None] * pulse
    if plan.second_harmonic:
        _double(rng, scene, grid, ringing, motion)
    return motion


def _double(
    rng: np.random.Generator, scene: _Scene, grid: _Grid, ringing: Ringing, motion: _Motion
) -> None:
    """1 to 5 % of the first mode's acceleration at twice its frequency, as the square goes."""
    for k in (0, MODES):
        if ringing.reference[k] == 0:
            continue
        eta = ringing.eta(k, grid.start_s, grid.logger.step_s, grid.size) / ringing.reference[k]
        peak = abs(ringing.modes.poles[k]) * ringing.reference[k]
        _add(motion.ringing, scene, k, rng.uniform(0.01, 0.05) * peak * (eta**2).imag)
        motion.lines.append(Line(2 * float(scene.modes.frequency_hz[k]), "2 f1 of the deflection"))


def _still(scene: _Scene, grid: _Grid) -> _Motion:
    shape = (len(scene.places_m), 2, grid.size)
    hz = scene.modes.frequency_hz
    return _Motion(
        ringing=np.zeros(shape),
        background=np.zeros(shape),
        energy=np.zeros(len(hz)),
        mean_hz=hz.copy(),
        change=np.zeros(len(hz)),
        lines=[],
        rings=[()] * len(hz),
    )


def _add(motion: Array, scene: _Scene, k: int, own: Array) -> None:
    for axis in np.flatnonzero(scene.direction[k]):
        motion[:, axis] += scene.at_sensors[k][:, None] * (scene.direction[k, axis] * own)


def _wind(
    rng: np.random.Generator, plan: Plan, scene: _Scene, grid: _Grid, modes: Sequence[int]
) -> dict[int, Array]:
    """q'' of each of `modes` under gusts, whose modal forces are independent; scale still free.

    Gusts fall off above 0.5 Hz with the square root of the frequency in amplitude, eddies of the
    hanger itself keep on to 100 Hz.  Trucks multiply the force for some seconds each.
    """
    step, count = grid.logger.step_s, grid.size
    frequency = fft.rfftfreq(count, step)
    density = (1 + frequency / 0.5) ** -0.5 / (1 + (frequency / 100) ** 2)
    swell = np.ones(count)
    if plan.excitation == "trucks":
        t = step * np.arange(count)
        for _ in range(int(rng.integers(4, 20))):
            middle, long = rng.uniform(0, t[-1]), rng.uniform(1, 4)
            swell += rng.uniform(3, 15) * np.exp(-0.5 * ((t - middle) / long) ** 2)
    answers = {}
    for k in modes:
        if scene.modes.frequency_hz[k] < 0.5 / step:
            force = rng.uniform(0.4, 1.0) * coloured(rng, count, step, density) * swell
            answers[k] = answer(scene.modes, k, force, step)
    return answers


def _deck(
    rng: np.random.Generator, scene: _Scene, grid: _Grid, motion: _Motion, rms: float
) -> None:
    """Three modes of the deck shake the lower end; the hanger follows in a straight line."""
    step, count = grid.logger.step_s, grid.size
    hz = np.sort(rng.uniform(0.8, 6.0, 3))
    modes = Modes(hz, np.asarray(rng.uniform(0.008, 0.02, 3)))
    level = np.ones(count // 2 + 1)
    for k in range(3):
        own = answer(modes, k, coloured(rng, count, step, level), step)
        own *= rms / max(float(np.std(own)), 1e-300)
        part = 1 - np.asarray(scene.places_m) / scene.length_m
        turn = rng.uniform(0, np.pi / 2)
        for axis, share in enumerate((np.cos(turn), np.sin(turn))):
            motion.background[:, axis] += part[:, None] * (share * own)
        motion.lines.append(Line(float(hz[k]), "deck"))


def _moved(
    rng: np.random.Generator, plan: Plan, scene: _Scene, grid: _Grid, blows: Sequence[_Blow]
) -> _Motion:
    ambient = plan.excitation in ("wind", "trucks")
    motion = _still(scene, grid) if ambient else _ring(rng, plan, scene, grid, blows)
    rms = float(np.exp(rng.uniform(np.log(0.01), np.log(0.2)))) * (1.0 if ambient else 0.05)
    if plan.quiet and not ambient:
        return motion
    lowest = [k for k, n in enumerate(scene.orders) if ambient or n <= 3]
    answers = _wind(rng, plan, scene, grid, lowest)
    target = np.zeros_like(motion.ringing)
    for k, own in answers.items():
        _add(target, scene, k, own)
    scale = rms / max(float(np.max(np.std(target, axis=2))), 1e-300)
    if ambient:
        motion.ringing += scale * target
        for k, own in answers.items():
            motion.energy[k] = np.sum((scale * own[grid.inside]) ** 2) * grid.logger.step_s
    else:
        motion.background += scale * target
    if plan.structure == "hanger" and not plan.quiet:
        _deck(rng, scene, grid, motion, 0.3 * rms)
    return motion


def _hammer_force(grid: _Grid, blows: Sequence[_Blow]) -> Array:
    force = np.zeros(grid.size)
    for blow in blows:
        push = Push(blow.at_s, blow.contact_s, np.zeros(0))
        first, pulse = band_limited(push, grid.start_s, grid.logger.step_s, grid.size)
        force[first : first + len(pulse)] += blow.peak_n * pulse
    return force


def _wires(rng: np.random.Generator, plan: Plan, scene: _Scene, logger: Logger) -> list[Wire]:
    """The hammer first, where it is recorded, then the sensors."""
    sensors = chain.random_wires(rng, logger, len(scene.places_m), plan.one_axis)
    wires = ([chain.hammer_wire(rng)] if plan.excitation == "hammer" else []) + sensors
    if plan.hum_at_mode:
        wires = [replace(w, hum=float(rng.uniform(0.02, 0.2))) for w in wires]
    if plan.quiet:
        straight = [(1.0, 0.0), (0.0, 1.0)]
        axes = [(1.0, 0.0)] * (plan.excitation == "hammer") + straight * len(scene.places_m)
        if plan.one_axis:
            axes = [(1.0, 0.0)] * len(wires)
        wires = [Wire(m, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, np.inf) for m in axes[: len(wires)]]
    return [replace(w, noise_density=w.noise_density * plan.noise) for w in wires]


@dataclass(frozen=True)
class _Traces:
    """What comes to the converter: (samples, channels) each."""

    wanted: Array
    unwanted: Array


def _traces(
    rng: np.random.Generator, grid: _Grid, wires: Sequence[Wire], motion: _Motion, force: Array
) -> _Traces:
    logger, inside = grid.logger, slice(PAD, PAD + grid.count)
    jitter = logger.jitter_s * rng.standard_normal(grid.size // logger.oversampling)
    wanted, unwanted = [], []
    per_place = max(1, round((len(wires) - (len(force) > 0)) / len(motion.ringing)))
    for i, wire in enumerate(wires):
        noise = chain.disturbances(rng, logger, wire, grid.count)
        if i == 0 and len(force):
            signal, other = force, np.zeros(grid.size)
        else:
            place = (i - (len(force) > 0)) // per_place
            signal, other = (
                wire.mixing[0] * m[place, 0] + wire.mixing[1] * m[place, 1]
                for m in (motion.ringing, motion.background)
            )
        wanted.append(chain.sampled(logger, wire, signal, jitter)[inside])
        unwanted.append(chain.sampled(logger, wire, other, jitter)[inside] + noise)
    return _Traces(np.array(wanted).T, np.array(unwanted).T)


def _modulated(rng: np.random.Generator, grid: _Grid, motion: _Motion) -> float:
    """A machine of 0.4 to 3 Hz moves the ringing's size by 10 to 30 %."""
    hz, depth = float(rng.uniform(0.4, 3.0)), float(rng.uniform(0.1, 0.3))
    t = grid.logger.step_s * np.arange(grid.size)
    motion.ringing *= 1 + depth * np.cos(2 * np.pi * hz * t + rng.uniform(0, 2 * np.pi))
    return hz


def _mode_truths(
    scene: _Scene,
    grid: _Grid,
    wires: Sequence[Wire],
    motion: _Motion,
    unwanted: Array,
    dead: int | None,
) -> tuple[ModeTruth, ...]:
    """`wires` and `unwanted` of the accelerations alone; no mode is heard in the `dead` one."""
    logger, truths = grid.logger, []
    per_place = max(1, len(wires) // len(scene.places_m))
    densities = [chain.density(trace, logger.true_rate_hz) for trace in unwanted.T]
    for k, hz in enumerate(scene.modes.frequency_hz):
        if hz >= logger.true_rate_hz / 2:
            continue
        passed = float(abs(chain.filter_gain(logger, np.array([hz]))[0]))
        width = float(2 * scene.modes.damping[k] * hz)
        shape, noise, ratios = [], [], [1e-30]
        for c, wire in enumerate(wires):
            heard = float(np.dot(wire.mixing, scene.direction[k]))
            shape.append(heard * float(scene.at_sensors[k, c // per_place]))
            density = densities[c].around(float(hz), width)
            density += chain.lsb(logger, wire) ** 2 / 6 / logger.true_rate_hz
            energy = (shape[-1] * wire.gain * passed) ** 2 * motion.energy[k] * (c != dead)
            ratios.append(energy / max(density * width * grid.seconds, 1e-300))
            noise.append(np.inf if c == dead else density / (wire.gain * passed) ** 2)
        truths.append(
            ModeTruth(
                plane=scene.planes[k],
                order=scene.orders[k],
                frequency_hz=float(hz),
                mean_frequency_hz=float(motion.mean_hz[k]),
                change_at_peak=float(motion.change[k]),
                bare_frequency_hz=float(scene.bare_hz[k]),
                damping_ratio=float(scene.modes.damping[k]),
                snr_db=float(10 * np.log10(max(ratios))),
                shape=tuple(shape),
                noise=tuple(noise),
                rings=motion.rings[k],
            )
        )
    return tuple(truths)


def _ranged(plan: Plan, wires: Sequence[Wire], traces: _Traces, hammer: bool) -> list[Wire]:
    """Each channel with its full scale: 1.2 times the peak or more, or half of it."""
    peaks = np.max(np.abs(traces.wanted + traces.unwanted), axis=0)
    ranged = []
    for i, (wire, peak) in enumerate(zip(wires, peaks, strict=True)):
        quantity = "force" if hammer and i == 0 else "acceleration"
        small = plan.clip == quantity
        full_scale = peak / 2 if small else chain.chosen_range(float(peak))
        ranged.append(replace(wire, full_scale=float(full_scale)))
    return ranged


@dataclass(frozen=True)
class _Fault:
    channel: int | None
    gap_s: tuple[float, float] | None = None
    factor: float = 1.0


def _spoilt(
    rng: np.random.Generator, plan: Plan, data: Array, hammer: bool, rate_hz: float, step: Array
) -> _Fault:
    """Spoils one acceleration channel of `data` in place."""
    if not plan.fault:
        return _Fault(None)
    channel = int(rng.integers(int(hammer), data.shape[1]))
    count = len(data)
    begin = int(rng.uniform(0.2, 0.7) * count)
    end = min(begin + int(rng.uniform(0.01, 0.05) * count) + 2, count)
    gap = (begin / rate_hz, end / rate_hz)
    if plan.fault == "dead":
        bits = rng.integers(-1, 2, count)
        data[:, channel] = data[0, channel] * 0.01 + bits * step[channel]
        return _Fault(channel)
    if plan.fault == "gain":
        factor = float(rng.choice([G, 1 / G, 1000.0, 0.1, 10.0]))
        data[:, channel] *= factor
        return _Fault(channel, factor=factor)
    data[begin:end, channel] = np.nan if plan.fault == "nan" else data[begin - 1, channel]
    return _Fault(channel, gap)


def _channels(
    plan: Plan,
    scene: _Scene,
    wires: Sequence[Wire],
    unit: str,
    bits: int,
    blows: Sequence[_Blow],
) -> tuple[Channel, ...]:
    """What the crew writes down; where the hammer hit, to the decimetre."""
    channels, rest = [], list(wires)
    if plan.excitation == "hammer":
        where = round(float(np.mean([b.place_m for b in blows])), 1)
        channels.append(Channel("Hammer", "force", "N", None, where, rest.pop(0).full_scale, bits))
    axes: tuple[tuple[str, str], ...] = (("y", PLANES[0]), ("z", PLANES[1]))
    if plan.one_axis:
        axes = ((("y", PLANES[0]) if plan.structure == "hanger" else ("", scene.planes[0])),)
    of_unit = G if unit == "g" else 1.0
    for i, place_m in enumerate(scene.places_m):
        for axis, plane in axes:
            name = f"Acc{i + 1}{axis}"
            scale = rest.pop(0).full_scale / of_unit
            channels.append(Channel(name, "acceleration", unit, plane, place_m, scale, bits))
    return tuple(channels)


def case(kind: str, seed: int) -> Recording:
    """The recording of this kind and seed: the same every time."""
    rng = np.random.default_rng([zlib.crc32(kind.encode()), seed])
    return recorded(rng, KINDS[kind].plan, kind, seed)


def recorded(rng: np.random.Generator, plan: Plan, kind: str, seed: int) -> Recording:
    """A recording of any plan; `case` draws those of the registry."""
    scene = (_hanger_scene if plan.structure == "hanger" else _frame_scene)(rng, plan)
    grid = _grid(rng, plan, scene)
    blows = _blows(rng, plan, scene, grid.seconds)
    motion = _moved(rng, plan, scene, grid, blows)
    modulation_hz = _modulated(rng, grid, motion) if plan.modulated else 0.0
    hammer = plan.excitation == "hammer"
    wires = _wires(rng, plan, scene, grid.logger)
    force = _hammer_force(grid, blows) if hammer else np.zeros(0)
    traces = _traces(rng, grid, wires, motion, force)
    wires = _ranged(plan, wires, traces, hammer)
    data = np.column_stack(
        [
            chain.converted(grid.logger, wire, trace)
            for wire, trace in zip(wires, (traces.wanted + traces.unwanted).T, strict=True)
        ]
    )
    reached = [
        np.max(np.abs(d)) >= w.full_scale * 0.9999 for d, w in zip(data.T, wires, strict=True)
    ]
    unit = "m/s2" if plan.quiet else str(rng.choice(["m/s2", "g"], p=[0.75, 0.25]))
    channels = _channels(plan, scene, wires, unit, grid.logger.bits, blows)
    step = np.array([chain.lsb(grid.logger, w) for w in wires])
    fault = _spoilt(rng, plan, data, hammer, grid.logger.rate_hz, step)
    data /= [G if c.unit == "g" else 1.0 for c in channels]
    dead = fault.channel - hammer if plan.fault == "dead" and fault.channel is not None else None
    noise = traces.unwanted[:, int(hammer) :]
    truth = Truth(
        modes=_mode_truths(scene, grid, wires[hammer:], motion, noise, dead),
        hits=_hits(grid, blows),
        lines=_lines(plan, grid, motion),
        clipped=tuple(c.name for c, at_end in zip(channels, reached, strict=True) if at_end),
        faulty=() if fault.channel is None else (channels[fault.channel].name,),
        fault=plan.fault,
        gap_s=fault.gap_s,
        wrong_factor=fault.factor,
        delays_s=tuple(w.delay_s for w in wires),
        time_base_error=grid.logger.time_base_error,
        modulation_hz=modulation_hz,
        description=scene.description,
    )
    start = datetime(2024, 1, 1, tzinfo=UTC) + timedelta(
        milliseconds=int(rng.integers(60_000_000_000))
    )
    return Recording(
        kind=kind,
        seed=seed,
        data=data,
        channels=channels,
        rate_hz=grid.logger.rate_hz,
        start=start,
        temperature_c=round(float(rng.uniform(-10, 35)), 1),
        length_m=scene.length_m,
        truth=truth,
    )


def _hits(grid: _Grid, blows: Sequence[_Blow]) -> tuple[Hit, ...]:
    clock = 1 + grid.logger.time_base_error
    return tuple(
        Hit(
            b.at_s * clock,
            b.peak_n,
            b.contact_s,
            PLANES[b.plane],
            b.off_deg,
            b.place_m,
            b.rebound,
        )
        for b in blows
    )


def _lines(plan: Plan, grid: _Grid, motion: _Motion) -> tuple[Line, ...]:
    mains = [] if plan.quiet else [grid.logger.mains_hz * n for n in (1, 3, 5)]
    half = grid.logger.true_rate_hz / 2
    return (*motion.lines, *(Line(hz, "mains") for hz in mains if hz < half))
