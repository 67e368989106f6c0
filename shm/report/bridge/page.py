"""The bridge as one HTML file."""

from __future__ import annotations

from markupsafe import Markup

from shm.report import words
from shm.report.bridge.content import BridgeReport
from shm.report.bridge.tables import summary, tables
from shm.report.figures.bridge_shift import bridge_illustration
from shm.report.template import ENVIRONMENT


def bridge_page(data: BridgeReport) -> str:
    """The report of a bridge: the summary, the elevation, the tables; nothing fetched."""
    drawn = [bridge_illustration(data.pattern)] if data.pattern else []
    return ENVIRONMENT.get_template("bridge.html.j2").render(
        bridge=data.bridge,
        status=data.worst,
        summary=summary(data),
        illustrations=[(item, Markup(item.svg())) for item in drawn],  # noqa: S704
        tables=tables(data),
        made=f"{words.moment(data.generated_at)} by shm {data.version}",
    )
