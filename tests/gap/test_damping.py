"""Damping that rises with the level speaks for what slips, and for nothing else."""

from __future__ import annotations

import numpy as np
import pytest

from shm.gap.contract import Hypothesis
from shm.gap.damping import MOST, log_odds, log_rising
from shm.gap.observations import observed
from shm.models.effects import Variant
from shm.values import NAN, ModalTest, Mode
from tests.helpers.hangers import HANGER_3

SLIP = Hypothesis((("joint_softening", Variant(ends=(0,))),))
STIFF = Hypothesis((("bending_stiffness", Variant()),))
LEVELS = (0.2, 0.2, 0.5, 0.5, 1.0, 1.0)


def _tests(rise: float, seed: int, sd: float = 0.03, of_tests: float = 0.1) -> list[ModalTest]:
    """Six orders whose damping rises by `rise`, in logarithms, towards the highest level."""
    rng = np.random.default_rng(seed)
    of_mode = rng.normal(-6.0, 0.5, 6)
    return [
        ModalTest(
            f"t{k}",
            tuple(_mode(order, rng.normal(of_mode[order - 1] + own + rise * level, sd), sd)
                  for order in range(1, 7)),
            amplitude=level,
        )
        for k, level in enumerate(LEVELS)
        for own in [rng.normal(0, of_tests)]
    ]  # fmt: skip


def _mode(order: int, log_damping: float, sd: float) -> Mode:
    damping = float(np.exp(log_damping))
    return Mode("transverse", order, 6.0 * order, 1e-3, damping, sd * damping)


def test_over_seeds_steady_damping_speaks_against_a_slip_and_rising_damping_for_it() -> None:
    steady = [
        log_odds(log_rising(observed(_tests(0.0, seed), HANGER_3)), SLIP) for seed in range(30)
    ]
    rising = [
        log_odds(log_rising(observed(_tests(1.0, seed), HANGER_3)), SLIP) for seed in range(30)
    ]
    assert np.mean(steady) < -0.5
    assert max(steady) < 1.0  # a test's own damping is no rise
    assert np.mean(np.array(rising) > 1.0) > 0.9
    assert max(rising) <= MOST


def test_it_says_nothing_of_steady_causes_and_half_of_it_of_the_unknown() -> None:
    found = observed(_tests(1.5, 1), HANGER_3)
    assert log_odds(log_rising(found), STIFF) == 0.0
    assert log_odds(log_rising(found), Hypothesis()) == 0.0
    slip, unknown = (
        log_odds(log_rising(found), SLIP),
        log_odds(log_rising(found), Hypothesis(flexible=True)),
    )
    assert unknown == pytest.approx(np.log((1 + np.exp(slip)) / 2))


def test_where_levels_or_standard_deviations_are_missing_it_says_nothing() -> None:
    tests = _tests(1.5, 1)
    assert log_odds(log_rising(observed(tests[4:], HANGER_3)), SLIP) == 0.0
    bare = [
        ModalTest(name, (Mode("transverse", 1, 6.0, 1e-3, damping, NAN),), amplitude=level)
        for name, damping, level in (("a", 0.002, 0.2), ("b", 0.02, 1.0))
    ]
    assert log_odds(log_rising(observed(bare, HANGER_3)), SLIP) == 0.0


def test_a_frequency_that_is_set_aside_takes_its_damping_along() -> None:
    found = observed(_tests(0.0, 1), HANGER_3)
    kept = np.arange(found.design.frequencies)[1:]
    part = found.part(kept, np.array([], dtype=int))
    assert np.array_equal(part.damping, found.damping[1:])
