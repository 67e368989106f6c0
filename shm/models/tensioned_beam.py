"""Exact frequencies and shapes of a tensioned Euler-Bernoulli beam on rotational end springs.

With x = X/L, the equation of motion is u'''' - xi^2 u'' - Omega^2 u = 0, where
xi^2 = T L^2/EI and Omega^2 = m omega^2 L^4/EI. Its roots are +-p (real) and +-i q with
p^2 - q^2 = xi^2 and p q = Omega. Ends: u = 0, u''(0) = ka u'(0), u''(1) = -kb u'(1), where
ka = k_a L/EI. Putting the general solution into the four end conditions and dividing by sinh p
gives, with W = p^2 + q^2,

    A sin q - B cos q + C = 0,
    A = W^2 + (ka + kb) W p coth p + ka kb xi^2,
    B = (ka + kb) W q + 2 ka kb p q coth p,
    C = 2 ka kb p q / sinh p.

All three are divided by (1 + ka) (1 + kb), so that springs from 0 to inf stay in range, and hold
only exp(-p), so that no tension overflows. Write q = n pi + phi and c = (-1)^n C; then
A sin phi - B cos phi + c = 0, which is a quadratic in tan(phi/2). Its root

    phi = 2 atan((B - c) / (A + D)),   D = sqrt(A^2 + B^2 - c^2),

is the phase by which the springs raise mode n above a pinned end's n pi. As B >= |c|, it lies in
[0, pi); as a function of q its slope lies between -0.18 and 0.20 and its curvature below 0.09 (the
tests scan both). So q - phi(q) = n pi has exactly one root for each n = 1, 2, ..., no mode can be
missed or doubled, and Newton's method finds it from anywhere in the interval: three steps from
(n + 1/4) pi leave less than 1e-12. The thesis (2.30, 2.45) solves the same equation unscaled, which
loses its roots at large xi.

Exact frequencies of a tensioned Timoshenko beam on rotational end springs.

With x = X/L, the deflection w over L and the rotation psi of the section obey

    (s + t) w'' + Omega^2 w = s psi',    psi'' + s (w' - psi) + r Omega^2 psi = 0,

where t = T L^2/EI, s = kappa G A L^2/EI, r = I/(A L^2) and Omega^2 = m omega^2 L^4/EI (Timoshenko
1921; with an axial force along the deformed axis, Abbas 1984, J. Sound Vib. 97, 541). Solutions
cosh p x, cos q x go with rotations P sinh p x, -Q sin q x:

    P = ((s + t) p^2 + Omega^2) / (s p),    Q = ((s + t) q^2 - Omega^2) / (s q).

Ends: w = 0, psi'(0) = ka psi(0), psi'(1) = -kb psi(1), ka = k_a L/EI. As for the Euler-Bernoulli
beam (where P = p and Q = q) the four end conditions give

    A sin q - B cos q + C = 0,
    A = V^2 + (ka + kb) V P coth p + ka kb (P^2 - Q^2),
    B = (ka + kb) V Q + 2 ka kb P Q coth p,
    C = 2 ka kb P Q / sinh p,    V = P p + Q q,

and the same phase phi in [0, pi) raises mode n above n pi. Given q, Omega^2 is the smaller root of
r Omega^4 - (q^2 + s + r (s + t) q^2) Omega^2 + q^2 ((s + t) q^2 + s t) = 0, and
p^2 = Omega^2 (s - r Omega^2) / ((s + t) q^2). This holds below the cut-off Omega^2 = s/r, beyond
which sections swing by themselves: no mode of a hanger comes near, and a mode beyond it is NaN.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from shm.values import FloatArray

_BLOCK = 6000
"""Roots solved at a time: some 20 intermediate results of 48 kB stay in the processor's cache and
below what the allocator hands back to the system. Twice as many took up to three times as long,
half as many a quarter longer (calls of numpy)."""

_SMALL_STEP = 3e-6
"""A Newton step below this leaves an error below its square: 0.5 * 0.09 / 0.8 * step^2 = 5e-13."""

_MOST_STEPS = 8
"""Never reached by finite numbers, which take three steps, rarely four; NaN must end too."""


@dataclass(frozen=True, eq=False)
class _Sets:
    """Hold what A, B and C of a block of parameter sets share over all q.

    The factors of the terms of no, one and two springs, each (sets,); `twice_both_signed` holds
    the sign (-1)^n of C as well and has shape (modes, sets).
    """

    xi_squared: FloatArray
    none: FloatArray
    one: FloatArray
    twice_both: FloatArray
    twice_both_signed: FloatArray
    both_xi_squared: FloatArray


def wave_numbers(xi: FloatArray, ka: FloatArray, kb: FloatArray, modes: int) -> FloatArray:
    """Return the roots q of the first modes.

    `xi` = L sqrt(T/EI) and the end springs `ka`, `kb` = k L/EI (inf for clamped) broadcast to
    one shape S; the answer has shape S + (modes,), dimensionless, right to 1e-12.
    """
    return _in_blocks(partial(_roots, modes=modes), modes, xi, ka, kb)


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

    def solve(xi: FloatArray, ka: FloatArray, kb: FloatArray, scale: FloatArray) -> FloatArray:
        q = _roots(xi, ka, kb, modes)
        return np.asarray(scale * q * np.sqrt(xi * xi + q * q))

    slenderness = length_m / bending_stiffness_n_m2
    return _in_blocks(
        solve,
        modes,
        length_m * np.sqrt(tension_n / bending_stiffness_n_m2),
        k_deck_n_m_rad * slenderness,
        k_arch_n_m_rad * slenderness,
        np.sqrt(bending_stiffness_n_m2 / mass_per_length_kg_m) / (2 * np.pi * length_m**2),
    )


def _in_blocks(solve: Callable[..., FloatArray], modes: int, *sets: FloatArray) -> FloatArray:
    """`solve` of all parameter sets, S + (modes,); it takes (block,) and gives (modes, block)."""
    shape = np.broadcast(*sets).shape
    table = np.empty((len(sets), *shape))
    for row, values in enumerate(sets):
        table[row, ...] = values
    flat = table.reshape(len(sets), -1)
    answer = np.empty((flat.shape[1], modes))
    length = max(1, _BLOCK // modes)
    for first in range(0, len(answer), length):
        block = slice(first, first + length)
        answer[block] = solve(*flat[:, block]).T
    return answer.reshape(*shape, modes)


def _roots(xi: FloatArray, ka: FloatArray, kb: FloatArray, modes: int) -> FloatArray:
    """Return the roots q (modes, sets) of a block of parameter sets (sets,), by Newton's method."""
    order = np.arange(1.0, modes + 1)[:, None]
    pinned: FloatArray = order * np.pi
    sets = _shared(xi, ka, kb, np.where(order % 2 == 0, 1.0, -1.0))
    q: FloatArray = pinned + np.pi / 4
    for _ in range(_MOST_STEPS):
        step = _newton_step(q, pinned, sets)
        q = q - step
        if np.abs(step).max() < _SMALL_STEP:
            break
    return q


def _shared(xi: FloatArray, ka: FloatArray, kb: FloatArray, sign: FloatArray) -> _Sets:
    free_a, free_b = _freedom(ka), _freedom(kb)
    held_a, held_b = 1 - free_a, 1 - free_b
    both = held_a * held_b
    xi_squared = xi * xi
    return _Sets(
        xi_squared=xi_squared,
        none=free_a * free_b,
        one=held_a * free_b + held_b * free_a,
        twice_both=2 * both,
        twice_both_signed=2 * sign * both,
        both_xi_squared=both * xi_squared,
    )


def _freedom(k: FloatArray) -> FloatArray:
    """1/(1 + k), from 1 for a free rotation to 0 for a clamped end; k/(1 + k) is the rest."""
    return np.asarray(1 / (1 + k))


def _newton_step(q: FloatArray, pinned: FloatArray, sets: _Sets) -> FloatArray:
    """Return Newton's step of `q` (modes, sets) on the way to q - phi(q) = n pi."""
    a, b, c, a_slope, b_slope, c_slope = _coefficients(q, sets)
    d = np.sqrt(a * a + b * b - c * c)
    t = (b - c) / (a + d)
    slope = b_slope - c_slope - t * (2 * a_slope + t * (b_slope + c_slope))
    phase_slope = slope / ((1 + t * t) * d)
    return np.asarray((q - pinned - 2 * np.arctan(t)) / (1 - phase_slope))


def _coefficients(q: FloatArray, sets: _Sets) -> tuple[FloatArray, ...]:
    """Return A, B, c and their derivatives by q, with p' = q/p and W' = 4 q."""
    q_squared = q * q
    p_squared = q_squared + sets.xi_squared
    w = p_squared + q_squared
    p_coth, p_csch = _hyperbolic(np.sqrt(p_squared))
    over_p = q / p_squared
    coth_slope = over_p * (p_coth - p_csch * p_csch)
    none, one, both = sets.none * w, sets.one * w, sets.twice_both
    a_over_w = none + sets.one * p_coth
    b_over_q = one + both * p_coth
    c_over_q = sets.twice_both_signed * p_csch
    four_q = 4 * q
    return (
        w * a_over_w + sets.both_xi_squared,
        q * b_over_q,
        q * c_over_q,
        four_q * (none + a_over_w) + one * coth_slope,
        b_over_q + q * (four_q * sets.one + both * coth_slope),
        c_over_q * (1 + q * over_p * (1 - p_coth)),
    )


def _hyperbolic(p: FloatArray) -> tuple[FloatArray, FloatArray]:
    """p coth p and p / sinh p by exp(-p), which cannot overflow and is quicker than both."""
    decay = np.exp(-p)
    grown = p / (1 - decay * decay)
    half = grown * decay
    return grown + half * decay, half + half


@dataclass(frozen=True, eq=False)
class Waves:
    """Wave numbers (sets, modes): q of the sines and p of the decaying waves.

    Their sections turn by `turn_q` and `turn_p` (Q and P; without shear the same).
    """

    q: FloatArray
    p: FloatArray
    turn_q: FloatArray
    turn_p: FloatArray


def waves(xi: FloatArray, ka: FloatArray, kb: FloatArray, modes: int) -> Waves:
    """Return the waves of an Euler-Bernoulli beam; arguments as of `wave_numbers`."""
    q = wave_numbers(xi, ka, kb, modes)
    p = np.hypot(np.broadcast_to(xi, np.broadcast(xi, ka, kb).shape)[..., None], q)
    return Waves(q, p, q, p)


def shapes(waves: Waves, ka: FloatArray, x: FloatArray) -> FloatArray:
    """Return deflections (sets, modes, points) at `x`, fractions of the length from the deck end.

    They are a exp(-p x) + b exp(-p (1 - x)) + c cos q x + sin q x, which stays in range at any
    tension. No deflection at either end and the moment of the spring `ka` = k L/EI at the deck give
    a, b and c.
    """
    free = 1 / (1 + ka)
    held = 1 - free
    decay, cosine, sine = np.exp(-waves.p), np.cos(waves.q), np.sin(waves.q)
    # b = constant + slope c by the arch's deflection, a = -(c + decay b) by the deck's.
    apart = 1 - decay**2
    constant, slope = -sine / apart, (decay - cosine) / apart
    moment = free * waves.turn_p * waves.p
    near, far = moment + held * waves.turn_p, decay * (moment - held * waves.turn_p)
    others = free * waves.turn_q * waves.q
    by_c = others + near * (1 + decay * slope) - far * slope
    c = (far * constant - near * decay * constant - held * waves.turn_q) / by_c
    b = constant + slope * c
    a = -(c + decay * b)
    p, q = waves.p[..., None], waves.q[..., None]
    decaying = a[..., None] * np.exp(-p * x) + b[..., None] * np.exp(-p * (1 - x))
    return np.asarray(decaying + c[..., None] * np.cos(q * x) + np.sin(q * x))


_SMALL_SECANT_STEP = 1e-7
"""A secant step below this leaves an error below its square, times a curvature below 1."""

_MOST_SECANT_STEPS = 12
"""Never reached by finite numbers, which take four steps, rarely five; NaN must end too."""


def timoshenko_frequencies_hz(
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

    `shear_stiffness_n` is kappa G A, `gyration_m` the radius of gyration sqrt(I/A). Modes beyond
    the cut-off, at which sections swing by themselves, are NaN.
    """

    def solve(*sets: FloatArray) -> FloatArray:
        t, s, r, ka, kb, scale = sets
        return np.asarray(scale * _omega(t, s, r, ka, kb, modes))

    slenderness = length_m / bending_stiffness_n_m2
    return _in_blocks(
        solve,
        modes,
        tension_n * length_m * slenderness,
        shear_stiffness_n * length_m * slenderness,
        (gyration_m / length_m) ** 2,
        k_deck_n_m_rad * slenderness,
        k_arch_n_m_rad * slenderness,
        np.sqrt(bending_stiffness_n_m2 / mass_per_length_kg_m) / (2 * np.pi * length_m**2),
    )


def timoshenko_waves(
    t: FloatArray, s: FloatArray, r: FloatArray, ka: FloatArray, kb: FloatArray, modes: int
) -> Waves:
    """Return the waves of a Timoshenko beam, whose t, s, r, ka and kb broadcast to the sets."""
    q = _in_blocks(partial(_timoshenko_roots, modes=modes), modes, t, s, r, ka, kb)
    t, s, r = (each[..., None] for each in (t, s, r))
    omega2, q2 = _square(q, t, s, r), q * q
    p = np.sqrt(_decay_squared(omega2, q2, t, s, r))
    return Waves(q, p, ((s + t) * q2 - omega2) / (s * q), ((s + t) * p * p + omega2) / (s * p))


def _omega(
    t: FloatArray, s: FloatArray, r: FloatArray, ka: FloatArray, kb: FloatArray, modes: int
) -> FloatArray:
    """Omega (modes, sets); NaN beyond the cut-off."""
    omega2 = _square(_timoshenko_roots(t, s, r, ka, kb, modes), t, s, r)
    return np.sqrt(np.where(r * omega2 < s, omega2, np.nan))


def _timoshenko_roots(
    t: FloatArray, s: FloatArray, r: FloatArray, ka: FloatArray, kb: FloatArray, modes: int
) -> FloatArray:
    """q (modes, sets): q = n pi + phi(q) by secants from the string's phase."""
    order = np.arange(1.0, modes + 1)[:, None]
    sign, pinned = np.where(order % 2 == 0, 1.0, -1.0), order * np.pi
    free_a, free_b = _freedom(ka), _freedom(kb)
    held = (1 - free_a) * (1 - free_b)
    one = (1 - free_a) * free_b + (1 - free_b) * free_a
    ends = free_a * free_b, one, held

    def rest(q: FloatArray) -> FloatArray:
        return np.asarray(q - pinned - _phase(q, t, s, r, ends, sign))

    q = pinned + np.pi / 4
    value = rest(q)
    # The slope of the phase lies between -0.2 and 0.2, so that a step of full length comes near.
    step = -value
    for _ in range(_MOST_SECANT_STEPS):
        moved = q + step
        found = rest(moved)
        slope = np.divide(found - value, step, out=np.ones_like(step), where=step != 0)
        slope = np.where(np.isfinite(slope) & (slope > 0.5), slope, 1.0)
        q, value, step = moved, found, -found / slope
        if np.nanmax(np.abs(step), initial=0.0) < _SMALL_SECANT_STEP:
            break
    return q + step


def _decay_squared(
    omega2: FloatArray, q2: FloatArray, t: FloatArray, s: FloatArray, r: FloatArray
) -> FloatArray:
    """Return p^2 of q^2.

    Below its least value p coth p and p / sinh p round to their limit 1, used beyond the cut-off as
    well.
    """
    return np.maximum(omega2 * (s - r * omega2) / ((s + t) * q2), np.finfo(float).eps)


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
    p2 = _decay_squared(omega2, q2, t, s, r)
    p = np.sqrt(p2)
    big_p, big_q = ((s + t) * p2 + omega2) / (s * p), ((s + t) * q2 - omega2) / (s * q)
    decay = np.exp(-p)
    below_one = -np.expm1(-2 * p)
    coth, csch = (1 + decay * decay) / below_one, 2 * decay / below_one
    none, one, both = ends
    v = big_p * p + big_q * q
    a = none * v * v + one * v * big_p * coth + both * (big_p**2 - big_q**2)
    b = one * v * big_q + 2 * both * big_p * big_q * coth
    c = sign * 2 * both * big_p * big_q * csch
    return np.asarray(2 * np.arctan((b - c) / (a + np.sqrt(np.maximum(a * a + b * b - c * c, 0)))))
