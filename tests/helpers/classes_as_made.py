"""Classes of a hanger as made, and parameter sets drawn from their priors."""

from __future__ import annotations

import numpy as np

from shm.inference.problem.described import DescribedCoordinates
from shm.models import AsMade, build
from shm.values import FloatArray, Hanger


def as_made(name: str, hanger: Hanger) -> AsMade:
    """Return a class with the hanger's deviations and terms."""
    model = build(name, hanger)
    assert isinstance(model, AsMade)
    return model


def drawn(model: AsMade, sets: int) -> FloatArray:
    """Draw parameter sets (sets, parameters) from the prior of the description."""
    rng = np.random.default_rng(1)
    coordinates = DescribedCoordinates(model, (), 1.0)
    return coordinates.finished(coordinates.draw_prior(sets, rng), rng)
