"""State, action and numbers of a control hanger, and what it says of a campaign."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from shm.report.hanger_status import CONTROL_REMEDY, control_lead
from shm.watch.control_chart import ControlChart, ControlPoint


def campaign_warning(hanger: int, chart: ControlChart, point: ControlPoint) -> str:
    """Return that the campaign of a hanger is in doubt, what to do, and why."""
    return (
        f"Hanger {hanger}: its campaign is in doubt, for control hanger {chart.hanger.id} was out "
        f"of its limits. {CONTROL_REMEDY} Test {point.test} of the control hanger "
        f"({point.time:%Y-%m-%d}) is {percent(point.deviation)} from the known tension; its limits "
        f"are {limits(point)}."
    )


def limits(point: ControlPoint) -> str:
    return f"{percent(point.centre - point.limit)} to {percent(point.centre + point.limit)}"


def percent(fraction: float) -> str:
    return f"{100 * fraction:+.2g} %"


def chart_document(chart: ControlChart) -> dict[str, Any]:
    """Return a chart as every JSON document gives it; deviations and limits are fractions."""
    lead, hanger = control_lead(chart), chart.hanger
    return {
        "hanger": hanger.id,
        "state": lead.state,
        "action": lead.action,
        "urgency": lead.urgency,
        "known_tension_n": hanger.known_tension_n,
        "known_tension_sd_n": hanger.known_tension_sd_n,
        "points": [{**asdict(each), "is_out": each.is_out} for each in chart.points],
    }
