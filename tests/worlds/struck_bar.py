"""Hammer tests of a clamped bar with a part that meets, opens or slips above an amplitude, in time.

The bar is finite elements reduced to its lowest modes; between samples each mode turns exactly, and
the part's force acts on all of them at once, from the motion where it sits: no averaging, no
describing function, no frequency that depends on an amplitude is written down anywhere. What the
software under test would call a frequency, a slope or a damping only comes out of the records.

A guide with play pushes back beyond its gap, with some loss in the contact. A crack gives way on
one side of the swing once its bending exceeds what holds it shut. A joint slips at an end: the
rotation is a sum of play operators of the moment (Iwan 1966), softer and lossier the wider it
swings. Both planes are alike but for a share of their stiffness and do not couple.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

Array = NDArray[np.float64]
PLANES = ("transverse", "longitudinal")
MODES, ELEMENTS = 12, 40
STEP_HZ, RATE_HZ = 2048, 1024
PAUSE_S = 0.25
DAMPING = 0.0015


@dataclass(frozen=True)
class Bar:
    """Clamped at both ends."""

    length_m: float = 12.0
    tension_n: float = 711e3
    bending_nm2: float = 200e9 * np.pi * 0.13**4 / 64
    mass_kg_m: float = 7800 * np.pi * 0.13**2 / 4


@dataclass(frozen=True)
class Modes:
    """Angular frequencies (modes,) and, by mode and node, deflection and curvature, mass-normed."""

    omega: Array
    deflection: Array
    curvature: Array
    x_m: Array

    def at(self, x_m: float, bent: bool = False) -> Array:
        table = self.curvature if bent else self.deflection
        return np.array([np.interp(x_m, self.x_m, row) for row in table])


def modes_of(bar: Bar) -> Modes:
    h = bar.length_m / ELEMENTS
    k = np.array([[12, 6 * h, -12, 6 * h], [6 * h, 4 * h**2, -6 * h, 2 * h**2]])
    k = np.vstack([k, -k[0], [6 * h, 2 * h**2, -6 * h, 4 * h**2]]) * bar.bending_nm2 / h**3
    g = np.array([[36, 3 * h, -36, 3 * h], [3 * h, 4 * h**2, -3 * h, -(h**2)]])
    g = np.vstack([g, -g[0], [3 * h, -(h**2), -3 * h, 4 * h**2]]) * bar.tension_n / (30 * h)
    m = np.array([[156, 22 * h, 54, -13 * h], [22 * h, 4 * h**2, 13 * h, -3 * h**2]])
    m = np.vstack([m, [54, 13 * h, 156, -22 * h], [-13 * h, -3 * h**2, -22 * h, 4 * h**2]])
    m = m * bar.mass_kg_m * h / 420
    size = 2 * (ELEMENTS + 1)
    stiff, mass = np.zeros((size, size)), np.zeros((size, size))
    for e in range(ELEMENTS):
        own = slice(2 * e, 2 * e + 4)
        stiff[own, own] += k + g
        mass[own, own] += m
    free = slice(2, size - 2)
    square, shape = linalg.eigh(stiff[free, free], mass[free, free], subset_by_index=[0, MODES - 1])
    full = np.zeros((MODES, size))
    full[:, free] = shape.T
    w, t = full[:, ::2], full[:, 1::2]
    # Of the Hermite polynomials, at the left end of each element and at the right of the last.
    left = (6 * (w[:, 1:] - w[:, :-1]) / h - 4 * t[:, :-1] - 2 * t[:, 1:]) / h
    last = (6 * (w[:, -2:-1] - w[:, -1:]) / h + 4 * t[:, -1:] + 2 * t[:, -2:-1]) / h
    return Modes(
        np.sqrt(square), w, np.hstack([left, last]), np.linspace(0, bar.length_m, len(w.T))
    )


@dataclass(frozen=True)
class Guide:
    """Pushes back on both sides beyond a gap; its loss goes with the speed in contact."""

    x_m: float
    stiffness_n_m: float
    gap_m: float
    loss_s: float = 2e-4
    planes: tuple[int, ...] = (0, 1)
    slips = 0

    def row(self, modes: Modes, bar: Bar) -> Array:
        return modes.at(self.x_m)

    def force(self, moved: Array, speed: Array, state: Array) -> tuple[Array, Array]:
        beyond = moved - np.clip(moved, -self.gap_m, self.gap_m)
        return -self.stiffness_n_m * (beyond + self.loss_s * speed * (beyond != 0)), state


@dataclass(frozen=True)
class Crack:
    """A hinge of a compliance on one side of the swing, above the moment that holds it shut."""

    x_m: float
    compliance_rad_nm: float
    shut_nm: float
    planes: tuple[int, ...] = (0,)
    slips = 0

    def row(self, modes: Modes, bar: Bar) -> Array:
        return bar.bending_nm2 * modes.at(self.x_m, bent=True)

    def force(self, moved: Array, speed: Array, state: Array) -> tuple[Array, Array]:
        return self.compliance_rad_nm * np.maximum(moved - self.shut_nm, 0.0), state


@dataclass(frozen=True)
class Joint:
    """Slips at the deck end: play operators of thresholds spread evenly up to `slip_nm`."""

    compliance_rad_nm: float
    slip_nm: float
    planes: tuple[int, ...] = (0, 1)
    slips = 12

    def row(self, modes: Modes, bar: Bar) -> Array:
        return bar.bending_nm2 * modes.at(0.0, bent=True)

    def force(self, moved: Array, speed: Array, state: Array) -> tuple[Array, Array]:
        width = self.slip_nm * (np.arange(self.slips) + 0.5) / self.slips
        now = np.clip(state, moved[:, None] - width, moved[:, None] + width)
        return self.compliance_rad_nm * now.mean(axis=1), now


Part = Guide | Crack | Joint


@dataclass(frozen=True)
class Crew:
    """How the test is made; sensors err in gain and place as in the field."""

    sensors_m: tuple[float, ...] = (1.5, 2.7, 4.1)
    hammer_m: float = 1.1
    hits: int = 5
    peak_n: float = 1500.0
    contact_s: float = 0.003
    ring_s: float = 12.0
    noise_m_s2: float = 5e-4
    noise_n: float = 0.3
    gain: float = 0.01
    place_m: float = 0.005
    turned_deg: float = 1.0


@dataclass(frozen=True)
class Record:
    """One hit from rest: `force_n` (samples,), `motion_m_s2` (sensors, planes, samples)."""

    plane: str
    force_n: Array
    motion_m_s2: Array
    largest_m: float  # what the part saw of the largest swing, in its own measure
    rate_hz: float = RATE_HZ


@dataclass(frozen=True)
class Hanger:
    bar: Bar = field(default_factory=Bar)
    part: Part | None = None
    apart: float = 0.0  # the longitudinal plane's bending stiffness is more by this share

    def planes(self) -> list[tuple[Bar, Modes]]:
        stiffer = Bar(
            self.bar.length_m,
            self.bar.tension_n,
            self.bar.bending_nm2 * (1 + self.apart),
            self.bar.mass_kg_m,
        )
        return [(each, modes_of(each)) for each in (self.bar, stiffer)]


def tested(hanger: Hanger, crew: Crew, level: float, rng: np.random.Generator) -> list[Record]:
    """A test at `level` times the crew's force: a record for each hit, a bit off its plane."""
    count = len(crew.sensors_m)
    off = crew.place_m * rng.standard_normal(count)
    gains = 1 + crew.gain * rng.standard_normal((count, 2))
    turned = np.deg2rad(crew.turned_deg) * rng.standard_normal(count)
    peaks = level * crew.peak_n * rng.uniform(0.8, 1.2, 2 * crew.hits)
    beside = np.deg2rad(rng.uniform(5, 20, 2 * crew.hits))
    first = np.arange(2 * crew.hits) < crew.hits
    moved, largest, force = [], [], peaks[:, None]
    for plane, (bar, modes) in enumerate(hanger.planes()):
        part = hanger.part if hanger.part and plane in hanger.part.planes else None
        along = np.where(first == (plane == 0), np.cos(beside), np.sin(beside))
        own, seen, pulse = _rung(bar, modes, part, crew, along * peaks, off)
        moved.append(own)
        largest.append(seen)
        force = peaks[:, None] * pulse
    turn = np.array([[np.cos(turned), np.sin(turned)], [-np.sin(turned), np.cos(turned)]])
    motion = np.einsum("aps,psht->saht", turn, np.array(moved)) * gains[:, :, None, None]
    records = []
    for k, along in enumerate(first):
        heard = motion[:, :, k] + crew.noise_m_s2 * rng.standard_normal(motion[:, :, k].shape)
        hammer = force[k] + crew.noise_n * rng.standard_normal(force[k].size)
        records.append(Record(PLANES[int(not along)], hammer, heard, max(largest)))
    return records


def _rung(
    bar: Bar, modes: Modes, part: Part | None, crew: Crew, peaks: Array, off: Array
) -> tuple[Array, float, Array]:
    """Each hit from rest, side by side: accelerations (sensors, hits, samples), the largest that
    the part saw, and the pulse of a peak of 1."""
    step = 1 / STEP_HZ
    pause, count = int(PAUSE_S * STEP_HZ), int((PAUSE_S + crew.ring_s) * STEP_HZ)
    pole = modes.omega * (-DAMPING + 1j * np.sqrt(1 - DAMPING**2))
    turn, swing = np.exp(pole * step), pole.imag
    since = (np.arange(count) - pause) * step
    shape = np.sin(np.pi * since / crew.contact_s) * (since > 0) * (since < crew.contact_s)
    struck = modes.at(crew.hammer_m)
    row = part.row(modes, bar) if part else np.zeros(MODES)
    state = np.zeros((len(peaks), part.slips if part else 0))
    seen = np.array([modes.at(x + d) for x, d in zip(crew.sensors_m, off, strict=True)])
    eta = np.zeros((len(peaks), MODES), complex)
    every, largest = STEP_HZ // RATE_HZ, 0.0
    out = np.zeros((len(peaks), len(seen), count // every))
    for i in range(count):
        modal = (shape[i] * peaks)[:, None] * struck if shape[i] else 0.0
        if part and i >= pause:
            moved = eta.imag @ (row / swing)
            speed = (eta.imag * pole.real + eta.real * swing) @ (row / swing)
            push, state = part.force(moved, speed, state)
            modal = modal + push[:, None] * row
            largest = max(largest, float(np.abs(moved).max()))
        if i % every == 0:
            own = (pole**2 * eta).imag / swing + modal
            out[:, :, i // every] = own @ seen.T
        eta = (eta + step * modal / 2) * turn + step * modal / 2
    return out.transpose(1, 0, 2), largest, shape[::every]
