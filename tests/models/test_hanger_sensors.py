"""What sensors and the logger make of a hanger's modes, and how joints and springs damp them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shm.models.hanger import solve
from tests.helpers.beam_shapes import mode_shape
from tests.helpers.physical_hangers import (
    EI,
    LENGTH,
    TENSION,
    clamped,
    frequencies_hz,
    on_springs,
)

PLACES = np.array([1.2, 3.6, 6.0, 9.0])


@pytest.mark.parametrize("k", [0.0, 2e6, np.inf])
def test_shapes_are_those_of_the_exact_beam(k: float) -> None:
    xi, scale = LENGTH * np.sqrt(TENSION / EI), LENGTH / EI
    springs = np.full((1, 2), k)
    found = solve(on_springs(clamped(1, 4), springs, springs), 8, PLACES).shape[0]
    for order in range(1, 9):
        exact = mode_shape(xi, k * scale, k * scale, order, PLACES / LENGTH)
        exact = exact / exact[np.abs(exact).argmax()]
        for plane in (0, 1):
            seen = found[plane, order - 1]
            sign = np.sign(seen[:, plane] @ exact)
            np.testing.assert_allclose(sign * seen[:, plane], exact, atol=2e-3)
            np.testing.assert_allclose(seen[:, 1 - plane], 0, atol=1e-12)


def test_a_turned_sensor_sees_both_planes() -> None:
    """Turned by phi: t' = t cos + l sin, l' = l cos - t sin."""
    angles = np.array([[0.0, 0.3, -0.2, np.pi / 2]])
    straight = solve(clamped(1, 4), 5, PLACES).shape[0]
    turned = solve(replace(clamped(1, 4), sensor_turn_rad=angles), 5, PLACES).shape[0]
    t, l_ = straight[..., 0], straight[..., 1]
    cosine, sine = np.cos(angles[0]), np.sin(angles[0])
    expected = np.stack([t * cosine + l_ * sine, l_ * cosine - t * sine], axis=-1)
    ratio = (turned * expected).sum(axis=(-1, -2)) / (expected**2).sum(axis=(-1, -2))
    np.testing.assert_allclose(turned, expected * ratio[..., None, None], atol=1e-12)


def test_joints_damp_by_their_share_of_the_strain_energy() -> None:
    """zeta = eta/2 (k/f^2) df^2/dk: half the loss factor times the springs' share, which is how
    much the frequency's square follows the springs' stiffness (Hellmann and Feynman)."""
    k, step = 2e6, 1e-3
    springs = np.array([[k, 2 * k]])
    bar = on_springs(clamped(), springs, np.full((1, 2), np.inf))
    lossy = replace(bar, joint_loss_factor=np.array([[0.1, 0.5]]))
    low, high = (
        frequencies_hz(on_springs(clamped(), springs * f, np.full((1, 2), np.inf)), 6)
        for f in (1 - step, 1 + step)
    )
    share = (np.log(high) - np.log(low)) / step
    found = solve(lossy, 6, PLACES)
    np.testing.assert_allclose(found.damping_ratio, 0.1 / 2 * share, rtol=1e-4)
    assert np.isnan(solve(lossy, 6, PLACES, shapes=False).damping_ratio).all()
