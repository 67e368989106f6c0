"""State, action and numbers of a control hanger, and what it says of a campaign."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from shm.report.formatting import NORMAL_90, moment, rounded_tension
from shm.report.paper import Table
from shm.values.messages import NEXT_TEST, WEEK, Lead
from shm.values.rounding import force_unit, rounded_percent
from shm.watch.control_chart import ControlChart, ControlPoint

_REMEDY = f"Check clock and sampling rate of the logger, and repeat the control test {WEEK}."


def control_lead(chart: ControlChart) -> Lead:
    """Return state and action of a control hanger."""
    name, latest = f"Control hanger {chart.hanger.id}", chart.latest
    if latest is None:
        return Lead(f"{name}: no test yet.", f"Test it {NEXT_TEST}.")
    size = rounded_percent(latest.deviation, NORMAL_90 * latest.sd, "+")
    if latest.is_out:
        return Lead(f"{name}: {size} from its known tension, out of its limits.", _REMEDY)
    return Lead(f"{name}: {size} from its known tension, within its limits.", "No action needed.")


def campaign_warning(hanger: int, chart: ControlChart, point: ControlPoint) -> str:
    """Return that the campaign of a hanger is in doubt, what to do, and why."""
    return (
        f"Hanger {hanger}: its campaign is in doubt, for control hanger {chart.hanger.id} was out "
        f"of its limits. {_REMEDY} Test {point.test} of the control hanger ({point.time:%Y-%m-%d}) "
        f"is {_percent(point.deviation)} from the known tension; its limits are {_limits(point)}."
    )


def _limits(point: ControlPoint) -> str:
    return f"{_percent(point.centre - point.limit)} to {_percent(point.centre + point.limit)}"


def _percent(fraction: float) -> str:
    return f"{100 * fraction:+.2g} %"


def control_table(chart: ControlChart) -> Table:
    """Return each test with its limits, the latest first."""
    unit = force_unit(chart.hanger.known_tension_n)
    rows = tuple(
        (
            each.test, moment(each.time), rounded_tension(each.tension_n, unit),
            rounded_tension(each.known_n, unit), _percent(each.deviation), _limits(each),
            "out of limits" if each.is_out else "within limits",
        )
        for each in reversed(chart.points)
    )  # fmt: skip
    names = ("test", "time", "tension", "known", "deviation", "limits", "")
    return Table("Control chart", names, rows, note="Limits: three standard deviations.")


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
