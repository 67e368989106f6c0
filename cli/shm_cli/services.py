"""`shm daemon` and `shm web`: what serves for ever, or prints a systemd unit of itself."""

from __future__ import annotations

import re
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import rich_click as click

from shm.errors import UsageError
from shm.resources import unit_file
from shm_cli import flags
from shm_cli.common import open_workspace

print_unit_option = click.option(
    "--print-unit",
    "as_unit",
    is_flag=True,
    help="Only print a systemd unit that begins it with the other options given here.",
)


@click.command()
@click.option("--once", is_flag=True, help="End when nothing is left to do.")
@click.option(
    "--standby", is_flag=True, help="Wait while another serves the store; take over when it ends."
)
@click.option("--web", "with_web", is_flag=True, help="Serve the web interface too: see `shm web`.")
@click.option("--host", default="127.0.0.1", help="Where --web listens.")
@click.option("--port", type=click.IntRange(1, 65535), default=8400, help="Its port.")
@click.option("--workers", type=click.IntRange(1, 64), help="Processes that identify and update.")
@flags.log_file
@print_unit_option
def daemon(
    once: bool,
    standby: bool,
    with_web: bool,
    host: str,
    port: int,
    workers: int | None,
    log_file: Path | None,
    as_unit: bool,
) -> None:
    """Watch the spool and process every file.

    A file dropped into spool/ is archived, identified, updated and watched; alerts go to the hooks
    of bridge.toml. SIGTERM ends the daemon; what was under way goes on at the next start.

    \b
    Example: shm --workspace arch daemon
    """
    from shm_daemon.logs import begin_logging
    from shm_daemon.web.address import Address
    from shm_daemon.web.serving import web_with_daemon

    workspace = replace(open_workspace(workers=workers), actor=None)
    if as_unit:
        words = [
            "daemon",
            *(["--standby"] if standby else []),
            *(["--web", *serving_words(host, port)] if with_web else []),
            *(["--workers", str(workers)] if workers is not None else []),
        ]
        print_unit("shm.service", workspace.folder, words)
        return
    begin_logging(workspace.settings, log_file)
    address = Address(host, port) if with_web else None
    with web_with_daemon(workspace, address, log_file):
        from shm_daemon.loop import run  # while the interface, which needs less, begins

        run(workspace, once=once, standby=standby)


@click.command()
@click.option("--host", default="127.0.0.1", help="The address to listen on.")
@click.option("--port", type=click.IntRange(1, 65535), default=8400, help="The port.")
@flags.log_file
@print_unit_option
def web(
    host: str,
    port: int,
    log_file: Path | None,
    as_unit: bool,
) -> None:
    """Serve the dashboard and its API.

    Open the printed address in a browser. Without --host only this machine can reach it. With
    --host everything but /health needs a sign-in: a user of `shm user add` or a token of
    `shm token create`. Writing (uploads, acknowledging alerts) always needs one. It runs as a
    separate process, or with the daemon as `shm daemon --web`.

    \b
    Example: shm --workspace arch web --port 8400
    """
    from shm_daemon.logs import begin_logging
    from shm_daemon.web.address import Address
    from shm_daemon.web.serving import leaving, serve

    workspace, address = replace(open_workspace(), actor=None), Address(host, port)
    if as_unit:
        print_unit("shm-web.service", workspace.folder, ["web", *serving_words(host, port)])
        return
    begin_logging(workspace.settings, log_file)
    line = f"The dashboard: {address.page()}  (Ctrl+C ends it)"
    with leaving():
        serve(workspace, address, lambda: click.echo(line))


_HOMES = (Path("/home"), Path("/root"), Path("/run/user"))
_OF_ROOT = "# The workspace belongs to root: better give it to a user who can harm nothing else."
_PLAIN = re.compile(r"[A-Za-z0-9_./:@+,=-]+")


def print_unit(name: str, workspace: Path, words: Sequence[str], *writes: Path) -> None:
    """Print the unit `name` of the shm that runs here: see `unit_text`; warn of root."""
    text = unit_text(name, workspace, Path(sys.prefix), words, *writes)
    if _OF_ROOT in text:
        click.echo(
            f"Warning: {workspace} belongs to root, so this service runs as root, and so do the "
            "programs of its hooks. Give the workspace to a user of its own and print the unit "
            f"again: useradd --system shm; chown -R shm {workspace}",
            err=True,
        )
    click.echo(text, nl=False)


def serving_words(host: str, port: int) -> Sequence[str]:
    """Return the address of the web interface as options."""
    return ["--host", host, "--port", str(port)]


def unit_text(name: str, workspace: Path, prefix: Path, words: Sequence[str], *writes: Path) -> str:
    """Return the unit `name` for a workspace, with the shm installed under `prefix`.

    It calls `shm` with `words` as the owner of the workspace, and may write to the workspace and
    to `writes`. Raises UsageError where a path or a word holds what a unit would have to quote.
    """
    folder, room = str(workspace), [str(workspace), *map(str, writes)]
    _refuse_odd((*room, str(prefix), *words))
    values = {
        "ExecStart": " ".join(["/usr/bin/env", "shm", *words]),
        "Environment=PATH": f"{prefix}/bin:/usr/local/bin:/usr/bin:/bin",
        "Environment=SHM_WORKSPACE": folder,
        "WorkingDirectory": folder,
        "ReadWritePaths": " ".join(room),
        "User": workspace.owner(),
    }
    paths = [each.resolve() for each in (workspace, prefix, *writes)]
    if any(path.is_relative_to(home) for path in paths for home in _HOMES):
        values["ProtectHome"] = "read-only"  # hidden homes would hide what it works with
    text = unit_file(name).read_text(encoding="utf-8")
    for key, value in values.items():
        line = re.compile(rf"^{re.escape(key)}=.*$", re.MULTILINE)
        text = line.sub(lambda _, key=key, value=value: f"{key}={value}", text, count=1)  # type: ignore[misc]
    return text.replace("\nUser=root\n", f"\n{_OF_ROOT}\nUser=root\n")


def _refuse_odd(texts: Sequence[str]) -> None:
    for text in texts:
        if not _PLAIN.fullmatch(text):
            raise UsageError(
                f"{text!r} would have to be quoted in a unit.",
                remedy="Use paths without spaces, or write it by hand from config/shm.service.",
            )
