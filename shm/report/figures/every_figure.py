"""Every figure of every report. A new one: a file with a `FIGURE`, and a line here."""

from __future__ import annotations

from collections.abc import Container

from shm.report.contents import BridgeReport, DiagnosisSheet, HangerReport, ModalTestReport
from shm.report.figures.along_the_bridge import SHIFTS, TENSIONS
from shm.report.figures.gap_before_and_after import BEFORE_AND_AFTER
from shm.report.figures.gap_causes import FIGURE as CAUSES
from shm.report.figures.gap_causes import SHARED
from shm.report.figures.gap_check import FIGURE as CHECK
from shm.report.figures.gap_map import FIGURE as GAP_MAP
from shm.report.figures.hanger_frequencies import FIGURE as FREQUENCIES
from shm.report.figures.hanger_stiffness import FIGURE as STIFFNESS
from shm.report.figures.hanger_tension import FIGURE as TENSION
from shm.report.figures.hanger_trend import FIGURE as TREND
from shm.report.figures.modal_test_hits import FIGURE as HITS
from shm.report.figures.modal_test_modes import SHAPES, STABILISATION
from shm.report.figures.modal_test_response import FIGURE as RESPONSE
from shm.report.figures.modal_test_response import ResponseCurves
from shm.report.figures.modal_test_time_history import FIGURE as TIME_HISTORY
from shm.report.figures.specification import FigureSpec, Illustration, drawn
from shm.values import BridgeDiagnosis, GapCheck

OF_HANGER: tuple[FigureSpec[HangerReport], ...] = (
    TREND, TENSION, FREQUENCIES, STIFFNESS
)  # fmt: skip
OF_MODAL_TEST: tuple[FigureSpec[ResponseCurves], ...] = (
    TIME_HISTORY, HITS, RESPONSE, STABILISATION, SHAPES
)  # fmt: skip
OF_DIAGNOSIS: tuple[FigureSpec[DiagnosisSheet], ...] = (CAUSES, GAP_MAP, BEFORE_AND_AFTER)
OF_BRIDGE_DIAGNOSIS: tuple[FigureSpec[BridgeDiagnosis], ...] = (SHARED,)
OF_GAP_CHECK: tuple[FigureSpec[GapCheck], ...] = (CHECK,)
OF_HANGER_NAMES = frozenset(each.name for each in OF_HANGER)


def hanger_figures(
    data: HangerReport, names: Container[str] = OF_HANGER_NAMES
) -> tuple[Illustration, ...]:
    """Draw those of these `names` that a hanger's report has the data for, in reading order."""
    return drawn([each for each in OF_HANGER if each.name in names], data)


def bridge_figures(data: BridgeReport) -> tuple[Illustration, ...]:
    """Draw those of a bridge: what moved, where it was compared, and what each hanger carries."""
    shifts = drawn((SHIFTS,), data.pattern) if data.pattern else ()
    return (*shifts, *drawn((TENSIONS,), data))


def modal_test_figures(sheet: ModalTestReport) -> tuple[Illustration, ...]:
    """Return all of one hammer test."""
    return drawn(OF_MODAL_TEST, ResponseCurves.of(sheet))


def diagnosis_figures(sheet: DiagnosisSheet) -> tuple[Illustration, ...]:
    """Draw those of a gap diagnosis."""
    return drawn(OF_DIAGNOSIS, sheet)


def bridge_diagnosis_figures(diagnosis: BridgeDiagnosis) -> tuple[Illustration, ...]:
    """Draw those of a joint diagnosis."""
    return drawn(OF_BRIDGE_DIAGNOSIS, diagnosis)


def gap_check_figures(check: GapCheck) -> tuple[Illustration, ...]:
    """Draw those of a check of what a diagnosis would find."""
    return drawn(OF_GAP_CHECK, check)
