"""Modes of a hanger as its state alone has it: the bar and its turnbuckles on rotational springs.

The elements are those of `bar`, on a mesh that does not depend on the tension: finer, as there are
no places at which effects act.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy

from shm.errors import UsageError
from shm.simulate.state import HangerState
from shm.values import PLANES, FloatArray, Hanger, Plane
from tests.worlds.simulated.bar.description import Piece, pieces_of
from tests.worlds.simulated.bar.mesh import assembled, interpolation, mass_of, stiffness_of

# A frequency errs by (wave number x element size)^4/1440: 4e-7 in mode 10 of 320 elements. In the
# time domain the highest modes only add their quasi-static share, so few elements are enough.
_LEAST_ELEMENTS = 320
_ELEMENTS_PER_MODE = 8
_ELEMENTS_PER_EXACT_MODE = 32
_LEAST_ELEMENTS_A_PIECE = 16


@dataclass(frozen=True, eq=False)
class PlaneModes:
    """Modes of one plane, mass-normalised.

    `angular_frequency_rad_s` (modes,); `nodes_m` (nodes,); `deflection` and `slope` (nodes, modes)
    in kg^-1/2 and kg^-1/2/m; `added_damping_ratio` (modes,) comes on top of the hanger's. `other`
    is how these modes move in the other plane, None where they do not.
    """

    angular_frequency_rad_s: FloatArray
    nodes_m: FloatArray
    deflection: FloatArray
    slope: FloatArray
    added_damping_ratio: FloatArray
    other: PlaneModes | None = None

    def at(self, x_m: FloatArray) -> FloatArray:
        """Mode shapes at `x_m` (points,): shape (points, modes)."""
        element, weights = interpolation(self.nodes_m, x_m)
        left, right = element, element + 1
        values = (
            self.deflection[left],
            self.slope[left],
            self.deflection[right],
            self.slope[right],
        )
        return np.asarray(np.sum(weights[..., None] * np.array(values), axis=0))


def natural_frequencies(hanger: Hanger, state: HangerState, modes: int) -> FloatArray:
    """Natural frequencies in Hz, shape (2, modes): transverse, longitudinal.

    Right to 1e-6 relative. Raises UsageError where a compression buckles the hanger.
    """
    both = [plane_modes(hanger, state, plane, modes, _ELEMENTS_PER_EXACT_MODE) for plane in PLANES]
    return np.array([found.angular_frequency_rad_s for found in both]) / (2 * np.pi)


def plane_modes(
    hanger: Hanger,
    state: HangerState,
    plane: Plane,
    modes: int,
    elements_per_mode: int = _ELEMENTS_PER_MODE,
) -> PlaneModes:
    """The lowest `modes` modes of one plane."""
    elements = max(_LEAST_ELEMENTS, elements_per_mode * modes)
    pieces = pieces_of(hanger, state.effective_length_m(hanger))
    nodes, owner = _nodes([piece.length_m for piece in pieces], elements)
    stiffness, mass = _matrices(nodes, [pieces[index] for index in owner], state.tension_n)
    springs = state.springs_n_m_rad(plane)
    free = np.delete(np.arange(2 * len(nodes)), _held(2 * len(nodes), springs))
    diagonal = np.zeros(stiffness.shape[0])
    diagonal[[1, -1]] = [0.0 if math.isinf(spring) else spring for spring in springs]
    stiffness = stiffness + scipy.sparse.diags_array(diagonal)
    squares, vectors = _lowest(stiffness[free][:, free], mass[free][:, free], modes)
    full = np.zeros((2 * len(nodes), modes))
    full[free] = vectors
    return PlaneModes(np.sqrt(squares), nodes, full[0::2], full[1::2], np.zeros(modes))


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


def _nodes(lengths_m: Sequence[float], elements: int) -> tuple[FloatArray, list[int]]:
    """Nodes of pieces end to end, and the piece of each element."""
    total, start = sum(lengths_m), 0.0
    nodes, owner = [np.zeros(1)], []
    for index, length_m in enumerate(lengths_m):
        share = max(_LEAST_ELEMENTS_A_PIECE, math.ceil(elements * length_m / total))
        nodes.append(start + length_m * _spread(share, index == 0, index == len(lengths_m) - 1))
        owner += [index] * share
        start += length_m
    return np.concatenate(nodes), owner


def _spread(elements: int, from_deck: bool, to_arch: bool) -> FloatArray:
    """Where the elements of a piece end, from 0 to 1.

    They crowd towards the held ends, where a string-like hanger bends in a thin layer; small
    elements elsewhere would drown the tension's stiffness in the rounding of their own.
    """
    angle = np.linspace(0, np.pi / 2, elements + 1)[1:]
    if from_deck and to_arch:
        return np.asarray(np.sin(angle) ** 2)
    if from_deck:
        return np.asarray(1 - np.cos(angle))
    return np.asarray(np.sin(angle) if to_arch else angle / angle[-1])


def _matrices(nodes_m: FloatArray, owners: Sequence[Piece], tension_n: float) -> tuple[Any, Any]:
    """Stiffness and mass of the free-free beam, sparse (2 nodes, 2 nodes)."""
    size = np.diff(nodes_m)
    bending = np.array([piece.bending_stiffness_n_m2 for piece in owners])
    mass_per_length = np.array([piece.mass_per_length_kg_m for piece in owners])
    stiffness = stiffness_of(size, bending, 0.0, tension_n)
    return assembled(stiffness), assembled(mass_of(size, bending, 0.0, mass_per_length, 0.0))


def _held(unknowns: int, springs: tuple[float, float]) -> list[int]:
    """Unknowns that are zero: both end deflections, and the slopes of clamped ends."""
    deck, arch = (math.isinf(spring) for spring in springs)
    return [0, unknowns - 2, *([1] if deck else []), *([unknowns - 1] if arch else [])]


def _lowest(stiffness: Any, mass: Any, modes: int) -> tuple[FloatArray, FloatArray]:
    """The lowest squares of angular frequency (modes,) and mass-normalised vectors."""
    start = np.ones(stiffness.shape[0])  # a fixed start, so that the same input gives the same bits
    squares, vectors = scipy.sparse.linalg.eigsh(stiffness, k=modes, M=mass, sigma=0.0, v0=start)
    order = np.argsort(squares)
    squares, vectors = squares[order], vectors[:, order]
    if squares[0] <= 0:
        raise UsageError(
            "the compression buckles the hanger: it has no lowest frequency.",
            remedy="Give a larger tension.",
        )
    return squares, vectors * np.sign(vectors[0])
