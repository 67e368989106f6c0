"""The figures of the gap: those of its diagnosis, one by one."""

from __future__ import annotations

import math

from shm.report.contents import DiagnosisSheet
from shm.report.diagnosis_wording import claimed
from shm.report.figures import gap_before_and_after, gap_causes, gap_map
from shm.report.figures.gap_map import kept, measured
from shm.report.figures.specification import stacked
from shm_daemon.web.hanger_figures.member import HangerFigure
from shm_daemon.web.hanger_view import HangerView


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
