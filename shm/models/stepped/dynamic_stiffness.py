"""Dynamic stiffness of a uniform tensioned Euler-Bernoulli segment, exact at any frequency.

Over its length h, with x = X/h, u'''' - (p^2 - q^2) u'' - p^2 q^2 u = 0, where
p^2 - q^2 = T h^2/EI and p q = omega h^2 sqrt(m/EI). Let f0 ... f3 be its solutions of which the
k-th has only its k-th derivative at x = 0, and that one is 1. Solving for u''(0) and u'''(0) with
the deflections w and slopes r of both ends given, and EI = h = 1, the shear forces and moments at
the ends are, with F = f2^2 - f2' f3,

    K(w0, w0) = (f2' f0 - f2 f0')/F     K(w0, w1) = -f2'/F
    K(w0, r0) = (f2 f0 - f3 f0')/F      K(w0, r1) = f2/F
    K(r0, r0) = (f2 f1 - f3 f1')/F      K(r0, r1) = f3/F

and the other end follows by symmetry. Multiplied out, each product holds one factor exp(p) at
most, which is taken out of numerator and denominator: nothing overflows. Numerators are written in
cosh p - 1, sinh p / p - 1 and the like, so that a short or stiff segment (small p and q) keeps its
equilibrium to the last digit; their common denominator F errs by 1e-16/(p^2 + q^2).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shm.values import FloatArray, IntArray

_SMALL = 0.3
_LEAST = 1e-30


@dataclass(frozen=True, eq=False)
class Segment:
    """Segments, each at one frequency; all fields have the shape of the arguments.

    `ww`, `wr`, `rr` couple deflection and slope of its deck end (at its arch end `wr` changes
    sign); `cross_ww`, `cross_wr`, `cross_rr` couple those of the deck end to those of the arch end
    (slope to deflection: minus `cross_wr`). In N/m, N/rad, N m/rad. `clamped` is zero at the
    frequencies that the segment has with both ends clamped; `clamped_below` counts those below.
    """

    ww: FloatArray
    wr: FloatArray
    rr: FloatArray
    cross_ww: FloatArray
    cross_wr: FloatArray
    cross_rr: FloatArray
    clamped: FloatArray
    clamped_below: IntArray

    def __getitem__(self, row: int) -> Segment:
        """One row of all fields."""
        return Segment(*(field[row] for field in vars(self).values()))


def wave_numbers(
    length_m: FloatArray,
    tension_n: FloatArray,
    bending_stiffness_n_m2: FloatArray,
    mass_per_length_kg_m: FloatArray,
    omega: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """p and q at the angular frequency `omega`, dimensionless; the arguments broadcast."""
    inertia = mass_per_length_kg_m * omega**2
    root = np.sqrt(tension_n**2 + 4 * bending_stiffness_n_m2 * inertia)
    q_squared = 2 * inertia / (tension_n + root)
    p_squared = q_squared + tension_n / bending_stiffness_n_m2
    return np.asarray(length_m * np.sqrt(p_squared)), np.asarray(length_m * np.sqrt(q_squared))


def segment(
    length_m: FloatArray, bending_stiffness_n_m2: FloatArray, p: FloatArray, q: FloatArray
) -> Segment:
    """The segment of wave numbers `p` and `q`; the arguments broadcast."""
    w, difference = p**2 + q**2, (p - q) * (p + q)
    decay_1, half = np.expm1(-p), np.sin(q / 2)
    decay, cos_1 = 1 + decay_1, 2 * half**2  # exp(-p), 1 - cos q
    cosine, sine_q = 1 - cos_1, 2 * half * np.cos(q / 2) / q
    cosh_1 = decay_1**2 / 2  # cosh p - 1; like all of cosh and sinh, times exp(-p)
    sinh_p = -decay_1 * (1 + decay) / (2 * p)  # sinh p / p
    sinh_1 = np.where(p < _SMALL, decay * _sinh_series(p**2), sinh_p - decay)
    sine_1 = np.where(q < _SMALL, -_sinh_series(-(q**2)), 1 - sine_q)
    bulk = decay * cos_1 - cosh_1 * cosine  # 1 - cosh p cos q
    clamped = (2 * bulk + difference * sinh_p * sine_q) / w**2
    scale = bending_stiffness_n_m2 / length_m / (w * off_zero(clamped))
    p_sinh, q_sine = p**2 * sinh_p, q**2 * sine_q
    return Segment(
        ww=scale * (p_sinh * cosine + q_sine * (cosh_1 + decay)) / length_m**2,
        wr=scale * (2 * p_sinh * q_sine - difference * bulk) / w / length_m,
        rr=scale * (cosh_1 * sine_q - decay * sine_1 - sinh_1 * cosine + decay * cos_1),
        cross_ww=-scale * (p_sinh + decay * q_sine) / length_m**2,
        cross_wr=scale * (cosh_1 + decay * cos_1) / length_m,
        cross_rr=scale * (sinh_1 + decay * sine_1),
        clamped=clamped,
        clamped_below=_clamped_below(q, clamped),
    )


def off_zero(values: FloatArray) -> FloatArray:
    """The values, an exact zero moved up by less than matters, so that one may divide by them."""
    return np.where(values == 0, _LEAST, values)


def _sinh_series(square: FloatArray) -> FloatArray:
    """sinh(p)/p - 1 for a small p^2; with -q^2 for p^2 it is sin(q)/q - 1."""
    total = np.ones_like(square)
    for number in (13, 11, 9, 7, 5):
        total = 1 + square / (number * (number - 1)) * total
    return np.asarray(square / 6 * total)


def _clamped_below(q: FloatArray, clamped: FloatArray) -> IntArray:
    """The n-th clamped frequency has q in [n pi, (n + 1) pi); there `clamped` changes sign."""
    whole = np.floor(q / np.pi).astype(np.int64)
    passed = (clamped < 0) == (whole % 2 == 1)
    return np.asarray(np.maximum(whole - ~passed, 0))
