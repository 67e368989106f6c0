"""The latest posterior, each parameter against each: what goes together, what is open."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from shm.report import words
from shm.values import FloatArray, Posterior
from shm.values.force_units import force_unit
from shm_daemon.web.hanger_figures.member import HangerFigure
from shm_daemon.web.hanger_figures.over_time import Trace
from shm_daemon.web.hanger_figures.panels import axis, domains, layout_name
from shm_daemon.web.hanger_view import HangerView
from shm_daemon.web.plotting import colour, figure

_MOST_SAMPLES = 250
_MOST_PARAMETERS = 7
_BINS = 16
_GAP = 0.015


@dataclass(frozen=True, eq=False)
class _Column:
    """One parameter as people read it: samples (samples,) in the unit of its label."""

    label: str
    samples: FloatArray


def _posterior(view: HangerView) -> Posterior:
    assert view.report is not None
    return view.report.posterior


def _columns(posterior: Posterior) -> list[_Column]:
    """The tension first; of very many parameters the first."""
    return [_column(posterior, name) for name in posterior.names[:_MOST_PARAMETERS]]


def _column(posterior: Posterior, name: str) -> _Column:
    if name == "theta_F":
        unit = force_unit(float(posterior.tension_n.mean()))
        return _Column(f"tension ({unit.name})", unit.of(posterior.tension_n))
    if name == "sigma":
        return _Column("sigma (%)", 100 * posterior.parameter(name))
    return _Column(name.replace("log10_", "log10 "), posterior.parameter(name))


def _draw(view: HangerView) -> dict[str, Any]:
    columns = _columns(_posterior(view))
    count = len(columns)
    traces = [_cloud(columns, row, column) for row in range(1, count) for column in range(row)] + [
        _histogram(each, number, count) for number, each in enumerate(columns)
    ]
    layout = _axes(columns)
    return figure(
        traces,
        layout["xaxis"]["title"]["text"],
        "",
        **layout,
        showlegend=False,
        hovermode="closest",
        bargap=0,
        margin={"l": 72, "r": 8, "t": 8, "b": 60},
    )


def _cloud(columns: list[_Column], row: int, column: int) -> Trace:
    x, y = columns[column], columns[row]
    chosen = _thinned(len(x.samples))
    return {
        "type": "scatter", "mode": "markers", "xaxis": axis("x", column), "yaxis": axis("y", row),
        "x": x.samples[chosen], "y": y.samples[chosen],
        "marker": {"size": 3.5, "color": colour("blue", 0.5)},
        "hovertemplate": f"{x.label} %{{x:.4g}}<br>{y.label} %{{y:.4g}}<extra></extra>",
    }  # fmt: skip


def _thinned(count: int) -> slice:
    return slice(None, None, max(1, -(-count // _MOST_SAMPLES)))


def _histogram(column: _Column, number: int, count: int) -> Trace:
    heights, edges = np.histogram(column.samples, bins=_BINS)
    return {
        "type": "bar", "xaxis": axis("x", number), "yaxis": axis("y", count + number),
        "x": (edges[:-1] + edges[1:]) / 2, "y": heights / max(heights.max(), 1),
        "width": np.diff(edges), "marker": {"color": colour("blue", 0.75), "line": {"width": 0}},
        "hovertemplate": f"{column.label} %{{x:.4g}}<extra></extra>",
    }  # fmt: skip


def _axes(columns: list[_Column]) -> dict[str, Any]:
    """Axes shared along rows and columns, and one of its own for each histogram."""
    count = len(columns)
    across = domains(count, _GAP)
    down = across[::-1]
    layout: dict[str, Any] = {}
    small = {"nticks": 3, "tickfont": {"size": 10}, "automargin": False, "tickangle": 0}
    for number, column in enumerate(columns):
        title = {"title": {"text": column.label, "font": {"size": 11}, "standoff": 6}}
        is_last = number == count - 1
        below = axis("y", count + number) if is_last else axis("y", count - 1)
        layout[layout_name("x", number)] = {
            "domain": across[number], "anchor": below, **title, **small,
        }  # fmt: skip
        row = {"domain": down[number], "anchor": "x", **title, **small}
        layout[layout_name("y", number)] = row if number else {"domain": down[0], "visible": False}
        layout[layout_name("y", count + number)] = {
            "domain": down[number], "anchor": axis("x", number), "visible": False,
            "range": [0, 1.08], "fixedrange": True,
        }  # fmt: skip
    return layout


def _caption(view: HangerView) -> str:
    posterior = _posterior(view)
    shown = posterior.names[:_MOST_PARAMETERS]
    meanings = "; ".join(
        f"{name.removeprefix('log10_')}: {words.meaning(name, posterior.model)}"
        for name in shown
        if name != "theta_F"
    )
    left = words.some(len(shown), len(posterior.names), "parameters")
    return (
        "Samples of the posterior by the latest test, each parameter against each, and the share "
        "of each value on the diagonal. A slanted cloud: two parameters that the modes do not "
        f"tell apart; a full one: a parameter that they do not feel. {meanings}.{left}"
    )


def _alt(view: HangerView) -> str:
    """The pairs that go together most."""
    columns = _columns(_posterior(view))
    with np.errstate(invalid="ignore", divide="ignore"):
        together = np.nan_to_num(np.corrcoef(np.array([c.samples for c in columns])))
    pairs = sorted(
        ((row, column) for row in range(len(columns)) for column in range(row)),
        key=lambda pair: -abs(float(together[pair])),
    )
    told = ", ".join(
        f"{columns[column].label} and {columns[row].label} ({together[row, column]:+.2f})"
        for row, column in pairs[:3]
    )
    return f"Samples of {len(columns)} parameters; the strongest correlations: {told}."


FIGURE = HangerFigure(
    "pairs",
    "What the latest posterior leaves open",
    "model",
    lambda view: view.report is not None and len(view.report.posterior.names) > 1,
    _draw,
    _caption,
    _alt,
    height_px=760,
    is_wide=True,
)
