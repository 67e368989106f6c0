"""`shm audit`: who changed what."""

from __future__ import annotations

import rich_click as click

from shm_cli import flags
from shm_cli.common import answer, opened_store, show_rows


@click.command()
@click.option("--limit", type=click.IntRange(min=1), help="So many of the newest.")
@flags.json
@click.pass_context
def command(ctx: click.Context, limit: int | None) -> None:
    """Who changed what, when and how: the newest first.

    What shm does by itself is not listed, nor what is edited in bridge.toml.

    \b
    Example: shm audit --limit 20
    """
    with opened_store(ctx) as (_, store):
        rows = store.audit.list_rows(limit)
    if flags.wants_json() or not rows:
        answer({"changes": [vars(each) for each in rows]}, "Nothing was changed.")
        return
    cells = [(f"{each.at:%Y-%m-%d %H:%M}", *list(vars(each).values())[2:]) for each in rows]
    show_rows("changes", ("time", "who", "by", "action", "of", "detail"), cells)
