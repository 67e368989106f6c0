"""Check `double hits`: the hammer struck twice in one swing."""

from __future__ import annotations

from shm.identify.measuring.signal_faults import DOUBLE_HIT
from shm.identify.quality.inspection import Inspection
from shm.identify.quality.wording import fault_count
from shm.values import QualityCheck


def check(inspection: Inspection) -> QualityCheck | None:
    """How many hits were left out because a second blow fell into their ring-down."""
    return fault_count(
        inspection,
        "double hits",
        (DOUBLE_HIT,),
        "each hit is a single blow",
        "Hit from the wrist and let the hammer spring back at once; repeat these hits.",
    )
