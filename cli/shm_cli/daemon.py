"""`shm daemon`: watches the spool and does the whole job."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import rich_click as click

from shm.errors import UsageError
from shm_cli.common import log_file_option, open_workspace, tls_options
from shm_cli.units import print_unit, print_unit_option, serving_words


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
@print_unit_option
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
    as_unit: bool,
) -> None:
    """Watch the spool and do the whole job, unattended.

    A file dropped into spool/ is archived, identified, updated and watched; alerts go to the hooks
    of bridge.toml. SIGTERM ends the daemon; what was under way goes on at the next start.

    \b
    Example: shm --workspace arch daemon
    """
    from shm_daemon.logs import begin_logging
    from shm_daemon.web.address import Address
    from shm_daemon.web.serving import web_beside

    tls = {"--certificate": certificate, "--key": key}
    if not web and any(tls.values()):
        raise UsageError("--certificate and --key are for --web.", remedy="Give --web as well.")
    workspace = replace(open_workspace(ctx, workers=workers), actor=None)
    if as_unit:
        words = [
            "daemon",
            *(["--standby"] if standby else []),
            *(["--web", *serving_words(host, port, tls)] if web else []),
            *(["--workers", str(workers)] if workers is not None else []),
        ]
        print_unit("shm.service", workspace.folder, words)
        return
    begin_logging(workspace.settings, log_file)
    address = Address(host, port) if web else None
    with web_beside(workspace, address, log_file, certificate, key):
        from shm_daemon.loop import run  # while the interface, which needs less, begins

        run(workspace, once=once, standby=standby)
