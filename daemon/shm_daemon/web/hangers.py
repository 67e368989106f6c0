"""What is known of the hangers, in numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Annotated, Any

from fastapi import APIRouter, Path

from shm.documents import averaged_document
from shm.errors import BadInput, NothingThere
from shm.pipeline import utc_now
from shm.pipeline.bridge_reporting import HangersNow
from shm.store import DeliveryState, StoredWatch, TrendPoint, Workspace
from shm.values import Hanger
from shm_daemon.heartbeat import seconds_since_beat
from shm_daemon.spool import scan
from shm_daemon.web.access import AtSite, Reader
from shm_daemon.web.faults import answers
from shm_daemon.web.models import LARGEST_NUMBER, Hangers, HangerState, Status, plain
from shm_daemon.web.site import Site

router = APIRouter(prefix="/api", tags=["state"])
Number = Annotated[int, Path(ge=0, le=LARGEST_NUMBER, description="The number of the hanger.")]
_SHIFT = ("quantity", "shift_mean", "shift_sd", "threshold", "probability")


@router.get("/status", response_model=Status, summary="What is held and what waits")
def status(site: AtSite, _: Reader) -> Any:
    """Counts of recordings, files, alerts and deliveries."""
    workspace, store = site.workspace, site.store
    return {
        "bridge": workspace.bridge.name,
        "recordings": store.recordings.stage_counts(),
        "spool": len(scan(workspace.spool)),
        "quarantine": quarantined(workspace),
        "open_alerts": store.alerts.counts()[0],
        "waiting_deliveries": store.alerts.delivery_counts()[DeliveryState.WAITING],
        "daemon_seen_seconds_ago": seconds_since_beat(workspace),
    }


@router.get("/hangers", response_model=Hangers, summary="The state of all hangers")
def hangers(site: AtSite, _: Reader) -> Any:
    """Tension with its interval, shifts and open alerts of each hanger."""
    return {"hangers": _states(site, site.workspace.bridge.hangers)}


@router.get(
    "/hangers/{hanger_id}",
    response_model=HangerState,
    responses=answers(404, 422),
    summary="The state of one hanger",
)
def hanger(site: AtSite, _: Reader, hanger_id: Number) -> Any:
    """Tension with its interval, shifts and open alerts of one hanger."""
    return _states(site, [described(site.workspace, hanger_id)])[0]


def described(workspace: Workspace, hanger_id: int) -> Hanger:
    """A hanger of the bridge; raises NothingThere."""
    try:
        return workspace.bridge.hanger(hanger_id)
    except BadInput as error:
        raise NothingThere(error.message, remedy=error.remedy) from error


def quarantined(workspace: Workspace) -> int:
    """How many refused files lie in the quarantine."""
    return sum(1 for _ in workspace.quarantine.folder.glob("*.reason.json"))


def _states(site: Site, hangers: Sequence[Hanger]) -> list[dict[str, Any]]:
    """Of many hangers in as many questions as of one."""
    store = site.store
    known = HangersNow.of(site.workspace, store, hangers, utc_now())
    tests = store.tests.latest()
    set_at = {id_: each.set_at for id_, each in known.baselines.items()}
    return [
        {
            "hanger": hanger.id,
            **known.line(hanger).message.document,
            "tests": tests[hanger.id].tests if hanger.id in tests else 0,
            "latest_test_at": tests[hanger.id].time if hanger.id in tests else None,
            "nominal_tension_n": hanger.nominal_tension_n,
            "baseline_set_at": set_at.get(hanger.id),
            **_watched(known.watches.get(hanger.id)),
            "open_alerts": known.open_alerts.get(hanger.id, 0),
            **_tension(known.latest.get(hanger.id)),
        }
        for hanger in hangers
    ]


def _tension(latest: TrendPoint | None) -> dict[str, Any]:
    if latest is None:
        return {"model": None, "tension_n": None, "averaged": None}
    summary = {**asdict(latest.tension_n), "map": latest.most_probable_tension_n}
    averaged = plain(averaged_document(latest.averaged))
    return {"model": latest.model, "tension_n": summary, "averaged": averaged}


def _watched(latest: StoredWatch | None) -> dict[str, Any]:
    """Of the latest test that was compared with the baseline in force."""
    drifts = latest.watched.told if latest else ()
    creep = latest.watched.creep_per_year if latest else None
    return {
        "shifts": plain([{key: getattr(drift, key) for key in _SHIFT} for drift in drifts]),
        "creep_per_year": {"mean": creep.mean, "sd": creep.sd}
        if creep and creep.is_known
        else None,
    }
