"""Truth for the diagnosis of any simulator: three systems that are no hangers, each with a cause.

- Frame of two storeys, its bolted joint with play: bolts of unlike clearances that make contact
  one by one, in equilibrium by bisection; frequencies from the stiffness there.
- Cantilever whose support moves: finite differences of the beam's fourth-order equation.
- Two masses with friction: the equations of motion integrated in time (Runge and Kutta), the
  friction a sign of the velocity; amplitudes by Fourier's sum over the last cycles.

Every reading has noise of `NOISE` of itself, whose stated deviation is off by up to 20 %, the
sensor a gain of 1 %, and the stiffnesses differ from what is assumed by some 5 %.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

NOISE = 0.004
GAIN = 0.01
Array = NDArray[np.float64]


class Read(NamedTuple):
    """A reading as a world gives it."""

    condition: dict[str, float]
    observable: str
    value: float
    sd: float


def _noisy(
    exact: list[tuple[dict[str, float], str, float]], rng: np.random.Generator
) -> list[Read]:
    stated = np.exp(rng.uniform(-0.2, 0.2))
    gain = 1 + GAIN * rng.standard_normal()
    reads = []
    for condition, name, value in exact:
        scaled = value if name.startswith("f") else value * gain
        sd = (NOISE if not name.startswith("f") else NOISE / 4) * abs(value)
        reads.append(Read(condition, name, scaled + sd * rng.standard_normal(), sd * stated))
    return reads


FRAME_MASS_KG, FRAME_HEIGHT_M = (4000.0, 3000.0), (3.0, 6.0)
FRAME_STIFFNESS_N_M = (6e6, 4e6)


def frame(rng: np.random.Generator, play_m: float) -> list[Read]:
    """Deflections by loads of 2 to 16 kN on either floor, and frequencies without load."""
    k = np.array(FRAME_STIFFNESS_N_M) * np.exp(0.05 * rng.standard_normal(2))
    clearances = play_m * np.linspace(0.5, 1.5, 6)
    exact = []
    for load_n in (2e3, 4e3, 8e3, 16e3):
        for floor in (1.0, 2.0):
            slip = _slip(load_n, clearances)
            u1 = load_n / k[0] + slip
            u2 = u1 + (load_n / k[1] if floor == 2 else 0.0)
            at = {"load_n": load_n, "floor": floor, "temperature_k": 0.0}
            exact += [(at, "u1_m", u1), (at, "u2_m", u2)]
    for temperature_k in (-15.0, 15.0):
        at = {"load_n": 0.0, "floor": 0.0, "temperature_k": temperature_k}
        stiffness = np.array([[k[0] + k[1], -k[1]], [-k[1], k[1]]])
        omega = np.sqrt(eigh(stiffness, np.diag(FRAME_MASS_KG), eigvals_only=True))
        exact += [(at, f"f{i}_hz", float(w) / (2 * np.pi)) for i, w in enumerate(omega, 1)]
    return _noisy(exact, rng)


def _slip(load_n: float, clearances: Array) -> float:
    """Where bolts that bear from their clearances on, and a weak preload, carry the load."""
    if not clearances.any():
        return 0.0
    low, high = 0.0, float(clearances.max()) * 3
    for _ in range(60):
        slip = (low + high) / 2
        carried = 2e3 * slip / clearances.mean() + 3e8 * np.maximum(slip - clearances, 0).sum()
        low, high = (slip, high) if carried < load_n else (low, slip)
    return (low + high) / 2


BEAM_LENGTH_M, BEAM_EI_N_M2, BEAM_MASS_KG_M = 4.0, 2e6, 60.0
_CELLS = 160


def cantilever(rng: np.random.Generator, support_m_n: float) -> list[Read]:
    """Deflections at four places by loads at two, and two frequencies; `support_m_n` a flexibility.

    A chain of rigid cells and rotational springs, the finite difference of the curvature.
    """
    ei = BEAM_EI_N_M2 * np.exp(0.05 * rng.standard_normal())
    cell = BEAM_LENGTH_M / _CELLS
    places = (np.arange(_CELLS) + 0.5) * cell
    corners = np.arange(_CELLS) * cell
    lever = np.maximum(places[:, None] - corners, 0)
    weight = np.ones(_CELLS)
    weight[0] = 0.5  # the first corner is the wall's: half a cell bends there
    flexibility = lever * (weight * cell / ei) @ lever.T + support_m_n
    exact = []
    for load_place in (0.5, 1.0):
        at_load = min(int(load_place * _CELLS), _CELLS - 1)
        for load_n in (1e3, 2e3):
            at = {"load_n": load_n, "load_at_m": float(places[at_load])}
            exact += [
                (at, f"w{int(100 * share)}_m", load_n * _between(share, flexibility[:, at_load]))
                for share in (0.25, 0.5, 0.75, 1.0)
            ]
    mass = BEAM_MASS_KG_M * cell
    periods = np.sort(np.linalg.eigvalsh(flexibility * mass))[::-1]
    at = {"load_n": 0.0, "load_at_m": 0.0}
    exact += [(at, f"f{i + 1}_hz", float(periods[i] ** -0.5) / (2 * np.pi)) for i in range(2)]
    return _noisy(exact, rng)


def _between(share: float, deflection: Array) -> float:
    """The deflection at a share of the length, straight on beyond the last cell's middle."""
    place = share * _CELLS - 0.5
    low = min(int(place), _CELLS - 2)
    return float(deflection[low] + (place - low) * (deflection[low + 1] - deflection[low]))


OSCILLATOR_MASS_KG, OSCILLATOR_STIFFNESS_N_M = (10.0, 5.0), (8000.0, 3000.0)
OSCILLATOR_DAMPING_N_S_M = (25.0, 15.0)
_CYCLES, _STEPS_A_CYCLE, _READ = 40, 80, 8


def oscillator(rng: np.random.Generator, friction_n: float) -> list[Read]:
    """Amplitudes of both masses at four frequencies and two forces on the first one."""
    k = np.array(OSCILLATOR_STIFFNESS_N_M) * np.exp(0.03 * rng.standard_normal(2))
    c = np.array(OSCILLATOR_DAMPING_N_S_M) * np.exp(0.1 * rng.standard_normal(2))
    frequencies_hz, forces_n = np.array([2.5, 3.5, 4.5, 6.0]), np.array([20.0, 80.0])
    omega, force = (each.ravel() for each in np.meshgrid(2 * np.pi * frequencies_hz, forces_n))
    first, second = _steady(omega, force, k, c, friction_n)
    exact = []
    for w, f, x1, x2 in zip(omega, force, first, second, strict=True):
        at = {"frequency_hz": float(w / (2 * np.pi)), "force_n": float(f)}
        exact += [(at, "x1_m", float(x1)), (at, "x2_m", float(x2))]
    return _noisy(exact, rng)


def _steady(
    omega: Array, force: Array, k: Array, c: Array, friction_n: float
) -> tuple[Array, Array]:
    """Amplitudes at the forcing's frequency, in the last cycles of an integration in time."""
    m = OSCILLATOR_MASS_KG
    step = 2 * np.pi / omega / _STEPS_A_CYCLE

    def rate(state: Array, time: Array) -> Array:
        x1, x2, v1, v2 = state
        between = k[1] * (x1 - x2) + c[1] * (v1 - v2)
        # Technical: the sign of the velocity, smooth within 2 mm/s.
        rubbing = friction_n * np.tanh(v1 / 2e-3)
        a1 = (force * np.cos(omega * time) - k[0] * x1 - c[0] * v1 - between - rubbing) / m[0]
        return np.array([v1, v2, a1, between / m[1]])

    state = np.zeros((4, len(omega)))
    total = np.zeros((2, len(omega)), dtype=complex)
    start = (_CYCLES - _READ) * _STEPS_A_CYCLE
    for i in range(_CYCLES * _STEPS_A_CYCLE):
        time = i * step
        if i >= start:
            total += state[:2] * np.exp(-1j * omega * time)
        one = rate(state, time)
        two = rate(state + step / 2 * one, time + step / 2)
        three = rate(state + step / 2 * two, time + step / 2)
        four = rate(state + step * three, time + step)
        state = state + step / 6 * (one + 2 * two + 2 * three + four)
    first, second = np.abs(total) * 2 / (_READ * _STEPS_A_CYCLE)
    return first, second
