"""Trend of the end stiffness of each plane, for model classes that have springs."""

from __future__ import annotations

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from shm.report import words
from shm.report.content import HangerReport
from shm.report.figures import style, timeline
from shm.report.figures.member import Member
from shm.watch import end_stiffness


def _draw(data: HangerReport) -> Figure | None:
    names = _planes(data)
    if not names:
        return None
    figure = style.new_figure(3.0)
    panels = figure.subplots(1, len(names), sharey=True, squeeze=False)[0]
    for name, axes in zip(names, panels, strict=True):
        style.dress(axes, "time of the test (UTC)", "")
        axes.set_title(words.quantity(name), fontsize=9, color=style.INK, loc="left")
        _trend(axes, data, name)
        _levels(axes, data, name)
    panels[0].set_ylabel("log10 of stiffness in N m/rad", fontsize=9, color=style.INK)
    return figure


def _planes(data: HangerReport) -> list[str]:
    return sorted({name for dated in timeline.dated(data) for name in dated.row.stiffness})[::-1]


def _trend(axes: Axes, data: HangerReport, name: str) -> None:
    points = [
        (dated.time, dated.row.stiffness[name])
        for dated in timeline.dated(data)
        if name in dated.row.stiffness
    ]
    timeline.band(axes, points, style.PURPLE, name)
    timeline.dress_time(axes, [time for time, _ in points])


def _levels(axes: Axes, data: HangerReport, name: str) -> None:
    baseline = end_stiffness(data.baseline, data.hanger).get(name) if data.baseline else None
    if baseline is None:
        return
    level, reach = float(baseline.mean()), data.hanger.thresholds.stiffness_shift_decades
    axes.axhline(level, color=style.GREEN, linestyle="--")
    for limit in (level - reach, level + reach):
        axes.axhline(limit, color=style.RED, linestyle="-.", linewidth=1)


def _caption(data: HangerReport) -> str:
    reach = data.hanger.thresholds.stiffness_shift_decades
    return (
        "Rotational stiffness of the ends by each test, 2/(1/k_deck + 1/k_arch) in each plane, "
        "because frequencies alone cannot tell the ends apart: mean and 90 % credible band. "
        f"Dashed: baseline; dash-dotted: thresholds, {reach:.3g} decades either side. A wide band "
        "means that the measured modes hardly feel the stiffness."
    )


def _alt(data: HangerReport) -> str:
    latest = timeline.dated(data)[-1].row.stiffness
    values = [
        f"{words.quantity(name)} {words.mean(interval)} ({words.span(interval)})"
        for name, interval in latest.items()
    ]
    return "End stiffness over time, log10; at last: " + "; ".join(values or ["not estimated"])


FIGURE = Member("stiffness", "Trend of the end stiffness", _draw, _caption, _alt)
