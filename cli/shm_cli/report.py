"""`shm report`: what an engineer files about a hanger."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import rich_click as click

from shm import report
from shm.documents import dump
from shm.pipeline import utc_now
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


@click.command()
@hanger_option(required=True)
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
    hanger_id: int,
    form: str | None,
    test_id: str | None,
    as_json: bool,
    out: Path | None,
) -> None:
    """What an engineer files about a hanger.

    Tension with its interval, against nominal and baseline; what changed; predicted and measured
    frequencies; the trend; the frequency response with its modes. HTML holds the figures. With
    --test, how one test was identified: hits, quality, stabilisation, shapes.

    \b
    Example: shm report --hanger 3 --format html --out hanger3.html
    """
    form = "json" if as_json else form or _FORMS.get(out.suffix if out else "", "text")
    with opened_store(ctx) as (workspace, store):
        if test_id is None:
            content = hanger_report(
                workspace, store, hanger_id, utc_now(), with_states=form == "html"
            )
            written = _WRITERS[form](content)
        else:
            written = _SHEET_WRITERS[form](test_sheet(workspace, store, hanger_id, test_id))
    if out is None:
        click.echo(written.rstrip())
    else:
        out.write_text(written, encoding="utf-8")
        click.echo(f"Wrote {out}.", err=True)
