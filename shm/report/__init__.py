"""Reports of a hanger from values: terminal text, one HTML file, a JSON document, figures.

Nothing here reads a store or writes a file: `HangerReport` in, str, bytes or a dict out. Only
this room opens matplotlib and jinja2.
"""

from __future__ import annotations

from shm.report.content import HangerReport, Interval, TrendRow, trend_row
from shm.report.document import json
from shm.report.figures import Illustration, illustrations
from shm.report.page import html
from shm.report.summary import Status, advice, status, summary
from shm.report.text import text

__all__ = [
    "HangerReport",
    "Illustration",
    "Interval",
    "Status",
    "TrendRow",
    "advice",
    "html",
    "illustrations",
    "json",
    "status",
    "summary",
    "text",
    "trend_row",
]
