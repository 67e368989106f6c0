"""Check `drop-outs`: samples are missing, or a signal stands still while the hanger moves."""

from __future__ import annotations

from shm.identify.measuring.signal_faults import FROZEN, NOT_A_NUMBER
from shm.identify.quality.inspection import Inspection
from shm.identify.quality.wording import fault_count
from shm.values import QualityCheck


def check(inspection: Inspection) -> QualityCheck | None:
    """How many hits and channels were left out for missing or repeated samples."""
    return fault_count(
        inspection,
        "drop-outs",
        (NOT_A_NUMBER, FROZEN),
        "no sample is missing",
        "Check the logger's memory card or radio link and its load, and repeat these hits.",
    )
