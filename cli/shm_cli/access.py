"""`shm token` and `shm user`: who may use the web interface, programs and people."""

from __future__ import annotations

import sys

import rich_click as click

from shm_cli import flags
from shm_cli.common import answer, opened_store, show, show_rows


@click.group()
def token() -> None:
    """Manage tokens for access over the network.

    \b
    Example: shm token list
    """


@token.command()
@click.argument("name")
@click.option(
    "--scope",
    type=click.Choice(["read", "write"]),
    default="read",
    help="`write` may upload and acknowledge, and read.",
)
@flags.json
def create(name: str, scope: str) -> None:
    """Make a token and print it, once.

    It goes into the header `Authorization: Bearer TOKEN`. Only its checksum is kept: where it is
    lost, revoke it and make another.

    \b
    Example: shm token create logger --scope write
    """
    from shm.pipeline import utc_now
    from shm.store import Scope

    with opened_store() as (_, store):
        secret = store.upkeep.create_token(name, Scope(scope), utc_now())
    if flags.wants_json():
        show({"name": name, "scope": scope, "token": secret})
        return
    click.echo(secret)
    click.echo(f"Token {name} may {scope}. It is not shown again.", err=True)


@token.command("list")
@flags.json
def list_tokens() -> None:
    """List tokens, their last use, and revoked ones.

    \b
    Example: shm token list --json
    """
    with opened_store() as (_, store):
        tokens = store.upkeep.list_tokens()
    if flags.wants_json() or not tokens:
        document = [{**vars(each), "scopes": sorted(each.scopes)} for each in tokens]
        answer({"tokens": document}, "No token has been made.")
        return
    rows = []
    for each in tokens:
        times = (each.created_at, each.last_used_at, each.revoked_at)
        shown = (f"{time:%Y-%m-%d %H:%M}" if time else "never" for time in times)
        rows.append((each.name, ", ".join(sorted(each.scopes)), *shown))
    show_rows("tokens", ("name", "may", "made", "last used", "revoked"), rows)


@token.command()
@click.argument("name")
@flags.json
def revoke(name: str) -> None:
    """Revoke a token at once.

    \b
    Example: shm token revoke logger
    """
    from shm.pipeline import utc_now

    with opened_store() as (_, store):
        store.upkeep.revoke_token(name, utc_now())
    answer({"name": name, "revoked": True}, f"Token {name} is revoked.")


@click.group()
def user() -> None:
    """Manage the people who may sign in.

    \b
    Example: shm user list
    """


@user.command()
@click.argument("name")
@click.option(
    "--role",
    type=click.Choice(["reader", "operator", "engineer"]),
    default="reader",
    help="An operator also uploads and acknowledges, an engineer also sets limits and users.",
)
@click.option("--single-sign-on", "vouched", is_flag=True, help="No password: by that alone.")
@flags.json
def add(name: str, role: str, vouched: bool) -> None:
    """Add a user; the password is asked for, or read from stdin.

    A password has at least 15 characters: four or five words will do.

    \b
    Example: shm user add 'M. Huber' --role engineer
    """
    from shm.pipeline import utc_now
    from shm.store.rows import Role

    with opened_store() as (_, store):
        store.people.add(name, Role(role), None if vouched else _asked(), utc_now())
    answer({"name": name, "role": role}, f"{name} may sign in as {role}.")


@user.command("list")
@flags.json
def list_users() -> None:
    """List users, their roles, and removed users.

    \b
    Example: shm user list --json
    """
    with opened_store() as (_, store):
        users = store.people.list_all()
    if flags.wants_json() or not users:
        answer({"users": [vars(each) for each in users]}, "No user has been made.")
        return
    rows = []
    for each in users:
        times = (f"{t:%Y-%m-%d %H:%M}" if t else "" for t in (each.made_at, each.removed_at))
        by = "single sign-on" if each.single_sign_on else "password"
        rows.append((each.name, each.role, by, *times))
    show_rows("users", ("name", "role", "signs in by", "made", "removed"), rows)


@user.command()
@click.argument("name")
@flags.json
def remove(name: str) -> None:
    """Remove a user and sign them out everywhere; the last engineer needs a successor first.

    \b
    Example: shm user remove 'M. Huber'
    """
    from shm.pipeline import utc_now

    with opened_store() as (_, store):
        store.people.remove(name, utc_now())
    answer({"name": name, "removed": True}, f"{name} may not sign in any more.")


@user.command()
@click.argument("name")
@flags.json
def password(name: str) -> None:
    """Set a new password, asked for or read from stdin; signs the user out everywhere.

    It has at least 15 characters.

    \b
    Example: shm user password 'M. Huber'
    """
    from shm.pipeline import utc_now

    with opened_store() as (_, store):
        store.people.set_password(name, _asked(), utc_now())
    answer({"name": name, "changed": True}, f"{name} has a new password.")


@user.command("single-sign-on")
@click.argument("name")
@flags.json
def use_single_sign_on(name: str) -> None:
    """Switch a user from password to single sign-on; signs the user out everywhere.

    \b
    Example: shm user single-sign-on ann@example.org
    """
    from shm.pipeline import utc_now

    with opened_store() as (_, store):
        store.people.set_single_sign_on(name, utc_now())
    answer({"name": name, "changed": True}, f"{name} signs in by single sign-on alone.")


def _asked() -> str:
    """Ask for a secret: an argument would be in the list of processes and the shell's history."""
    if not sys.stdin.isatty():
        return sys.stdin.readline().rstrip("\r\n")
    return str(click.prompt("Password", hide_input=True, confirmation_prompt=True, err=True))
