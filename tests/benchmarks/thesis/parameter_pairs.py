"""Posterior of the parameters, each alone and each against each other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from shm.report import formatting
from shm.report.contents import HangerReport
from shm.report.figures import specification as spec
from shm.report.figures.style import WIDTH_INCHES
from shm.values import FloatArray, Posterior
from shm.values.rounding import force_unit

# Layout: a page holds seven panels beside each other, each a cloud that can be seen through.
_PANEL_INCHES = 1.6
_MOST_SAMPLES = 250
_MOST_PARAMETERS = 7
_BINS = 16
_MOST_TOLD = 3
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


def specify(posterior: Posterior) -> spec.Specification:
    """A histogram of each parameter on the diagonal, draws of each two below it.

    Their correlation stands above the diagonal. A cross is the most probable value.
    """
    columns = _columns(posterior)
    correlation = _correlation(columns)
    rows = [
        [
            _histogram(columns, row)
            if row == column
            else _draws(columns, row, column)
            if row > column
            else _in_words(float(correlation[row, column]))
            for column in range(len(columns))
        ]
        for row in range(len(columns))
    ]
    height = min(WIDTH_INCHES, _PANEL_INCHES * len(columns))
    return spec.Specification(rows=rows, height_inches=height, is_grid=True)


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


def _columns(posterior: Posterior) -> list[_Column]:
    """The tension first; of very many parameters the first."""
    return [_column(posterior, name) for name in posterior.names[:_MOST_PARAMETERS]]


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


def _draws(columns: list[_Column], row: int, column: int) -> spec.Panel:
    x, y = columns[column], columns[row]
    chosen = slice(None, None, max(1, -(-len(x.samples) // _MOST_SAMPLES)))
    hover = f"{x.label} %{{x:.4g}}<br>{y.label} %{{y:.4g}}"
    cloud = spec.Points(
        x=x.samples[chosen], y=y.samples[chosen], size=2.0, colour="blue", opacity=0.5, hover=hover
    )
    best = spec.Points(
        x=[x.most_probable], y=[y.most_probable], symbol="cross", size=5, colour="orange",
        hover=f"most probable:<br>{hover}",
    )  # fmt: skip
    is_lowest = row == len(columns) - 1
    return spec.Panel(
        y=spec.Axis(label="" if column else y.label, range=y.range, most_ticks=3),
        marks=[cloud, best],
        x=spec.Axis(label=x.label if is_lowest else "", range=x.range, most_ticks=3),
        shares_y=column > 0,
    )  # fmt: skip


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


def _in_words(correlation: float) -> spec.Panel:
    told = f"{correlation:+z.2f}" if np.isfinite(correlation) else "constant"
    return spec.Panel(y=spec.Axis(), marks=[], x=spec.Axis(), words=told)


def _correlation(columns: list[_Column]) -> FloatArray:
    """Of each two parameters (parameters, parameters); NaN where one does not vary."""
    samples = np.array([column.samples for column in columns]).T
    spread = samples.std(axis=0)
    scaled = (samples - samples.mean(axis=0)) / np.where(spread > 0, spread, np.nan)
    return np.asarray(scaled.T @ scaled / len(samples))


def caption(posterior: Posterior) -> str:
    shown = posterior.names[:_MOST_PARAMETERS]
    meanings = "; ".join(
        f"{name.removeprefix('log10_')}: {formatting.meaning(posterior, name)}"
        for name in shown
        if name != "theta_F"
    )
    left = formatting.some(len(shown), len(posterior.names), "parameters")
    return (
        "Samples of the posterior by the latest test: the share of each value on the diagonal, "
        "each parameter against each below it, their correlation above; cross: most probable "
        "value. A slanted cloud: two parameters that the modes do not tell apart; a full one: a "
        f"parameter that they do not feel. {meanings}.{left}"
    )


def alt(posterior: Posterior) -> str:
    """The pairs that go together most."""
    columns = _columns(posterior)
    together = np.nan_to_num(_correlation(columns))
    pairs = sorted(
        ((row, column) for row in range(len(columns)) for column in range(row)),
        key=lambda pair: -abs(float(together[pair])),
    )
    told = ", ".join(
        f"{columns[column].label} and {columns[row].label} ({together[row, column]:+.2f})"
        for row, column in pairs[:_MOST_TOLD]
    )
    return f"Samples of {len(columns)} parameters; the strongest correlations: {told}."


FIGURE = spec.Member[HangerReport](
    "pairs",
    "What the latest posterior leaves open",
    lambda data: specify(data.posterior),
    lambda data: caption(data.posterior),
    lambda data: alt(data.posterior),
)
