"""Something unknown: it must beat a wrong effect that fits half, and lose to the right one."""

from __future__ import annotations

import numpy as np
import pytest

from shm.gap.noise import flexible_nodes, nodes
from tests.gap import linear_toy as toy

SEEDS = pytest.mark.parametrize(
    "seed", [0, *(pytest.param(seed, marks=pytest.mark.trial) for seed in range(1, 5))]
)


def test_tests_at_several_temperatures_allow_a_remainder_that_grows_with_them() -> None:
    plain = toy.observations(np.zeros(toy.design().size))
    varied = toy.observations(plain.value, toy.design((-15.0, 0.0, 15.0)))
    assert len(flexible_nodes(varied)) > len(flexible_nodes(plain))


def test_frequencies_of_unknown_accuracy_get_a_remainder_too() -> None:
    plain = toy.observations(np.zeros(toy.design().size))
    plain.sd[: plain.design.frequencies] = np.nan
    found = flexible_nodes(plain)
    assert np.exp([node.log_weight for node in found]).sum() == pytest.approx(1.0)


@SEEDS
def test_without_a_gap_it_loses_to_the_baseline(seed: int) -> None:
    value = toy.noise(np.random.default_rng(seed))
    errors = toy.observations(value)
    plain = toy.log_evidence(nodes(errors), toy.tension(), value)
    assert plain > toy.log_evidence(flexible_nodes(errors), toy.tension(), value) + 1


@SEEDS
@pytest.mark.parametrize("size", [2e-3, 2e-2])
def test_it_loses_to_the_right_effect(seed: int, size: float) -> None:
    value = toy.noise(np.random.default_rng(seed)) + toy.stiffening(size)
    errors = toy.observations(value)
    right = np.column_stack([toy.tension(), toy.stiffening(0.05)])
    known = toy.log_evidence(nodes(errors), right, value)
    assert known > toy.log_evidence(flexible_nodes(errors), toy.tension(), value) + 3


@SEEDS
@pytest.mark.parametrize("size", [8e-3, 4e-2])
def test_it_beats_a_wrong_effect_that_fits_half_of_the_gap(seed: int, size: float) -> None:
    rng = np.random.default_rng(seed)
    design = toy.design()
    odd = np.where(design.frequency_order % 2 == 1, 1.0, 0.3)
    value = toy.noise(rng)
    value[: design.frequencies] += size * (design.frequency_order / toy.MODES) ** 2 * odd
    errors = toy.observations(value)
    wrong = np.column_stack([toy.tension(), toy.stiffening(0.05)])
    half = toy.log_evidence(nodes(errors), wrong, value)
    remainder = flexible_nodes(errors)
    unknown = [toy.log_evidence(remainder, slopes, value) for slopes in (toy.tension(), wrong)]
    assert max(unknown) > half + 2


def test_shapes_that_are_off_everywhere_are_something_unknown() -> None:
    value = toy.noise(np.random.default_rng(3))
    first = toy.design().frequencies
    value[first:] += np.random.default_rng(4).normal(0.0, 0.02, len(value) - first)
    errors = toy.observations(value)
    plain = toy.log_evidence(nodes(errors), toy.tension(), value)
    assert toy.log_evidence(flexible_nodes(errors), toy.tension(), value) > plain + 10
