"""`shm daemon`: watches the spool and does the whole job."""

from __future__ import annotations

import re
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import rich_click as click

from shm.errors import UsageError
from shm.resources import service_unit
from shm_cli.common import log_file_option, open_workspace, tls_options

if TYPE_CHECKING:
    from shm_daemon.web.address import Address


@click.command()
@click.option("--once", is_flag=True, help="End when nothing is left to do.")
@click.option(
    "--standby", is_flag=True, help="Wait while another serves the store; take over when it ends."
)
@click.option("--web", is_flag=True, help="Serve the web interface too: see `shm web`.")
@click.option("--host", default="127.0.0.1", show_default=True, help="Where --web listens.")
@click.option(
    "--port", type=click.IntRange(1, 65535), default=8400, show_default=True, help="Its port."
)
@tls_options
@click.option("--workers", type=click.IntRange(1, 64), help="Processes that identify and update.")
@log_file_option
@click.option(
    "--print-unit",
    is_flag=True,
    help="Only print a systemd unit that begins it with the other options given here.",
)
@click.pass_context
def command(
    ctx: click.Context,
    once: bool,
    standby: bool,
    web: bool,
    host: str,
    port: int,
    certificate: Path | None,
    key: Path | None,
    workers: int | None,
    log_file: Path | None,
    print_unit: bool,
) -> None:
    """Watch the spool and do the whole job, unattended.

    A file dropped into spool/ is archived, identified, updated and watched; alerts go to the hooks
    of bridge.toml. SIGTERM ends the daemon; what was under way goes on at the next start.

    \b
    Example: shm --workspace arch daemon
    """
    from shm_daemon.logs import begin_logging
    from shm_daemon.web.address import Address
    from shm_daemon.web.web_process import web_beside

    tls = {"--certificate": certificate, "--key": key}
    if not web and any(tls.values()):
        raise UsageError("--certificate and --key are for --web.", remedy="Give --web as well.")
    workspace = open_workspace(ctx, workers=workers)
    if print_unit:
        options = _options(standby, web, Address(host, port), tls, workers)
        click.echo(unit_text(workspace.folder, Path(sys.prefix), options), nl=False)
        return
    begin_logging(workspace.settings, log_file)
    address = Address(host, port) if web else None
    with web_beside(workspace, address, log_file, certificate, key):
        from shm_daemon.loop import run  # while the interface, which needs less, begins

        run(workspace, once=once, standby=standby)


def _options(
    standby: bool,
    web: bool,
    address: Address,
    tls: Mapping[str, Path | None],
    workers: int | None,
) -> Sequence[str]:
    """The options as they are typed, with paths that hold from everywhere."""
    place = ["--web", "--host", address.host, "--port", str(address.port)]
    files = [str(word) for name, file in tls.items() if file for word in (name, file.resolve())]
    return [
        *(["--standby"] if standby else []),
        *([*place, *files] if web else []),
        *(["--workers", str(workers)] if workers is not None else []),
    ]


_HOMES = (Path("/home"), Path("/root"), Path("/run/user"))
_PLAIN = re.compile(r"[A-Za-z0-9_./:@+,=-]+")


def unit_text(workspace: Path, prefix: Path, options: Sequence[str] = ()) -> str:
    """The unit for a workspace, with the shm installed under `prefix` and options of `shm daemon`;
    it runs as the owner of the workspace.

    Raises UsageError where a path or an option holds what a unit would have to quote.
    """
    folder = str(workspace)
    _refuse_odd((folder, str(prefix), *options))
    values = {
        "ExecStart": " ".join(["/usr/bin/env", "shm", "daemon", *options]),
        "Environment=PATH": f"{prefix}/bin:/usr/local/bin:/usr/bin:/bin",
        "Environment=SHM_WORKSPACE": folder,
        "WorkingDirectory": folder,
        "ReadWritePaths": folder,
        "User": workspace.owner(),
    }
    if _is_in_a_home(workspace) or _is_in_a_home(prefix):
        values["ProtectHome"] = "read-only"  # hidden homes would hide workspace or program
    text = service_unit().read_text(encoding="utf-8")
    for key, value in values.items():
        line = re.compile(rf"^{re.escape(key)}=.*$", re.MULTILINE)
        text = line.sub(lambda _, key=key, value=value: f"{key}={value}", text, count=1)  # type: ignore[misc]
    return text


def _is_in_a_home(path: Path) -> bool:
    return any(path.resolve().is_relative_to(home) for home in _HOMES)


def _refuse_odd(texts: Sequence[str]) -> None:
    for text in texts:
        if not _PLAIN.fullmatch(text):
            raise UsageError(
                f"{text!r} would have to be quoted in a unit.",
                remedy="Use paths without spaces, or write it by hand from config/shm.service.",
            )
