"""The report of a whole bridge: the state of all hangers, what moved, what explains it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from shm.report.bridge.content import BridgeReport
from shm.report.bridge.facts import facts
from shm.report.bridge.summary import summary
from shm.report.bridge.tables import tables
from shm.report.paper import CREDIBLE, Paper, Part

if TYPE_CHECKING:
    from shm.report.figures.member import Illustration


def bridge_paper(data: BridgeReport) -> Paper:
    """Summary, figures along the bridge, numbers."""
    return Paper(
        title=data.bridge,
        period=str(data.period) if data.period else "",
        status=data.worst.value if data.worst else "",
        style=data.worst.name.lower() if data.worst else "first",
        parts=(
            Part("In short", summary=summary(data), facts=facts(data)),
            Part("Along the bridge", figures=lambda: _figures(data)),
            Part("Numbers", tables=tables(data)),
        ),
        generated_at=data.generated_at,
        version=data.version,
        closing=f"{CREDIBLE}; times are UTC.",
    )


def _figures(data: BridgeReport) -> Sequence[Illustration]:
    from shm.report.bridge.figures import bridge_illustrations

    return bridge_illustrations(data)
