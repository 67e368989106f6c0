"""`shm alerts`: what was raised, and whether the hooks got it."""

from __future__ import annotations

import rich_click as click

from shm.documents import alert_document
from shm_cli.common import hanger_option, json_option, opened_store, show, show_table, table


@click.command()
@hanger_option()
@json_option
@click.pass_context
def command(ctx: click.Context, hanger_id: int | None, as_json: bool) -> None:
    """Alerts that were raised, and their deliveries.

    \b
    Example: shm alerts --hanger 7 --json
    """
    with opened_store(ctx) as (workspace, store):
        if hanger_id is not None:
            workspace.bridge.hanger(hanger_id)
        alerts = store.alerts(hanger_id)
        deliveries = store.deliveries()
    rows = [
        {
            "id": stored.id,
            "raised_at": stored.raised_at,
            "alert": alert_document(stored.alert),
            "deliveries": [
                {
                    "hook": delivery.hook,
                    "state": delivery.state.value,
                    "attempts": delivery.attempts,
                    "last_error": delivery.last_error or None,
                }
                for delivery in deliveries
                if delivery.alert.key == stored.alert.key
            ],
        }
        for stored in alerts
    ]
    if as_json:
        show({"alerts": rows})
        return
    if not alerts:
        click.echo("No alert has been raised.")
        return
    made = table("alerts", "hanger", "test of", "what", "hooks")
    for stored, row in zip(alerts, rows, strict=True):
        states = ", ".join(f"{d['hook']}: {d['state']}" for d in row["deliveries"])  # type: ignore[attr-defined]
        alert = stored.alert
        made.add_row(str(alert.hanger), f"{alert.time:%Y-%m-%d}", alert.message, states or "none")
    show_table(made)
