"""The report as one HTML file: style, figures and words inside, nothing fetched."""

from __future__ import annotations

from markupsafe import Markup

from shm.report import words
from shm.report.content import HangerReport
from shm.report.diagnosis.page import section
from shm.report.diagnosis.part import diagnosed, how_to_diagnose
from shm.report.facts import facts
from shm.report.figures import illustrations
from shm.report.summary import status, summary
from shm.report.tables import numbers, origins
from shm.report.template import ENVIRONMENT


def html(data: HangerReport) -> str:
    """The report of one hanger: readable on screen (light or dark), on paper, by ear."""
    return ENVIRONMENT.get_template("hanger.html.j2").render(
        title=words.hanger_name(data.hanger.id, data.hanger.name),
        bridge=data.bridge,
        status=status(data),
        summary=summary(data),
        facts=facts(data),
        illustrations=[(item, Markup(item.svg())) for item in illustrations(data)],  # noqa: S704
        tables=numbers(data),
        gap_watch=data.gap_watch,
        diagnosis=section(sheet) if (sheet := diagnosed(data)) else None,
        how_to_diagnose=how_to_diagnose(data),
        origins=origins(data),
        period=str(data.period) if data.period else "",
        made=f"{words.moment(data.generated_at)} by shm {data.version}",
    )
