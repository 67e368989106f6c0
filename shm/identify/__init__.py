"""Identify the modes of a hammer test from its records: hits, windows, responses, quality.

`identify` does all of it. Identifiers are one file and one line each of `IDENTIFIERS`, quality
checks one row each of `shm.identify.quality.CHECKS`.
"""

from __future__ import annotations

from shm.identify.contract import Dropped, Hit, Poles
from shm.identify.identification import IDENTIFIERS, Identification, identify
from shm.identify.options import IdentifyOptions

__all__ = [
    "IDENTIFIERS",
    "Dropped",
    "Hit",
    "Identification",
    "IdentifyOptions",
    "Poles",
    "identify",
]
