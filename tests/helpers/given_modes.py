"""A test whose modes have given frequencies."""

from __future__ import annotations

from typing import Any

import numpy as np

from shm.values import NAN, PLANES, FloatArray, ModalTest, Mode, Plane


def with_modes(
    frequency_hz: Any,
    sd: float = NAN,
    noise: FloatArray | float = 0.0,
    first_order: int = 1,
    name: str = "t1",
    planes: tuple[Plane, ...] = PLANES,
    **about: Any,
) -> ModalTest:
    """Return a test of frequencies (planes, modes), off by fractions and stated to a fraction."""
    exact = np.asarray(frequency_hz, dtype=float)
    modes = tuple(
        Mode(plane, order, float(hz), float(sd * true))
        for plane, row, of in zip(planes, exact * (1 + noise), exact, strict=True)
        for order, (hz, true) in enumerate(zip(row, of, strict=True), start=first_order)
    )
    return ModalTest(name, modes, **{"hanger": 3, **about})
