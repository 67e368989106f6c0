"""`shm web`: the web interface in a process of its own."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import rich_click as click

from shm_cli import flags
from shm_cli.common import open_workspace
from shm_cli.units import print_unit, print_unit_option, serving_words


@click.command()
@click.option("--host", default="127.0.0.1", show_default=True, help="The address to listen on.")
@click.option(
    "--port", type=click.IntRange(1, 65535), default=8400, show_default=True, help="The port."
)
@flags.tls
@flags.log_file
@print_unit_option
@click.pass_context
def command(
    ctx: click.Context,
    host: str,
    port: int,
    certificate: Path | None,
    key: Path | None,
    log_file: Path | None,
    as_unit: bool,
) -> None:
    """The dashboard and its API: pages for people, upload, alerts, health and metrics.

    Open the address that it prints in a browser. Only this machine can reach it unless --host says
    otherwise; then all but /health needs a token of `shm token create`, which a person gives once
    at /sign-in. Writing (uploads, acknowledging alerts) always needs one. Runs beside the daemon,
    or with it as `shm daemon --web`.

    \b
    Example: shm --workspace arch web --port 8400
    """
    from shm_daemon.logs import begin_logging
    from shm_daemon.web.address import Address
    from shm_daemon.web.serving import leaving, serve

    workspace, address = replace(open_workspace(ctx), actor=None), Address(host, port)
    if as_unit:
        files = {"--certificate": certificate, "--key": key}
        words = ["web", *serving_words(host, port, files)]
        print_unit("shm-web.service", workspace.folder, words)
        return
    begin_logging(workspace.settings, log_file)
    page = address.page(certificate is not None)
    said = f"The dashboard: {page}  (Ctrl+C ends it)"
    with leaving():
        serve(workspace, address, certificate, key, lambda: click.echo(said))
