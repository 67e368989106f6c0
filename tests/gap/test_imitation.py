"""Which pairs something unknown passes for."""

from __future__ import annotations

from itertools import combinations

import pytest

from shm.gap.model_probabilities import CALIBRATION, EVEN, imitation
from shm.models.effects import EFFECTS


@pytest.mark.parametrize(
    "catalogue",
    [tuple(EFFECTS), [n for n in EFFECTS if n != "sensor_misalignment"], ("sag", "timebase")],
)
def test_over_all_pairs_of_a_catalogue_the_mean_is_one(catalogue: tuple[str, ...]) -> None:
    found = [imitation(pair, catalogue) for pair in combinations(catalogue, 2)]
    assert sum(found) / len(found) == pytest.approx(1.0)


def test_a_mass_and_a_loss_anywhere_imitate_far_more_than_effects_that_do_one_thing() -> None:
    free = imitation(("point_mass", "section_loss"), tuple(EFFECTS))
    bound = imitation(("geometric_hardening", "sensor_mass"), tuple(EFFECTS))
    assert free > 20 * bound
    assert bound == pytest.approx(EVEN)


@pytest.mark.parametrize("ends", CALIBRATION.with_turned_sensors)
def test_turned_sensors_with_yielding_ends_imitate_skewed_axes(ends: str) -> None:
    pair = (ends, "sensor_misalignment")
    among_all = imitation(pair, tuple(EFFECTS))
    assert among_all == pytest.approx(imitation(pair[::-1], tuple(EFFECTS)))
    assert among_all > 2 * imitation(("sag", "sensor_misalignment"), tuple(EFFECTS))


def test_of_effects_of_which_nothing_is_known_all_pairs_imitate_alike() -> None:
    assert imitation(("a", "b"), ("a", "b", "c")) == 1.0


def test_the_counts_are_of_effects_of_the_catalogue() -> None:
    counts = CALIBRATION.in_mimicking_pairs
    assert {*counts, *CALIBRATION.with_turned_sensors} <= set(EFFECTS)
    assert sum(counts.values()) % 2 == 0
