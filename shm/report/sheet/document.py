"""A test's sheet as a JSON document (`shm.test-sheet/1`)."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

from shm import modes_document
from shm.report.sheet.content import TestSheet
from shm.report.sheet.summary import summary
from shm.report.verdicts import overall

SHEET_SCHEMA = "shm.test-sheet/1"


def sheet_json(sheet: TestSheet) -> dict[str, Any]:
    """A document for `shm.documents.dump`; signals and curves stay in the records."""
    found = sheet.identification
    return {
        "schema": SHEET_SCHEMA,
        "hanger": found.test.hanger,
        "verdict": overall(found.quality),
        "summary": summary(sheet),
        "test": modes_document.test_document(found.test),
        "quality": [asdict(check) for check in found.quality],
        "set_aside": [asdict(each) for each in found.set_aside],
        "hits": [asdict(hit) for hit in found.hits],
        "dropped": [asdict(each) for each in found.dropped],
        "notes": list(found.notes),
        "records": [Path(record.source).name for record in sheet.records],
        "lineage": dict(sheet.lineage),
        "settings": dict(sheet.settings),
        "generated_at": sheet.generated_at,
        "version": sheet.version or None,
        "band_hz": list(sheet.band_hz) if sheet.band_hz else None,
    }
