"""The gap diagnosis as a part of a hanger's report, or how to come by one."""

from __future__ import annotations

from shm.report.content import DiagnosisSheet, HangerReport


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
