"""`shm drift`: how far tension and end stiffness have moved from their baseline, and setting it."""

from __future__ import annotations

import rich_click as click

from shm.documents import drift_document
from shm.errors import NothingThere
from shm.values import Drift
from shm_cli.bridge_pattern import command as bridge
from shm_cli.common import hanger_option, json_option, opened_store, show, show_table, table
from shm_cli.rebaseline import rebaseline


@click.group(invoke_without_command=True)
@hanger_option()
@click.option("--all", "all_tests", is_flag=True, help="All tests, not each hanger's latest.")
@json_option
@click.pass_context
def command(ctx: click.Context, hanger_id: int | None, all_tests: bool, as_json: bool) -> None:
    """How far tension and stiffness have moved.

    The shift of the latest test of each hanger from its baseline: tension as a fraction, end
    stiffness in decades, with the probability that it lies beyond the threshold.

    \b
    Example: shm drift --hanger 3 --all
    """
    if ctx.invoked_subcommand is not None:
        return
    with opened_store(ctx) as (workspace, store):
        if hanger_id is not None:
            workspace.bridge.hanger(hanger_id)
        drifts = store.drifts(hanger_id)
    if not drifts:
        raise NothingThere(
            "no test has been compared with a baseline yet.",
            remedy="Take in more tests: the first ones of a hanger form its baseline.",
        )
    shown = drifts if all_tests else _latest(drifts)
    if as_json:
        show({"drifts": [drift_document(drift) for drift in shown]})
        return
    made = table(
        "shift from the baseline", "hanger", "time", "quantity", "shift", "sd", "threshold",
        "probability beyond",
    )  # fmt: skip
    for drift in shown:
        made.add_row(
            str(drift.hanger),
            f"{drift.time:%Y-%m-%d %H:%M}",
            drift.quantity.replace("_", " "),
            *(_shift(drift, value) for value in (drift.shift_mean, drift.shift_sd)),
            _shift(drift, drift.threshold),
            f"{drift.probability:.3f}",
        )
    show_table(made)


command.add_command(rebaseline)
command.add_command(bridge)


def _latest(drifts: tuple[Drift, ...]) -> list[Drift]:
    """Of each hanger's latest test: an earlier one may have been watched in another class."""
    newest = {drift.hanger: drift.test for drift in drifts}
    latest = [drift for drift in drifts if newest[drift.hanger] == drift.test]
    return sorted(latest, key=lambda drift: drift.hanger)


def _shift(drift: Drift, value: float) -> str:
    return f"{value:.2%}" if drift.quantity == "tension" else f"{value:.2f} decades"
