"""How probable each model class is."""

from __future__ import annotations

from typing import Any

from shm.report import words
from shm.values import Selection
from shm_daemon.web.hanger_figures.member import HangerFigure
from shm_daemon.web.hanger_view import HangerView
from shm_daemon.web.plotting import colour, figure


def _selection(view: HangerView) -> Selection | None:
    return view.report.selection if view.report else None


def _rows(view: HangerView) -> list[tuple[str, float]]:
    """Names and probabilities, the most probable first."""
    found = _selection(view)
    if found is None:
        return []
    return [
        (words.model_class(posterior.model), share)
        for posterior, share in zip(found.posteriors, found.probabilities, strict=True)
    ]


def _draw(view: HangerView) -> dict[str, Any]:
    rows = _rows(view)[::-1]
    chosen = _chosen(view)
    bars = {
        "type": "bar", "orientation": "h", "y": [name for name, _ in rows],
        "x": [share for _, share in rows],
        "text": [words.probability(share) for _, share in rows], "textposition": "auto",
        "textangle": 0,
        "cliponaxis": False,
        "marker": {"color": [colour("blue" if name == chosen else "quiet") for name, _ in rows]},
        "hovertemplate": "%{y}: %{text}<extra></extra>",
    }  # fmt: skip
    return figure(
        [bars],
        "probability",
        "",
        xaxis={"range": [0, 1.12], "tickvals": [0, 0.2, 0.4, 0.6, 0.8, 1]},
        yaxis={"type": "category"},
        showlegend=False,
        bargap=0.45,
        margin={"t": 12},
    )


def _chosen(view: HangerView) -> str:
    return words.model_class(view.report.posterior.model) if view.report else ""


def _caption(view: HangerView) -> str:
    return (
        "Probability of each model class given the tests on which they were compared, all equally "
        f"probable before. Blue: the class in force, {_chosen(view)}."
    )


def _alt(view: HangerView) -> str:
    told = [f"{name} {words.probability(share)}" for name, share in _rows(view)]
    return f"Probabilities of the model classes: {'; '.join(told)}."


FIGURE = HangerFigure(
    "models",
    "Model classes",
    "model",
    lambda view: len(_rows(view)) > 1,
    _draw,
    _caption,
    _alt,
    height_px=240,
)
