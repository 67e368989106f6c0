"""From the store to what a report is made of."""

from __future__ import annotations

from datetime import datetime

import shm
from shm.errors import NothingThere
from shm.report import HangerReport, trend_row
from shm.store import Store, Workspace


def hanger_report(
    workspace: Workspace, store: Store, hanger_id: int, generated_at: datetime
) -> HangerReport:
    """All that the store knows of a hanger, for its report.

    Raises BadInput for an unknown hanger, NothingThere before its first test is through.
    """
    hanger = workspace.bridge.hanger(hanger_id)
    history = store.history(hanger_id)
    if not history:
        raise NothingThere(
            f"no test of hanger {hanger_id} has been through updating yet.",
            remedy="Take recordings in with `shm ingest FILE`, or see `shm status`.",
        )
    latest, posterior = history[-1]
    selection, baseline = store.selection(hanger_id), store.baseline(hanger_id)
    return HangerReport(
        bridge=workspace.bridge.name,
        hanger=hanger,
        tests=tuple(stored.test for stored, _ in history),
        posterior=posterior,
        generated_at=generated_at,
        version=shm.__version__,
        trend=tuple(trend_row(each, stored.test, hanger) for stored, each in history),
        baseline=baseline.posterior if baseline else None,
        selection=selection.selection if selection else None,
        drifts=store.drifts(hanger_id, latest.test.id),
        alerts=tuple(stored.alert for stored in store.alerts(hanger_id)),
        frequency_response=store.frequency_response(latest),
        lineage={
            "input_sha256": latest.lineage.input_sha256,
            "settings_sha256": latest.lineage.settings_sha256,
            "version": latest.lineage.version,
        },
    )
