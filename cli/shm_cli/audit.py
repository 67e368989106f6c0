"""`shm audit`: who changed what."""

from __future__ import annotations

import rich_click as click

from shm_cli import flags
from shm_cli.common import opened_store, show, show_table, table


@click.command()
@click.option("--limit", type=click.IntRange(min=1), help="So many of the newest.")
@flags.json
@click.pass_context
def command(ctx: click.Context, limit: int | None, as_json: bool) -> None:
    """Who changed what, when and how: the newest first.

    What shm does by itself is not listed, nor what is edited in bridge.toml.

    \b
    Example: shm audit --limit 20
    """
    with opened_store(ctx) as (_, store):
        rows = store.audit.list_rows(limit)
    if as_json:
        show({"changes": [vars(each) for each in rows]})
        return
    if not rows:
        click.echo("Nothing was changed.")
        return
    made = table("changes", "time", "who", "by", "action", "of", "detail")
    for each in rows:
        made.add_row(f"{each.at:%Y-%m-%d %H:%M}", *list(vars(each).values())[2:])
    show_table(made)
