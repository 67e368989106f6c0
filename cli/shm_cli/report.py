"""`shm report`: the state of a hanger or the bridge on a screen, or the report that is filed."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import Any

import rich_click as click

from shm.documents import dump
from shm.errors import UsageError
from shm.pipeline import utc_now
from shm.pipeline.bridge_reporting import bridge_report
from shm.pipeline.reporting import hanger_report, modal_test_report, structure_report
from shm.report.as_text import as_brief_text, as_text
from shm.report.bridge_report import bridge_json, bridge_paper
from shm.report.hanger_report import hanger_json, hanger_paper, structure_json, structure_paper
from shm.report.modal_test_report import modal_test_json, modal_test_paper
from shm.report.paper import Paper
from shm.report.states import Period, period_since
from shm_cli import flags
from shm_cli.common import drawing, opened_store, readable_width, waiting

_SUFFIXES = {".html": "html", ".htm": "html", ".json": "json", ".pdf": "pdf"}


@dataclass(frozen=True)
class _Report:
    """A report to write: its content, paper and JSON document."""

    content: Any
    paper: Callable[[Any], Paper]
    document: Callable[[Any], dict[str, Any]]


def _written(report: _Report, form: str, revision: str, *, is_brief: bool) -> str | bytes:
    if form == "json":
        return dump(report.document(report.content))
    if form == "text":
        paper = report.paper(report.content)
        return (as_brief_text if is_brief else as_text)(paper, readable_width())
    # What draws and sets is loaded where a page is asked for.
    with drawing():
        if form == "html":
            from shm.report.as_html import as_html

            return as_html(replace(report.paper(report.content), revision=revision))
        from shm.report.as_pdf import as_pdf

        return as_pdf(replace(report.paper(report.content), revision=revision))


@click.command()
@flags.hanger()
@click.option("--bridge", "of_bridge", is_flag=True, help="Of the whole bridge, not of one hanger.")
@click.option(
    "--format",
    "form",
    type=click.Choice(["text", "html", "pdf", "json"]),
    show_default="by the suffix of --out, else text",
)
@click.option("--test", "test_id", metavar="ID", help="Of one of its tests: how it was identified.")
@click.option(
    "--since",
    metavar="WHEN",
    help="Only the period since a date (2026-03-01) or over a span (90d, 12w, 6m, 1y).",
)
@click.option("--full", "is_full", is_flag=True, help="Print all of it, not one screen.")
@click.option("--revision", metavar="TEXT", default="", help="The revision that a page names.")
@click.option("--json", "as_json", is_flag=True, help="The same as --format json.")
@click.option("--out", type=flags.NewFile(), metavar="FILE", help="Write here instead of stdout.")
def command(
    hanger_id: int | None,
    of_bridge: bool,
    form: str | None,
    test_id: str | None,
    since: str | None,
    is_full: bool,
    revision: str,
    as_json: bool,
    out: Path | None,
) -> None:
    """Print the state of a hanger or the bridge, or write its report.

    One screen: state, action, tension with its interval, change since the baseline. With --full
    everything: trend, fit, formulas of practice, quality, gap, alerts. HTML and PDF hold the
    figures. With --since, the tests, alerts and trend of a period, and what changed in it. With
    --test, how one test was identified. With --bridge, all hangers, and what explains their
    changes.

    \b
    Example: shm report --hanger 3 --since 90d --out hanger3.pdf
    Example: shm report --bridge --out bridge.html
    """
    _refuse_unclear(hanger_id, of_bridge, test_id, since)
    form = "json" if as_json else form or _SUFFIXES.get(out.suffix.lower() if out else "", "text")
    _refuse_pdf_on_a_terminal(form, out)
    now = utc_now()
    period = period_since(since, now) if since else None
    is_brief = form == "text" and not is_full and out is None
    report = _gathered(hanger_id, test_id, now, period, is_brief=is_brief)
    _write(_written(report, form, revision, is_brief=is_brief), out)


def _gathered(
    hanger_id: int | None,
    test_id: str | None,
    now: datetime,
    period: Period | None,
    *,
    is_brief: bool,
) -> _Report:
    with opened_store() as (workspace, store), waiting("gathering the numbers"):
        if hanger_id is None:
            content = bridge_report(workspace, store, now, period)
            return _Report(content, bridge_paper, bridge_json)
        if any(each.id == hanger_id for each in workspace.bridge.structures):
            _refuse_of_structure(test_id, period)
            of_structure = structure_report(workspace, store, hanger_id, now)
            return _Report(of_structure, structure_paper, structure_json)
        if test_id is None:
            of_hanger = hanger_report(workspace, store, hanger_id, now, period, is_brief=is_brief)
            return _Report(of_hanger, partial(hanger_paper, is_brief=is_brief), hanger_json)
        sheet = modal_test_report(workspace, store, hanger_id, test_id)
        return _Report(replace(sheet, generated_at=now), modal_test_paper, modal_test_json)


def _refuse_of_structure(test_id: str | None, period: Period | None) -> None:
    if test_id is not None or period is not None:
        raise UsageError(
            "a structure without a model has one report, of all its tests.",
            remedy="Leave out --test and --since.",
        )


def _write(written: str | bytes, out: Path | None) -> None:
    if out is not None:
        out.write_bytes(written if isinstance(written, bytes) else written.encode())
        click.echo(f"Wrote {out}.", err=True)
    elif isinstance(written, bytes):
        click.echo(written, nl=False)
    else:
        click.echo(written.rstrip())


def _refuse_unclear(
    hanger_id: int | None, of_bridge: bool, test_id: str | None, since: str | None
) -> None:
    if (hanger_id is None) != of_bridge:
        raise UsageError(
            "a report is of a hanger or of the bridge.",
            remedy="Give either --hanger N or --bridge.",
        )
    if of_bridge and test_id is not None:
        raise UsageError("a test is of one hanger.", remedy="Give --hanger N with --test.")
    if test_id is not None and since is not None:
        raise UsageError("one test has no period.", remedy="Give either --test or --since.")


def _refuse_pdf_on_a_terminal(form: str, out: Path | None) -> None:
    if form == "pdf" and out is None and on_a_terminal():
        raise UsageError("a PDF cannot be shown in a terminal.", remedy="Give --out FILE.pdf.")


def on_a_terminal() -> bool:
    """Return True if stdout is a terminal."""
    return sys.stdout.isatty()
