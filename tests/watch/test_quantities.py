"""What is watched of a hanger, and the coordinates of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from shm.models import described
from shm.values import TENSION, Hanger, Posterior, Turnbuckle
from shm.watch.engine.quantities import (
    MeasuredMode,
    watched_quantities,
)
from tests.helpers.hangers import HANGER_3
from tests.helpers.modelled_tests import posterior

SPRUNG = (1.1, 0.97, 7.2, 7.6, 8.6, 6.6)
TRANSVERSE: list[MeasuredMode] = [("transverse", order) for order in range(1, 7)]
LONGITUDINAL: list[MeasuredMode] = [("longitudinal", order) for order in range(1, 7)]
BOTH = TRANSVERSE + LONGITUDINAL
TRANSVERSE_ENDS, LONGITUDINAL_ENDS = "transverse_end_stiffness", "longitudinal_end_stiffness"


def baseline(
    theta: Sequence[float], model: str = "beam2", spread: float = 0.05, hanger: Hanger = HANGER_3
) -> Posterior:
    """A posterior about `theta`, with two percent more tension on the mean than most probably."""
    made, rng = described(model, hanger), np.random.default_rng(1)
    samples = np.tile(np.array(theta), (500, 1)) + spread * rng.standard_normal((500, len(theta)))
    samples[:, 0] = 1.02 * theta[0] * (1 + 0.01 * rng.standard_normal(500))
    samples = np.clip(samples, made.prior.lower, made.prior.upper)
    return replace(
        posterior(theta, model, hanger),
        names=(*made.parameter_names, "sigma"),
        samples=np.column_stack([samples, np.full(500, 0.003)]),
        log_likelihood=np.zeros(500),
        most_probable=np.append(theta, 0.003),
    )


def test_of_clamped_ends_the_tension_alone_is_watched() -> None:
    (tension,) = watched_quantities(baseline((1.1, 0.97), "beam1"), HANGER_3, BOTH)
    assert (tension.name, tension.step_sd, tension.end, tension.plane) == (
        TENSION,
        0.05,
        None,
        None,
    )


def test_the_tension_comes_first_and_then_the_ends_of_each_plane_in_one() -> None:
    found = watched_quantities(baseline(SPRUNG), HANGER_3, BOTH)
    assert [(each.name, each.plane, each.parameters) for each in found] == [
        ("tension", None, ("theta_F",)),
        (TRANSVERSE_ENDS, "transverse", ("log10_k1", "log10_k3")),
        (LONGITUDINAL_ENDS, "longitudinal", ("log10_k2", "log10_k4")),
    ]


def test_ends_that_no_frequency_tells_apart_are_not_named() -> None:
    found = watched_quantities(baseline(SPRUNG), HANGER_3, BOTH)
    assert [each.end for each in found] == [None] * 3


def test_ends_that_a_turnbuckle_tells_apart_are_watched_each_by_its_name() -> None:
    hanger = replace(HANGER_3, turnbuckles=(Turnbuckle(1.5, 0.6, 120.0, 6e6),))
    found = watched_quantities(baseline(SPRUNG, hanger=hanger), hanger, BOTH)
    assert [(each.name, each.end, each.plane, each.parameters) for each in found[1:]] == [
        ("log10_k1", "deck", "transverse", ("log10_k1",)),
        ("log10_k2", "deck", "longitudinal", ("log10_k2",)),
        ("log10_k3", "arch", "transverse", ("log10_k3",)),
        ("log10_k4", "arch", "longitudinal", ("log10_k4",)),
    ]
    assert [each.baseline for each in found[1:]] == list(SPRUNG[2:])


def test_a_symmetrical_effect_leaves_the_ends_alike_and_is_not_watched_itself() -> None:
    name = "beam2+bending_stiffness@everywhere"
    names = described(name, HANGER_3).parameter_names
    values = dict.fromkeys(names, 0.0) | {"theta_F": 1.1, "log10_k1": 7.2, "log10_k2": 7.6}
    values |= {"log10_k3": 8.6, "log10_k4": 6.6, "stiffness_change": -0.1}
    theta = [values[each] for each in names]
    found = watched_quantities(baseline(theta, name, spread=0.001), HANGER_3, BOTH)
    assert [each.name for each in found] == [TENSION, TRANSVERSE_ENDS, LONGITUDINAL_ENDS]
    assert [each.end for each in found] == [None] * 3
