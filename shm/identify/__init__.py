"""From the records of a hammer test to its modes: hits, windows, responses, identification.

`identify` is the door. Identifiers stand in a registry: one file and one line each.
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
