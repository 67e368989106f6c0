"""The bridge as plain text for a terminal."""

from __future__ import annotations

from shm.report.bridge.content import BridgeReport
from shm.report.bridge.summary import summary
from shm.report.bridge.tables import tables
from shm.report.table import WIDTH, headed, laid_out


def bridge_text(data: BridgeReport, width: int = WIDTH) -> str:
    """The report of a bridge: the summary, then the tables."""
    verdict = f": {data.worst.value}" if data.worst else ""
    within = f", {data.period}" if data.period else ""
    head = headed(f"{data.bridge}{within}{verdict}", summary(data), width)
    return "\n".join((head, *(laid_out(table, width) for table in tables(data, bars=True))))
