"""The bridge as JSON documents."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from shm.documents import averaged_document, drift_document
from shm.report.bridge.content import BridgeReport
from shm.report.bridge.summary import advice, summary
from shm.report.period import period_json
from shm.watch.neighbours import BridgePattern

REPORT_SCHEMA = "shm.bridge_report/1"
PATTERN_SCHEMA = "shm.bridge_pattern/1"


def pattern_json(pattern: BridgePattern) -> dict[str, Any]:
    """What `shm drift bridge --json` prints."""
    return {"schema": PATTERN_SCHEMA, **asdict(pattern)}


def bridge_json(data: BridgeReport) -> dict[str, Any]:
    """A document for `shm.documents.dump`."""
    return {
        "schema": REPORT_SCHEMA,
        "bridge": data.bridge,
        "summary": summary(data),
        "advice": list(advice(data)),
        "period": period_json(data.period),
        "hangers": [
            {
                "hanger": line.hanger.id,
                "name": line.hanger.name,
                "status": line.status.name.lower() if line.status else None,
                "latest": line.latest,
                "tension_n": asdict(line.tension_n) if line.tension_n else None,
                "averaged": averaged_document(line.averaged) if line.averaged else None,
                "drift": drift_document(line.drift) if line.drift else None,
                "test": line.test or None,
                "model": line.model or None,
                "called": line.called,
                "open_alerts": line.open_alerts,
                "in_period": asdict(line.course) if line.course else None,
            }
            for line in data.hangers
        ],
        "pattern": pattern_json(data.pattern) if data.pattern else None,
        "why_no_pattern": data.why_no_pattern,
        "lineage": dict(data.lineage),
        "settings": dict(data.settings),
        "version": data.version,
        "generated_at": data.generated_at,
    }
