"""`shm daemon`: watches the spool and does the whole job."""

from __future__ import annotations

import logging

import rich_click as click

from shm_cli.common import open_workspace
from shm_daemon import run


@click.command()
@click.option("--once", is_flag=True, help="End when nothing is left to do.")
@click.option("--workers", type=click.IntRange(1, 64), help="Processes that identify and update.")
@click.pass_context
def command(ctx: click.Context, once: bool, workers: int | None) -> None:
    """Watch the spool and do the whole job, unattended.

    A file dropped into spool/ is archived, identified, updated and watched; alerts go to the hooks
    of bridge.toml. SIGTERM ends the daemon; what was under way goes on at the next start.

    \b
    Example: shm --workspace arch daemon
    """
    logging.basicConfig(
        level=logging.INFO, format="%(asctime)s %(levelname)s %(message)s", force=True
    )
    run(open_workspace(ctx, workers=workers), once=once)
