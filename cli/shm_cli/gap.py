"""`shm gap`: why model and measurement differ, what that does to tension, what to measure next."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, replace
from functools import partial
from itertools import accumulate
from pathlib import Path
from typing import Any

import numpy as np
import rich_click as click

from shm.bridge import load_bridge
from shm.errors import NothingThere, UsageError
from shm.gap import GapOptions, diagnose_bridge
from shm.gap import diagnose as diagnosed
from shm.gap.bridge.shared_causes import LEAST
from shm.gap.diagnose import examined
from shm.gap.next_measurement.measurement_plan import (
    PlannedMeasurement,
    Race,
    nothing_planned,
    planned,
)
from shm.pipeline import utc_now
from shm.pipeline.diagnosing import ChosenTests, choose_tests, diagnose_stored, keep_diagnosis
from shm.report.as_html import as_html
from shm.report.as_text import as_text
from shm.report.bridge_diagnosis_report import bridge_diagnosis_json, bridge_diagnosis_paper
from shm.report.contents import BridgeDiagnosisSheet, DiagnosisSheet
from shm.report.diagnosis_report import FIGURES as OF_DIAGNOSIS
from shm.report.diagnosis_report import diagnosis_json, diagnosis_paper
from shm.report.figures.gap_causes import SHARED
from shm.report.figures.specification import Illustration, drawn
from shm.report.paper import Paper
from shm.store import Store
from shm.store.tests import load_frequency_response
from shm.values import Diagnosis, Hanger, ModalTest, ResponsePoint
from shm.values.bar_description import describe_bar, list_sensors
from shm_cli import completion, flags
from shm_cli.adopt import adopt, adopted, drop
from shm_cli.common import (
    answer,
    drawing,
    one_hanger,
    open_workspace,
    opened_store,
    progress_bar,
    readable_width,
    show_doubts,
    show_rows,
    tests_and_hanger,
    write_pictures,
)
from shm_cli.effects import effects
from shm_cli.gap_check import check

_without = click.option(
    "--without",
    multiple=True,
    metavar="EFFECT",
    shell_complete=completion.effects,
    help="Take an effect out of the catalogue; may be given again.",
)

_all_tests = click.option(
    "--all-tests",
    is_flag=True,
    help="Take tests from before the last change that the watch reports, too.",
)

_HEADS = ("measurement", "hours", "in all", "promised log odds", "then", "probability")


@click.group()
def command() -> None:
    """Find out why model and measurement differ.

    \b
    Example: shm gap diagnose hanger3.modes.json
    """


@command.command()
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
@flags.baseline
@_without
@_all_tests
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
    all_tests: bool,
    seed: int,
) -> None:
    """Rank the next measurements, each with its cost and expected benefit.

    Uses MODES.json, or the latest tests of a hanger of the workspace since its last change, 20 at
    most. State the hours of each kind of measurement in the table [measurement_hours] of
    bridge.toml.

    \b
    Example: shm gap plan hanger3.modes.json --hanger-file H.toml --budget 8
    """
    tests, hanger, remark = _measured(ctx, file, hanger_file, hanger_id, every=all_tests)
    bridge = load_bridge(hanger_file) if hanger_file is not None else open_workspace(ctx).bridge
    options = GapOptions(baseline, without, seed=seed)
    with progress_bar() as progress:
        diagnosis, attribution = examined(tests, hanger, options, progress)
    if remark:
        click.echo(remark, err=True)
    race = Race.of(attribution, np.random.default_rng(seed))
    most_hours = budget_hours or np.inf
    steps = planned(race, bridge.measurement_hours, most_hours)
    rows = _rows(steps)
    if flags.wants_json() or not steps:
        answer(
            {
                "hanger": diagnosis.hanger,
                "baseline": diagnosis.baseline,
                "seed": seed,
                "steps": rows,
            },
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
        f"Baseline {diagnosis.baseline}. Of the true explanation against all others, averaged over "
        "which it is; make the first, diagnose, and plan again."
    )


def _measured(
    ctx: click.Context,
    file: Path | None,
    hanger_file: Path | None,
    hanger_id: int | None,
    *,
    every: bool,
) -> tuple[Sequence[ModalTest], Hanger, str]:
    """Return the tests, their hanger and a remark on those left out, as `shm gap diagnose` does."""
    if file is not None:
        return *tests_and_hanger(ctx, file, hanger_file, hanger_id), ""
    hanger = one_hanger(ctx, hanger_file, hanger_id)
    with opened_store(ctx) as (_, store):
        chosen = choose_tests(store, hanger, every=every)
        return chosen.tests, hanger, chosen.remark


def _rows(steps: Sequence[PlannedMeasurement]) -> list[dict[str, Any]]:
    spent = accumulate(step.hours for step in steps)
    return [
        asdict(step) | {"hours_in_all": hours} for step, hours in zip(steps, spent, strict=True)
    ]


@command.command()
@click.argument(
    "files", metavar="[MODES.json] [H.toml MODES.json H.toml ...]", nargs=-1, type=flags.FILE
)
@flags.hanger()
@flags.hanger_file
@click.option("--bridge", is_flag=True, help="All hangers of the workspace together.")
@flags.baseline
@_without
@click.option(
    "--hold-out",
    multiple=True,
    metavar="TEST|ORDER",
    show_default="every order and every test in turn",
    help="Leave a test or an order of modes out of the fit and predict it; may be given again.",
)
@flags.latest
@_all_tests
@flags.seed
@click.option(
    "--html", type=flags.NewFile(), metavar="FILE", help="Write a page with all figures here."
)
@flags.figures
@flags.json
@click.pass_context
def diagnose(
    ctx: click.Context,
    files: tuple[Path, ...],
    hanger_id: int | None,
    hanger_file: Path | None,
    bridge: bool,
    baseline: str,
    without: tuple[str, ...],
    hold_out: tuple[str, ...],
    count: int,
    all_tests: bool,
    seed: int,
    html: Path | None,
    figures: Path | None,
) -> None:
    """Diagnose the gap: where it is, its causes, how far they shrink it, what to measure next.

    Give MODES.json with --hanger-file, or a hanger of the workspace: its latest tests since the
    last change that the watch reports are used, and the diagnosis is stored for its report and for
    `shm gap adopt`. The answer gives a probability to every effect of the catalogue, to no gap, and
    to something that the catalogue lacks.

    With --bridge, or with several MODES.json, each followed by its H.toml: the cause that hangers
    share, which of them have it, and what it means for their tensions.

    \b
    Example: shm gap diagnose hanger3.modes.json --hanger-file H.toml --html gap.html
    Example: shm gap diagnose h1.modes.json h1.toml h2.modes.json h2.toml
    Example: shm --workspace arch gap diagnose --bridge --html bridge.html
    """
    options = GapOptions(baseline, without, hold_out, seed=seed)
    if bridge or len(files) > 1:
        joint = _jointly(ctx, files, bridge, (hanger_id, hanger_file), (count, all_tests), options)
        draw = partial(drawn, (SHARED,), joint.diagnosis)
        _show(bridge_diagnosis_paper(joint), bridge_diagnosis_json(joint), draw, html, figures)
        return
    if not files:
        sheet = _of_workspace(
            ctx, one_hanger(ctx, hanger_file, hanger_id), (count, all_tests), options
        )
    else:
        tests, hanger = tests_and_hanger(ctx, files[0], hanger_file, hanger_id)
        found = _diagnosis(tests, hanger, options)
        sheet = DiagnosisSheet(found, hanger, sensors=_sensors(tests))
    draw = partial(drawn, OF_DIAGNOSIS, sheet)
    _show(diagnosis_paper(sheet), diagnosis_json(sheet), draw, html, figures)


for _verb in (adopt, adopted, check, drop, effects):
    command.add_command(_verb)


def _of_workspace(
    ctx: click.Context, hanger: Hanger, latest: tuple[int, bool], options: GapOptions
) -> DiagnosisSheet:
    """Return the diagnosis of the latest tests, which the store keeps.

    `latest` says how many at most, and if from before the last change, too.
    """
    with opened_store(ctx) as (workspace, store):
        chosen = choose_tests(store, hanger, latest[0], every=latest[1])
        with progress_bar() as progress:
            found = diagnose_stored(store, chosen, hanger, options, utc_now(), progress)
        sensors = _stored_sensors(store, chosen)
    return DiagnosisSheet(found, hanger, workspace.bridge.name, sensors)


def _sensors(tests: Sequence[ModalTest]) -> tuple[ResponsePoint, ...]:
    """Return the sensors of all tests, each once."""
    return tuple(dict.fromkeys(point for test in tests for point in list_sensors(test)))


def _stored_sensors(store: Store, chosen: ChosenTests) -> tuple[ResponsePoint, ...]:
    """Return the sensors of all tests as their recordings had them, each once."""
    responses = ((each.test, load_frequency_response(store, each)) for each in chosen.stored)
    return tuple(dict.fromkeys(p for test, found in responses for p in list_sensors(test, found)))


def _diagnosis(tests: Sequence[ModalTest], hanger: Hanger, options: GapOptions) -> Diagnosis:
    with progress_bar() as progress:
        return diagnosed(tests, hanger, options, progress)


def _jointly(
    ctx: click.Context,
    files: tuple[Path, ...],
    bridge: bool,
    one: tuple[int | None, Path | None],
    latest: tuple[int, bool],
    options: GapOptions,
) -> BridgeDiagnosisSheet:
    """Diagnose several hangers together: of files, or all of the workspace, which stores each."""
    if (bridge and files) or any(each is not None for each in one):
        raise UsageError(
            "--bridge takes all hangers of the workspace, several files name theirs.",
            remedy="Give MODES.json H.toml pairs alone, or --bridge alone.",
        )
    if bridge:
        return _of_bridge(ctx, latest, options)
    found = [tests_and_hanger(ctx, modes, of, None) for modes, of in _pairs(files)]
    for tests, hanger in found:
        show_doubts(tests, hanger)
    with progress_bar() as progress:
        named = [(hanger, tests) for tests, hanger in found]
        bars = tuple(describe_bar(hanger, _sensors(tests)) for tests, hanger in found)
        return BridgeDiagnosisSheet(diagnose_bridge(named, options, progress), bars=bars)


def _pairs(files: tuple[Path, ...]) -> list[tuple[Path, Path]]:
    pairs = list(zip(files[::2], files[1::2], strict=False))
    if len(files) % 2 or any(hanger.suffix != ".toml" for _, hanger in pairs):
        raise UsageError(
            "several MODES.json are given, but not each with its description.",
            remedy="Write each H.toml right behind its MODES.json.",
        )
    return pairs


def _of_bridge(
    ctx: click.Context, latest: tuple[int, bool], options: GapOptions
) -> BridgeDiagnosisSheet:
    """Return all hangers of the workspace that have tests and that the baseline can describe."""
    with opened_store(ctx) as (workspace, store):
        stored = {
            hanger: choose_tests(store, hanger, latest[0], every=latest[1])
            for hanger in workspace.bridge.hangers
            if hanger.is_modelled and store.tests.list_all(hanger.id)
        }
        if len(stored) < LEAST:
            raise NothingThere(
                f"{len(stored)} of {len(workspace.bridge.hangers)} hangers have a test, a shared "
                f"cause takes {LEAST}.",
                remedy="Take tests in with `shm ingest`.",
            )
        with progress_bar() as progress:
            named = [(hanger, chosen.tests) for hanger, chosen in stored.items()]
            found = diagnose_bridge(named, options, progress)
        each_alone = tuple(
            keep_diagnosis(store, chosen, hanger, diagnosis, options, utc_now())
            for (hanger, chosen), diagnosis in zip(stored.items(), found.diagnoses, strict=True)
        )
        found = replace(found, diagnoses=each_alone)
        bars = tuple(
            describe_bar(hanger, _stored_sensors(store, chosen))
            for hanger, chosen in stored.items()
        )
    return BridgeDiagnosisSheet(found, workspace.bridge.name, bars)


def _show(
    paper: Paper,
    document: dict[str, Any],
    draw: Callable[[], Sequence[Illustration]],
    html: Path | None,
    figures: Path | None,
) -> None:
    """Write the files, then the answer."""
    if html is not None or figures is not None:
        with drawing():
            if html is not None:
                html.write_text(as_html(paper), encoding="utf-8")
            if figures is not None:
                write_pictures(draw(), figures)
    answer(document, as_text(paper, readable_width()).rstrip())
