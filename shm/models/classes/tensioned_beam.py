"""Exact frequencies and shapes of a tensioned beam on rotational end springs.

With x = X/L, the deflection w over L and the rotation psi of the section of Timoshenko's beam obey

    (1 + t e) w'' + e Omega^2 w = psi',    e psi'' + (w' - psi) + e r Omega^2 psi = 0,

where t = T L^2/EI, e = EI/(kappa G A L^2), r = I/(A L^2) and Omega^2 = m omega^2 L^4/EI (Timoshenko
1921; with an axial force along the deformed axis, Abbas 1984, J. Sound Vib. 97, 541). e = r = 0 is
the beam of Euler and Bernoulli, w'''' - t w'' - Omega^2 w = 0. Solutions cosh p x, cos q x go with
rotations P sinh p x, -Q sin q x; with g = 1 + t e

    P = g p + e Omega^2/p,    Q = g q - e Omega^2/q.

Ends: w = 0, psi'(0) = ka psi(0), psi'(1) = -kb psi(1), where ka = k_a L/EI. Putting the general
solution into the four end conditions and dividing by sinh p gives

    A sin q - B cos q + C = 0,
    A = V^2 + (ka + kb) V P coth p + ka kb (P^2 - Q^2),
    B = (ka + kb) V Q + 2 ka kb P Q coth p,
    C = 2 ka kb P Q / sinh p,    V = P p + Q q.

All three are divided by (1 + ka) (1 + kb), so that springs from 0 to inf stay in range, and hold
only exp(-p), so that no tension overflows. Write q = n pi + phi and c = (-1)^n C; then
A sin phi - B cos phi + c = 0, which is a quadratic in tan(phi/2). Its root

    phi = 2 atan((B - c) / (A + D)),   D = sqrt(A^2 + B^2 - c^2),

is the phase by which the springs raise mode n above a pinned end's n pi. As B >= |c|, it lies in
[0, pi); as a function of q its slope lies between -0.2 and 0.2 and its curvature below 1 (the tests
scan both). So q - phi(q) = n pi has exactly one root for each n = 1, 2, ..., no mode can be missed
or doubled, and secants find it from anywhere in the interval. The thesis (2.30, 2.45) solves the
same equation unscaled, which loses its roots at large tension.

Given q, Omega^2 is the smaller root of
e r Omega^4 - (1 + q^2 (e + r g)) Omega^2 + q^2 (g q^2 + t) = 0, and p^2 = Omega^2 (1 - e r Omega^2)
/ (g q^2). This holds below the cut-off Omega^2 = 1/(e r), beyond which sections swing by
themselves: no mode of a hanger comes near, and a mode beyond it is NaN.
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

_SMALL_STEP = 1e-7
"""A secant step below this leaves an error below its square, times a curvature below 1."""

_MOST_STEPS = 12
"""Never reached by finite numbers, which take four steps, rarely five; NaN must end too."""

_NONE = np.array(0.0)


@dataclass(frozen=True, eq=False)
class Waves:
    """Wave numbers (sets, modes): q of the sines and p of the decaying waves.

    Their sections turn by `turn_q` and `turn_p` (Q and P).
    """

    q: FloatArray
    p: FloatArray
    turn_q: FloatArray
    turn_p: FloatArray


@dataclass(frozen=True, eq=False)
class _Section:
    """Hold t, e and r of beams, which broadcast with wave numbers."""

    t: FloatArray
    e: FloatArray
    r: FloatArray

    def omega_squared(self, q: FloatArray) -> FloatArray:
        """Return Omega^2 at wave numbers q; the smaller root, without cancellation."""
        q2, g = q * q, 1 + self.t * self.e
        b = 1 + q2 * (self.e + self.r * g)
        c = q2 * (g * q2 + self.t)
        return np.asarray(2 * c / (b + np.sqrt(np.maximum(b * b - 4 * self.e * self.r * c, 0.0))))

    def waves(self, q: FloatArray) -> Waves:
        """Return the waves that go with wave numbers q.

        Below the least p^2, p coth p and p / sinh p round to their limit 1, used beyond the cut-off
        as well.
        """
        omega2, g = self.omega_squared(q), 1 + self.t * self.e
        p2 = omega2 * (1 - self.e * self.r * omega2) / (g * q * q)
        p = np.sqrt(np.maximum(p2, np.finfo(float).eps))
        return Waves(q, p, g * q - self.e * omega2 / q, g * p + self.e * omega2 / p)


def wave_numbers(
    t: FloatArray,
    ka: FloatArray,
    kb: FloatArray,
    modes: int,
    e: FloatArray = _NONE,
    r: FloatArray = _NONE,
) -> FloatArray:
    """Return the roots q of the first modes.

    t = T L^2/EI, the end springs `ka`, `kb` = k L/EI (inf for clamped), e and r broadcast to one
    shape S; the answer has shape S + (modes,), dimensionless, right to 1e-12.
    """
    return _in_blocks(partial(_roots, modes=modes), modes, t, ka, kb, e, r)


def waves(
    t: FloatArray,
    ka: FloatArray,
    kb: FloatArray,
    modes: int,
    e: FloatArray = _NONE,
    r: FloatArray = _NONE,
) -> Waves:
    """Return the waves of the first modes, S + (modes,); arguments as of `wave_numbers`."""
    section = _Section(*(np.asarray(each)[..., None] for each in (t, e, r)))
    return section.waves(wave_numbers(t, ka, kb, modes, e, r))


def frequencies_hz(
    length_m: FloatArray,
    tension_n: FloatArray,
    bending_stiffness_n_m2: FloatArray,
    mass_per_length_kg_m: FloatArray,
    k_deck_n_m_rad: FloatArray,
    k_arch_n_m_rad: FloatArray,
    modes: int,
    shear_compliance_1_n: FloatArray = _NONE,
    gyration_m: FloatArray = _NONE,
) -> FloatArray:
    """Return natural frequencies, shape S + (modes,), where the arguments broadcast to the shape S.

    `shear_compliance_1_n` is 1/(kappa G A), `gyration_m` the radius of gyration sqrt(I/A). Modes
    beyond the cut-off, at which sections swing by themselves, are NaN, as are those of a bar under
    compression.
    """

    def solve(
        t: FloatArray,
        ka: FloatArray,
        kb: FloatArray,
        e: FloatArray,
        r: FloatArray,
        scale: FloatArray,
    ) -> FloatArray:
        t = np.where(t < 0, np.nan, t)
        omega2 = _Section(t, e, r).omega_squared(_roots(t, ka, kb, e, r, modes))
        return np.asarray(scale * np.sqrt(np.where(e * r * omega2 < 1, omega2, np.nan)))

    slenderness = length_m / bending_stiffness_n_m2
    return _in_blocks(
        solve,
        modes,
        tension_n * length_m * slenderness,
        k_deck_n_m_rad * slenderness,
        k_arch_n_m_rad * slenderness,
        shear_compliance_1_n / (length_m * slenderness),
        (gyration_m / length_m) ** 2,
        np.sqrt(bending_stiffness_n_m2 / mass_per_length_kg_m) / (2 * np.pi * length_m**2),
    )


def shapes(waves: Waves, ka: FloatArray, x: FloatArray) -> FloatArray:
    """Return deflections (sets, modes, points) at `x`, fractions of the length from the deck end.

    They are a exp(-p x) + b exp(-p (1 - x)) + c cos q x + sin q x, which stays in range at any
    tension. No deflection at either end and the moment of the spring `ka` = k L/EI at the deck give
    a, b and c.
    """
    free = _freedom(ka)
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


def _in_blocks(solve: Callable[..., FloatArray], modes: int, *sets: FloatArray) -> FloatArray:
    """Return `solve` of all sets, S + (modes,); it takes (block,) and gives (modes, block)."""
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


def _roots(
    t: FloatArray, ka: FloatArray, kb: FloatArray, e: FloatArray, r: FloatArray, modes: int
) -> FloatArray:
    """Return q (modes, sets) where q = n pi + phi(q), by secants from the string's phase."""
    order = np.arange(1.0, modes + 1)[:, None]
    sign, pinned = np.where(order % 2 == 0, 1.0, -1.0), order * np.pi
    free_a, free_b = _freedom(ka), _freedom(kb)
    held = (1 - free_a) * (1 - free_b)
    one = (1 - free_a) * free_b + (1 - free_b) * free_a
    ends, section = (free_a * free_b, one, held), _Section(t, e, r)

    def rest(q: FloatArray) -> FloatArray:
        return np.asarray(q - pinned - _phase(section.waves(q), ends, sign))

    q = pinned + np.pi / 4
    value = rest(q)
    # The slope of the phase lies between -0.2 and 0.2, so that a step of full length comes near.
    step = -value
    for _ in range(_MOST_STEPS):
        moved = q + step
        found = rest(moved)
        slope = np.divide(found - value, step, out=np.ones_like(step), where=step != 0)
        slope = np.where(np.isfinite(slope) & (slope > 0.5), slope, 1.0)
        q, value, step = moved, found, -found / slope
        if np.nanmax(np.abs(step), initial=0.0) < _SMALL_STEP:
            break
    return q + step


def _freedom(k: FloatArray) -> FloatArray:
    """Return 1/(1 + k), from 1 for a free rotation to 0 for a clamped end."""
    return np.asarray(1 / (1 + k))


def _phase(
    waves: Waves, ends: tuple[FloatArray, FloatArray, FloatArray], sign: FloatArray
) -> FloatArray:
    """Return phi (modes, sets): 2 atan((B - c)/(A + sqrt(A^2 + B^2 - c^2))), c = (-1)^n C."""
    big_p, big_q = waves.turn_p, waves.turn_q
    decay = np.exp(-waves.p)
    below_one = -np.expm1(-2 * waves.p)
    coth, csch = (1 + decay * decay) / below_one, 2 * decay / below_one
    none, one, both = ends
    v = big_p * waves.p + big_q * waves.q
    a = none * v * v + one * v * big_p * coth + both * (big_p**2 - big_q**2)
    b = one * v * big_q + 2 * both * big_p * big_q * coth
    c = sign * 2 * both * big_p * big_q * csch
    return np.asarray(2 * np.arctan((b - c) / (a + np.sqrt(np.maximum(a * a + b * b - c * c, 0)))))
