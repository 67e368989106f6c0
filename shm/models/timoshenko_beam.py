"""Exact frequencies of a tensioned Timoshenko beam on rotational end springs.

With x = X/L, the deflection w over L and the rotation psi of the section obey

    (s + t) w'' + Omega^2 w = s psi',    psi'' + s (w' - psi) + r Omega^2 psi = 0,

where t = T L^2/EI, s = kappa G A L^2/EI, r = I/(A L^2) and Omega^2 = m omega^2 L^4/EI (Timoshenko
1921; with an axial force along the deformed axis, Abbas 1984, J. Sound Vib. 97, 541). Solutions
cosh p x, cos q x go with rotations P sinh p x, -Q sin q x:

    P = ((s + t) p^2 + Omega^2) / (s p),    Q = ((s + t) q^2 - Omega^2) / (s q).

Ends: w = 0, psi'(0) = ka psi(0), psi'(1) = -kb psi(1), ka = k_a L/EI. As for the Euler-Bernoulli
beam (`shm.models.tensioned_beam`, where P = p and Q = q) the four end conditions give

    A sin q - B cos q + C = 0,
    A = V^2 + (ka + kb) V P coth p + ka kb (P^2 - Q^2),
    B = (ka + kb) V Q + 2 ka kb P Q coth p,
    C = 2 ka kb P Q / sinh p,    V = P p + Q q,

and the same phase phi in [0, pi) raises mode n above n pi. Given q, Omega^2 is the smaller root of
r Omega^4 - (q^2 + s + r (s + t) q^2) Omega^2 + q^2 ((s + t) q^2 + s t) = 0, and
p^2 = Omega^2 (s - r Omega^2) / ((s + t) q^2). This holds below the cut-off Omega^2 = s/r, beyond
which sections swing by themselves: no mode of a hanger comes near.
"""

from __future__ import annotations

import numpy as np

from shm.values import FloatArray

_BLOCK = 6000
"""Roots solved at a time, as in `shm.models.tensioned_beam`."""

_SMALL_STEP = 1e-7
"""A secant step below this leaves an error below its square, times a curvature below 1."""

_MOST_STEPS = 12
"""Never reached by finite numbers, which take four steps, rarely five; NaN must end too."""


def frequencies_hz(
    length_m: FloatArray,
    tension_n: FloatArray,
    bending_stiffness_n_m2: FloatArray,
    mass_per_length_kg_m: FloatArray,
    shear_stiffness_n: FloatArray,
    gyration_m: FloatArray,
    k_deck_n_m_rad: FloatArray,
    k_arch_n_m_rad: FloatArray,
    modes: int,
) -> FloatArray:
    """Natural frequencies, shape S + (modes,), where the arguments broadcast to the shape S.

    `shear_stiffness_n` is kappa G A, `gyration_m` the radius of gyration sqrt(I/A).
    """
    slenderness = length_m / bending_stiffness_n_m2
    sets = np.broadcast_arrays(
        tension_n * length_m * slenderness,
        shear_stiffness_n * length_m * slenderness,
        (gyration_m / length_m) ** 2,
        k_deck_n_m_rad * slenderness,
        k_arch_n_m_rad * slenderness,
        np.sqrt(bending_stiffness_n_m2 / mass_per_length_kg_m) / (2 * np.pi * length_m**2),
    )
    flat = np.array([each.ravel() for each in sets])
    answer = np.empty((flat.shape[1], modes))
    block = max(1, _BLOCK // modes)
    for first in range(0, len(answer), block):
        t, s, r, ka, kb, scale = flat[:, first : first + block]
        answer[first : first + block] = (scale * _omega(t, s, r, ka, kb, modes)).T
    return answer.reshape(*sets[0].shape, modes)


def _omega(
    t: FloatArray, s: FloatArray, r: FloatArray, ka: FloatArray, kb: FloatArray, modes: int
) -> FloatArray:
    """Omega (modes, sets): q = n pi + phi(q) by secants from the string's phase."""
    order = np.arange(1.0, modes + 1)[:, None]
    sign, pinned = np.where(order % 2 == 0, 1.0, -1.0), order * np.pi
    free_a, free_b = 1 / (1 + ka), 1 / (1 + kb)
    held = (1 - free_a) * (1 - free_b)
    one = (1 - free_a) * free_b + (1 - free_b) * free_a
    ends = free_a * free_b, one, held

    def rest(q: FloatArray) -> FloatArray:
        return np.asarray(q - pinned - _phase(q, t, s, r, ends, sign))

    q = pinned + np.pi / 4
    value = rest(q)
    # The slope of the phase lies between -0.2 and 0.2, so that a step of full length comes near.
    step = -value
    for _ in range(_MOST_STEPS):
        moved = q + step
        found = rest(moved)
        with np.errstate(divide="ignore", invalid="ignore"):
            slope = (found - value) / step
        slope = np.where(np.isfinite(slope) & (slope > 0.5), slope, 1.0)
        q, value, step = moved, found, -found / slope
        if np.nanmax(np.abs(step), initial=0.0) < _SMALL_STEP:
            break
    return np.sqrt(_square(q + step, t, s, r))


def _square(q: FloatArray, t: FloatArray, s: FloatArray, r: FloatArray) -> FloatArray:
    """Omega^2 at wave number q; the smaller root, without cancellation."""
    q2 = q * q
    b = s + q2 * (1 + r * (s + t))
    c = q2 * ((s + t) * q2 + s * t)
    return np.asarray(2 * c / (b + np.sqrt(np.maximum(b * b - 4 * r * c, 0.0))))


def _phase(
    q: FloatArray,
    t: FloatArray,
    s: FloatArray,
    r: FloatArray,
    ends: tuple[FloatArray, FloatArray, FloatArray],
    sign: FloatArray,
) -> FloatArray:
    """phi (modes, sets): 2 atan((B - c)/(A + sqrt(A^2 + B^2 - c^2))), c = (-1)^n C."""
    omega2, q2 = _square(q, t, s, r), q * q
    p2 = np.maximum(omega2 * (s - r * omega2), np.finfo(float).tiny) / ((s + t) * q2)
    p = np.sqrt(p2)
    big_p, big_q = ((s + t) * p2 + omega2) / (s * p), ((s + t) * q2 - omega2) / (s * q)
    decay = np.exp(-p)
    coth, csch = (1 + decay * decay) / (1 - decay * decay), 2 * decay / (1 - decay * decay)
    none, one, both = ends
    v = big_p * p + big_q * q
    a = none * v * v + one * v * big_p * coth + both * (big_p**2 - big_q**2)
    b = one * v * big_q + 2 * both * big_p * big_q * coth
    c = sign * 2 * both * big_p * big_q * csch
    return np.asarray(2 * np.arctan((b - c) / (a + np.sqrt(np.maximum(a * a + b * b - c * c, 0)))))
