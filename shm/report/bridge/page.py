"""The bridge as one HTML file."""

from __future__ import annotations

from markupsafe import Markup

from shm.report import words
from shm.report.bridge.content import BridgeReport
from shm.report.bridge.facts import facts
from shm.report.bridge.figures import bridge_illustrations
from shm.report.bridge.summary import summary
from shm.report.bridge.tables import tables
from shm.report.template import ENVIRONMENT


def bridge_page(data: BridgeReport) -> str:
    """The report of a bridge: the summary, the elevation, the tables; nothing fetched."""
    return ENVIRONMENT.get_template("bridge.html.j2").render(
        bridge=data.bridge,
        status=data.worst,
        period=str(data.period) if data.period else "",
        summary=summary(data),
        facts=facts(data),
        illustrations=[(item, Markup(item.svg())) for item in bridge_illustrations(data)],  # noqa: S704
        tables=tables(data),
        made=f"{words.moment(data.generated_at)} by shm {data.version}",
    )
