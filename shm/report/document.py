"""The report as a JSON document (`shm.report/1`)."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from shm import documents, modes_document
from shm.report.bridge.document import pattern_json
from shm.report.content import HangerReport, status
from shm.report.diagnosis.document import diagnosis_json
from shm.report.diagnosis.part import diagnosed
from shm.report.period import period_json
from shm.report.summary import advice, summary
from shm.report.temperatures import temperature_documents
from shm.values import FrequencyResponse

REPORT_SCHEMA = "shm.report/1"


def json(data: HangerReport) -> dict[str, Any]:
    """A document for `shm.documents.dump`; unknown numbers become null there."""
    return {
        "schema": REPORT_SCHEMA,
        "bridge": data.bridge,
        "hanger": asdict(data.hanger),
        "status": status(data).name.lower(),
        "summary": summary(data),
        "advice": list(advice(data)),
        "test": modes_document.test_document(data.latest),
        "posterior": documents.posterior_document(data.posterior),
        "baseline": documents.posterior_document(data.baseline) if data.baseline else None,
        "selection": (
            documents.selection_document(data.selection, data.hanger.limits)
            if data.selection
            else None
        ),
        "averaged": documents.averaged_document(data.averaged),
        "trend": [asdict(row) for row in data.trend],
        "drifts": [documents.drift_document(drift) for drift in data.drifts],
        "alerts": [documents.alert_document(alert) for alert in data.alerts],
        "acknowledged": dict(data.acknowledged),
        "frequency_response": _response(data.frequency_response),
        "quality": [asdict(check) for check in data.quality],
        "diagnosis": diagnosis_json(sheet) if (sheet := diagnosed(data)) else None,
        "gap_watch": data.gap_watch,
        "drift_watch": data.drift_watch,
        "redescribed": list(data.redescribed),
        "temperature_coefficients": temperature_documents(data.states),
        "neighbours": pattern_json(data.neighbours) if data.neighbours else None,
        "period": period_json(data.period),
        "lineage": dict(data.lineage),
        "settings": dict(data.settings),
        "version": data.version,
        "generated_at": data.generated_at,
    }


def _response(response: FrequencyResponse | None) -> dict[str, Any] | None:
    """What was measured, without the lines: those stand in the archived recording."""
    if response is None:
        return None
    return {
        "source": response.source,
        "points": [asdict(point) for point in response.points],
        "lines": len(response.frequency_hz),
        "highest_frequency_hz": float(response.frequency_hz[-1]),
    }
