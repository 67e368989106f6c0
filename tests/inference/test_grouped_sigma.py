"""A model error of each plane or mode, thesis (4.7) to (4.12), integrated out group by group."""

from __future__ import annotations

import numpy as np
import pytest

from shm.errors import UsageError
from shm.inference import UpdateOptions, select
from shm.inference.likelihood import GroupedLikelihood, Likelihood
from shm.models import DESCRIPTION, THESIS, build
from shm.values import PLANES, ModalTest, Mode
from tests.helpers.hangers import HANGER_3

HZ = np.array([5.82, 13.85, 26.17, 6.09, 14.80, 27.00])
TEST = ModalTest(
    "t", tuple(Mode(PLANES[n // 3], n % 3 + 1, float(hz), 0.01) for n, hz in enumerate(HZ))
)
PREDICTED = HZ * (1 + np.array([[0.01] * 3 + [0.03] * 3, [0.02, -0.01, 0.0, 0.0, 0.04, 0.01]]))


def test_of_planes_it_is_the_product_of_both_planes_alone() -> None:
    """Problem: errors of 1 % in one plane and 3 % in the other; solution: two data sets apart."""
    alone = [
        Likelihood([ModalTest("t", TEST.modes[own])], repeat=2).marginal(PREDICTED[:, own])
        for own in (slice(0, 3), slice(3, 6))
    ]
    grouped = GroupedLikelihood([TEST], 2, "plane")
    assert np.allclose(grouped.marginal(PREDICTED), sum(alone))
    assert np.array_equal(grouped.joint(PREDICTED, np.ones(2)), grouped.marginal(PREDICTED))


def test_of_modes_each_is_integrated_by_itself() -> None:
    """Against a fine sum over sigma of the likelihood (4.5), uniform on [0, 1]."""
    sigma = np.geomspace(1e-4, 1.0, 20_001)
    variance = sigma**2 + (0.01 / HZ[:, None]) ** 2
    off = (PREDICTED[0] / HZ - 1)[:, None]
    density = np.exp(-(off**2) / variance / 2) / np.sqrt(2 * np.pi * variance) / HZ[:, None]
    exact = np.log(np.trapezoid(density, sigma, axis=1) + 1e-4 * density[:, 0]).sum()
    found = GroupedLikelihood([TEST], 1, "mode").marginal(PREDICTED[:1])[0]
    assert found == pytest.approx(exact, abs=0.05)


def test_sigma_stands_for_the_mean_square_of_the_groups() -> None:
    grouped = GroupedLikelihood([TEST], 100, "plane")
    drawn = grouped.draw_sigma(np.repeat(PREDICTED[:1], 200, axis=0), np.random.default_rng(1))
    assert drawn.mean() == pytest.approx(np.sqrt((0.01**2 + 0.03**2) / 2), rel=0.05)
    assert grouped.likeliest_sigma(PREDICTED[:1])[0] == pytest.approx(drawn.mean(), rel=0.1)


def test_it_is_asked_for_of_a_selection_with_the_thesis_s_priors_alone() -> None:
    one, plane = (
        select([TEST], [build("beam1", HANGER_3, THESIS)], UpdateOptions(samples=200, sigma=sigma))
        for sigma in ("one", "plane")
    )
    assert one.selected.log_evidence != plane.selected.log_evidence
    with pytest.raises(UsageError, match="each plane"):
        select([TEST], [build("beam1", HANGER_3, DESCRIPTION)], UpdateOptions(sigma="plane"))
    textbook = UpdateOptions(method="textbook", sigma="mode")
    with pytest.raises(UsageError, match="one model error"):
        select([TEST], [build("beam1", HANGER_3, THESIS)], textbook)
