"""`shm drift bridge`: which hangers gained and lost tension, and what explains it."""

from __future__ import annotations

import math
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import rich_click as click

from shm.report.figures.bridge_shift import bridge_illustration
from shm.values import NAN
from shm.watch.neighbours import BridgePattern, HangerRow, bridge_pattern, shifts_of
from shm_cli.common import json_option, opened_store, show, show_table, table

if TYPE_CHECKING:
    from shm.store import Baseline, Store

SCHEMA = "shm.bridge_pattern/1"


@click.command("bridge")
@json_option
@click.option(
    "--figure",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE.png",
    help="Write the elevation of the bridge, hangers coloured by their shift.",
)
@click.pass_context
def command(ctx: click.Context, as_json: bool, figure: Path | None) -> None:
    """Which hangers gained and which lost, and whether it is the bridge at all.

    Compares the latest tension shift of each hanger with its neighbours': one hanger that sheds
    load, one that gains it, all alike (a temperature or a clock), or each by itself. Hangers stand
    along the bridge as in bridge.toml; tests more than 30 days older than the newest are left out.

    \b
    Example: shm drift bridge --figure bridge.png
    """
    with opened_store(ctx) as (workspace, store):
        order = [hanger.id for hanger in workspace.bridge.hangers]
        pattern = _pattern(store, order)
    if figure is not None:
        figure.write_bytes(bridge_illustration(pattern).png())
    if as_json:
        show(pattern_document(pattern))
        return
    _show(pattern)


def pattern_document(pattern: BridgePattern) -> dict[str, Any]:
    """What `shm drift bridge --json` prints."""
    return {"schema": SCHEMA, **asdict(pattern)}


def _pattern(store: Store, order: list[int]) -> BridgePattern:
    baselines = {hanger: store.baseline(hanger) for hanger in order}
    watched = {
        hanger: store.watches(hanger, baseline.id)
        for hanger, baseline in baselines.items()
        if baseline is not None
    }
    drifts = {
        hanger: [drift for watch in watches for drift in watch.watched.drifts]
        for hanger, watches in watched.items()
    }
    changes = {
        hanger: watches[-1].watched.temperature_c - _before_c(store, hanger, baselines[hanger])
        for hanger, watches in watched.items()
        if watches
    }
    return bridge_pattern(shifts_of(drifts, order, temperature_changes_k=changes), order)


def _before_c(store: Store, hanger: int, baseline: Baseline | None) -> float:
    """Mean temperature of the baseline's tests; NaN where none is known."""
    names = baseline.posterior.tests if baseline else ()
    temperatures = [
        each.test.temperature_c for each in store.tests(hanger) if each.test.id in names
    ]
    known = [value for value in temperatures if math.isfinite(value)]
    return sum(known) / len(known) if known else NAN


def _show(pattern: BridgePattern) -> None:
    made = table(
        "shifts along the bridge", "hanger", "test of", "shift (kN)", "90 % interval", "shift (%)",
        "90 % interval", "", "probability",
    )  # fmt: skip
    for row in pattern.rows:
        made.add_row(*_cells(row))
    for each in pattern.not_compared:
        made.add_row(
            str(each.hanger), f"{each.time:%Y-%m-%d}" if each.time else "none", *[""] * 4,
            "not compared", "",
        )  # fmt: skip
    show_table(made)
    why = table("what explains them", "explanation", "probability")
    for explanation in pattern.explanations:
        why.add_row(explanation.name, f"{explanation.probability:.3f}")
    show_table(why)
    for sentence in (pattern.sentence, *pattern.remarks):
        click.echo(sentence)


def _cells(row: HangerRow) -> tuple[str, ...]:
    kilonewtons = (value / 1e3 for value in (row.shift_n, row.low_n, row.high_n))
    percents = (100 * value for value in (row.shift_fraction, row.low_fraction, row.high_fraction))
    return (
        str(row.hanger),
        f"{row.time:%Y-%m-%d}",
        *_with_interval(*kilonewtons),
        *_with_interval(*percents),
        row.way,
        f"{row.probability:.2f}",
    )


def _with_interval(mean: float, low: float, high: float) -> tuple[str, str]:
    return f"{mean:+.1f}", f"{low:+.1f} to {high:+.1f}"
