"""`shm alerts silence`, `silences` and `unsilence`: when no hook is told, on the record."""

from __future__ import annotations

from datetime import datetime

import rich_click as click

from shm.errors import UsageError
from shm.pipeline import utc_now
from shm.store import Silence
from shm.store.stored_alerts import hangers_of
from shm_cli import flags
from shm_cli.common import answer, opened_store, show_rows


@click.command()
@flags.hanger()
@click.option("--bridge", "whole", is_flag=True, help="All hangers.")
@click.option("--from", "since", type=flags.Time(), show_default="now", help="When it begins.")
@click.option("--until", type=flags.Time(), required=True, help="When it ends, as 2026-12-01.")
@click.option("--maintenance", is_flag=True, help="Planned works: tests of then are not watched.")
@click.option("--why", type=flags.Words(), required=True, help="For the record.")
@flags.who
@flags.json
@click.pass_context
def silence(
    ctx: click.Context,
    hanger_id: int | None,
    whole: bool,
    since: datetime | None,
    until: datetime,
    maintenance: bool,
    why: str,
    who: str,
) -> None:
    """Hold messages to hooks back until a time.

    Alerts are raised and shown all the same; hooks are told of them at the end, unless they have
    been acknowledged or resolved. Times without a zone are UTC. With --maintenance, tests made in
    that time are taken in but not watched: record it before they come in.

    \b
    Example: shm alerts silence --hanger 7 --until 2026-12-01 --why "sensor is replaced"
    Example: shm alerts silence --bridge --maintenance --until 2027-03-05 --why "new joints"
    """
    if whole == (hanger_id is not None):
        raise UsageError("name one hanger, or all.", remedy="Give --hanger N or --bridge.")
    now = utc_now()
    with opened_store(ctx) as (workspace, store):
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
        f"{kind} {made.id}: hooks are told nothing of {hangers_of(made.hanger)} from "
        f"{_at(made.starts_at)} until {_at(made.until)} UTC. End it early: "
        f"`shm alerts unsilence {made.id}`.",
    )


@click.command()
@flags.json
@click.pass_context
def silences(ctx: click.Context) -> None:
    """Silences and maintenance windows, with who made them and why.

    \b
    Example: shm alerts silences --json
    """
    now = utc_now()
    with opened_store(ctx) as (_, store):
        found = store.silences.list_all()
    if flags.wants_json() or not found:
        document = {"silences": [silence_row(each, now) for each in found]}
        answer(document, "No silence was ever made.")
        return
    headings = ("number", "of", "kind", "state", "from", "until", "by")
    show_rows("silences", headings, [_cells(each, now) for each in found])


def _cells(each: Silence, now: datetime) -> tuple[str, ...]:
    return (
        str(each.id),
        hangers_of(each.hanger),
        "maintenance" if each.is_maintenance else "silence",
        state_of(each, now),
        _at(each.starts_at),
        _at(each.until),
        f"{each.who}: {each.why}" + (f" (ended by {each.ended_who})" if each.ended_at else ""),
    )


@click.command()
@click.argument("silence_id", type=int, metavar="ID")
@flags.who
@flags.json
@click.pass_context
def unsilence(ctx: click.Context, silence_id: int, who: str) -> None:
    """End a silence now, on the record.

    \b
    Example: shm alerts unsilence 3
    """
    now = utc_now()
    with opened_store(ctx) as (_, store):
        ended = store.silences.end(silence_id, who, now)
    answer(
        silence_row(ended, now),
        f"Silence {silence_id} has ended: hooks are told of {hangers_of(ended.hanger)} again.",
    )


def silence_row(silence: Silence, now: datetime) -> dict[str, object]:
    """What `--json` says of a silence."""
    return {**vars(silence), "state": state_of(silence, now), "until": silence.until}


def state_of(silence: Silence, now: datetime) -> str:
    """`in force`, `to come` or `over`."""
    if silence.is_over(now):
        return "over"
    return "to come" if silence.starts_at > now else "in force"


def _at(time: datetime) -> str:
    return f"{time:%Y-%m-%d %H:%M}"
