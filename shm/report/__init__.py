"""Reports of a hanger, and sheets of one hammer test by which a person checks it, from values.

Nothing here reads a store or writes a file: `HangerReport` or `TestSheet` in, terminal text, one
HTML file, a JSON document or figures out. Only this room opens matplotlib and jinja2.
"""

from __future__ import annotations

from shm.report.content import HangerReport, Interval, TrendRow, trend_row
from shm.report.document import json
from shm.report.figures import Illustration, illustrations
from shm.report.page import html
from shm.report.quality import quality_table
from shm.report.sheet.content import TestSheet
from shm.report.sheet.document import test_json
from shm.report.sheet.figures import test_figures
from shm.report.sheet.page import test_page
from shm.report.sheet.text import test_text
from shm.report.summary import Status, advice, status, summary
from shm.report.table import Table
from shm.report.text import text

__all__ = [
    "HangerReport",
    "Illustration",
    "Interval",
    "Status",
    "Table",
    "TestSheet",
    "TrendRow",
    "advice",
    "html",
    "illustrations",
    "json",
    "quality_table",
    "status",
    "summary",
    "test_figures",
    "test_json",
    "test_page",
    "test_text",
    "text",
    "trend_row",
]
