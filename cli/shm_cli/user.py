"""`shm user`: people who may sign in to the dashboard."""

from __future__ import annotations

import sys

import rich_click as click

from shm_cli import flags
from shm_cli.common import answer, opened_store, show_rows


@click.group()
def command() -> None:
    """People who may sign in to the dashboard.

    \b
    Example: shm user list
    """


@command.command()
@click.argument("name")
@click.option(
    "--role",
    type=click.Choice(["reader", "operator", "engineer"]),
    default="reader",
    show_default=True,
    help="An operator also uploads and acknowledges, an engineer also sets limits and users.",
)
@click.option("--single-sign-on", "vouched", is_flag=True, help="No password: by that alone.")
@flags.json
@click.pass_context
def add(ctx: click.Context, name: str, role: str, vouched: bool) -> None:
    """Let a person sign in. The password is asked for, or is a line of stdin.

    \b
    Example: shm user add 'M. Huber' --role engineer
    """
    from shm.pipeline import utc_now
    from shm.store.people import Role

    with opened_store(ctx) as (_, store):
        store.people.add(name, Role(role), None if vouched else _asked(), utc_now())
    answer({"name": name, "role": role}, f"{name} may sign in as {role}.")


@command.command("list")
@flags.json
@click.pass_context
def list_users(ctx: click.Context) -> None:
    """Users, their roles, and which were removed.

    \b
    Example: shm user list --json
    """
    with opened_store(ctx) as (_, store):
        users = store.people.list_all()
    if flags.wants_json() or not users:
        answer({"users": [vars(each) for each in users]}, "No user has been made.")
        return
    rows = []
    for each in users:
        times = (f"{t:%Y-%m-%d %H:%M}" if t else "" for t in (each.made_at, each.removed_at))
        rows.append((each.name, each.role, *times))
    show_rows("users", ("name", "role", "made", "removed"), rows)


@command.command()
@click.argument("name")
@flags.json
@click.pass_context
def remove(ctx: click.Context, name: str) -> None:
    """End a user, in all browsers at once; the last engineer only after another is made.

    \b
    Example: shm user remove 'M. Huber'
    """
    from shm.pipeline import utc_now

    with opened_store(ctx) as (_, store):
        store.people.remove(name, utc_now())
    answer({"name": name, "removed": True}, f"{name} may not sign in any more.")


@command.command()
@click.argument("name")
@flags.json
@click.pass_context
def password(ctx: click.Context, name: str) -> None:
    """Give a user a new password, asked for or a line of stdin; all browsers are signed out.

    \b
    Example: shm user password 'M. Huber'
    """
    from shm.pipeline import utc_now

    with opened_store(ctx) as (_, store):
        store.people.set_password(name, _asked(), utc_now())
    answer({"name": name, "changed": True}, f"{name} has a new password.")


def _asked() -> str:
    """Never an argument: those stand in the list of processes and the shell's history."""
    if not sys.stdin.isatty():
        return sys.stdin.readline().rstrip("\r\n")
    return str(click.prompt("Password", hide_input=True, confirmation_prompt=True, err=True))
