"""Kinds of values that the nouns share."""

from __future__ import annotations

import math
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

FloatArray: TypeAlias = NDArray[np.float64]
IntArray: TypeAlias = NDArray[np.int64]
BoolArray: TypeAlias = NDArray[np.bool_]
ComplexArray: TypeAlias = NDArray[np.complex128]
Plane: TypeAlias = Literal["transverse", "longitudinal"]
Quantity: TypeAlias = Literal["force", "acceleration"]
Verdict: TypeAlias = Literal["good", "warning", "refused", "unknown"]

PLANES: tuple[Plane, Plane] = ("transverse", "longitudinal")
NAN = math.nan

COLDEST_C, WARMEST_C = -60.0, 80.0
"""Judgement: no outdoor air or steel is beyond; what a sensor at fault says (-127, 85, 999) is."""


def outdoor_c(temperature_c: float) -> float:
    """Return the temperature where air or steel outdoors can have it, else NaN."""
    return temperature_c if COLDEST_C <= temperature_c <= WARMEST_C else NAN
