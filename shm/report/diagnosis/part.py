"""The gap diagnosis as a part of a hanger's report, or how to come by one."""

from __future__ import annotations

import textwrap

from shm.report.content import HangerReport
from shm.report.diagnosis.content import DiagnosisSheet
from shm.report.diagnosis.text import diagnosis_text


def diagnosed(data: HangerReport) -> DiagnosisSheet | None:
    """The latest diagnosis of the report's hanger."""
    if data.diagnosis is None:
        return None
    return DiagnosisSheet(data.diagnosis, data.hanger, data.bridge)


def how_to_diagnose(data: HangerReport) -> str:
    """What to do where no diagnosis was made."""
    return (
        "The gap between model and measurement has not been diagnosed. To learn where it lies, "
        "what causes it and what that does to the tension: "
        f"shm gap diagnose --hanger {data.hanger.id}"
    )


def diagnosis_part(data: HangerReport, width: int) -> list[str]:
    """The gap since an effect was adopted, then the latest diagnosis, for a terminal."""
    sheet = diagnosed(data)
    watched = [textwrap.fill(data.gap_watch, width) + "\n"] if data.gap_watch else []
    if sheet is None:
        return [*watched, textwrap.fill(how_to_diagnose(data), width) + "\n"]
    return [*watched, diagnosis_text(sheet, width)]
