"""`shm alerts`: what was raised, whether the hooks got it, and whether they work.

A person takes note of an alert, or silences the hooks for a time, on the record.
"""

from __future__ import annotations

import os
from datetime import datetime
from typing import Any

import rich_click as click

from shm.bridge import Bridge, Hook
from shm.documents import alert_document
from shm.errors import UsageError, suggest
from shm.pipeline import utc_now
from shm.pipeline.courier import quiet_until
from shm.store import Delivery, DeliveryState, Silence, StoredAlert
from shm.store.alerts import hangers_of, silenced_until
from shm_cli import completion, flags
from shm_cli.common import answer, open_workspace, opened_store, paragraph, show_rows


@click.group(invoke_without_command=True)
@flags.hanger()
@flags.json
@click.pass_context
def command(ctx: click.Context, hanger_id: int | None) -> None:
    """Show alerts and their deliveries; acknowledge them.

    \b
    Example: shm alerts --hanger 7 --json
    """
    if ctx.invoked_subcommand is None:
        _list(hanger_id)


@command.command()
@flags.hanger()
@click.option("--bridge", "whole", is_flag=True, help="All hangers.")
@click.option("--from", "since", type=flags.Time(), show_default="now", help="When it begins.")
@click.option("--until", type=flags.Time(), required=True, help="When it ends, as 2026-12-01.")
@click.option("--maintenance", is_flag=True, help="Planned works: tests of then are not watched.")
@click.option("--why", type=flags.Words(), required=True, help="For the record.")
@flags.who
@flags.json
def silence(
    hanger_id: int | None,
    whole: bool,
    since: datetime | None,
    until: datetime,
    maintenance: bool,
    why: str,
    who: str,
) -> None:
    """Silence notifications until a time.

    Alerts are still raised and shown; at the end hooks receive those that are neither acknowledged
    nor resolved. Times without a zone are UTC. With --maintenance, tests of that time are stored
    but not watched: announce it before they arrive.

    \b
    Example: shm alerts silence --hanger 7 --until 2026-12-01 --why "sensor is replaced"
    Example: shm alerts silence --bridge --maintenance --until 2027-03-05 --why "new joints"
    """
    if whole == (hanger_id is not None):
        raise UsageError("name one hanger, or all.", remedy="Give --hanger N or --bridge.")
    now = utc_now()
    with opened_store() as (workspace, store):
        if hanger_id is not None:
            workspace.bridge.tested(hanger_id)
        made = store.silences.make(
            hanger_id,
            (since or now, until),
            who,
            why,
            now,
            is_maintenance=maintenance,
        )
    kind = "Maintenance window" if maintenance else "Silence"
    answer(
        silence_row(made, now),
        f"{kind} {made.id}: hooks get nothing about {hangers_of(made.hanger)} from "
        f"{_at(made.starts_at)} until {_at(made.until)} UTC. End it early: "
        f"`shm alerts unsilence {made.id}`.",
    )


@command.command()
@flags.json
def silences() -> None:
    """List silences and maintenance windows, with author and reason.

    \b
    Example: shm alerts silences --json
    """
    now = utc_now()
    with opened_store() as (_, store):
        found = store.silences.list_all()
    if flags.wants_json() or not found:
        document = {"silences": [silence_row(each, now) for each in found]}
        answer(document, "No silence was ever made.")
        return
    headings = ("number", "of", "kind", "state", "from", "until", "by")
    show_rows("silences", headings, [_silence_cells(each, now) for each in found])


def _silence_cells(each: Silence, now: datetime) -> tuple[str, ...]:
    return (
        str(each.id),
        hangers_of(each.hanger),
        "maintenance" if each.is_maintenance else "silence",
        state_of(each, now),
        _at(each.starts_at),
        _at(each.until),
        f"{each.who}: {each.why}" + (f" (ended by {each.ended_who})" if each.ended_at else ""),
    )


@command.command()
@click.argument("silence_id", type=int, metavar="ID")
@flags.who
@flags.json
def unsilence(silence_id: int, who: str) -> None:
    """End a silence now.

    \b
    Example: shm alerts unsilence 3
    """
    now = utc_now()
    with opened_store() as (_, store):
        ended = store.silences.end(silence_id, who, now)
    answer(
        silence_row(ended, now),
        f"Silence {silence_id} has ended: hooks are notified about {hangers_of(ended.hanger)} "
        "again.",
    )


def silence_row(silence: Silence, now: datetime) -> dict[str, object]:
    """Return the JSON document of a silence."""
    return {**vars(silence), "state": state_of(silence, now), "until": silence.until}


def state_of(silence: Silence, now: datetime) -> str:
    """Return `in force`, `to come` or `over`."""
    if silence.is_over(now):
        return "over"
    return "to come" if silence.starts_at > now else "in force"


def _at(time: datetime) -> str:
    return f"{time:%Y-%m-%d %H:%M}"


@command.command("ack")
@click.argument("alert_id", type=int, metavar="ID")
@click.option("--why", type=flags.Words(), required=True, help="What came of it, for the record.")
@click.option("--resolved", is_flag=True, help="Its cause is gone or explained: hooks hear of it.")
@flags.who
@flags.json
def acknowledge(alert_id: int, why: str, resolved: bool, who: str) -> None:
    """Acknowledge an alert.

    ID is the number that `shm alerts` shows. The alert is open no more; the watch goes on as it
    was, and raises another alert once something else moves. To compare a hanger with itself as it
    is now, see `shm drift rebaseline`.

    \b
    Example: shm alerts ack 4 --why "crew is on its way"
    Example: shm alerts ack 4 --resolved --why "crew was there on 3 May: pin replaced"
    """
    with opened_store() as (_, store):
        note = store.alerts.resolve if resolved else store.alerts.acknowledge
        noted = note(alert_id, who, why, utc_now())
    done = "resolved" if resolved else "acknowledged"
    answer(
        {"id": noted.id, **acknowledgement_row(noted), "alert": alert_document(noted.alert)},
        f"Alert {alert_id} of hanger {noted.alert.hanger} is {done}.",
    )


def acknowledgement_row(stored: StoredAlert) -> dict[str, object]:
    """Return the JSON document of an alert.

    `acknowledged` is null until somebody acknowledges it, `resolved` while its condition holds; it
    is open while both are null.
    """
    noted, ended = stored.acknowledgement, stored.resolution
    return {"acknowledged": noted and noted.as_document, "resolved": ended and ended.as_document}


def acknowledgement_words(stored: StoredAlert) -> str:
    """Return `open`, or who acknowledged it, when and why; or that it is resolved."""
    noted, ended = stored.acknowledgement, stored.resolution
    if noted is None:
        return "open" if ended is None else f"resolved {ended.at:%Y-%m-%d}: {ended.why}"
    text = f"{noted.who}, {noted.at:%Y-%m-%d}: {noted.why}"
    return text if ended is None else f"{text} (resolved {ended.at:%Y-%m-%d})"


@command.command()
@click.argument("alert_id", type=int, metavar="ID")
@flags.json
def resend(alert_id: int) -> None:
    """Send an alert again to the hooks that gave it up.

    A hook that keeps failing is given up after `hook_attempts` tries. Mend it, see that it works
    with `shm alerts test`, then send the alert again: the daemon tries as often as before.

    \b
    Example: shm alerts resend 4
    """
    with opened_store() as (_, store):
        owed = store.alerts.resend(alert_id, utc_now())
    hooks = list(dict.fromkeys(each.hook for each in owed))
    answer(
        {"id": alert_id, "hooks": hooks},
        f"Alert {alert_id} is owed again to {', '.join(hooks)}: the daemon sends it next.",
    )


@command.command()
@click.option(
    "--hook",
    "name",
    required=True,
    metavar="NAME",
    shell_complete=completion.hooks,
    help="A hook of bridge.toml.",
)
@flags.json
def test(name: str) -> None:
    """Send a test alert to a hook.

    It goes the way of every alert, once, whether the daemon runs or not. Only the audit log keeps
    it. Says what the hook answered, or what went wrong.

    \b
    Example: shm alerts test --hook mail
    """
    from shm_daemon.hooks.trial import send_test_alert

    workspace = open_workspace()
    hook = _described(workspace.bridge, name)
    found = send_test_alert(workspace, hook, os.environ, utc_now())
    document = {"hook": name, "kind": hook.kind, "key": found.alert.key, "answer": found.answer}
    answer({**document, "seconds": round(found.seconds, 3)}, found.sentence(hook))


def _described(bridge: Bridge, name: str) -> Hook:
    for hook in bridge.hooks:
        if hook.name == name:
            return hook
    known = ", ".join(hook.name for hook in bridge.hooks) or "none"
    raise UsageError(
        f"bridge.toml describes no hook {name} (known: {known}).",
        remedy=f"{suggest(name, (hook.name for hook in bridge.hooks))}"
        "Correct the name, or describe it in a [[hook]] table.",
    )


def _list(hanger_id: int | None) -> None:
    with opened_store() as (workspace, store):
        if hanger_id is not None:
            workspace.bridge.tested(hanger_id)
        alerts = store.alerts.list_all(hanger_id)
        deliveries = store.alerts.list_deliveries()
        made = store.silences.list_all()
    now = utc_now()
    rows = [
        {
            **_row(stored, deliveries, workspace.bridge, now),
            "silenced_until": silenced_until(made, stored.alert.hanger, now)
            if stored.resolution is None
            else None,
        }
        for stored in alerts
    ]
    if flags.wants_json() or not alerts:
        answer({"alerts": rows}, "No alert has been raised.")
        return
    headings = ("number", "hanger", "test of", "kind", "hooks", "acknowledged")
    show_rows("alerts", headings, map(_cells, alerts, rows))
    for stored, row in zip(alerts, rows, strict=True):
        click.echo("\n" + paragraph(f"{stored.id}. {stored.alert.message}"))
        for each in row["deliveries"]:
            if each["state"] == DeliveryState.GIVEN_UP:
                click.echo(paragraph(_given_up_words(stored.id, each)))


def _cells(stored: StoredAlert, row: dict[str, Any]) -> tuple[str, ...]:
    states = ", ".join(_delivery_words(each) for each in row["deliveries"])
    if (until := row["silenced_until"]) is not None:
        states = f"silenced until {until:%Y-%m-%d %H:%M}; {states}"
    alert = stored.alert
    return (
        str(stored.id),
        str(alert.hanger),
        f"{alert.time:%Y-%m-%d}",
        ", ".join(alert.kinds),
        states or "none",
        acknowledgement_words(stored),
    )


def _given_up_words(alert_id: int, delivery: dict[str, Any]) -> str:
    tries = "one try" if delivery["attempts"] == 1 else f"{delivery['attempts']} tries"
    why = delivery["last_error"] or "no reason is known"
    return (
        f"The hook {delivery['hook']} was not notified: given up after {tries}, {why} Fix it, then "
        f"`shm alerts resend {alert_id}`."
    )


def _delivery_words(delivery: dict[str, Any]) -> str:
    what = "resolved " if delivery["news"] == "resolved" else ""
    if delivery["escalation"]:
        words = {"delivered": "escalated", "waiting": "escalates unless acknowledged"}
        return f"{delivery['hook']}: {what}{words.get(delivery['state'], delivery['state'])}"
    until = delivery["waits_until"]
    state = f"waits until {until:%H:%M %Z}" if until else delivery["state"]
    return f"{delivery['hook']}: {what}{state}"


def _row(
    stored: StoredAlert, deliveries: tuple[Delivery, ...], bridge: Bridge, now: datetime
) -> dict[str, Any]:
    return {
        "id": stored.id,
        "raised_at": stored.raised_at,
        **acknowledgement_row(stored),
        "alert": alert_document(stored.alert),
        "deliveries": [
            {
                "hook": delivery.hook,
                "news": delivery.news.value,
                "escalation": delivery.hook in bridge.escalation_s,
                "state": delivery.state.value,
                "waits_until": quiet_until(delivery, bridge.hooks, now)
                if delivery.state is DeliveryState.WAITING
                else None,
                "attempts": delivery.attempts,
                "last_error": delivery.last_error or None,
            }
            for delivery in deliveries
            if delivery.alert.key == stored.alert.key
        ],
    }
