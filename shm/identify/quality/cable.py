"""Check `cable`: jumps, bursts, dead or doubled channels that no hanger makes."""

from __future__ import annotations

from shm.identify.measuring.signal_faults import CABLE, COPY, DEAD, SILENT, WANDERS
from shm.identify.quality.inspection import Inspection
from shm.identify.quality.wording import fault_count
from shm.values import QualityCheck


def check(inspection: Inspection) -> QualityCheck | None:
    """How many hits and channels were left out for what a cable or a sensor made of them."""
    return fault_count(
        inspection,
        "cable",
        (CABLE, COPY, DEAD, SILENT, WANDERS),
        "no channel jumps, wanders or is silent",
        "Reseat the connectors of these channels, tie the cables down, exchange a cable that stays "
        "bad, and repeat these hits.",
    )
