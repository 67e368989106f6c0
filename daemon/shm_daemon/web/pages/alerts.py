"""Show and acknowledge alerts; create and end silences and maintenance windows."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from datetime import datetime
from typing import Annotated, Any

from fastapi import APIRouter, Query, Request, Response
from fastapi.responses import JSONResponse, RedirectResponse

from shm.bridge import Hook
from shm.errors import BadInput
from shm.pipeline import utc_now
from shm.pipeline.bridge_reporting import hanger_summaries
from shm.report import formatting
from shm.report.hanger_status import HangerMessage
from shm.store import Delivery, DeliveryState, News, Silence, StoredAlert
from shm.store.alerts import count_open_alerts, describe_silence, list_alert_page, silenced_until
from shm.values.messages import Lead
from shm_daemon.web.access import AtSite, Principal, Reader, Writer
from shm_daemon.web.address import test_page
from shm_daemon.web.faults import answers
from shm_daemon.web.forms import Form, reason_in, time_in
from shm_daemon.web.frame import page
from shm_daemon.web.models import (
    LARGEST_NUMBER,
    MOST_ROWS,
    Acknowledge,
    Before,
    Row,
    document,
    paged,
)
from shm_daemon.web.site import Site

router = APIRouter(tags=["alerts"])

_SHOWN = 50  # technical: alerts on a page, which links to older ones
_MARKS = {"delivered": "steady", "waiting": "watch", "given up": "alert", "not needed": "steady"}


@router.get("/alerts", include_in_schema=False)
def alerts_page(
    request: Request,
    site: AtSite,
    _: Reader,
    hanger: Before = None,
    open_before: Before = None,
    noted_before: Before = None,
) -> Response:
    """Return alerts of all hangers or of one, the newest first.

    `open_before` goes on among the open ones alone, `noted_before` among the others.
    """
    opened, older_open = _some(site, hanger, open_before, is_open=True)
    noted, older_noted = _some(site, hanger, noted_before, is_open=False)
    counts, now = count_open_alerts(site.store), utc_now()
    return page(
        request,
        "alerts.html.j2",
        opened=None if noted_before is not None else opened,
        noted=None if open_before is not None else noted,
        older_open=older_open,
        older_noted=older_noted,
        open_count=sum(counts.values()) if hanger is None else counts.get(hanger, 0),
        is_first=open_before is None and noted_before is None,
        hanger=hanger,
        silences=[
            (each.id, _sentence(each))
            for each in site.store.silences.list_all()
            if not each.is_over(now)
        ],
        hangers=[
            (h.id, formatting.hanger_name(h.id, h.name)) for h in site.workspace.bridge.watched
        ],
        has_hooks=bool(site.workspace.bridge.hooks),
        marks=_MARKS,
    )


def _sentence(silence: Silence) -> str:
    words = f"{describe_silence(silence)}, from {silence.starts_at:%Y-%m-%d %H:%M} on."
    return words[0].upper() + words[1:]


def _some(
    site: Site, hanger: int | None, before: int | None, *, is_open: bool
) -> tuple[list[dict[str, Any]], int | None]:
    """Return a page of alerts, and the number to continue after, if there are more."""
    rows = list_alert_page(site.store, hanger, is_open=is_open, limit=_SHOWN + 1, before=before)
    shown, older = paged(rows, _SHOWN)
    documents, now = alert_documents(shown, site), _messages(shown, site)
    return [
        {
            **found,
            "address": _address(each, site),
            "stream": _stream_of(each, site),
            "now": _now(each, now.get(each.alert.hanger)),
        }
        for each, found in zip(shown, documents, strict=True)
    ], older


def _messages(shown: Sequence[StoredAlert], site: Site) -> dict[int, HangerMessage]:
    """Return the leads of the hangers of these alerts, by number."""
    numbers = {each.alert.hanger for each in shown if each.resolution is None}
    hangers = [each for each in site.workspace.bridge.hangers if each.id in numbers]
    if not hangers:
        return {}
    lines = hanger_summaries(site.workspace, site.store, utc_now(), hangers)
    return {each.hanger.id: each.message for each in lines}


def _now(stored: StoredAlert, message: HangerMessage | None) -> str:
    """Return the present state of the hanger of an open alert; empty if the alert states it."""
    alert = stored.alert
    if message is None or stored.resolution or alert.kinds == ("test",):
        return ""
    return "" if alert.message.startswith(message.lead.words) else message.lead.words


def _address(stored: StoredAlert, site: Site) -> str | None:
    """Return the page that an alert is about; None for one that only tries a hook."""
    alert = stored.alert
    if stream := _stream_of(stored, site):
        return f"/streams/{stream}"
    if "held" in alert.kinds:  # what is held has no page of its own
        return "/operation#held"
    return None if "test" in alert.kinds else test_page(alert.hanger, alert.test)


def _stream_of(stored: StoredAlert, site: Site) -> str | None:
    """Return the stream whose hourly reading raised an alert; None of a hammer test."""
    name, _, hour = stored.alert.test.rpartition(" ")
    known = (each.name for each in site.workspace.bridge.streams)
    return name if hour and name in known else None


@router.get("/api/alerts", responses=answers(422), summary="Alerts that were raised")
def alerts(
    site: AtSite,
    _: Reader,
    hanger: Before = None,
    open: Annotated[
        bool, Query(description="Only those that are open and not acknowledged.")
    ] = False,
    limit: Annotated[
        int | None,
        Query(ge=1, le=MOST_ROWS, description="So many of the newest, the newest first."),
    ] = None,
    before: Annotated[
        int | None,
        Query(
            ge=0, le=LARGEST_NUMBER, description="With `limit`: `next_before` of the answer before."
        ),
    ] = None,
) -> JSONResponse:
    """Return them with their deliveries; without `limit` all that were ever raised, oldest first.

    With `limit` page by page, the newest first: after years that is the quicker question. One is
    open while `acknowledged` and `resolved` are null; hooks hear of its hanger again from
    `silenced_until` on.
    """
    is_open = True if open else None
    if limit is None:
        found = list_alert_page(site.store, hanger, is_open=is_open)[::-1]
        return document({"alerts": alert_documents(found, site), "next_before": None})
    rows = list_alert_page(site.store, hanger, is_open=is_open, limit=limit + 1, before=before)
    shown, older = paged(rows, limit)
    return document({"alerts": alert_documents(shown, site), "next_before": older})


@router.post(
    "/api/alerts/{alert_id}/acknowledgement",
    responses=answers(404, 409, 422),
    summary="Take note of an alert",
)
def acknowledge(site: AtSite, writer: Writer, alert_id: Row, comment: Acknowledge) -> JSONResponse:
    """Record that somebody has seen an alert, or with `resolved` that it has ended."""
    _note(site, writer, alert_id, comment.who, comment.why, comment.resolved)
    return document(alert_documents([site.store.alerts.get(alert_id)], site)[0])


@router.post("/alerts/{alert_id}/acknowledgement", include_in_schema=False)
def acknowledge_by_form(site: AtSite, writer: Writer, alert_id: Row, form: Form) -> Response:
    """Record what a person wrote in the form of a page, which works without a script."""
    why, person = reason_in(form, "an alert"), form.get("who", "").strip()
    _note(site, writer, alert_id, person or None, why, "resolved" in form)
    return RedirectResponse(f"/alerts#alert-{alert_id}", 303)


def _note(
    site: Site, writer: Principal, alert_id: int, person: str | None, why: str, is_resolved: bool
) -> None:
    """Acknowledge or resolve an alert; `person` is who came with the token of a program."""
    named = person is not None and not writer.is_person  # who signed in has a name
    who = f"{person} (token {writer.name})" if named else writer.name
    alerts = site.store.acting_as(writer.actor).alerts
    (alerts.resolve if is_resolved else alerts.acknowledge)(alert_id, who, why, utc_now())


def alert_documents(found: Sequence[StoredAlert], site: Site) -> list[dict[str, Any]]:
    """Return alerts with the state of their deliveries, and what holds these back."""
    silences, now = site.store.silences.list_all(), utc_now()
    hooks = {hook.name: hook for hook in site.workspace.bridge.hooks}
    owed = defaultdict[int, list[Delivery]](list)
    for each in site.store.alerts.list_deliveries(alert_ids=[each.id for each in found]):
        owed[each.stored.id].append(each)
    return [_document(each, owed[each.id], hooks, silences, now) for each in found]


def _document(
    stored: StoredAlert,
    owed: Sequence[Delivery],
    hooks: Mapping[str, Hook],
    silences: tuple[Silence, ...],
    now: datetime,
) -> dict[str, Any]:
    noted, ended, alert = stored.acknowledgement, stored.resolution, stored.alert
    lead = Lead.of(alert.message)
    return {
        "id": stored.id,
        "hanger": alert.hanger,
        "raised_at": stored.raised_at,
        "test": alert.test,
        "test_at": alert.time,
        "kinds": list(alert.kinds),
        "message": alert.message,
        **asdict(lead),
        "urgency": lead.urgency,
        "acknowledged": noted and noted.as_document,
        "resolved": ended and ended.as_document,
        "silenced_until": None if ended else silenced_until(silences, alert.hanger, now),
        "deliveries": [_delivery(each, hooks.get(each.hook), alert.message, now) for each in owed],
    }


def _delivery(row: Delivery, hook: Hook | None, message: str, now: datetime) -> dict[str, Any]:
    until = None
    if hook is not None and row.state is DeliveryState.WAITING:
        until = hook.quiet_until(message, now, is_raised=row.news is News.RAISED)
    escalates = hook is not None and hook.escalation_after_seconds is not None
    delivery = {name: getattr(row, name) for name in ("hook", "attempts", "last_error", "news")}
    state = {"state": row.state.value, "escalation": escalates, "waits_until": until}
    return {**delivery, **state}


@router.post("/silences", include_in_schema=False)
def silence(site: AtSite, writer: Writer, form: Form) -> Response:
    """Hold the messages of hooks back for a while."""
    now, number, why = utc_now(), form.get("hanger", ""), reason_in(form, "a silence")
    since, until = time_in(form, "from") or now, time_in(form, "until")
    if until is None or not (number == "all" or number.isdecimal()):
        raise BadInput("a silence has hangers and an end.", remedy="Choose them in the form.")
    hanger = None if number == "all" else int(number)
    if hanger is not None:
        site.workspace.bridge.tested(hanger)
    who = writer.actor
    site.store.acting_as(who).silences.make(
        hanger, (since, until), who.name, why, now, is_maintenance="maintenance" in form
    )
    return RedirectResponse("/alerts#silences", 303)


@router.post("/silences/{number}/end", include_in_schema=False)
def end_silence(site: AtSite, writer: Writer, number: Row) -> Response:
    """End one before its time."""
    site.store.acting_as(writer.actor).silences.end(number, writer.actor.name, utc_now())
    return RedirectResponse("/alerts#silences", 303)
