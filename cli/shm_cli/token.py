"""`shm token`: who may read and write over the network."""

from __future__ import annotations

import rich_click as click

from shm_cli import flags
from shm_cli.common import answer, opened_store, show, show_rows


@click.group()
def command() -> None:
    """Who may read and write over the network.

    \b
    Example: shm token list
    """


@command.command()
@click.argument("name")
@click.option(
    "--scope",
    type=click.Choice(["read", "write"]),
    default="read",
    show_default=True,
    help="`write` may upload and acknowledge, and read.",
)
@flags.json
@click.pass_context
def create(ctx: click.Context, name: str, scope: str) -> None:
    """Make a token and print it, this once.

    It goes into the header `Authorization: Bearer TOKEN`. Only its checksum is kept: where it is
    lost, revoke it and make another.

    \b
    Example: shm token create logger --scope write
    """
    from shm.pipeline import utc_now
    from shm.store import Scope

    with opened_store(ctx) as (_, store):
        secret = store.upkeep.create_token(name, Scope(scope), utc_now())
    if flags.wants_json():
        show({"name": name, "scope": scope, "token": secret})
        return
    click.echo(secret)
    click.echo(f"Token {name} may {scope}. It is not shown again.", err=True)


@command.command("list")
@flags.json
@click.pass_context
def list_tokens(ctx: click.Context) -> None:
    """Tokens, when they were last used, and which are revoked.

    \b
    Example: shm token list --json
    """
    with opened_store(ctx) as (_, store):
        tokens = store.upkeep.list_tokens()
    if flags.wants_json() or not tokens:
        document = [{**vars(each), "scopes": sorted(each.scopes)} for each in tokens]
        answer({"tokens": document}, "No token has been made.")
        return
    rows = []
    for each in tokens:
        times = (each.created_at, each.last_used_at, each.revoked_at)
        told = (f"{time:%Y-%m-%d %H:%M}" if time else "never" for time in times)
        rows.append((each.name, ", ".join(sorted(each.scopes)), *told))
    show_rows("tokens", ("name", "may", "made", "last used", "revoked"), rows)


@command.command()
@click.argument("name")
@flags.json
@click.pass_context
def revoke(ctx: click.Context, name: str) -> None:
    """End a token, at once.

    \b
    Example: shm token revoke logger
    """
    from shm.pipeline import utc_now

    with opened_store(ctx) as (_, store):
        store.upkeep.revoke_token(name, utc_now())
    answer({"name": name, "revoked": True}, f"Token {name} is revoked.")
