"""Show the page of operation: state of the work, refused files, `shm doctor`, held recordings."""

from __future__ import annotations

import json
import platform
import shutil
from dataclasses import asdict, dataclass
from datetime import timedelta
from pathlib import Path
from typing import Any

from fastapi import APIRouter, Request, Response
from fastapi.responses import JSONResponse, RedirectResponse

import shm
from shm.documents import parse_time
from shm.errors import BadInput, ShmError, UsageError
from shm.pipeline import utc_now
from shm.pipeline.intake import learn_from_answer
from shm.plausibility import refuse_impossible
from shm.report import formatting
from shm.report.paper import Table
from shm.store import DeliveryState, Workspace
from shm.store.alerts import count_deliveries
from shm.store.recordings import count_stages, find_latest_hold, find_oldest_waiting
from shm.store.rows import ON_THE_WAY
from shm_daemon.doctor import Finding, Level, examine
from shm_daemon.heartbeat import duration_words, seconds_since_beat
from shm_daemon.spool import scan
from shm_daemon.web.access import AtSite, Reader, Writer
from shm_daemon.web.background_work import RETRY_AFTER, background_worker_of
from shm_daemon.web.forms import Form, reason_in, time_in
from shm_daemon.web.frame import page
from shm_daemon.web.health import troubles
from shm_daemon.web.models import Before, Row, Underway, document
from shm_daemon.web.site import Site, held_documents, quarantined

router = APIRouter(tags=["operation"])

_SHOWN = 100  # technical: refused files on a page
_FRESH_S = 300  # technical: looking at all takes seconds and a trial of each hook; read by people
_BEING_LOOKED = {"message": "The checks are running …"}
_MARKS = {
    Level.OK: "good",
    Level.UNKNOWN: "unknown",
    Level.WARNING: "warning",
    Level.FAULT: "refused",
}
_STAGES = {
    "received": "taken in, not identified yet",
    "identified": "identified, wait for the update (or for enough tests for a baseline)",
    "updated": "updated, wait for the watch",
    "watched": "watched, wait for their alerts to be sent",
    "done": "finished",
    "refused": "not usable as they are",
    "discarded": "excluded by a person",
    "held": "implausible: counts in nothing until a person decides",
}
_OTHER_STAGE = "at a stage that this version of shm does not know"


@dataclass(frozen=True)
class Examine:
    """An order to look at everything, good for some minutes: a large store takes seconds."""

    folder: Path
    minutes: int

    def make(self) -> tuple[Finding, ...]:
        return examine(self.folder, utc_now())


@router.get("/operation", include_in_schema=False)
def operation_page(request: Request, site: AtSite, _: Reader, decided: Before = None) -> Response:
    """Show the state of operation, and the full examination as soon as it is available.

    `decided` is a held recording whose decision is shown.
    """
    state = _operation(site)
    return page(
        request,
        "health.html.j2",
        state=state,
        decided=None if decided is None else find_latest_hold(site.store, decided),
        facts=_facts(state),
        stages=_stages(state["recordings"]),
        examination=_examination(request, site),
    )


@router.post("/held/{recording}", include_in_schema=False)
def decide(site: AtSite, writer: Writer, recording: Row, form: Form) -> Response:
    """Accept a held recording or discard it; the daemon does the rest."""
    who, why, now = writer.actor, reason_in(form, "a decision"), utc_now()
    decisions = site.store.acting_as(who).recordings
    match form.get("action"):
        case "confirm":
            _refuse_decided(site, recording)
            time = time_in(form, "time")
            refuse_impossible(time, site.workspace.bridge.built)
            hold = decisions.accept(recording, who.name, why, now, time)
            learn_from_answer(site.workspace, site.store, hold)
        case "discard":
            _refuse_decided(site, recording)
            decisions.exclude(recording, who.name, why, now)
        case "withdraw":
            decisions.exclude(recording, who.name, why, now, form.get("test"))
        case "reinstate":
            decisions.accept(recording, who.name, why, now)
        case _:
            raise BadInput("this is none of the decisions.", remedy="Choose one in the form.")
    return RedirectResponse(f"/operation?decided={recording}#held", 303)


def _refuse_decided(site: Site, recording: int) -> None:
    """Raise UsageError where somebody has decided since the page was shown."""
    hold = find_latest_hold(site.store, site.store.recordings.get(recording).id)
    if hold is None or hold.decision is not None:
        now = "not held" if hold is None else f"not held: it was {hold.decision} by {hold.who}"
        raise UsageError(f"recording {recording} is {now}.", remedy="Load the page again.")


@router.get("/operation/examination", include_in_schema=False)
def examination_fragment(request: Request, site: AtSite, _: Reader) -> Response:
    """Return the examination alone, for a page that is shown already."""
    found = _examination(request, site)
    if found is None:
        return _underway()
    return page(request, "examination.html.j2", examination=found)


@router.get("/api/operation", summary="Whether the work goes on")
def operation(site: AtSite, _: Reader) -> JSONResponse:
    """Return daemon, queue, held and refused files, disk and versions.

    `troubles` is empty if the work goes on; `quarantine` has the newest 100.
    """
    return document(_operation(site))


@router.get(
    "/api/operation/examination",
    responses={202: {"model": Underway}},
    summary="All checks of `shm doctor`",
)
def examination(request: Request, site: AtSite, _: Reader) -> JSONResponse:
    """Made anew every five minutes at most; 202 while it is being made."""
    found = _examined(request, site)
    if found is None:
        return _underway()
    return document({"findings": [asdict(each) for each in found]})


def _operation(site: Site) -> dict[str, Any]:
    workspace, store = site.workspace, site.store
    disk = shutil.disk_usage(workspace.folder)
    return {
        "troubles": troubles(site),
        "daemon": workspace.holder(),
        "daemon_seen_seconds_ago": seconds_since_beat(workspace),
        "recordings": count_stages(store),
        "spool": len(scan(workspace.spool)),
        "oldest_waiting_at": find_oldest_waiting(store),
        "held": held_documents(site),
        "deliveries": count_deliveries(store),
        "quarantine": _refused(workspace),
        "quarantined": quarantined(workspace),
        "disk_free_bytes": disk.free,
        "disk_bytes": disk.total,
        "version": shm.__version__,
        "python": platform.python_version(),
    }


def _refused(workspace: Workspace) -> list[dict[str, Any]]:
    """Return the newest first."""
    reasons = workspace.quarantine.folder.glob("*.reason.json")
    newest = sorted(((_modified_ns(path), path) for path in reasons), reverse=True)[:_SHOWN]
    return [_reason(path) for _, path in newest]


def _reason(path: Path) -> dict[str, Any]:
    """Return the stored reason of a refused file, as far as it can be read."""
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
        where = f" (line {document['line']})" if document["line"] else ""
        return {
            "file": f"{document['file']}{where}",
            "message": str(document["message"]),
            "remedy": str(document["remedy"]),
            "at": parse_time(document["time"]),
        }
    except (OSError, ValueError, KeyError, TypeError):
        name = path.name.removesuffix(".reason.json")
        unread = "Its reason cannot be read."
        return {"file": name, "message": unread, "remedy": "See the quarantine.", "at": None}


def _modified_ns(path: Path) -> int:
    try:
        return path.stat().st_mtime_ns
    except FileNotFoundError:  # taken away since it was listed
        return 0


def _facts(state: dict[str, Any]) -> list[tuple[str, str, str]]:
    seen_s, counts = state["daemon_seen_seconds_ago"], state["recordings"]
    under_way = sum(counts[stage] for stage in ON_THE_WAY)
    owed, oldest = state["deliveries"], state["oldest_waiting_at"]
    return [
        (
            "Daemon",
            "active" if state["daemon"] else "none active",
            "never seen here" if seen_s is None
            else f"last seen {duration_words(timedelta(seconds=seen_s))} ago",
        ),
        (
            "Waiting",
            f"{state['spool']} in the spool, {under_way} stored",
            f"the oldest since {formatting.moment(oldest)}" if oldest else "nothing stored waits",
        ),
        (
            "Deliveries",
            f"{owed[DeliveryState.WAITING]} waiting",
            f"{owed[DeliveryState.GIVEN_UP]} given up, {owed[DeliveryState.DELIVERED]} delivered",
        ),
        (
            "Disk",
            f"{state['disk_free_bytes'] / 1e9:.1f} GB free",
            f"of {state['disk_bytes'] / 1e9:.0f} GB",
        ),
        ("Version", f"shm {state['version']}", f"Python {state['python']}"),
    ]  # fmt: skip


def _stages(counts: dict[str, int]) -> Table:
    rows = tuple((name, str(n), _STAGES.get(name, _OTHER_STAGE)) for name, n in counts.items())
    return Table("Recordings by stage", ("stage", "recordings", "what that means"), rows)


def _examination(request: Request, site: Site) -> Table | None:
    findings = _examined(request, site)
    if findings is None:
        return None
    order = list(Level)
    worst_first = sorted(findings, key=lambda each: order.index(each.level), reverse=True)
    return Table(
        "All checks",
        ("check", "result", "found", "what to do"),
        tuple((each.check, each.level.value, each.found, each.remedy) for each in worst_first),
        marks=tuple(_MARKS[each.level] for each in worst_first),
        note="Made anew every five minutes at most; paths are those of the bridge's computer.",
    )


def _examined(request: Request, site: Site) -> tuple[Finding, ...] | None:
    order = Examine(site.workspace.folder, int(utc_now().timestamp() // _FRESH_S))
    try:
        found: tuple[Finding, ...] | None = background_worker_of(request).get_or_start(order)
    except ShmError as error:
        return (Finding("examination", Level.UNKNOWN, error.message, error.remedy),)
    return found


def _underway() -> JSONResponse:
    return JSONResponse(_BEING_LOOKED, 202, RETRY_AFTER)
