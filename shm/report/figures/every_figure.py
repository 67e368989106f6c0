"""Every figure of every report. A new one: a file with a `FIGURE`, and a line here."""

from __future__ import annotations

from shm.report.contents import BridgeReport, DiagnosisSheet, HangerReport, ModalTestReport
from shm.report.figures.along_the_bridge import SHIFTS, TENSIONS
from shm.report.figures.gap_causes import FIGURE as CAUSES
from shm.report.figures.gap_map import FIGURE as GAP_MAP
from shm.report.figures.hanger_frequencies import FIGURE as FREQUENCIES
from shm.report.figures.hanger_stiffness import FIGURE as STIFFNESS
from shm.report.figures.hanger_temperature import FIGURE as TEMPERATURE
from shm.report.figures.hanger_trend import FIGURE as TREND
from shm.report.figures.modal_test_hits import FIGURE as HITS
from shm.report.figures.modal_test_modes import SHAPES, STABILISATION
from shm.report.figures.modal_test_response import FIGURE as RESPONSE
from shm.report.figures.modal_test_response import ResponseCurves
from shm.report.figures.modal_test_time_history import FIGURE as TIME_HISTORY
from shm.report.figures.specification import FigureSpec, Illustration, drawn

OF_HANGER: tuple[FigureSpec[HangerReport], ...] = (TREND, FREQUENCIES, STIFFNESS, TEMPERATURE)
OF_MODAL_TEST: tuple[FigureSpec[ResponseCurves], ...] = (
    TIME_HISTORY, HITS, RESPONSE, STABILISATION, SHAPES
)  # fmt: skip
OF_DIAGNOSIS: tuple[FigureSpec[DiagnosisSheet], ...] = (CAUSES, GAP_MAP)


def bridge_figures(data: BridgeReport) -> tuple[Illustration, ...]:
    """Draw those of a bridge: what moved, where it was compared, and what each hanger carries."""
    shifts = drawn((SHIFTS,), data.pattern) if data.pattern else ()
    return (*shifts, *drawn((TENSIONS,), data))


def modal_test_figures(sheet: ModalTestReport) -> tuple[Illustration, ...]:
    """Draw all of one hammer test."""
    return drawn(OF_MODAL_TEST, ResponseCurves.of(sheet))
