from __future__ import annotations

from datetime import UTC, datetime

import numpy as np
import pytest

from shm.values import AddedMass, Channel, FrequencyResponse, Recording, ResponsePoint


@pytest.fixture
def recording() -> Recording:
    """Return a force and two biaxial channels, with everything known."""
    rng = np.random.default_rng(5)
    values = rng.standard_normal((3, 200))
    return Recording(
        source="test",
        channels=(
            Channel("force", "force", 800 * values[0], x_m=1.92),
            Channel("acc_1", "acceleration", values[1], "transverse", 2.52),
            Channel("acc_2", "acceleration", 1e-4 * values[2], "longitudinal", 2.52),
        ),
        sampling_rate_hz=512.0,
        hanger=3,
        time=datetime(2026, 5, 1, 10, 0, 30, 250000, tzinfo=UTC),
        temperature_c=-2.5,
        added_mass=AddedMass(25.0, 3.6, 0.08),
        operator="Ann",
    )


@pytest.fixture
def response() -> FrequencyResponse:
    """Two points, lines from 0, with coherence."""
    rng = np.random.default_rng(6)
    real, imaginary = rng.standard_normal((2, 2, 65))
    return FrequencyResponse(
        source="test",
        points=(ResponsePoint("low", "transverse", 2.5), ResponsePoint("high", None, 4.0)),
        frequency_hz=0.01953125 * np.arange(65),
        accelerance=real + 1j * imaginary,
        coherence=rng.uniform(size=(2, 65)),
        hanger=7,
        time=datetime(2026, 5, 2, tzinfo=UTC),
        temperature_c=8.0,
    )
