"""How many effects pass for another in given data."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shm.gap.contract import Fit
from shm.gap.imitation import imitated_share
from shm.values import FloatArray
from tests.gap import linear_toy as toy

NOTHING = np.zeros(toy.design().size)


def _baseline() -> Fit:
    return toy.fit(NOTHING, toy.tension())


def _gained(size: float) -> Fit:
    """A fit that takes a gap of so many standard deviations away."""
    return replace(_baseline(), log_fit=size**2 / 2)


def _one_mode(number: int) -> FloatArray:
    shift = NOTHING.copy()
    shift[number] = 5 * toy.FREQUENCY_SD
    return shift[None]


def test_effects_in_proportion_pass_for_each_other_and_others_do_not() -> None:
    stiff = toy.stiffening(1e-3)[None]
    shifts = {"a": stiff, "b": -3 * stiff, "c": _one_mode(0), "d": _one_mode(5)}
    assert imitated_share(shifts, _baseline(), _gained(8.0)) == pytest.approx(0.5)


def test_what_the_baseline_can_follow_tells_nothing_apart() -> None:
    level = toy.tension(1e-3)[:, 0]
    shifts = {"a": toy.stiffening(1e-3)[None], "b": (toy.stiffening(1e-3) + level)[None]}
    assert imitated_share(shifts, _baseline(), _gained(8.0)) == pytest.approx(1.0)


def test_a_large_gap_tells_apart_what_a_small_one_does_not() -> None:
    bent = toy.stiffening(1e-3) * (1 + 0.1 * np.sin(np.arange(len(NOTHING))))
    shifts = {"a": toy.stiffening(1e-3)[None], "b": bent[None]}
    assert imitated_share(shifts, _baseline(), _gained(6.0)) == pytest.approx(1.0)
    assert imitated_share(shifts, _baseline(), _gained(60.0)) == pytest.approx(0.0)


def test_a_single_effect_has_nobody_to_imitate() -> None:
    assert imitated_share({"a": _one_mode(0)}, _baseline(), _gained(8.0)) == 0.0
