"""`shm update` and `shm select`: the posterior of one model class, or of several compared."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import rich_click as click

from shm.documents import posterior_document, selection_document
from shm.errors import UsageError
from shm.inference import Progress, UpdateOptions, select, update
from shm.inference.options import IMPORTANCE, SAMPLERS
from shm.models import Model, applicable, build, competing_names
from shm.modes_document import load_modes
from shm.notebook import posterior_sheet, selection_sheet
from shm.report.assumed import assumptions_line, with_assumptions
from shm.settings import load_settings
from shm.store.watch import list_adoptions
from shm.values import Hanger, Limits, ModalTest, Posterior
from shm_cli import completion, flags
from shm_cli.common import (
    opened_store,
    paragraph,
    progress_bar,
    readable_width,
    show,
    show_doubts,
    show_rows,
    tests_and_hanger,
)

_calibrated_by = click.option(
    "--calibrated-by",
    type=flags.FILE,
    metavar="MODES.json",
    help="Tests with a measured tension (tension_read_n) of this hanger, or of one of its family.",
)


_sampler = click.option(
    "--sampler",
    type=click.Choice(SAMPLERS),
    default=IMPORTANCE,
    help="How draws are made; emcee is slower, an independent check of the usual one.",
)


_level = click.option(
    "--at-level",
    "level",
    type=click.FloatRange(min=0),
    metavar="LEVEL",
    help="Give the tension at this level of the hits (1: the reference force), not at rest.",
)


def tests_at(tests: Sequence[ModalTest], level: float | None) -> tuple[ModalTest, ...]:
    """Return the tests at a level of motion, and say so; as they are where none is stated."""
    if level is None:
        return tuple(tests)
    from shm.inference.reference_level import at_level  # it opens what identifies: not before

    moved = tuple(at_level(test, level) for test in tests)
    depend = sum(mode.depends_on_amplitude for test in tests for mode in test.modes)
    click.echo(
        f"At level {level:g} of the hits: {depend} of {sum(len(each.modes) for each in tests)} "
        "frequencies depend on it.",
        err=flags.wants_json(),
    )
    return moved


def _at(level: float | None) -> dict[str, float]:
    """Return the level that a document holds at; nothing of one at small amplitude."""
    return {} if level is None else {"at_level": level}


def _updating(function: flags.F) -> flags.F:
    """Return the options that both have."""
    updating = (flags.seed, flags.samples, flags.priors, _sampler, _calibrated_by, _level)
    for option in reversed((flags.hanger(), flags.hanger_file, *updating, flags.json)):
        function = option(function)
    return function


def calibrated(
    options: UpdateOptions, path: Path | None, models: Sequence[Model], progress: Progress
) -> UpdateOptions:
    """Return the options with what the tests of `path` teach; raises as `calibrate` does."""
    if path is None:
        return options
    from shm.inference.calibrating import calibrate  # it opens what infers: not before

    return calibrate(options, load_modes(path), models, progress, path)


modes_argument = click.argument(
    "modes_file", metavar="[MODES.json]", required=False, type=flags.FILE
)


@click.command()
@modes_argument
@click.option(
    "--model",
    default="beam2",
    shell_complete=completion.models,
    help="The model class.",
)
@_updating
@click.pass_context
def command(
    ctx: click.Context,
    modes_file: Path | None,
    model: str,
    hanger_id: int | None,
    hanger_file: Path | None,
    seed: int,
    samples: int,
    priors: str,
    sampler: str,
    calibrated_by: Path | None,
    level: float | None,
) -> None:
    """Infer tension and end stiffness with one model class.

    The tests come from MODES.json, or are the latest of a hanger of the workspace.

    \b
    Example: shm update hanger3.modes.json --hanger-file H.toml --model beam2
    """
    options = UpdateOptions(samples, seed, sampler=sampler)
    tests, hanger = tests_and_hanger(ctx, modes_file, hanger_file, hanger_id)
    tests = tests_at(tests, level)
    doubts = show_doubts(tests, hanger, apart=flags.wants_json())
    tell_irregular(tests)
    with progress_bar() as progress:
        chosen = build(model, hanger, priors)
        options = calibrated(options, calibrated_by, [chosen], progress)
        posterior = update(tests, chosen, options, progress)
    if flags.wants_json():
        document = {**posterior_document(posterior), **_at(level), "doubts": doubts}
        show(with_assumptions(document, hanger))
        return
    show_posterior(posterior, hanger.limits)
    tell_assumptions(hanger)


def tell_assumptions(hanger: Hanger) -> None:
    """Print which physical assumptions the owner has overridden, if any."""
    if hanger.assumptions.overridden:
        click.echo(paragraph(assumptions_line(hanger)))


def tell_irregular(tests: Sequence[ModalTest]) -> None:
    """Print on stderr which modes are left out, and what to do."""
    for test in tests:
        for mode in test.modes:
            if mode.irregular:
                click.echo(
                    f"Left out: {mode.plane} {mode.order} of test {test.id}, "
                    f"{mode.frequency_hz:.3f} Hz, is well off the bar that the other modes follow. "
                    "For the cause: shm gap diagnose",
                    err=True,
                )


def show_posterior(posterior: Posterior, limits: Limits | None = None) -> None:
    """Print the tension in words, then parameters and predicted frequencies as tables."""
    click.echo(posterior_sheet(posterior, limits).text_of(readable_width()))
    predicted = [
        (
            f"{row.plane} {row.order}",
            f"{row.measured_hz:.3f}",
            f"{row.mean_hz:.3f} ± {row.sd_hz:.3f}",
            f"{row.mean_hz / row.measured_hz:.4f}",
        )
        for row in posterior.predicted
    ]
    headings = ("mode", "measured (Hz)", "predicted (Hz, ± sd)", "ratio")
    show_rows("predicted frequencies", headings, predicted)


@click.command("select")
@modes_argument
@click.option(
    "--models",
    show_default="the setting `models`",
    shell_complete=completion.models,
    help="Classes, separated by commas.",
)
@click.option(
    "--prior",
    "class_priors",
    metavar="CLASS=P,...",
    help="How probable each class is beforehand, such as beam1=0.25,beam2=0.75.",
)
@_updating
@click.pass_context
def select_command(
    ctx: click.Context,
    modes_file: Path | None,
    models: str | None,
    class_priors: str | None,
    hanger_id: int | None,
    hanger_file: Path | None,
    seed: int,
    samples: int,
    priors: str,
    sampler: str,
    calibrated_by: Path | None,
    level: float | None,
) -> None:
    """Infer the tension with all model classes, and compare them.

    Before the test clamped classes have a probability of 0.1 to 0.4, by the kind of ends (see
    `shm settings --assumptions`), and the others share the rest equally; change that with --prior,
    or make all equal with --priors thesis. Classes that do not apply are listed with a reason. The
    tests come from MODES.json, or are the latest of a hanger of the workspace, with its adopted
    classes.

    \b
    Example: shm select hanger3.modes.json --hanger-file H.toml --models beam1,beam2
    """
    options = UpdateOptions(samples, seed, sampler=sampler)
    stated = None if class_priors is None else _stated_priors(class_priors)
    tests, hanger = tests_and_hanger(ctx, modes_file, hanger_file, hanger_id)
    names = _names(ctx, models, None if hanger_file else hanger.id)
    _, not_applicable = applicable(hanger, names)
    chosen = [build(name, hanger, priors) for name in competing_names(hanger, names)]
    if stated is not None:
        from shm.inference.answer.updating import check_class_priors

        check_class_priors(stated, [model.name for model in chosen])
    tests = tests_at(tests, level)
    doubts = show_doubts(tests, hanger, apart=flags.wants_json())
    tell_irregular(tests)
    with progress_bar() as progress:
        options = calibrated(options, calibrated_by, chosen, progress)
        selection = select(tests, chosen, options, progress, stated)
    if flags.wants_json():
        document = selection_document(selection, hanger.limits)
        complete = {**document, **_at(level), "not_applicable": not_applicable, "doubts": doubts}
        show(with_assumptions(complete, hanger))
        return
    click.echo(selection_sheet(selection, hanger.limits).text_of(readable_width()))
    tell_assumptions(hanger)
    for name, reason in not_applicable.items():
        click.echo(f"{name} does not apply: {reason}")


def _names(ctx: click.Context, models: str | None, hanger_id: int | None) -> tuple[str, ...]:
    """Return the requested classes, or those of the setting and the hanger's adopted ones."""
    if models is not None:
        return load_settings({"models": models}, environment={}).model_names
    if hanger_id is None:
        return load_settings().model_names
    with opened_store(ctx) as (workspace, store):
        adopted = [each.adoption.model for each in list_adoptions(store, hanger_id)]
    return tuple(dict.fromkeys([*workspace.settings.model_names, *adopted]))


def _stated_priors(text: str) -> dict[str, float]:
    """Parse beam1=0.25,beam2=0.75 into numbers by class."""
    pairs = [part.partition("=") for part in text.split(",")]
    try:
        return {name.strip(): float(value) for name, _, value in pairs}
    except ValueError as error:
        raise UsageError(
            f"--prior {text}: not one number a class.",
            remedy="Write beam1=0.25,beam2=0.75, say.",
        ) from error
