"""The figures of the gap: those of its diagnosis, one by one."""

from __future__ import annotations

import math

from shm.report import DiagnosisSheet, words
from shm.report.diagnosis.content import claimed, claims
from shm.report.diagnosis.figures import before_and_after, gap_map
from shm.report.diagnosis.figures.below_map import local, profiles
from shm.report.diagnosis.figures.causes import FIGURE as OF_CAUSES
from shm.report.diagnosis.figures.modes import kept, measured
from shm.report.diagnosis.phrases import label, title
from shm.report.figures.specification import Specification, stacked
from shm.values import Diagnosis
from shm_daemon.web.hanger_figures.member import HangerFigure
from shm_daemon.web.hanger_figures.probabilities import probability_bars
from shm_daemon.web.hanger_view import HangerView

_MOST = 8
_LETTERS = "ABCDEFGHIJKLMNOPQRSTUVWXYZ"


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
    height_px=480,
)


def _alt_of_places(view: HangerView) -> str:
    places = "; ".join(
        f"as {title(place.kind)} it would sit at {words.number(place.x_m, '.2f')} m"
        for place in local(_sheet(view))
    )
    return f"Along the hanger: {places}."


GAP_PLACES = HangerFigure(
    "gap_places",
    "Where along the hanger",
    "gap",
    lambda view: view.sheet is not None and bool(local(view.sheet)),
    lambda view: stacked([profiles(_sheet(view))], 2.2),
    lambda view: (
        "Where along the hanger a local cause of each kind would have to sit, were it of that "
        "kind, with the share of the misfit that it would explain there."
    ),
    _alt_of_places,
    height_px=300,
)


def _causes(view: HangerView) -> Specification:
    """From the top; those alike share a letter."""
    diagnosis = _sheet(view).diagnosis
    causes = [cause for claim in claims(diagnosis) for cause in claim.causes][:_MOST]
    bars = [(label(c) + _letter(c.group), c.probability, "blue") for c in causes]
    unknown = ("something not in the catalogue", diagnosis.unexplained_probability, "orange")
    return probability_bars([*bars, unknown, ("no gap", diagnosis.no_gap_probability, "green")])


def _letter(group: int | None) -> str:
    return "" if group is None else f" [{_LETTERS[group % len(_LETTERS)]}]"


def _caption_of_causes(diagnosis: Diagnosis) -> str:
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


CAUSES = HangerFigure(
    "causes",
    OF_CAUSES.title,
    "gap",
    lambda view: view.sheet is not None and bool(view.sheet.diagnosis.causes),
    _causes,
    lambda view: _caption_of_causes(_sheet(view).diagnosis),
    lambda view: OF_CAUSES.alt(_sheet(view)),
    height_px=430,
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
    lambda view: before_and_after.specify(_sheet(view), is_on_screen=True),
    lambda view: before_and_after.FIGURE.caption(_sheet(view)),
    lambda view: before_and_after.FIGURE.alt(_sheet(view)),
    height_px=480,
)
