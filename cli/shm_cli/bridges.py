"""`shm bridges`: this bridge and those of `[[other_bridge]]`, the worst first."""

from __future__ import annotations

import rich_click as click

from shm.pipeline import utc_now
from shm.values import printable
from shm_cli import flags
from shm_cli.common import open_workspace, paragraph, show


@click.command()
@flags.json
@click.pass_context
def command(ctx: click.Context) -> None:
    """How this bridge and the others of bridge.toml are, the worst first.

    The dashboard of each [[other_bridge]] is asked; one that does not answer is named, with what
    to do.

    \b
    Example: shm --workspace arch bridges
    """
    from shm_daemon.web.address import Address
    from shm_daemon.web.bridge_summary import headline, own_row, row_document, worst_first
    from shm_daemon.web.other_bridges import ask_all
    from shm_daemon.web.site import Description, Site

    workspace = open_workspace(ctx)
    site = Site(Description(workspace), Address())
    try:
        others = ask_all(workspace.bridge.other_bridges, workspace.folder)
        rows = worst_first((*own_row(site, utc_now()), *others))
    finally:
        site.close()
    if flags.wants_json():
        documents = [row_document(row) for row in rows]
        show({"headline": headline(rows), "bridges": documents})
        return
    click.echo(paragraph(headline(rows)))
    for row in rows:
        said = [lead.words for lead in row.leads] + ([row.summary.words] if row.summary else [])
        state = f" ({', '.join(word for word, _ in row.states)})" if row.states else ""
        click.echo(paragraph(printable(f"{row.name}{state}: {' '.join(said)}", " ")))
