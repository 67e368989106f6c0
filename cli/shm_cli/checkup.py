"""`shm doctor` and `shm bridges`: whether all is well, of this workspace and of other bridges."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

import rich_click as click
from rich.table import Table
from rich.text import Text

from shm.errors import StoreError
from shm.pipeline import utc_now
from shm.values import printable
from shm_cli import flags
from shm_cli.common import open_workspace, paragraph, show, workspace_folder
from shm_cli.terminal import Terminal
from shm_daemon.doctor import Finding, Level, examine

_STYLES = {
    Level.OK: "green",
    Level.UNKNOWN: "dim",
    Level.WARNING: "yellow",
    Level.FAULT: "bold red",
}
_FAULT = 1


@click.command()
@flags.json
def doctor() -> int:
    """Check the installation and the workspace.

    Looks at folders, disks, store, daemon, spool, recordings, backups, clock, hooks, hangers,
    versions and other bridges; changes nothing. Exit code 0 without a fault (warnings do not
    count), 5 for a fault of the store, else 1.

    \b
    Example: shm --workspace arch doctor
    """
    findings = examine(Path(workspace_folder()), utc_now())
    if flags.wants_json():
        worst = max((each.level for each in findings), key=list(Level).index)
        show({"worst": worst, "findings": [asdict(each) for each in findings]})
    else:
        _show_findings(findings)
    faults = {each.check for each in findings if each.level is Level.FAULT}
    return StoreError.exit_code if "store" in faults else _FAULT if faults else 0


def _show_findings(findings: Sequence[Finding]) -> None:
    made = Table(box=None, show_header=False, pad_edge=False)
    for each in findings:
        remedy = f"\n-> {each.remedy}" if each.remedy else ""
        level = Text(each.level, style=_STYLES[each.level])
        made.add_row(level, Text(each.check), Text(f"{each.found}{remedy}"))
    console = Terminal(highlight=False)
    console.print(made)
    counted = Counter(each.level for each in findings)
    console.print(f"faults: {counted[Level.FAULT]}, warnings: {counted[Level.WARNING]}")


@click.command()
@flags.json
def bridges() -> None:
    """Show the state of this bridge and of the others of bridge.toml.

    The dashboard of each [[other_bridge]] is asked; one that does not answer is named, with what
    to do.

    \b
    Example: shm --workspace arch bridges
    """
    from shm_daemon.web.address import Address
    from shm_daemon.web.bridge_summary import headline, row_document, site_rows, worst_first
    from shm_daemon.web.other_bridges import ask_all
    from shm_daemon.web.site import Description, Site

    workspace = open_workspace()
    site = Site(Description(workspace), Address())
    try:
        others = ask_all(workspace.bridge.other_bridges, workspace.folder)
        rows = worst_first((*site_rows(site, utc_now()), *others))
    finally:
        site.close()
    if flags.wants_json():
        documents = [row_document(row) for row in rows]
        show({"headline": headline(rows), "bridges": documents})
        return
    click.echo(paragraph(headline(rows)))
    for row in rows:
        words = [lead.words for lead in row.leads] + ([row.summary.words] if row.summary else [])
        state = f" ({', '.join(word for word, _ in row.states)})" if row.states else ""
        click.echo(paragraph(printable(f"{row.name}{state}: {' '.join(words)}", " ")))
