"""Modes of a hanger as its state alone has it: the bar and its turnbuckles on rotational springs.

The bar is that of all worlds, `tests/worlds/bars.py`; `bar` beside this module knows effects, too.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.linalg import LinAlgError

from shm.errors import UsageError
from shm.simulate.state import HangerState
from shm.values import PLANES, FloatArray, Hanger, Plane
from tests.worlds.bars import Bar, Matrices, Zone, solve
from tests.worlds.simulated.bar.description import Piece, pieces_of

_LEAST_ELEMENTS = 12


@dataclass(frozen=True, eq=False)
class PlaneModes:
    """Modes of one plane, mass-normalised.

    `angular_frequency_rad_s` (modes,); `at` gives the shapes (points, modes), in kg^-1/2, at places
    (points,); `added_damping_ratio` (modes,) comes on top of the hanger's. `other` is how these
    modes move in the other plane, None where they do not.
    """

    angular_frequency_rad_s: FloatArray
    at: Callable[[FloatArray], FloatArray]
    added_damping_ratio: FloatArray
    other: PlaneModes | None = None


def natural_frequencies(hanger: Hanger, state: HangerState, modes: int) -> FloatArray:
    """Natural frequencies in Hz, shape (2, modes): transverse, longitudinal.

    Right to 1e-6 relative. Raises UsageError where a compression buckles the hanger.
    """
    both = [plane_modes(hanger, state, plane, modes) for plane in PLANES]
    return np.array([found.angular_frequency_rad_s for found in both]) / (2 * np.pi)


def plane_modes(hanger: Hanger, state: HangerState, plane: Plane, modes: int) -> PlaneModes:
    """The lowest `modes` modes of one plane."""
    length, zones, start = state.effective_length_m(hanger), [], 0.0
    stiffness, mass = hanger.bending_stiffness_n_m2, hanger.mass_per_length_kg_m
    for piece in pieces_of(hanger, length):
        factors = piece.bending_stiffness_n_m2 / stiffness, piece.mass_per_length_kg_m / mass
        if factors != (1.0, 1.0):
            zones.append(Zone(start, start + piece.length_m, *factors))
        start += piece.length_m
    springs = state.springs_n_m_rad(plane)
    bar = Bar(
        length, state.tension_n, stiffness, mass, zones=tuple(zones), rotation_n_m_rad=springs
    )
    matrices = Matrices(bar, elements=max(_LEAST_ELEMENTS, modes))
    try:
        hz, vectors = solve(matrices.stiffness(), matrices.mass, modes)
    except LinAlgError:
        raise UsageError(
            "the compression buckles the hanger: it has no lowest frequency.",
            remedy="Give a larger tension.",
        ) from None
    return PlaneModes(2 * np.pi * hz, lambda x_m: matrices.rows(x_m) @ vectors, np.zeros(modes))


def modes_below(hanger: Hanger, state: HangerState, frequency_hz: float) -> int:
    """At least as many as the plane modes below a frequency: those of pinned pieces (exact).

    f_n = n/(2L) sqrt(T/m) sqrt(1 + n^2 pi^2 EI/(T L^2)); end springs only raise it. Each joint of
    two pieces adds a mode at most: without the deflection of the joints, and with a hinge at each,
    they would be pinned beams.
    """
    pieces = pieces_of(hanger, state.effective_length_m(hanger))
    modes = sum(_pinned_below(piece, state.tension_n, frequency_hz) for piece in pieces)
    return max(1, modes + len(pieces) - 1)


def _pinned_below(piece: Piece, tension_n: float, frequency_hz: float) -> int:
    bending = piece.bending_stiffness_n_m2
    sought = piece.mass_per_length_kg_m * (2 * math.pi * frequency_hz) ** 2
    root = math.sqrt(max(tension_n**2 + 4 * bending * sought, 0.0))
    wave_number = math.sqrt((root - tension_n) / (2 * bending))
    return math.ceil(wave_number * piece.length_m / math.pi)
