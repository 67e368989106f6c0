"""Hold bars whose zones end at nearly the same place against those where they end at the same."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shm.models.hanger import Zone
from tests.helpers.physical_hangers import clamped, frequencies_hz


@pytest.mark.parametrize("shear_compliance_1_n", [0.0, 8e-9])
@pytest.mark.parametrize("apart_m", [1e-4, 1e-5, 1e-6, 1e-9, 1e-12])
def test_edges_that_nearly_coincide(apart_m: float, shear_compliance_1_n: float) -> None:
    """Check that frequencies change by less than the distance, and exist however small it is."""
    bar = clamped(2)
    one = np.ones(2)
    bar = replace(bar, shear_compliance_1_n=shear_compliance_1_n * one)
    start_m, end_m = 0 * one, 0.25 * one
    fitting = Zone(start_m, end_m, 3 * one, 1.7 * one)
    stiff = Zone(start_m, end_m + np.array([0.0, apart_m]), 5 * one, one)
    same, near = frequencies_hz(replace(bar, zones=(fitting, stiff)), 6)
    np.testing.assert_allclose(near, same, rtol=apart_m + 1e-9)
