"""The figures of a bridge's report."""

from __future__ import annotations

from shm.report.contents import BridgeReport
from shm.report.figures.bridge_shift import bridge_illustration
from shm.report.figures.bridge_tension import FIGURE as TENSIONS
from shm.report.figures.member import Illustration, drawn


def bridge_illustrations(data: BridgeReport) -> tuple[Illustration, ...]:
    """Every figure that this report has the data for, in reading order."""
    shifts = (bridge_illustration(data.pattern),) if data.pattern else ()
    return (*shifts, *drawn((TENSIONS,), data))
