"""What is known of the hangers, in numbers."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter, Path

from shm.documents import posterior_document
from shm.errors import BadInput, NothingThere
from shm.store import DeliveryState, Store, Workspace
from shm.values import Hanger
from shm_daemon.heartbeat import seconds_since_beat
from shm_daemon.spool import scan
from shm_daemon.web.access import AtSite, Reader
from shm_daemon.web.faults import answers
from shm_daemon.web.models import Hangers, HangerState, Status

router = APIRouter(prefix="/api", tags=["state"])
Number = Annotated[int, Path(ge=0, le=2**31 - 1, description="The number of the hanger.")]
_SHIFT = ("quantity", "shift_mean", "shift_sd", "threshold", "probability")


@router.get(
    "/status",
    response_model=Status,
    responses=answers(400, 401, 403, 503),
    summary="What is held and what waits",
)
def status(site: AtSite, _: Reader) -> Any:
    """Counts of recordings, files, alerts and deliveries."""
    workspace, store = site.workspace, site.store
    return {
        "bridge": workspace.bridge.name,
        "recordings": {stage.value: n for stage, n in store.stage_counts().items()},
        "spool": len(scan(workspace.spool)),
        "quarantine": quarantined(workspace),
        "open_alerts": store.alert_counts()[0],
        "waiting_deliveries": store.delivery_counts()[DeliveryState.WAITING],
        "daemon_seen_seconds_ago": seconds_since_beat(workspace),
    }


@router.get(
    "/hangers",
    response_model=Hangers,
    responses=answers(400, 401, 403, 503),
    summary="The state of all hangers",
)
def hangers(site: AtSite, _: Reader) -> Any:
    """Tension with its interval, shifts and open alerts of each hanger."""
    workspace, store = site.workspace, site.store
    return {"hangers": [_state(store, hanger) for hanger in workspace.bridge.hangers]}


@router.get(
    "/hangers/{hanger_id}",
    response_model=HangerState,
    responses=answers(400, 401, 403, 404, 422, 503),
    summary="The state of one hanger",
)
def hanger(site: AtSite, _: Reader, hanger_id: Number) -> Any:
    """Tension with its interval, shifts and open alerts of one hanger."""
    return _state(site.store, described(site.workspace, hanger_id))


def described(workspace: Workspace, hanger_id: int) -> Hanger:
    """A hanger of the bridge; raises NothingThere."""
    try:
        return workspace.bridge.hanger(hanger_id)
    except BadInput as error:
        raise NothingThere(error.message, remedy=error.remedy) from error


def quarantined(workspace: Workspace) -> int:
    """How many refused files lie in the quarantine."""
    return sum(1 for _ in workspace.quarantine.folder.glob("*.reason.json"))


def _state(store: Store, hanger: Hanger) -> dict[str, Any]:
    tests, baseline = store.tests(hanger.id), store.baseline(hanger.id)
    return {
        "hanger": hanger.id,
        "tests": len(tests),
        "latest_test_at": tests[-1].time if tests else None,
        "nominal_tension_n": hanger.nominal_tension_n,
        "baseline_set_at": baseline.set_at if baseline else None,
        "shifts": _shifts(store, hanger),
        "open_alerts": sum(alert.acknowledgement is None for alert in store.alerts(hanger.id)),
        **_tension(store, hanger),
    }


def _tension(store: Store, hanger: Hanger) -> dict[str, Any]:
    try:
        document = posterior_document(store.posterior(hanger.id))
    except NothingThere:
        return {"model": None, "tension_n": None}
    return {"model": document["model"], "tension_n": document["tension_n"]}


def _shifts(store: Store, hanger: Hanger) -> list[dict[str, Any]]:
    """Those of the latest test that was compared with a baseline."""
    drifts = store.drifts(hanger.id)
    return [
        {key: _known(getattr(drift, key)) for key in _SHIFT}
        for drift in drifts
        if drift.test == drifts[-1].test
    ]


def _known(value: Any) -> Any:
    return None if value != value else value  # NaN is what is not known
