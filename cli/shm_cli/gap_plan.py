"""`shm gap plan`: what to measure next on a hanger, in which order, at which cost."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from itertools import accumulate
from pathlib import Path
from typing import Any

import numpy as np
import rich_click as click

from shm.bridge import load_bridge
from shm.gap import GapOptions
from shm.gap.diagnose import examined
from shm.gap.measurement_plan import PlannedMeasurement, Race, nothing_planned, planned
from shm.values import Hanger, ModalTest
from shm_cli import completion, flags
from shm_cli.common import (
    advancing_bar,
    answer,
    latest_tests,
    one_hanger,
    open_workspace,
    opened_store,
    show_rows,
    tests_and_hanger,
)

baseline_option = click.option(
    "--baseline",
    metavar="NAME",
    default=GapOptions().baseline,
    show_default=True,
    shell_complete=completion.models,
    help="The model class whose gap is diagnosed.",
)
without_option = click.option(
    "--without",
    multiple=True,
    metavar="EFFECT",
    shell_complete=completion.effects,
    help="Take an effect out of the catalogue; may be given again.",
)

_LATEST = 20  # as `shm gap diagnose`
_HEADS = ("measurement", "hours", "in all", "promised log odds", "then", "probability")


@click.command()
@click.argument("file", metavar="[MODES.json]", required=False, type=flags.FILE)
@flags.hanger()
@flags.hanger_file
@click.option(
    "--budget",
    "budget_hours",
    type=click.FloatRange(0.0, min_open=True),
    metavar="HOURS",
    help="Hours of a crew that the plan may cost.  [default: as many as it takes]",
)
@baseline_option
@without_option
@flags.seed
@flags.json
@click.pass_context
def plan(
    ctx: click.Context,
    file: Path | None,
    hanger_id: int | None,
    hanger_file: Path | None,
    budget_hours: float | None,
    baseline: str,
    without: tuple[str, ...],
    seed: int,
) -> None:
    """The next measurements in order, each with its cost and what it promises.

    Of MODES.json, or of the latest 20 tests of a hanger of the workspace. Hours of each kind of
    measurement stand in the table [measurement_hours] of the bridge file.

    \b
    Example: shm gap plan hanger3.modes.json --hanger-file H.toml --budget 8
    """
    tests, hanger = _measured(ctx, file, hanger_file, hanger_id)
    bridge = load_bridge(hanger_file) if hanger_file is not None else open_workspace(ctx).bridge
    options = GapOptions(baseline, without, seed=seed)
    with advancing_bar() as progress:
        diagnosis, attribution = examined(tests, hanger, options, progress)
    race = Race.of(attribution, np.random.default_rng(seed))
    most_hours = budget_hours or np.inf
    steps = planned(race, bridge.measurement_hours, most_hours)
    rows = _rows(steps)
    if flags.wants_json() or not steps:
        answer(
            {"hanger": diagnosis.hanger, "baseline": baseline, "seed": seed, "steps": rows},
            "" if steps else nothing_planned(race, bridge.measurement_hours, most_hours),
        )
        return
    cells = [
        (
            row["what"], f"{row['hours']:g}", f"{row['hours_in_all']:g}",
            f"{row['promised_log_odds']:+.1f}", f"{row['log_odds']:.1f}",
            f"{row['probability']:.2f}",
        )
        for row in rows
    ]  # fmt: skip
    show_rows("Next measurements", _HEADS, cells)
    click.echo(
        "Of the true explanation against all others, averaged over which it is; make the first, "
        "diagnose, and plan anew."
    )


def _measured(
    ctx: click.Context, file: Path | None, hanger_file: Path | None, hanger_id: int | None
) -> tuple[Sequence[ModalTest], Hanger]:
    """The tests and their hanger, those of the workspace as `shm gap diagnose` takes them."""
    if file is not None:
        return tests_and_hanger(ctx, file, hanger_file, hanger_id)
    hanger = one_hanger(ctx, hanger_file, hanger_id)
    with opened_store(ctx) as (_, store):
        return [each.test for each in latest_tests(store, hanger, _LATEST)], hanger


def _rows(steps: Sequence[PlannedMeasurement]) -> list[dict[str, Any]]:
    spent = accumulate(step.hours for step in steps)
    return [
        asdict(step) | {"hours_in_all": hours} for step, hours in zip(steps, spent, strict=True)
    ]
