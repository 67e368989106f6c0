"""`shm db`: upgrades or checks the store."""

from __future__ import annotations

import rich_click as click

from shm.store import Store
from shm_cli.common import open_workspace


@click.group()
def command() -> None:
    """Upgrade or check the store.

    \b
    Example: shm db upgrade
    """


@command.command()
@click.pass_context
def upgrade(ctx: click.Context) -> None:
    """Bring the store to the schema of this version.

    \b
    Example: shm --workspace arch db upgrade
    """
    workspace = open_workspace(ctx)
    with workspace.lock():
        Store.upgrade(workspace.database)
    click.echo("The store has the present schema.")


@command.command()
@click.pass_context
def check(ctx: click.Context) -> None:
    """Say whether the store can be used; exit code 5 where it cannot.

    \b
    Example: shm db check
    """
    with open_workspace(ctx).store() as store:
        held = sum(store.stage_counts().values())
    click.echo(f"The store has the present schema and holds {held} recordings.")
