"""Exact frequencies and shapes of a tensioned Euler-Bernoulli beam on rotational end springs.

With x = X/L, the equation of motion is u'''' - xi^2 u'' - Omega^2 u = 0, where
xi^2 = T L^2/EI and Omega^2 = m omega^2 L^4/EI. Its roots are +-p (real) and +-i q with
p^2 - q^2 = xi^2 and p q = Omega. Ends: u = 0, u''(0) = ka u'(0), u''(1) = -kb u'(1), where
ka = k_a L/EI. Putting the general solution into the four end conditions and dividing by sinh p
gives, with W = p^2 + q^2,

    A sin q - B cos q + C = 0,
    A = W^2 + (ka + kb) W p coth p + ka kb xi^2,
    B = (ka + kb) W q + 2 ka kb p q coth p,
    C = 2 ka kb p q / sinh p,

which holds nothing that overflows. It has exactly one root q in each [n pi, (n + 1) pi), n = 1,
2, ... (n pi with free rotations, close to (n + 1/2) pi for a stiff clamped beam), so that n is the
order of the mode and none can be missed or doubled. The root is the fixed point of the phase

    q = n pi + atan2(B, A) - (-1)^n asin(C / hypot(A, B)),

found by secant steps. The thesis (2.30, 2.45) solves the same equation unscaled, which loses its
roots at large xi.
"""

from __future__ import annotations

import numpy as np

from shm.values import FloatArray

_STEPS = 12
_RESOLUTION = 4e-16


def wave_numbers(xi: FloatArray, ka: FloatArray, kb: FloatArray, modes: int) -> FloatArray:
    """The roots q of the first modes.

    `xi` = L sqrt(T/EI) and the end springs `ka`, `kb` = k L/EI (inf for clamped) broadcast to
    one shape S; the answer has shape S + (modes,), dimensionless.
    """
    xi, ka, kb = (np.asarray(a, dtype=float)[..., None] for a in np.broadcast_arrays(xi, ka, kb))
    order = np.arange(1.0, modes + 1)
    low: FloatArray = order * np.pi
    previous: FloatArray = low + np.pi / 2
    previous_fault: FloatArray = previous - _phase(previous, xi, ka, kb, order)
    q: FloatArray = np.clip(previous - previous_fault, low, low + np.pi)
    for _ in range(_STEPS):
        fault: FloatArray = q - _phase(q, xi, ka, kb, order)
        step = _secant_step(q, previous, fault, previous_fault)
        previous, previous_fault = q, fault
        q = np.clip(q - step, low, low + np.pi)
        if np.all(np.abs(step) <= _RESOLUTION * q):
            break
    return q


def _secant_step(
    q: FloatArray, previous: FloatArray, fault: FloatArray, previous_fault: FloatArray
) -> FloatArray:
    """The secant step; the plain fixed-point step where two iterates have met."""
    rise, run = fault - previous_fault, q - previous
    steep = np.abs(rise) > 1e-3 * np.abs(run)
    safe = np.where(steep, rise, 1.0)
    return np.asarray(np.where(steep, fault * run / safe, fault))


def _phase(
    q: FloatArray, xi: FloatArray, ka: FloatArray, kb: FloatArray, order: FloatArray
) -> FloatArray:
    """The right-hand side of the fixed-point equation."""
    a, b, c = _characteristic(q, xi, ka, kb)
    sign = np.where(order % 2 == 0, 1.0, -1.0)
    return np.asarray(order * np.pi + np.arctan2(b, a) - sign * np.arcsin(c / np.hypot(a, b)))


def _characteristic(
    q: FloatArray, xi: FloatArray, ka: FloatArray, kb: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """A, B and C, each end divided by W + k (p + q): springs from 0 to inf stay in range."""
    p = np.hypot(xi, q)
    w = p**2 + q**2
    spring_a, free_a = _end(ka, w, p + q)
    spring_b, free_b = _end(kb, w, p + q)
    both, mixed = spring_a * spring_b, spring_a * free_b + spring_b * free_a
    p_coth = p / np.tanh(p)
    a = free_a * free_b * w**2 + mixed * w * p_coth + both * xi**2
    b = mixed * w * q + 2 * both * p_coth * q
    c = 4 * both * p * q * np.exp(-p) / -np.expm1(-2 * p)
    return a, b, c


def _end(k: FloatArray, w: FloatArray, s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """k/(W + k s) and 1/(W + k s), with their limits for a clamped end."""
    with np.errstate(divide="ignore"):
        flexibility = 1 / k
    bounded = np.where(k > 1, flexibility, 1.0)
    stiff = np.where(k > 1, 1.0, k)
    denominator = w * bounded + stiff * s
    return stiff / denominator, bounded / denominator


def frequencies_hz(
    length_m: FloatArray,
    tension_n: FloatArray,
    bending_stiffness_n_m2: FloatArray,
    mass_per_length_kg_m: FloatArray,
    k_deck_n_m_rad: FloatArray,
    k_arch_n_m_rad: FloatArray,
    modes: int,
) -> FloatArray:
    """Natural frequencies, shape S + (modes,), where the arguments broadcast to the shape S."""
    length, tension, stiffness, mass, deck, arch = np.broadcast_arrays(
        length_m,
        tension_n,
        bending_stiffness_n_m2,
        mass_per_length_kg_m,
        k_deck_n_m_rad,
        k_arch_n_m_rad,
    )
    xi = length * np.sqrt(tension / stiffness)
    q = wave_numbers(xi, deck * length / stiffness, arch * length / stiffness, modes)
    scale = np.sqrt(stiffness / mass) / (2 * np.pi * length**2)
    return np.asarray(scale[..., None] * q * np.hypot(xi[..., None], q))


def mode_shape(xi: float, ka: float, kb: float, order: int, x: FloatArray) -> FloatArray:
    """The shape of one mode at `x` (points,), as a fraction of the length from the deck end.

    Scaled to a largest value of 1 along the beam, positive in its first lobe. The basis
    exp(-p x), exp(-p (1 - x)), cos q x, sin q x stays in range at any xi.
    """
    arrays = np.asarray(xi, float), np.asarray(ka, float), np.asarray(kb, float)
    q = float(wave_numbers(*arrays, modes=order)[order - 1])
    p = float(np.hypot(xi, q))
    coefficients = np.linalg.svd(_end_conditions(p, q, ka, kb))[2][-1]
    fine = _basis(p, q, np.linspace(0, 1, 40 * order + 1)) @ coefficients
    peak = np.abs(fine).max()
    return np.asarray(_basis(p, q, x) @ coefficients / np.copysign(peak, fine[20]))


def _basis(p: float, q: float, x: FloatArray) -> FloatArray:
    """The four solutions at `x`, shape (points, 4)."""
    return np.stack([np.exp(-p * x), np.exp(-p * (1 - x)), np.cos(q * x), np.sin(q * x)], -1)


def _end_conditions(p: float, q: float, ka: float, kb: float) -> FloatArray:
    """Displacement and moment conditions at both ends, shape (4, 4), rows of like size."""
    e, c, s = np.exp(-p), np.cos(q), np.sin(q)
    w = p**2 + q**2
    spring_a, free_a = (float(v) for v in _end(np.asarray(ka), np.asarray(w), np.asarray(p + q)))
    spring_b, free_b = (float(v) for v in _end(np.asarray(kb), np.asarray(w), np.asarray(p + q)))
    slope_0, slope_1 = np.array([-p, p * e, 0, q]), np.array([-p * e, p, -q * s, q * c])
    curve_0 = np.array([p**2, p**2 * e, -(q**2), 0])
    curve_1 = np.array([p**2 * e, p**2, -(q**2) * c, -(q**2) * s])
    return np.array(
        [
            [1, e, 1, 0],
            [e, 1, c, s],
            free_a * curve_0 - spring_a * slope_0,
            free_b * curve_1 + spring_b * slope_1,
        ]
    )
