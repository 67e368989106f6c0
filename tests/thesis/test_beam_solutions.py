"""Roots of the beam's equation against the determinant (2.45) of the thesis, figures 2.3 to 2.7."""

from __future__ import annotations

import numpy as np
import pytest

from shm.models.classes.tensioned_beam import wave_numbers
from shm.values import FloatArray

MODES = 7  # as many as the thesis draws
LIMIT = 1e-6  # double precision leaves 1e-9 where the terms cancel most, at the largest xi
STIFF = 1e6  # "when the springs obtain large values": within 1e-6 of clamped
LARGE, SMALL = (20.0, 200.0), (0.1, 20.0)  # xi above and below 20, as the thesis divides them


def roots(low: float, high: float, spring: float, points: int) -> tuple[FloatArray, FloatArray]:
    """Return xi (points, 1) and the wave numbers (points, MODES) for equal springs k L/EI."""
    xi = np.linspace(low, high, points)
    springs = np.full_like(xi, spring)
    return xi[:, None], wave_numbers(xi**2, springs, springs, MODES)


def newton_step(q: FloatArray, xi: FloatArray, spring: float) -> FloatArray:
    """Return a Newton step of the thesis's determinant from each root, over that root."""
    step = 1e-5 * q
    here, ahead, behind = (determinant(each, xi, spring) for each in (q, q + step, q - step))
    return np.abs(2 * step * here / (ahead - behind) / q)


def determinant(al: FloatArray, xi: FloatArray, spring: float) -> FloatArray:
    """Return (2.45), whose rows become those of (2.18) for clamped ends.

    With exp(-bl x) and exp(-bl (1 - x)) for sinh(bl x) and cosh(bl x): the same roots, and nothing
    overflows.
    """
    bl = np.hypot(xi, al)
    decay, sine, cosine = np.exp(-bl), np.sin(al), np.cos(al)
    zero, one = np.zeros_like(al), np.ones_like(al)
    a, b = al**2 / spring, bl**2 / spring
    rows = [
        [one, decay, zero, one],
        [b + bl, (b - bl) * decay, -al, -a],
        [decay, one, sine, cosine],
        [(b - bl) * decay, b + bl, al * cosine - a * sine, -al * sine - a * cosine],
    ]
    return np.asarray(np.linalg.det(np.moveaxis(np.array(rows), (0, 1), (-2, -1))))


@pytest.mark.parametrize(
    ("xi_range", "spring"),
    [(LARGE, np.inf), (SMALL, np.inf), (SMALL, STIFF), (LARGE, STIFF), (SMALL, 10.0)],
    ids=["2.3", "2.4", "2.5", "2.6", "2.7"],
)
def test_equation_of_the_thesis_has_our_roots(xi_range, spring) -> None:
    xi, q = roots(*xi_range, spring, points=50)
    assert q.shape == (50, MODES)
    assert newton_step(q, xi, spring).max() < LIMIT


def test_another_root_is_noticed() -> None:
    q, xi = np.array([[4.73 * 1.01]]), np.array([[0.1]])
    assert newton_step(q, xi, np.inf)[0, 0] > 1000 * LIMIT


def test_large_tension_makes_a_string() -> None:
    xi, q = roots(*LARGE, np.inf, points=5)
    eta = q * np.hypot(xi, q) / (np.pi * xi * np.arange(1, MODES + 1))
    assert eta[-1, 0] == pytest.approx(1 + 2 / 200, rel=1e-3)


def test_no_tension_makes_a_clamped_beam() -> None:
    xi, q = roots(*SMALL, np.inf, points=5)
    clamped = wave_numbers(np.zeros(1), np.full(1, np.inf), np.full(1, np.inf), MODES)[0]
    phi = q * np.hypot(xi, q) / clamped**2
    assert phi[0] == pytest.approx(1.0, abs=1e-3)
