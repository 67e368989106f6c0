"""Damping that rises with the level speaks for what slips, and for nothing else."""

from __future__ import annotations

import numpy as np

from shm.gap.causes.damping import log_rising, remark_on_damping
from shm.gap.hypotheses.observations import observed
from shm.values import NAN, ModalTest, Mode
from tests.helpers.hangers import HANGER_3

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


def test_remark_on_damping_over_seeds() -> None:
    """A test's own damping is no rise; one by a factor of 4.5 always is."""
    steady, rising = (
        [observed(_tests(rise, seed), HANGER_3) for seed in range(30)] for rise in (0.0, 1.5)
    )
    assert np.mean([log_rising(each) for each in steady]) < -0.5
    assert not any(remark_on_damping(each) for each in steady)
    assert all(remark_on_damping(each) for each in rising)


def test_log_rising_levels_or_sd_missing() -> None:
    assert log_rising(observed(_tests(1.5, 1)[4:], HANGER_3)) == 0.0
    bare = [
        ModalTest(name, (Mode("transverse", 1, 6.0, 1e-3, damping, NAN),), amplitude=level)
        for name, damping, level in (("a", 0.002, 0.2), ("b", 0.02, 1.0))
    ]
    assert log_rising(observed(bare, HANGER_3)) == 0.0


def test_a_frequency_that_is_set_aside_takes_its_damping_along() -> None:
    found = observed(_tests(0.0, 1), HANGER_3)
    kept = np.arange(found.design.frequencies)[1:]
    part = found.part(kept, np.array([], dtype=int))
    assert np.array_equal(part.damping, found.damping[1:])
