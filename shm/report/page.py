"""The report as one HTML file: style, figures and words inside, nothing fetched."""

from __future__ import annotations

from markupsafe import Markup

from shm.report import words
from shm.report.content import HangerReport
from shm.report.diagnosis.page import section
from shm.report.diagnosis.part import diagnosed, how_to_diagnose
from shm.report.figures import illustrations
from shm.report.summary import status, summary
from shm.report.tables import tables
from shm.report.template import ENVIRONMENT


def html(data: HangerReport) -> str:
    """The report of one hanger: readable on screen (light or dark), on paper, by ear."""
    *main, origin = tables(data)
    return ENVIRONMENT.get_template("hanger.html.j2").render(
        title=words.hanger_name(data.hanger.id, data.hanger.name),
        bridge=data.bridge,
        status=status(data),
        summary=summary(data),
        facts=_facts(data),
        illustrations=[(item, Markup(item.svg())) for item in illustrations(data)],  # noqa: S704
        tables=main,
        gap_watch=data.gap_watch,
        diagnosis=section(sheet) if (sheet := diagnosed(data)) else None,
        how_to_diagnose=how_to_diagnose(data),
        origin=origin,
        made=f"{words.moment(data.generated_at)} by shm {data.version}",
    )


def _facts(data: HangerReport) -> tuple[tuple[str, str, str], ...]:
    """The figures on top: what, value, what stands beside it."""
    tension = words.kilonewtons(data.tension_n)
    modes = data.latest.modes
    return (
        ("Tension", f"{words.mean(tension)} kN", f"90 % interval {words.span(tension)} kN"),
        (
            "Of nominal",
            f"{100 * data.tension_n.mean / data.hanger.nominal_tension_n:.1f} %",
            f"nominal {data.hanger.nominal_tension_n / 1e3:.0f} kN",
        ),
        (
            "Latest test",
            words.moment(data.latest.time),
            words.temperature(data.latest.temperature_c),
        ),
        ("Model class", words.model_class(data.posterior.model), f"{len(modes)} modes identified"),
    )
