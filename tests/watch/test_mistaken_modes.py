"""Which modes are mistaken, against the closed form by hand and against planted mistakes."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from shm.watch.mistaken_modes import (
    MISTAKEN,
    MISTAKEN_RANGE,
    sound_modes,
)

RNG = np.random.default_rng(4)
SLOPES = np.column_stack([np.ones(8), np.linspace(0.4, 0.1, 8)])
VARIANCE, PRECISION = np.full(8, 1e-6), 1 / np.array([0.003, 0.1]) ** 2


def test_the_evidence_of_few_modes_is_the_sum_over_all_sets_of_mistaken_ones() -> None:
    """Of three modes, of which at most one may be mistaken: a normal law and three of two."""
    off, slopes, variance = np.array([0.01, 0.02, -0.01]), SLOPES[:3], np.full(3, 1e-4)
    covariance = slopes @ np.diag(1 / PRECISION) @ slopes.T + np.diag(variance)
    parts = []
    for gone in (None, 0, 1, 2):
        rows = [n for n in range(3) if n != gone]
        normal = multivariate_normal(cov=covariance[np.ix_(rows, rows)])
        log = normal.logpdf(off[rows]) + len(rows) * math.log(1 - MISTAKEN)
        parts.append(log + (3 - len(rows)) * math.log(MISTAKEN / MISTAKEN_RANGE))
    # Less that of all three being mistaken.
    expected = np.logaddexp.reduce(parts) - 3 * math.log(MISTAKEN / MISTAKEN_RANGE)
    found = sound_modes(off, slopes, variance, PRECISION)
    assert found.log_evidence == pytest.approx(expected)


@pytest.mark.parametrize("planted", [(), (0,), (3,), (7,), (0, 1), (2, 6)])
def test_planted_mistakes_are_found_and_the_others_say_where_the_test_lies(
    planted: tuple[int, ...],
) -> None:
    truth = np.array([0.001, -0.08])
    off = SLOPES @ truth + 1e-3 * RNG.standard_normal(8)
    off[list(planted)] += 0.05
    found = sound_modes(off, SLOPES, VARIANCE, PRECISION)
    assert tuple(np.flatnonzero(~found.sound)) == planted
    assert found.x == pytest.approx(truth, abs=0.02)


def test_where_modes_lie_anywhere_none_is_taken_for_mistaken() -> None:
    off = RNG.uniform(-0.5, 0.5, 12)
    slopes = np.column_stack([np.ones(12), np.linspace(0.4, 0.1, 12)])
    found = sound_modes(off, slopes, np.full(12, 1e-6), PRECISION)
    assert found.is_misfit
    assert found.sound.all()


def test_a_smooth_move_of_all_modes_is_a_misfit_and_no_mistake_of_four() -> None:
    """Those of the demo's hanger 3: a bar beside the model, in two planes of six orders."""
    off = np.array([4.7, 3.2, -2.3, -0.6, -1.6, -1.6, 0.2, -3.5, -5.5, -3.9, -5.3, -4.5]) / 100
    tension = np.tile([0.45, 0.35, 0.25, 0.2, 0.15, 0.1], 2)[:, None]
    found = sound_modes(off, tension, np.full(12, 1e-6), np.array([4.0]))
    assert found.is_misfit
    assert found.sound.all()


def test_a_third_that_is_mistaken_by_little_is_no_misfit() -> None:
    truth = np.array([0.001, -0.08])
    slopes = np.column_stack([np.ones(12), np.linspace(0.4, 0.1, 12)])
    off = slopes @ truth + 1e-3 * RNG.standard_normal(12)
    planted = [1, 4, 6, 11]
    off[planted] += np.array([0.03, -0.2, 0.15, -0.04])
    found = sound_modes(off, slopes, np.full(12, 1e-6), PRECISION)
    assert not found.is_misfit
    assert np.flatnonzero(~found.sound).tolist() == planted
