"""A gap diagnosis as a JSON document with its answer in words."""

from __future__ import annotations

from typing import Any

from shm.diagnosis_document import diagnosis_document
from shm.report.content import DiagnosisSheet
from shm.report.diagnosis.content import answer
from shm.report.diagnosis.summary import summary


def diagnosis_json(sheet: DiagnosisSheet) -> dict[str, Any]:
    """A document for `shm.documents.dump`; unknown numbers become null there."""
    return {
        **diagnosis_document(sheet.diagnosis),
        "answer": answer(sheet.diagnosis).name.lower(),
        "summary": summary(sheet),
    }
