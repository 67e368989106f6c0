"""How probable each cause of the gap is, beside no gap and something not in the catalogue."""

from __future__ import annotations

import textwrap
from typing import Any

from shm.report import words
from shm.report.diagnosis.content import claims
from shm.report.diagnosis.figures.causes import FIGURE as OF_REPORT
from shm.report.diagnosis.phrases import label
from shm.values import Diagnosis
from shm_daemon.web.hanger_figures.by_mode import sheet_of
from shm_daemon.web.hanger_figures.member import HangerFigure
from shm_daemon.web.hanger_view import HangerView
from shm_daemon.web.plotting import colour, figure

_MOST = 8
_WIDTH = 30
_LETTERS = "ABCDEFGHIJKLMNOPQRSTUVWXYZ"


def _bars(diagnosis: Diagnosis) -> list[tuple[str, float, str]]:
    """Label, probability and colour, from the top; those alike share a letter."""
    causes = [cause for claim in claims(diagnosis) for cause in claim.causes][:_MOST]
    bars = [(label(c) + _letter(c.group), c.probability, "blue") for c in causes]
    unknown = ("something not in the catalogue", diagnosis.unexplained_probability, "orange")
    return [*bars, unknown, ("no gap", diagnosis.no_gap_probability, "green")]


def _letter(group: int | None) -> str:
    return "" if group is None else f" [{_LETTERS[group % len(_LETTERS)]}]"


def _draw(view: HangerView) -> dict[str, Any]:
    bars = _bars(sheet_of(view).diagnosis)[::-1]
    trace = {
        "type": "bar", "orientation": "h",
        "y": ["<br>".join(textwrap.wrap(name, _WIDTH)) for name, _, _ in bars],
        "x": [share for _, share, _ in bars],
        "text": [words.probability(share) for _, share, _ in bars], "textposition": "auto",
        "textangle": 0,
        "cliponaxis": False, "marker": {"color": [colour(hue) for _, _, hue in bars]},
        "hovertemplate": "%{y}: %{text}<extra></extra>",
    }  # fmt: skip
    return figure(
        [trace],
        "probability",
        "",
        xaxis={"range": [0, 1.15], "tickvals": [0, 0.2, 0.4, 0.6, 0.8, 1]},
        yaxis={"type": "category", "tickfont": {"size": 12}},
        showlegend=False,
        margin={"t": 12},
    )


def _caption(view: HangerView) -> str:
    diagnosis = sheet_of(view).diagnosis
    left = len(diagnosis.causes) - _MOST
    more = f" {words.counted(left, 'less probable cause')} not drawn." if left > 0 else ""
    alike = (
        " Causes with the same letter cannot be told apart with these data; what counts is their "
        "sum."
        if diagnosis.groups
        else ""
    )
    return (
        "Probability of each cause, of something that the catalogue does not hold, and of no gap; "
        f"all add to 1.{alike}{more}"
    )


FIGURE = HangerFigure(
    "causes",
    "What causes the gap",
    "gap",
    lambda view: view.sheet is not None and bool(view.sheet.diagnosis.causes),
    _draw,
    _caption,
    lambda view: OF_REPORT.alt(sheet_of(view)),
    height_px=430,
)
