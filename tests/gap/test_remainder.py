"""The law of something unknown: found where there is one, on data that scatter by themselves, and
not where there is none; its share that looks like a tension in closed form."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from shm.gap.noise import same_mode
from shm.gap.remainder import Left, like_tension, terms_of, with_law
from shm.models.effects import Conditions
from shm.values import NAN, PLANES, FloatArray, Remainder
from tests.helpers.hangers import HANGER_3
from tests.helpers.toy_gap import design_of

LEVELS, WARMTH_K, ORDERS, SD = (0.3, 1.0, 2.0), (-10.0, 10.0), 8, 1e-4
NOTHING = Remainder(NAN, NAN, NAN)


DESIGN = design_of(
    [
        Conditions(f"t{k}", warmth_k, level)
        for k, (level, warmth_k) in enumerate(product(LEVELS, WARMTH_K))
    ],
    list(product(range(2), range(1, ORDERS + 1))),
)
ORDER, PLANE, TEST = DESIGN.frequency_order, DESIGN.frequency_plane, DESIGN.frequency_test
LEVEL = np.array([c.amplitude for c in DESIGN.conditions])[TEST]
WARM_K = np.array([c.temperature_shift_k for c in DESIGN.conditions])[TEST]
TERMS = terms_of(DESIGN, HANGER_3)


def described(law: FloatArray, seed: int, mode_sd: float = 2e-4) -> Remainder:
    """What is left by a law where modes err alike in all tests, and a tension may follow."""
    rng = np.random.default_rng(seed)
    of_mode = mode_sd * rng.standard_normal((2, ORDERS + 1))
    noise = of_mode[PLANE, ORDER] + SD * rng.standard_normal(len(ORDER))
    tension = np.full((len(ORDER), 1), 0.5)
    left = Left(
        law + noise,
        SD**2 * np.eye(len(ORDER)),
        tension @ tension.T,
        same_mode(DESIGN),
        np.geomspace(1, 30, 5),
    )
    return with_law(NOTHING, left, TERMS)


@pytest.mark.parametrize(
    ("law", "orders", "tests", "planes"),
    [
        (2e-4 * ORDER**2 * (PLANE == 1), "order squared", "all tests", PLANES[1:]),
        (3e-3 * (-1.0) ** ORDER, "alternating", "all tests", PLANES),
        (4e-4 * WARM_K * ORDER / 8, "order", "temperature", PLANES),
        (-5e-3 * (LEVEL > 1.5) * (PLANE == 0), "even", "above a level", PLANES[:1]),
        (2e-3 * LEVEL * np.sin(0.3 * np.pi * ORDER) ** 2, "local", "level", PLANES),
    ],
    ids=["order squared", "alternating", "warmth", "threshold", "local"],
)
def test_a_law_is_found_with_its_size_and_shrinks_what_is_held_out(
    law: FloatArray, orders: str, tests: str, planes: tuple[str, ...]
) -> None:
    found = described(law, 3)
    first = found.law[0]
    assert (first.over_orders, first.over_tests, first.planes) == (orders, tests, planes)
    assert first.log_bayes_factor > 3
    assert abs(first.change_percent) == pytest.approx(
        100 * max(np.ptp(law), abs(law).max()), rel=0.3
    )
    assert found.held_out_after_percent < 0.8 * found.held_out_before_percent


def test_scatter_alone_has_no_law() -> None:
    """Twelve seeds with modes that err alike in all tests, ten times what tests differ by."""
    none = np.zeros(len(ORDER))
    assert not any(described(none, seed, mode_sd=1e-3).law for seed in range(12))


def test_what_a_tension_can_follow_is_no_law() -> None:
    assert described(np.full(len(ORDER), 0.01), 5).law == ()


def test_terms_are_told_once() -> None:
    """With two levels a threshold and every power of the level are one term."""
    unit = np.array([term.values / np.linalg.norm(term.values) for term in TERMS])
    assert np.max(np.abs(unit @ unit.T) - np.eye(len(unit))) <= 0.98


def test_the_share_like_a_tension_is_the_projection_on_its_slopes() -> None:
    """Left 0.02 along slopes of a half and as much across: sqrt(1/2) of the rms, and 4 %."""
    slopes, across = np.array([0.5, 0.5]), np.array([0.02, -0.02])
    share, change = like_tension(0.04 * slopes + across, slopes)
    assert (share, change) == pytest.approx((0.5**0.5, 0.04))
    assert np.isnan(like_tension(across, np.zeros(0))).all()
