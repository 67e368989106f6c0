"""How many modes of a tensioned beam on end springs lie below a trial frequency.

Wittrick and Williams (1971), by dynamic stiffness: shares no formula with the solver.
"""

from __future__ import annotations

import numpy as np


def modes_below(q: np.ndarray, xi: np.ndarray, ka: np.ndarray, kb: np.ndarray) -> np.ndarray:
    """The number of frequencies below Omega = q sqrt(xi^2 + q^2).

    J = J_fixed + s(K + springs), where K (2, 2) is the stiffness that both end rotations feel at
    Omega and s counts negative eigenvalues. The same with no springs is the pinned beam, whose
    count is floor(q / pi), so J_fixed = floor(q / pi) - s(K). By symmetry K has the eigenvalues
    W / u for opposite and W / v for equal rotations, with W = p^2 + q^2,
    u = q tan(q/2) + p tanh(p/2), v = p coth(p/2) - q cot(q/2). Scaling row and column of an end by
    1/sqrt(1 + k) keeps the signs and lets k reach inf; determinant and trace are taken times u v,
    which may be 0.
    """
    p = np.sqrt(xi**2 + q**2)
    w, tangent, tangent_h = p**2 + q**2, np.tan(q / 2), np.tanh(p / 2)
    u, v = q * tangent + p * tangent_h, p / tangent_h - q / tangent
    free_a, free_b = 1 / (1 + ka), 1 / (1 + kb)
    held_a, held_b = 1 - free_a, 1 - free_b
    own, one = w * (u + v) / 2, free_a * held_b + free_b * held_a
    sign = np.where((u < 0) ^ (v < 0), -1, 1)
    determinant = sign * (free_a * free_b * w**2 + one * own + held_a * held_b * u * v)
    trace = sign * ((free_a + free_b) * own + (held_a + held_b) * u * v)
    sprung = np.where(determinant < 0, 1, np.where(trace < 0, 2, 0))
    unsprung = (u < 0).astype(int) + (v < 0)
    return np.floor(q / _pi(q)).astype(int) - unsprung + sprung


def _pi(q: np.ndarray) -> np.ndarray:
    """Pi in the precision of `q`."""
    return 4 * np.arctan(np.ones(1, dtype=q.dtype))
