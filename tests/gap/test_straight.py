"""Coordinates of two end springs in which what precise frequencies leave of them is straight."""

from __future__ import annotations

import numpy as np
import pytest

from shm.gap.coordinates import Pair, Straight

PAIR = Pair(0, 2, -1.5, 3.0, 1.1)
STRAIGHT = Straight([PAIR])


def test_what_is_straightened_comes_back() -> None:
    w = 1.5 * np.random.default_rng(1).standard_normal((500, 4))
    np.testing.assert_allclose(STRAIGHT.w(STRAIGHT.y(w)), w, atol=1e-6)


def test_slopes_and_volume_are_those_of_differences() -> None:
    for w in np.random.default_rng(2).standard_normal((20, 4)):
        step = 1e-6 * np.eye(4)
        slopes = (STRAIGHT.y(w + step) - STRAIGHT.y(w - step)).T / 2e-6
        np.testing.assert_allclose(STRAIGHT.slopes(w), slopes, rtol=1e-5, atol=1e-7)
        volume = STRAIGHT.log_volume(w[None], STRAIGHT.y(w[None]))[0]
        assert volume == pytest.approx(np.linalg.slogdet(slopes)[1], abs=1e-5)


def test_ends_that_give_way_as_much_together_differ_in_one_coordinate_alone() -> None:
    """From two springs alike to one end nearly clamped and the other twice as soft."""
    give = PAIR.give(np.array([0.6]))[0]
    shares = np.linspace(0.2, 1.8, 17) * give
    w = np.column_stack([PAIR.alike(shares), shares, PAIR.alike(2 * give - shares), shares])
    y = STRAIGHT.y(w)
    np.testing.assert_allclose(y[:, 0], 0.6, atol=1e-9)
    assert (np.diff(y[:, 2]) < 0).all()


def test_points_far_out_keep_finite_weights() -> None:
    w = np.array([[12.0, 0.0, -12.0, 0.0], [9.0, 0.0, 9.5, 0.0], [-9.0, 0.0, -9.0, 0.0]])
    y = STRAIGHT.y(w)
    assert np.isfinite(STRAIGHT.w(y)).all()
    assert np.isfinite(STRAIGHT.log_volume(w, y)).all()
