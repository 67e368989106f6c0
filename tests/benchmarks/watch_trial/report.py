"""The trial's tables and figure."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from tests.benchmarks.watch_trial.outcomes import (
    QUIET,
    RIVALS,
    Row,
    alarm_by,
    covers,
    delays,
    false_alarms,
    first_alert,
    is_alert,
    is_right,
    limit_at,
    named_first,
    ours,
    quantile,
    rate,
    share,
)

TITLES = {
    "quiet": "no change",
    "creep": "relaxation of 0.3 % a year",
    "step3": "tension -3 %",
    "step5": "tension -5 %",
    "step10": "tension -10 %",
    "rise15": "tension +15 %",
    "ramp1": "tension -1 % a year",
    "ramp2": "tension -2 % a year",
    "ramp5": "tension -5 % a year",
    "springs": "one end's springs to a third",
    "lamp": "a lamp of 8 kg",
    "clock": "a clock off by 0.2 %",
    "section": "10 % of the section over a stretch",
    "sensor": "a sensor moved",
}
_COLOURS = {"ours": "#0b5394", "CUSUM": "#cc4125", "EWMA": "#999999"}
_MOST_TESTS, _COLUMNS = 20, 4


def of(rows: Sequence[Row], **wanted: object) -> list[Row]:
    """The rows with these values."""
    return [row for row in rows if all(row[key] == value for key, value in wanted.items())]


def limits_of(rows: Sequence[Row]) -> dict[str, float]:
    """Limits of the rivals in one world that give them as many false alarms as ours, on the very
    years that they are judged by; at our better end where we had none."""
    quiet = of(rows, scenario="quiet")
    count, years = false_alarms(quiet, ours)
    return {rule: limit_at(quiet, rule, max(count, 1) / years) for rule in RIVALS}


HEADS = (
    "world", "event", "n", "ours", "never", "CUSUM", "EWMA", "named first", "alerts that say today",
    "right",
)  # fmt: skip
"""Of the rows of `events`; ours and the rivals' as median, 90 and 95 % of the tests until told."""


def tables(rows: Sequence[Row]) -> str:
    """Markdown: false alarms, and what the events add up to."""
    lines = ["| world | baseline | | first false alarms a hanger-year | notices a year |"]
    lines.append("|---|---|---|---|---|")
    for world in _worlds(rows):
        for count in sorted({row["baseline"] for row in rows}, reverse=True):
            for scenario in QUIET:
                mine = of(rows, world=world, baseline=count, scenario=scenario)
                if mine:
                    hits, years = false_alarms(mine, ours)
                    notices = sum(not is_alert(a) for row in mine for a in row["alerts"]) / years
                    lines.append(
                        f"| {world} | {count} | {TITLES[scenario]} | {rate(hits, years)} | "
                        f"{notices:.2f} |"
                    )
    told = [row for row in rows if row["scenario"] not in QUIET and first_alert(row) is not None]
    right = f"{share(sum(map(is_right, told)), len(told))} ([each event](watch_trial/events.csv))"
    quiet = [row for row in rows if row["scenario"] not in ("lamp", "clock", "section", "sensor")]
    seconds = np.median([row["seconds"] for row in rows])
    lines += [
        "",
        f"The first alert of a hanger with an event is right in {right}.",
        f"The 90 % interval of the last shift held the true one: {_covered(quiet)}.",
        f"Median of the processor time: {1000 * seconds:.0f} ms a test.",
    ]
    return "\n".join(lines)


def events(rows: Sequence[Row]) -> list[list[str]]:
    """Delays beside the rivals' and what was named: a row for each event in each world."""
    found = []
    for world in _worlds(rows):
        own = of(rows, world=world)
        limits = limits_of(own)
        for scenario, title in TITLES.items():
            mine = of(own, scenario=scenario)
            if scenario not in QUIET and mine:
                found.append(_row(world, title, mine, limits))
    return found


def _worlds(rows: Sequence[Row]) -> list[str]:
    return list(dict.fromkeys(row["world"] for row in rows))


def _row(world: str, title: str, rows: Sequence[Row], limits: dict[str, float]) -> list[str]:
    found = delays(rows, ours)
    named: dict[str, int] = {}
    told = [row for row in rows if first_alert(row) is not None]
    for row in told:
        named[named_first(row)] = named.get(named_first(row), 0) + 1
    names = ", ".join(f"{name} {n}" for name, n in sorted(named.items(), key=lambda x: -x[1]))
    today = sum("today" in (first_alert(row) or {}).get("message", "") for row in told)
    return [
        world,
        title,
        str(len(found)),
        _delay(found),
        str(int(np.isinf(found).sum())),
        *(_delay(delays(rows, alarm_by(rule, limits[rule]))) for rule in RIVALS),
        names,
        str(today),
        share(sum(map(is_right, told)), len(told)),
    ]


def _delay(found: np.ndarray) -> str:
    """Median, 90 and 95 %."""
    every = (quantile(found, each) for each in (0.5, 0.9, 0.95))
    return ", ".join("-" if not np.isfinite(each) else f"{each:.0f}" for each in every)


def _covered(rows: Sequence[Row]) -> str:
    return share(sum(map(covers, rows)), len(rows))


def save_figure(rows: Sequence[Row], path: Path) -> None:
    """The share of each event told within so many tests, at equal false alarms."""
    worlds = _worlds(rows)
    shown = [s for s in TITLES if s not in QUIET and of(rows, scenario=s)]
    height = -(-len(shown) // _COLUMNS)
    figure = Figure(figsize=(12, 2.7 * height + 0.6), layout="constrained")
    axes = figure.subplots(height, _COLUMNS, squeeze=False, sharex=True, sharey=True)
    tests = np.arange(_MOST_TESTS + 1)
    for axis, scenario in zip(axes.flat, shown, strict=False):
        for rule, colour in _COLOURS.items():
            found = []
            for world in worlds:
                own = of(rows, world=world)
                chosen = ours if rule == "ours" else alarm_by(rule, limits_of(own)[rule])
                found.append(delays(of(own, scenario=scenario), chosen))
            every = np.concatenate(found)
            shares = [(every <= n).mean() if len(every) else np.nan for n in tests]
            width = 2.2 if rule == "ours" else 1.3
            axis.step(tests, shares, where="post", color=colour, label=rule, linewidth=width)
        axis.set_title(TITLES[scenario], fontsize=10)
        axis.set(xlim=(0, _MOST_TESTS), ylim=(0, 1.02))
        axis.grid(alpha=0.3)
    for axis in axes.flat[len(shown) :]:
        axis.axis("off")
    for axis in axes[:, 0]:
        axis.set_ylabel("share told")
    for axis in axes[-1]:
        axis.set_xlabel("tests since the event")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False)
    path.parent.mkdir(exist_ok=True)
    figure.savefig(path, dpi=110)
