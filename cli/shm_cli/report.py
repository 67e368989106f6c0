"""`shm report`: what an engineer files about a hanger or the bridge."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import rich_click as click

from shm import report
from shm.documents import dump
from shm.errors import UsageError
from shm.pipeline import utc_now
from shm.pipeline.bridge_reporting import bridge_report
from shm.pipeline.reporting import hanger_report, test_sheet
from shm_cli.common import hanger_option, opened_store

_SHEET_WRITERS: dict[str, Callable[[report.TestSheet], str]] = {
    "text": report.test_text,
    "html": report.test_page,
    "json": lambda sheet: dump(report.test_json(sheet)),
}
_FORMS = {".html": "html", ".htm": "html", ".json": "json"}
_WRITERS: dict[str, Callable[[report.HangerReport], str]] = {
    "text": report.text,
    "html": report.html,
    "json": lambda content: dump(report.json(content)),
}


_BRIDGE_WRITERS: dict[str, Callable[[report.BridgeReport], str]] = {
    "text": report.bridge_text,
    "html": report.bridge_page,
    "json": lambda content: dump(report.bridge_json(content)),
}


@click.command()
@hanger_option()
@click.option("--bridge", "of_bridge", is_flag=True, help="Of the whole bridge, not of one hanger.")
@click.option(
    "--format",
    "form",
    type=click.Choice(["text", "html", "json"]),
    show_default="by the suffix of --out, else text",
)
@click.option("--test", "test_id", metavar="ID", help="Of one of its tests: how it was identified.")
@click.option("--json", "as_json", is_flag=True, help="The same as --format json.")
@click.option(
    "--out",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE",
    help="Write here instead of stdout.",
)
@click.pass_context
def command(
    ctx: click.Context,
    hanger_id: int | None,
    of_bridge: bool,
    form: str | None,
    test_id: str | None,
    as_json: bool,
    out: Path | None,
) -> None:
    """What an engineer files about a hanger, or the bridge.

    Tension with its interval, against nominal and baseline; what changed, how it goes with the
    temperature, what the hangers beside it did; predicted and measured frequencies; the trend; the
    frequency response with its modes. HTML holds the figures. With --test, how one test was
    identified: hits, quality, stabilisation, shapes. With --bridge, all hangers: their state, who
    lost and who gained tension, and what explains it.

    \b
    Example: shm report --hanger 3 --out hanger3.html
    Example: shm report --bridge --out bridge.html
    """
    _refuse_unclear(hanger_id, of_bridge, test_id)
    form = "json" if as_json else form or _FORMS.get(out.suffix if out else "", "text")
    with opened_store(ctx) as (workspace, store):
        if hanger_id is None:
            written = _BRIDGE_WRITERS[form](bridge_report(workspace, store, utc_now()))
        elif test_id is None:
            written = _WRITERS[form](hanger_report(workspace, store, hanger_id, utc_now()))
        else:
            written = _SHEET_WRITERS[form](test_sheet(workspace, store, hanger_id, test_id))
    if out is None:
        click.echo(written.rstrip())
    else:
        out.write_text(written, encoding="utf-8")
        click.echo(f"Wrote {out}.", err=True)


def _refuse_unclear(hanger_id: int | None, of_bridge: bool, test_id: str | None) -> None:
    if (hanger_id is None) != of_bridge:
        raise UsageError("of what?", remedy="Give either --hanger N or --bridge.")
    if of_bridge and test_id is not None:
        raise UsageError("a test is of one hanger.", remedy="Give --hanger N with --test.")
