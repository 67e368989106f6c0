"""`shm gap check`: what a diagnosis would find on a hanger with its sensors."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from contextlib import contextmanager
from pathlib import Path

import rich_click as click

from shm.diagnosis_document import gap_check_document
from shm.errors import BadInput, NothingThere, UsageError
from shm.gap.check import Check, CheckOptions
from shm.report.figures.gap_check import FIGURE
from shm.report.figures.specification import drawn
from shm.report.gap_check_report import HEADINGS, check_text, introduction, rows
from shm.values import GapCheck, Hanger, ModalTest
from shm_cli import completion, flags
from shm_cli.common import (
    drawing,
    one_hanger,
    opened_store,
    paragraph,
    progress_bar,
    show,
    show_rows,
    tests_and_hanger,
)

_PICTURES = (".svg", ".png")


@click.command()
@click.argument("file", metavar="[MODES.json]", required=False, type=flags.FILE)
@flags.hanger()
@flags.hanger_file
@click.option(
    "--effects",
    metavar="A,B",
    shell_complete=completion.effects,
    help="Plant these alone.  [default: all of the catalogue]",
)
@flags.baseline
@click.option(
    "--seeds",
    type=click.IntRange(1, 50),
    default=CheckOptions().seeds,
    show_default=True,
    help="Searches an effect, each at another place with other errors.",
)
@click.option(
    "--sound",
    type=click.IntRange(0, 1000),
    default=CheckOptions().sound,
    show_default=True,
    metavar="N",
    help="Twins without an effect.",
)
@click.option(
    "--processes",
    type=click.IntRange(1, 64),
    default=lambda: len(os.sched_getaffinity(0)),
    show_default="one a processor",
    metavar="N",
    help="Diagnoses that run at the same time.",
)
@flags.latest
@flags.seed
@click.option(
    "--figure", type=flags.NewFile(), metavar="FILE", help="Draw the result here, .svg or .png."
)
@flags.json
@click.pass_context
def check(
    ctx: click.Context,
    file: Path | None,
    hanger_id: int | None,
    hanger_file: Path | None,
    effects: str | None,
    baseline: str,
    seeds: int,
    sound: int,
    processes: int,
    count: int,
    seed: int,
    figure: Path | None,
) -> None:
    """Report which effects a diagnosis would find on this hanger, and from which size.

    Each effect is put into a simulated twin of the hanger, with its modes, sensors, errors and
    conditions, and diagnosed. The twin follows MODES.json with --hanger-file, the latest tests of a
    hanger of the workspace or, without tests, a usual hammer test. Ctrl-C prints what is done.

    \b
    Example: shm gap check --hanger 3
    Example: shm gap check hanger3.modes.json --hanger-file H.toml --effects point_mass,timebase
    """
    if figure is not None and figure.suffix.lower() not in _PICTURES:
        raise BadInput(
            f"{figure} is no name of a picture.", remedy="Let it end in .svg or in .png."
        )
    tests, hanger = _measured(file, hanger_file, hanger_id, count)
    chosen = () if effects is None else tuple(name.strip() for name in effects.split(","))
    if not all(chosen):
        raise UsageError(
            f"--effects {effects!r} names no effect, or has a comma too many.",
            remedy="Name some of `shm gap effects`, say point_mass,timebase.",
        )
    options = CheckOptions(chosen, baseline, seeds, sound, seed=seed)
    job = Check(tests, hanger, options)
    click.echo(_expected(job, processes), err=True)
    found = _run(job, processes)
    _answer(found)
    if figure is not None:
        if not found.effects:
            raise NothingThere(f"no effect was checked: {figure} is not drawn.")
        with drawing():
            for each in drawn((FIGURE,), found):
                each.figure.savefig(figure, facecolor="white")
    if not found.is_complete:
        ctx.exit(130)  # as a shell reports Ctrl-C


def _measured(
    file: Path | None,
    hanger_file: Path | None,
    hanger_id: int | None,
    count: int,
) -> tuple[Sequence[ModalTest], Hanger]:
    """Return the tests and their hanger; no test where none is given or stored."""
    if file is not None:
        return tests_and_hanger(file, hanger_file, hanger_id)
    hanger = one_hanger(hanger_file, hanger_id)
    if hanger_file is not None:
        return (), hanger
    with opened_store() as (_, store):
        return [each.test for each in store.tests.list_all(hanger.id)[-count:]], hanger


def _expected(job: Check, processes: int) -> str:
    """Return how long it takes, before it begins."""
    effects = len(job.effects) * job.options.seeds
    diagnoses = round(2.5 * effects) + job.options.sound  # two or three a search of four sizes
    least, most = (math.ceil(diagnoses * each / processes / 60) for each in (5, 30))
    return (
        f"About {diagnoses} diagnoses of 5 to 30 s each, {processes} at a time: {least} to {most} "
        "minutes. Ctrl-C prints what is done."
    )


def _run(job: Check, processes: int) -> GapCheck:
    """Return what was found until the end or Ctrl-C."""
    done = []
    try:
        with progress_bar() as progress, _executor(min(processes, len(job.searches))) as executor:
            for trials in job.run(progress, executor):
                done.append(trials)
    except KeyboardInterrupt:
        if not done:
            raise
    return job.summarise(done)


@contextmanager
def _executor(processes: int) -> Iterator[Executor | None]:
    """Yield processes of our own; None for one."""
    if processes == 1:
        yield None
        return
    from shm_daemon.execution import children_ended, process_pool

    with children_ended():
        pool = process_pool(processes)
        try:
            yield pool
        finally:
            pool.shutdown(wait=False, cancel_futures=True)


def _answer(found: GapCheck) -> None:
    if flags.wants_json():
        show(gap_check_document(found))
        return
    click.echo(paragraph(introduction(found)))
    if found.effects:
        show_rows("What a diagnosis would find", HEADINGS, rows(found))
    for line in check_text(found):
        click.echo(paragraph(line))
