"""The bridge as JSON documents."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from shm.report.bridge.content import BridgeReport
from shm.report.bridge.tables import summary
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
        "hangers": [
            {
                "hanger": line.hanger.id,
                "name": line.hanger.name,
                "status": line.status.name.lower() if line.status else None,
                "latest": line.latest,
                "tension_n": asdict(line.tension_n) if line.tension_n else None,
                "called": line.called,
                "open_alerts": line.open_alerts,
            }
            for line in data.hangers
        ],
        "pattern": pattern_json(data.pattern) if data.pattern else None,
        "why_no_pattern": data.why_no_pattern,
        "version": data.version,
        "generated_at": data.generated_at,
    }
