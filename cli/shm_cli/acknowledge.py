"""`shm alerts ack`: a person takes note of an alert, on the record."""

from __future__ import annotations

import getpass

import rich_click as click

from shm.documents import alert_document
from shm.pipeline import utc_now
from shm.store import StoredAlert
from shm_cli.common import json_option, opened_store, show
from shm_cli.record import Words


@click.command("ack")
@click.argument("alert_id", type=int, metavar="ID")
@click.option("--why", type=Words(), required=True, help="What came of it, for the record.")
@click.option("--who", show_default="the user's name", help="For the record.")
@json_option
@click.pass_context
def acknowledge(
    ctx: click.Context, alert_id: int, why: str, who: str | None, as_json: bool
) -> None:
    """Take note of an alert, on the record.

    ID is the number that `shm alerts` shows. The alert is open no more; the watch goes on as it
    was, and raises another alert once something else moves. To compare a hanger with itself as it
    is now, see `shm drift rebaseline`.

    \b
    Example: shm alerts ack 4 --why "crew was there on 3 May: pin replaced"
    """
    with opened_store(ctx) as (_, store):
        noted = store.acknowledge(alert_id, who or getpass.getuser(), why, utc_now())
    if as_json:
        show({"id": noted.id, **acknowledgement_row(noted), "alert": alert_document(noted.alert)})
        return
    click.echo(f"Alert {alert_id} of hanger {noted.alert.hanger} is acknowledged.")


def acknowledgement_row(stored: StoredAlert) -> dict[str, object]:
    """What `shm alerts --json` says of it: `acknowledged` is null while the alert is open."""
    noted = stored.acknowledgement
    if noted is None:
        return {"acknowledged": None}
    return {"acknowledged": {"who": noted.who, "why": noted.why, "at": noted.at}}


def acknowledgement_words(stored: StoredAlert) -> str:
    """`open`, or who took note of it, when and why."""
    noted = stored.acknowledgement
    return "open" if noted is None else f"{noted.who}, {noted.at:%Y-%m-%d}: {noted.why}"
