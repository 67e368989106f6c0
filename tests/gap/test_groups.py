"""Causes that cannot be told apart."""

from __future__ import annotations

import numpy as np
import pytest

from shm.gap.attribution import expected_log_bayes_factor, grouped
from tests.gap import linear_toy as toy


def test_half_the_squared_distance_is_expected_where_nothing_can_follow() -> None:
    one, other = np.zeros(toy.design().size), np.zeros(toy.design().size)
    other[0] = 4 * toy.FREQUENCY_SD
    rigid = np.zeros((len(one), 1))
    found = expected_log_bayes_factor(toy.fit(one, rigid), toy.fit(other, rigid))
    assert found == pytest.approx(8.0)


def test_a_rival_that_can_follow_is_not_told_apart() -> None:
    near, far = toy.fit(np.zeros(toy.design().size), toy.tension()), toy.tension(0.001)[:, 0]
    assert expected_log_bayes_factor(near, toy.fit(far, toy.tension())) < 0.01


def test_causes_alike_form_one_group_and_others_none() -> None:
    alike = [toy.fit(toy.stiffening(size), toy.tension()) for size in (2e-3, 2.01e-3)]
    apart = toy.fit(np.zeros(toy.design().size), toy.tension())
    assert grouped([[alike[0]], [apart], [alike[1]]]) == ((0, 2),)


def test_groups_are_connected() -> None:
    steps = [toy.fit(toy.stiffening(k * 5e-5), np.zeros((toy.design().size, 1))) for k in range(3)]
    assert expected_log_bayes_factor(steps[0], steps[2]) > 3
    assert grouped([[step] for step in steps]) == ((0, 1, 2),)


def test_a_cause_of_two_faces_is_like_what_one_of_them_is_like() -> None:
    one, other = (toy.fit(toy.stiffening(size), toy.tension()) for size in (0.0, 2e-3))
    assert grouped([[one, other], [toy.fit(toy.stiffening(2e-3), toy.tension())]]) == ((0, 1),)


def test_causes_that_the_evidence_found_leaves_near_the_best_are_one_group() -> None:
    causes = [[toy.fit(toy.stiffening(size), toy.tension())] for size in (0.0, 2e-3, 4e-3)]
    assert grouped(causes) == ()
    assert grouped(causes, [True, False, True]) == ((0, 2),)
