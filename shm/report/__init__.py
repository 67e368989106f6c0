"""Reports of a hanger, sheets of one hammer test, gap diagnoses, scores of a blind trial.

Nothing here reads a store or writes a file: `HangerReport`, `TestSheet` (by which a person checks a
test), `BridgeReport`, `DiagnosisSheet` or `TrialScore` in, terminal text, one HTML file, PDF bytes,
a JSON document or figures out. Only this room opens matplotlib, jinja2 and reportlab.
"""

from __future__ import annotations

from shm.report.bridge.content import BridgeReport
from shm.report.bridge.document import bridge_json, pattern_json
from shm.report.bridge.page import bridge_page
from shm.report.bridge.text import bridge_text
from shm.report.content import HangerReport, Interval, TrendRow, trend_row
from shm.report.diagnosis.content import DiagnosisSheet
from shm.report.diagnosis.document import diagnosis_json
from shm.report.diagnosis.figures import diagnosis_figures
from shm.report.diagnosis.page import diagnosis_page
from shm.report.diagnosis.text import diagnosis_text
from shm.report.document import json
from shm.report.figures import Illustration, illustrations
from shm.report.page import html
from shm.report.paper import bridge_pdf, pdf, test_pdf
from shm.report.quality import quality_table
from shm.report.sheet.content import TestSheet
from shm.report.sheet.document import test_json
from shm.report.sheet.figures import test_figures
from shm.report.sheet.page import test_page
from shm.report.sheet.text import test_text
from shm.report.summary import Status, advice, status, summary
from shm.report.table import Table
from shm.report.text import text
from shm.report.trial.document import trial_json
from shm.report.trial.figures import trial_figures
from shm.report.trial.page import trial_page
from shm.report.trial.text import trial_text

__all__ = [
    "BridgeReport",
    "DiagnosisSheet",
    "HangerReport",
    "Illustration",
    "Interval",
    "Status",
    "Table",
    "TestSheet",
    "TrendRow",
    "advice",
    "bridge_json",
    "bridge_page",
    "bridge_pdf",
    "bridge_text",
    "diagnosis_figures",
    "diagnosis_json",
    "diagnosis_page",
    "diagnosis_text",
    "html",
    "illustrations",
    "json",
    "pattern_json",
    "pdf",
    "quality_table",
    "status",
    "summary",
    "test_figures",
    "test_json",
    "test_page",
    "test_pdf",
    "test_text",
    "text",
    "trend_row",
    "trial_figures",
    "trial_json",
    "trial_page",
    "trial_text",
]
