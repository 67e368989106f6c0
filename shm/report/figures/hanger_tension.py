"""Posterior of the tension: a histogram, its 90 % interval, nominal and baseline."""

from __future__ import annotations

import numpy as np

from shm.report import formatting
from shm.report.contents import HangerReport
from shm.report.figures import specification as spec
from shm.report.formatting import Interval


def specify(data: HangerReport) -> spec.Specification:
    unit = data.tension_unit
    samples = unit.of(data.compared.tension_n)
    interval = Interval.of_averaged(data.by_latest_test).in_unit(unit)
    heights, edges = np.histogram(samples, bins=min(40, 10 + len(samples) // 40), density=True)
    centres, width = (edges[:-1] + edges[1:]) / 2, 0.94 * float(np.diff(edges)[0])
    inside = (centres >= interval.low) & (centres <= interval.high)
    marks: list[spec.Mark] = [
        spec.Bars(
            x=centres[chosen], y=heights[chosen], width=width, colour="blue", opacity=opacity,
            name=name,
        )
        for chosen, opacity, name in ((inside, 0.9, "90 % interval"), (~inside, 0.35, "outside it"))
    ]  # fmt: skip
    lines = [("nominal", "ink", "dot", unit.of(data.hanger.nominal_tension_n))]
    if data.baseline_tension_n is not None:
        before = data.baseline_tension_n.in_unit(unit)
        lines.append(("baseline", "green", "dash", before.mean))
        marks.append(
            spec.Span(low=before.low, high=before.high, axis="x", colour="green", opacity=0.15)
        )
    marks += [
        spec.Rule(at=at, axis="x", colour=colour, dash=dash, name=name)  # type: ignore[arg-type]
        for name, colour, dash, at in lines
    ]
    panel = spec.Panel(
        y=spec.Axis(label=f"probability density (1/{unit.name})"),
        marks=marks,
        x=spec.Axis(label=f"tension ({unit.name})"),
    )
    return spec.stacked([panel], 3.4)


def _caption(data: HangerReport) -> str:
    tension = formatting.tension(Interval.of_averaged(data.by_latest_test), data.tension_unit)
    baseline = (
        "There is no earlier baseline."
        if data.baseline_tension_n is None
        else "Dashed: mean of the baseline, its 90 % interval shaded."
    )
    return (
        f"Tension by the latest test alone: {tension}. Dark bars lie in the 90 % interval. "
        f"Dotted: nominal tension. {baseline}"
    )


def _alt(data: HangerReport) -> str:
    tension = formatting.tension(Interval.of_averaged(data.by_latest_test), data.tension_unit)
    return f"Histogram of {len(data.posterior.samples)} posterior samples of tension, {tension}."


FIGURE = spec.FigureSpec[HangerReport](
    "tension", "Posterior of the tension by the latest test", specify, _caption, _alt
)
