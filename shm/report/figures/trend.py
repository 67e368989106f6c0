"""Trend of the tension over time, with credible band, baseline, thresholds and alerts."""

from __future__ import annotations

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from shm.report import words
from shm.report.content import HangerReport
from shm.report.figures import style, timeline
from shm.report.figures.member import Member
from shm.values.force_units import ForceUnit, force_unit


def _draw(data: HangerReport) -> Figure | None:
    rows = timeline.dated(data)
    if not rows:
        return None
    figure = style.new_figure()
    axes = figure.subplots()
    unit = _unit(rows)
    style.dress(axes, "time of the test (UTC)", f"tension ({unit.name})")
    timeline.band(
        axes,
        [(row.time, row.row.tension_n.in_unit(unit)) for row in rows],
        style.BLUE,
        "tension, 90 % band",
    )
    _levels(axes, data, unit)
    _alerts(axes, data, rows, unit)
    timeline.dress_time(axes, [row.time for row in rows])
    style.legend_above(axes, columns=5)
    return figure


def _unit(rows: list[timeline.Dated]) -> ForceUnit:
    """The one unit of the figure."""
    return force_unit(*(row.row.tension_n.mean for row in rows))


def _levels(axes: Axes, data: HangerReport, unit: ForceUnit) -> None:
    nominal = unit.of(data.hanger.nominal_tension_n)
    axes.axhline(nominal, color=style.INK, linestyle=":", label="nominal")
    if data.baseline is None:
        return
    baseline = unit.of(float(data.baseline.tension_n.mean()))
    fraction = data.hanger.thresholds.tension_shift_fraction
    axes.axhline(baseline, color=style.GREEN, linestyle="--", label="baseline")
    for sign, label in ((1, "threshold"), (-1, "_")):
        axes.axhline(
            baseline * (1 + sign * fraction),
            color=style.RED,
            linestyle="-.",
            linewidth=1.1,
            label=label,
        )


def _alerts(axes: Axes, data: HangerReport, rows: list[timeline.Dated], unit: ForceUnit) -> None:
    alerted = {alert.test for alert in data.alerts}
    marked = [row for row in rows if row.row.test in alerted]
    if marked:
        axes.plot(
            timeline.positions([row.time for row in marked]),
            [unit.of(row.row.tension_n.mean) for row in marked],
            linestyle="none",
            marker="v",
            markersize=11,
            markerfacecolor="none",
            markeredgecolor=style.RED,
            markeredgewidth=1.8,
            label="alert",
        )


def _caption(data: HangerReport) -> str:
    undated = len(data.trend) - len(timeline.dated(data))
    left_out = f" {undated} tests without a time are left out." if undated else ""
    percent = 100 * data.hanger.thresholds.tension_shift_fraction
    return (
        "Tension by each test: mean and 90 % credible band. Dotted: nominal; dashed: baseline; "
        f"dash-dotted: thresholds, {percent:.3g} % either side of the baseline; "
        f"triangles: alerts.{left_out}"
    )


def _alt(data: HangerReport) -> str:
    rows = timeline.dated(data)
    first, last = (_at(row, _unit(rows)) for row in (rows[0], rows[-1]))
    return f"Tension over {len(rows)} tests, {first} at first, {last} at last."


def _at(row: timeline.Dated, unit: ForceUnit) -> str:
    return f"{words.tension(row.row.tension_n, unit)} on {row.time:%Y-%m-%d}"


FIGURE = Member("trend", "Trend of the tension", _draw, _caption, _alt)
