"""The report of a control hanger: its control chart, and what it says of a campaign."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from datetime import datetime
from typing import Any

from shm.report import formatting
from shm.report.paper import Paper, Part, Table, filled
from shm.values.messages import NEXT_TEST, WEEK, Lead
from shm.values.rounding import force_unit, rounded_percent
from shm.watch.control_chart import ControlChart, ControlPoint

SCHEMA = "shm.control_report/1"
_REMEDY = f"Check clock and sampling rate of the logger, and repeat the control test {WEEK}."


def control_lead(chart: ControlChart) -> Lead:
    """Return state and action of a control hanger."""
    name, latest = f"Control hanger {chart.hanger.id}", chart.latest
    if latest is None:
        return Lead(f"{name}: no test yet.", f"Test it {NEXT_TEST}.")
    size = rounded_percent(latest.deviation, formatting.NORMAL_90 * latest.sd, "+")
    if latest.is_out:
        return Lead(f"{name}: {size} from its known tension, out of its limits.", _REMEDY)
    return Lead(f"{name}: {size} from its known tension, within its limits.", "No action needed.")


def campaign_warning(hanger: int, chart: ControlChart, point: ControlPoint) -> str:
    """Return that the campaign of a hanger is in doubt, what to do, and why."""
    return (
        f"Hanger {hanger}: its campaign is in doubt, for control hanger {chart.hanger.id} was out "
        f"of its limits. {_REMEDY} Test {point.reading.test} of the control hanger "
        f"({point.reading.time:%Y-%m-%d}) is {_percent(point.deviation)} from the known tension; "
        f"its limits are {_percent(point.centre - point.limit)} to "
        f"{_percent(point.centre + point.limit)}."
    )


def _percent(fraction: float) -> str:
    return f"{100 * fraction:+.2g} %"


@dataclass(frozen=True)
class ControlReport:
    """What the report of a control hanger is made of."""

    bridge: str
    chart: ControlChart
    generated_at: datetime
    version: str


def control_paper(data: ControlReport) -> Paper:
    """Return the paper: state and action, the chart, each test."""
    # The figures are made of reports.
    from shm.report.figures.control_chart import FIGURE
    from shm.report.figures.specification import drawn

    chart, hanger = data.chart, data.chart.hanger
    is_out = chart.latest is not None and chart.latest.is_out
    unit = force_unit(hanger.known_tension_n)
    known = formatting.Interval.normal(hanger.known_tension_n, hanger.known_tension_sd_n)
    facts = (
        ("Known tension", formatting.with_half(known, unit), "90 % interval, as described"),
        ("Tests", str(len(chart.points)), f"{_count_out(chart)} out of limits"),
    )
    return Paper(
        title=f"Control hanger {hanger.id} {hanger.name}".rstrip(),
        bridge=data.bridge,
        status="Check" if is_out else "",
        style="check" if is_out else "steady",
        parts=(
            Part(
                "In short", lead=control_lead(chart).words, facts=facts, brief=filled(table(chart))
            ),
            Part("Control chart", figures=lambda: drawn((FIGURE,), chart)),
            Part("Numbers", tables=filled(table(chart))),
        ),
        generated_at=data.generated_at,
        version=data.version,
        closing="Times are UTC.",
    )


def _count_out(chart: ControlChart) -> int:
    return sum(point.is_out for point in chart.points)


def table(chart: ControlChart) -> Table:
    """Return each test with its limits, the latest first."""
    unit = force_unit(chart.hanger.known_tension_n)
    rows = tuple(
        (
            each.reading.test,
            formatting.moment(each.reading.time),
            formatting.rounded_tension(each.reading.tension_n, unit),
            formatting.rounded_tension(each.reading.known_n, unit),
            _percent(each.deviation),
            f"{_percent(each.centre - each.limit)} to {_percent(each.centre + each.limit)}",
            "out of limits" if each.is_out else "within limits",
        )
        for each in reversed(chart.points)
    )
    names = ("test", "time", "tension", "known", "deviation", "limits", "")
    return Table("Control chart", names, rows, note="Limits: three standard deviations.")


def control_json(data: ControlReport) -> dict[str, Any]:
    """Return a document for `shm.documents.dump`."""
    return {
        "schema": SCHEMA,
        "bridge": data.bridge,
        **chart_document(data.chart),
        "version": data.version,
        "generated_at": data.generated_at,
    }


def chart_document(chart: ControlChart) -> dict[str, Any]:
    """Return a chart as every JSON document gives it; deviations and limits are fractions."""
    lead, hanger = control_lead(chart), chart.hanger
    return {
        "hanger": hanger.id,
        "name": hanger.name,
        "state": lead.state,
        "action": lead.action,
        "urgency": lead.urgency,
        "known_tension_n": hanger.known_tension_n,
        "known_tension_sd_n": hanger.known_tension_sd_n,
        "points": [
            {
                **asdict(each.reading),
                "deviation": each.deviation,
                "lower_limit": each.centre - each.limit,
                "upper_limit": each.centre + each.limit,
                "is_out": each.is_out,
            }
            for each in chart.points
        ],
    }
