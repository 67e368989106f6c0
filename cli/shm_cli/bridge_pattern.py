"""`shm drift bridge`: which hangers gained and lost tension, and what explains it."""

from __future__ import annotations

from pathlib import Path

import rich_click as click

from shm.pipeline.bridge_reporting import stored_pattern
from shm.report.bridge_report import pattern_json
from shm.report.figures.along_the_bridge import bridge_illustration
from shm.report.shifts import pattern_tables
from shm_cli.common import json_option, opened_store, paragraph, show, show_texts
from shm_cli.writable import NewFile


@click.command("bridge")
@json_option
@click.option(
    "--figure",
    type=NewFile(),
    metavar="FILE.png",
    help="Write the elevation of the bridge, hangers coloured by their shift, as a picture.",
)
@click.pass_context
def command(ctx: click.Context, as_json: bool, figure: Path | None) -> None:
    """Which hangers gained and which lost, and whether it is the bridge at all.

    Compares the latest tension shift of each hanger with its neighbours': one hanger that sheds
    load, one that gains it, all alike (a temperature or a clock), or each by itself. Hangers stand
    along the bridge as in bridge.toml; tests more than 30 days older than the newest are left out.
    `shm report --bridge --out bridge.html` shows the same with the elevation of the bridge.

    \b
    Example: shm drift bridge
    """
    with opened_store(ctx) as (workspace, store):
        pattern = stored_pattern(store, [hanger.id for hanger in workspace.bridge.hangers])
    if figure is not None:
        figure.write_bytes(bridge_illustration(pattern).png())
        click.echo(f"Wrote {figure}.", err=True)
    if as_json:
        show(pattern_json(pattern))
        return
    for each in pattern_tables(pattern):
        show_texts(each)
    for sentence in (pattern.sentence, *pattern.remarks):
        click.echo(paragraph(sentence))
