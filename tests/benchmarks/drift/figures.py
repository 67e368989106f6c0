"""The figures of the trial: how soon each rule alarms, and how often without cause."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tests.benchmarks.drift.comparing import delays, false_alarms, of_scenario
from tests.benchmarks.drift.outcomes import (
    CUSUM,
    CUSUM_CLIPPED,
    CUSUM_WARM,
    OURS,
    THREE_SIGMA,
    Outcome,
)
from tests.benchmarks.drift.scenarios import HARD_QUIET, QUIET
from tests.benchmarks.drift.table import RULES, changing

_COLOURS = {
    OURS: "#0b5394",
    THREE_SIGMA: "#cc4125",
    CUSUM: "#e69138",
    CUSUM_WARM: "#6aa84f",
    CUSUM_CLIPPED: "#999999",
}
_MOST_TESTS = 60
_LIMITS_YEARS = np.geomspace(2, 1000, 40)
_COLUMNS = 4


def save_figures(
    outcomes: Sequence[Outcome], limits: Mapping[str, float], folder: Path
) -> list[Path]:
    """`drift_delays.png` and `drift_false_alarms.png`."""
    folder.mkdir(exist_ok=True)
    made = {
        "drift_delays.png": delay_figure(outcomes, limits),
        "drift_false_alarms.png": false_alarm_figure(outcomes, limits[OURS]),
    }
    for name, figure in made.items():
        figure.savefig(folder / name, dpi=110)
    return [folder / name for name in made]


def delay_figure(outcomes: Sequence[Outcome], limits: Mapping[str, float]) -> Figure:
    """The share detected within so many tests, a panel for each scenario."""
    scenarios = changing(outcomes)
    rows = max(1, -(-len(scenarios) // _COLUMNS))
    figure = Figure(figsize=(12, 2.9 * rows + 0.6), layout="constrained")
    axes = figure.subplots(rows, _COLUMNS, squeeze=False, sharex=True, sharey=True)
    for axis, scenario in zip(axes.flat, scenarios, strict=False):
        _draw_delays(axis, of_scenario(outcomes, scenario.name), limits)
        axis.set_title(scenario.title, fontsize=10)
    for axis in axes.flat[len(scenarios) :]:
        axis.axis("off")
    for axis in axes[:, 0]:
        axis.set_ylabel("share detected")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(RULES), frameon=False)
    return figure


def _draw_delays(axis: Axes, outcomes: Sequence[Outcome], limits: Mapping[str, float]) -> None:
    tests = np.arange(0, _MOST_TESTS + 1)
    for rule in RULES:
        found = delays(outcomes, rule, limits[rule])
        shares = [found.detected_within(int(n)) for n in tests]
        width = 2.2 if rule == OURS else 1.3
        axis.step(tests, shares, where="post", color=_COLOURS[rule], label=rule, linewidth=width)
    axis.set(xlim=(0, _MOST_TESTS), ylim=(0, 1.02), xlabel="tests since the change")
    axis.grid(alpha=0.3)


def false_alarm_figure(outcomes: Sequence[Outcome], limit_years: float) -> Figure:
    """Rates achieved over the limit, beside what the limit promises."""
    figure = Figure(figsize=(6.4, 4.4), layout="constrained")
    axis = figure.subplots()
    for scenario, colour in ((QUIET, "#0b5394"), (HARD_QUIET, "#cc4125")):
        own = of_scenario(outcomes, scenario.name)
        if not own:
            continue
        found = [false_alarms(own, OURS, float(limit)) for limit in _LIMITS_YEARS]
        low, high = np.array([each.interval for each in found]).T
        rates = [each.rate or np.nan for each in found]
        axis.plot(_LIMITS_YEARS, rates, color=colour, label=scenario.title)
        axis.fill_between(_LIMITS_YEARS, np.maximum(low, 1e-6), high, color=colour, alpha=0.15)
    axis.plot(_LIMITS_YEARS, 1 / _LIMITS_YEARS, "k--", linewidth=1, label="stated: 1/limit")
    axis.axvline(limit_years, color="#999999", linewidth=0.8)
    axis.set(xscale="log", yscale="log", ylim=(2e-4, 1))
    axis.set(xlabel="limit of the evidence (years)", ylabel="false alarms per hanger-year")
    axis.grid(alpha=0.3, which="both")
    axis.legend(frameon=False)
    return figure
