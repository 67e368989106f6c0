"""The figures of the model and of its gap: how its frequencies fit, what is open, which class it
is, and those of the diagnosis, one by one; what a figure of the hanger page declares about itself.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from shm.report import formatting
from shm.report.contents import DiagnosisSheet, HangerReport
from shm.report.diagnosis_wording import claimed
from shm.report.figures import gap_before_and_after, gap_causes, gap_map
from shm.report.figures.gap_causes import Bar, probability_bars
from shm.report.figures.gap_map import kept, measured
from shm.report.figures.hanger_frequencies import FIGURE as OF_REPORT
from shm.report.figures.hanger_frequencies import compared_modes
from shm.report.figures.parameter_pairs import FIGURE as OF_PAIRS
from shm.report.figures.specification import Specification, stacked
from shm_daemon.web import with_plotly
from shm_daemon.web.hanger_view import HangerView


@dataclass(frozen=True)
class HangerFigure:
    """A figure, and where on the page it stands (`part`).

    `is_there` says whether the hanger has what it shows and costs next to nothing beside the page;
    `draw` gives its specification, `caption` explains what is seen, `alt` says what a blind
    reader needs. What `shows_states` is not whole while the states over time are worked out; what
    `is_wide` scrolls on a phone.
    """

    name: str
    title: str
    part: str
    is_there: Callable[[HangerView], bool]
    draw: Callable[[HangerView], object]
    caption: Callable[[HangerView], str]
    alt: Callable[[HangerView], str]
    height_px: int = 360
    shows_states: bool = False
    is_wide: bool = False

    def document(self, view: HangerView) -> dict[str, Any]:
        """The plotly document with its words."""
        found = self.draw(view)
        assert isinstance(found, Specification)
        words = {"caption": self.caption(view), "alt": self.alt(view)}
        return {**with_plotly.document(found), **words}


def _sheet(view: HangerView) -> DiagnosisSheet:
    assert view.sheet is not None
    return view.sheet


GAP_MAP = HangerFigure(
    "gap_map",
    gap_map.FIGURE.title,
    "gap",
    lambda view: view.sheet is not None and bool(measured(view.sheet)),
    lambda view: gap_map.specify(_sheet(view), is_on_screen=True),
    lambda view: gap_map.caption(_sheet(view), is_on_screen=True),
    lambda view: gap_map.FIGURE.alt(_sheet(view)),
    height_px=480,  # judgement: a row for each plane and test
)


GAP_PLACES = HangerFigure(
    "gap_places",
    "Where along the hanger",
    "gap",
    lambda view: view.sheet is not None and bool(gap_map.local(view.sheet)),
    lambda view: stacked([gap_map.profiles(_sheet(view))], 2.2),
    lambda view: (
        "Where along the hanger a local cause of each kind would have to sit, were it of that "
        "kind, with the share of the misfit that it would explain there."
    ),
    lambda view: gap_map.places_in_words(_sheet(view)),
    height_px=300,  # judgement: one low panel
)


CAUSES = HangerFigure(
    "causes",
    gap_causes.FIGURE.title,
    "gap",
    lambda view: view.sheet is not None and bool(view.sheet.diagnosis.causes),
    lambda view: gap_causes.specify_on_screen(_sheet(view)),
    lambda view: gap_causes.caption(_sheet(view), is_on_screen=True),
    lambda view: gap_causes.FIGURE.alt(_sheet(view)),
    height_px=430,  # some 20 px, a line of text, for each of 20 effects
)


def _shrinks(view: HangerView) -> bool:
    if view.sheet is None or claimed(view.sheet.diagnosis) is None:
        return False
    return any(math.isfinite(residual.after_percent) for residual in kept(view.sheet))


BEFORE_AND_AFTER = HangerFigure(
    "before_and_after",
    "How far the gap shrinks",
    "gap",
    _shrinks,
    lambda view: gap_before_and_after.specify(_sheet(view), is_on_screen=True),
    lambda view: gap_before_and_after.BEFORE_AND_AFTER.caption(_sheet(view)),
    lambda view: gap_before_and_after.BEFORE_AND_AFTER.alt(_sheet(view)),
    height_px=480,  # judgement: a panel for each plane
)


def report_of(view: HangerView) -> HangerReport:
    """The report of a view that has one."""
    assert view.report is not None
    return view.report


FREQUENCIES = HangerFigure(
    "frequencies",
    OF_REPORT.title,
    "model",
    lambda view: view.report is not None and bool(compared_modes(view.report)),
    lambda view: OF_REPORT.draw(report_of(view)),
    lambda view: OF_REPORT.caption(report_of(view)),
    lambda view: OF_REPORT.alt(report_of(view)),
    height_px=380,  # judgement: the usual, with words below the axis
)


PAIRS = HangerFigure(
    "pairs",
    OF_PAIRS.title,
    "model",
    lambda view: view.report is not None and len(view.report.posterior.names) > 1,
    lambda view: OF_PAIRS.draw(report_of(view)),
    lambda view: OF_PAIRS.caption(report_of(view)),
    lambda view: OF_PAIRS.alt(report_of(view)),
    height_px=760,  # judgement: a grid of a panel for each pair, nearly square
    is_wide=True,
)


def _rows(view: HangerView) -> list[tuple[str, float]]:
    """Names and probabilities of the model classes, the most probable first."""
    found = view.report.selection if view.report else None
    if found is None:
        return []
    return [
        (formatting.model_class(posterior.model), share)
        for posterior, share in zip(found.posteriors, found.probabilities, strict=True)
    ]


def _chosen(view: HangerView) -> str:
    return formatting.model_class(report_of(view).posterior.model)


def _alt_of_models(view: HangerView) -> str:
    told = [f"{name} {formatting.probability(share)}" for name, share in _rows(view)]
    return f"Probabilities of the model classes: {'; '.join(told)}."


MODELS = HangerFigure(
    "models",
    "Model classes",
    "model",
    lambda view: len(_rows(view)) > 1,
    lambda view: probability_bars(
        [Bar(name, p, "blue" if name == _chosen(view) else "quiet") for name, p in _rows(view)]
    ),
    lambda view: (
        "Probability of each model class given the tests on which they were compared, all equally "
        f"probable before. Blue: the class in force, {_chosen(view)}."
    ),
    _alt_of_models,
    height_px=240,  # judgement: a bar for each of a few classes
)
