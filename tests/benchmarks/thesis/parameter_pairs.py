"""Posterior of the parameters, each alone or two against each other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from shm.report.figures import specification as spec
from shm.values import FloatArray, Posterior
from shm.values.rounding import force_unit

# Layout: bins of a histogram, its height in inches.
_BINS = 16
_ALONE_INCHES = 2.2
_BY_DENSITY = {
    "least dense quarter": "quiet",
    "second": "blue",
    "third": "green",
    "densest quarter": "orange",
}


@dataclass(frozen=True, eq=False)
class _Column:
    """One parameter as people read it: samples (samples,) in the unit of its label."""

    label: str
    samples: FloatArray
    most_probable: float

    @property
    def range(self) -> tuple[float, float]:
        return spec.limits(self.samples, room=0.03)


def marginals(posterior: Posterior, names: Sequence[str]) -> spec.Specification:
    """A histogram of each of these parameters, side by side."""
    columns = [_column(posterior, name) for name in names]
    panels = [_histogram([each], 0) for each in columns]
    return spec.Specification(rows=[panels], height_inches=_ALONE_INCHES)


def pair(posterior: Posterior, x_name: str, y_name: str) -> spec.Specification:
    """All draws of two parameters, coloured by their likelihood: under even priors, the posterior
    density with the other parameters as drawn."""
    x, y = _column(posterior, x_name), _column(posterior, y_name)
    share = np.argsort(np.argsort(posterior.log_likelihood)) / len(x.samples)
    bounds = np.linspace(0, 1, len(_BY_DENSITY) + 1)
    clouds: list[spec.Mark] = []
    for place, (name, colour) in enumerate(_BY_DENSITY.items()):
        own = (share >= bounds[place]) & (share < bounds[place + 1])
        clouds.append(
            spec.Points(x=x.samples[own], y=y.samples[own], size=2.5, colour=colour, name=name)
        )
    best = spec.Points(
        x=[x.most_probable], y=[y.most_probable], symbol="cross", size=7, name="most probable"
    )
    panel = spec.Panel(
        x=spec.Axis(label=x.label, range=x.range),
        y=spec.Axis(label=y.label, range=y.range),
        marks=[*clouds, best],
    )
    return spec.Specification(rows=[[panel]], height_inches=2 * _ALONE_INCHES, legend_columns=5)


def _column(posterior: Posterior, name: str) -> _Column:
    samples = posterior.parameter(name)
    best = float(posterior.most_probable[posterior.names.index(name)])
    if name == "theta_F":
        unit, nominal_n = force_unit(float(posterior.tension_n.mean())), posterior.nominal_tension_n
        label = f"tension ({unit.name})"
        return _Column(label, unit.of(posterior.tension_n), unit.of(best * nominal_n))
    if name == "sigma":
        return _Column("sigma (%)", 100 * samples, 100 * best)
    return _Column(name.replace("log10_", "log10 "), samples, best)


def _histogram(columns: list[_Column], number: int) -> spec.Panel:
    own = columns[number]
    heights, edges = np.histogram(own.samples, bins=_BINS)
    bars = spec.Bars(
        x=(edges[:-1] + edges[1:]) / 2, y=heights / max(heights.max(), 1), colour="blue",
        width=float(edges[1] - edges[0]), opacity=0.75, hover=f"{own.label} %{{x:.4g}}",
    )  # fmt: skip
    label = own.label if number == len(columns) - 1 else ""
    across = spec.Axis(label=label, range=own.range, most_ticks=3)
    return spec.Panel(y=spec.Axis(range=(0, 1.08), ticks=(), grid=False), marks=[bars], x=across)
