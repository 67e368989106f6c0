"""Mode shapes of a stepped beam.

In each segment the shape is a sum of exp(-p x), exp(-p (1 - x)), cos q x and sin q x, which stay in
range. Their factors are the null vector of the end conditions and of the continuity of deflection,
slope, moment EI w'' and shear force EI w''' - T w' at the joints.
"""

from __future__ import annotations

import numpy as np

from shm.models.stepped.beam import SteppedBeam, shares
from shm.models.stepped.dynamic_stiffness import wave_numbers
from shm.values import FloatArray

_POINTS_A_HALF_WAVE = 40
_RISEN = 0.01


def mode_shape(beam: SteppedBeam, order: int, x_m: FloatArray) -> FloatArray:
    """The shape of one mode of a single beam at `x_m` (points,) from the deck end.

    Scaled to a largest value of 1 along the beam, positive in its first lobe.
    """
    omega = 2 * np.pi * beam.frequencies_hz(order)[:, -1]
    length = beam.length_m[:, 0]
    p, q = wave_numbers(
        length,
        beam.tension_n,
        beam.bending_stiffness_n_m2[:, 0],
        beam.mass_per_length_kg_m[:, 0],
        omega,
    )
    factors = np.linalg.svd(_conditions(beam, p, q))[2][-1].reshape(len(length), 4)
    fine = np.linspace(0, length.sum(), _POINTS_A_HALF_WAVE * (order + len(length)) + 1)
    along = _values(fine, length, p, q, factors)
    peak = np.abs(along).max()
    first = along[np.argmax(np.abs(along) > _RISEN * peak)]
    return np.asarray(_values(x_m, length, p, q, factors) / np.copysign(peak, first))


def _values(
    x_m: FloatArray, length_m: FloatArray, p: FloatArray, q: FloatArray, factors: FloatArray
) -> FloatArray:
    """Deflections at `x_m` (points,) for `factors` (segments, 4)."""
    ends = np.cumsum(length_m)
    row = np.searchsorted(ends[:-1], x_m)
    x = (x_m - (ends - length_m)[row]) / length_m[row]
    return np.asarray(np.sum(_solutions(p[row], q[row], x, 0) * factors[row], axis=1))


def _solutions(p: FloatArray, q: FloatArray, x: FloatArray, derivative: int) -> FloatArray:
    """A derivative of the four solutions at the fractions `x` of their segments, (points, 4)."""
    turn = q * x + derivative * np.pi / 2
    grow, swing = p**derivative, q**derivative
    falling = (-1) ** derivative * grow * np.exp(-p * x)
    return np.stack(
        [falling, grow * np.exp(-p * (1 - x)), swing * np.cos(turn), swing * np.sin(turn)], axis=-1
    )


def _conditions(beam: SteppedBeam, p: FloatArray, q: FloatArray) -> FloatArray:
    """End and joint conditions as rows of length 1, shape (4 segments, 4 segments)."""
    left, right = (_end_values(beam, p, q, np.full(p.shape, x)) for x in (0.0, 1.0))
    segments = len(p)
    rows = np.zeros((segments, 4, segments, 4))
    for joint in range(1, segments):
        rows[joint, :, joint - 1], rows[joint, :, joint] = right[joint - 1], -left[joint]
    stiff, flexible = shares(beam.k_deck_n_m_rad)
    rows[0, 0, 0], rows[0, 1, 0] = left[0, 0], flexible * left[0, 2] - stiff * left[0, 1]
    stiff, flexible = shares(beam.k_arch_n_m_rad)
    rows[0, 2, -1], rows[0, 3, -1] = right[-1, 0], flexible * right[-1, 2] + stiff * right[-1, 1]
    matrix = rows.reshape(4 * segments, 4 * segments)
    return np.asarray(matrix / np.linalg.norm(matrix, axis=1, keepdims=True))


def _end_values(beam: SteppedBeam, p: FloatArray, q: FloatArray, x: FloatArray) -> FloatArray:
    """Deflection, slope, moment and shear force of the solutions, (segments, 4, 4)."""
    length = beam.length_m
    deflection, slope, second, third = (_solutions(p, q, x, k) / length**k for k in range(4))
    stiffness = beam.bending_stiffness_n_m2
    shear = stiffness * third - beam.tension_n * slope
    return np.stack([deflection, slope, stiffness * second, shear], axis=1)
