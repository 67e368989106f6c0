"""The proposal of the sampler, where a population is too thin to be clustered."""

from __future__ import annotations

import numpy as np

from shm.inference.mixture import TMixture


def test_points_too_few_for_clusters_make_one_part() -> None:
    three = np.array([[0.0, 0.0], [50.0, 50.0], [99.0, 0.0]])
    few = np.repeat(three, 2, axis=0) + 1e-3 * np.eye(6, 2)
    made = TMixture.of(few, 3, np.random.default_rng(3))
    assert len(made.parts) == 1
    np.testing.assert_allclose(made.parts[0].mean, few.mean(axis=0))
