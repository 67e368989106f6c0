"""The report of a bridge, on paper."""

from __future__ import annotations

from shm.report.bridge.content import BridgeReport
from shm.report.bridge.facts import facts
from shm.report.bridge.figures import bridge_illustrations
from shm.report.bridge.summary import summary
from shm.report.bridge.tables import tables
from shm.report.paper.content import Paper, Part
from shm.report.paper.hanger import CLOSING


def bridge_paper(data: BridgeReport) -> Paper:
    """Summary, figures along the bridge, numbers."""
    within = f", {data.period}" if data.period else ""
    return Paper(
        title=f"All hangers{within}",
        bridge=data.bridge,
        status=data.worst.value if data.worst else "",
        style=data.worst.name.lower() if data.worst else "first",
        parts=(
            Part("In short", summary(data), facts(data)),
            Part("Along the bridge", illustrations=bridge_illustrations(data)),
            Part("Numbers", tables=tables(data)),
        ),
        generated_at=data.generated_at,
        version=data.version,
        closing=CLOSING,
    )
