"""A small posterior of a known test, made once."""

from __future__ import annotations

import numpy as np
import pytest

import shm
from shm.models import described
from shm.values import PLANES
from tests.helpers.hangers import HANGER_3


@pytest.fixture(scope="session")
def hanger() -> shm.Hanger:
    return HANGER_3


@pytest.fixture(scope="session")
def test_of_711_kn() -> shm.ModalTest:
    """The frequencies of beam1 at the nominal tension, known to a tenth of a percent."""
    found = described("beam1", HANGER_3).frequencies_hz(np.array([[1.0, 1.0]]), 4)[0]
    modes = tuple(
        shm.Mode(plane, order, float(hertz), 0.001 * float(hertz))
        for plane, row in zip(PLANES, found, strict=True)
        for order, hertz in enumerate(row, start=1)
    )
    return shm.ModalTest("t1", modes, hanger=3)


@pytest.fixture(scope="session")
def posterior(test_of_711_kn: shm.ModalTest) -> shm.Posterior:
    return shm.update(test_of_711_kn, HANGER_3, "beam1", samples=300, seed=1)


@pytest.fixture(scope="session")
def recording() -> shm.Recording:
    return shm.simulate(HANGER_3, hits=3, seconds_per_hit=8.0, seed=1)


@pytest.fixture(scope="session")
def identified(recording: shm.Recording) -> shm.Identification:
    return shm.identify(recording, hanger=HANGER_3, cross_check="none")
