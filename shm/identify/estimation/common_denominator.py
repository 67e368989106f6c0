"""A common-denominator model of frequency responses, fitted by least squares in parts of a band.

In each part every response is a quotient N(z)/D(z) of polynomials in z = exp(s dt), with one D for
all: its roots are the poles. With D linear in the error, D H - N, the numerators drop out of the
normal equations, which are Toeplitz matrices of a few sums over the lines (least-squares complex
frequency: Verboven 2002, 3.3; Peeters, Van der Auweraer, Guillaume and Leuridan 2004, eq. 5 to 15).
Coefficients are complex, so a part away from zero needs no mirror image.

D's scale must be fixed. With its highest coefficient 1 the poles are nearly free of bias but noise
makes stable ones too; with its lowest coefficient 1 those turn unstable, and the true ones are more
damped than they should (Cauberghe et al. 2005). A pole of the first that the second has too is
true.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shm.values import ComplexArray, FloatArray, IntArray

_GUARD = 1.15
"""The circle of z is this much longer than a part of the band: its ends do not meet."""
_MIXES = 6  # judgement: as many sums as a part sees modes; further ones are noise
_LONGEST_STEP = 0.5
"""Of ln z in Newton's method, where the whole circle is 2 pi long."""
_RIDGE = 1e-14
"""Keeps the normal equations solvable where responses hold no noise, as a share of their size."""


@dataclass(frozen=True, eq=False)
class Part:
    """A part of the band: its own share, `low_hz` to `high_hz`, and the `lines` that are fitted.

    `powers` (lines, 2 * order + 1): z to the power -order, ..., order; `mixing` (mixes, points):
    the few sums of responses that carry most of them.
    """

    low_hz: float
    high_hz: float
    lines: slice
    centre_hz: float
    step_s: float
    powers: ComplexArray
    mixing: ComplexArray


@dataclass(frozen=True, eq=False)
class Sums:
    """Sums over the lines of the parts times powers of z.

    `unit`, `power` (parts, powers) of one and of the squared responses; `mixes` (parts, mixes,
    powers), `points` (parts, points, powers) of responses.
    """

    unit: ComplexArray
    power: ComplexArray
    mixes: ComplexArray
    points: ComplexArray


@dataclass(frozen=True, eq=False)
class Denominators:
    """D of each part with its highest, and with its lowest coefficient 1, (parts, order + 1)."""

    highest: ComplexArray
    lowest: ComplexArray


def part_of(
    frequency_hz: FloatArray,
    response: ComplexArray,
    share_hz: tuple[float, float],
    lines: slice,
    max_order: int,
) -> Part:
    """The part of a band that fits `lines` of `response` (points, lines) for its share of it."""
    inside = frequency_hz[lines]
    step_s = float(1 / (_GUARD * np.ptp(inside)))
    centre_hz = float(inside[0] + inside[-1]) / 2
    exponents = np.arange(-max_order, max_order + 1)
    powers = np.exp(2j * np.pi * step_s * np.outer(inside - centre_hz, exponents))
    left = np.linalg.svd(response[:, lines], full_matrices=False)[0]
    return Part(*share_hz, lines, centre_hz, step_s, powers, left[:, :_MIXES].conj().T)


def sums_of(parts: list[Part], response: ComplexArray) -> Sums:
    """The sums of `response` (points, lines) that the fits of all orders are made of."""
    points = np.array([response[:, part.lines] @ part.powers for part in parts])
    mixed = [part.mixing @ response[:, part.lines] for part in parts]
    squares = [np.sum(np.abs(m) ** 2, axis=0) for m in mixed]
    return Sums(
        unit=np.array([part.powers.sum(axis=0) for part in parts]),
        power=np.array([s @ part.powers for s, part in zip(squares, parts, strict=True)]),
        mixes=np.array([m @ part.powers for m, part in zip(mixed, parts, strict=True)]),
        points=points,
    )


def _toeplitz(sums: ComplexArray, order: int) -> ComplexArray:
    """Sum over lines of conj(z^i) h z^j, (..., order + 1, order + 1), from those of h z^(j - i)."""
    index = np.arange(order + 1)
    return np.asarray(sums[..., sums.shape[-1] // 2 + index - index[:, np.newaxis]])


def denominators(sums: Sums, order: int) -> Denominators:
    """D of that order in each part, under both constraints."""
    parts, mixes = sums.mixes.shape[:2]
    size = order + 1
    unit, cross = _toeplitz(sums.unit, order), _toeplitz(sums.mixes, order)
    columns = cross.transpose(0, 2, 1, 3).reshape(parts, size, mixes * size)
    numerators = np.linalg.solve(unit, columns).reshape(parts, size, mixes, size)
    explained = cross.reshape(parts, -1, size).conj().transpose(0, 2, 1) @ (
        numerators.transpose(0, 2, 1, 3).reshape(parts, -1, size)
    )
    normal = _toeplitz(sums.power, order)
    ridge = _RIDGE * normal[:, :1, :1] * np.eye(size)
    reduced = normal - explained + ridge
    one = np.ones((parts, 1))
    highest = np.linalg.solve(reduced[:, :-1, :-1], -reduced[:, :-1, -1:])[..., 0]
    lowest = np.linalg.solve(reduced[:, 1:, 1:], -reduced[:, 1:, :1])[..., 0]
    return Denominators(np.hstack([highest, one]), np.hstack([one, lowest]))


def roots(found: Denominators) -> tuple[ComplexArray, ComplexArray]:
    """ln z of the roots under the two constraints, each (parts, order)."""
    # Reversed, the second has leading coefficient 1 too; its roots are the reciprocals.
    both = np.concatenate([found.highest, found.lowest[:, ::-1]])
    order = both.shape[1] - 1
    companion = np.zeros((len(both), order, order), dtype=complex)
    companion[:, np.arange(1, order), np.arange(order - 1)] = 1
    companion[:, :, -1] = -both[:, :-1]
    first, second = np.split(np.log(np.linalg.eigvals(companion)), 2)
    return first, -second


def polished(highest: ComplexArray, log_z: ComplexArray, rounds: int = 3) -> ComplexArray:
    """ln z (poles,) moved onto roots of polynomials `highest` (poles, order + 1), by Newton.

    NaN where a step leads far away: there is no root near.
    """
    exponents = np.arange(highest.shape[1])
    lost = np.zeros(log_z.shape, dtype=bool)
    for _ in range(rounds):
        powers = highest * np.exp(log_z[:, np.newaxis] * exponents)
        step = powers.sum(axis=1) / (powers @ exponents)
        lost |= np.abs(step) > _LONGEST_STEP
        log_z = np.where(lost, log_z, log_z - step)
    return np.where(lost, np.nan, log_z)


def residues(
    sums: Sums, highest: ComplexArray, part: IntArray, log_z: ComplexArray
) -> ComplexArray:
    """Residues at poles (poles,) of the parts `part` (poles,), unscaled, (points, poles).

    They are the numerators at the poles: N of least squares for the D that is known.
    """
    order = highest.shape[1] - 1
    right = (_toeplitz(sums.points, order) @ highest[:, np.newaxis, :, np.newaxis])[..., 0]
    numerators = np.linalg.solve(_toeplitz(sums.unit, order), right.transpose(0, 2, 1))
    powers = np.exp(log_z[:, np.newaxis] * np.arange(order + 1))
    return np.asarray(np.einsum("ki,kio->ok", powers, numerators[part]))
