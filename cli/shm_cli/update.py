"""`shm update`: the posterior of one model class."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import rich_click as click

from shm.documents import posterior_document, summary
from shm.errors import BadInput, UsageError
from shm.inference import Progress, UpdateOptions, select, update
from shm.models import DESCRIPTION, Model, build
from shm.modes_document import load_modes
from shm.pipeline.lineage import Taught
from shm.values import Averaged, Hanger, Limits, ModalTest, Posterior
from shm.values.rounding import force_unit
from shm.values.stated_tension import averaged_now, stated
from shm_cli import completion
from shm_cli.common import (
    hanger_file_option,
    hanger_option,
    json_option,
    method_option,
    paragraph,
    priors_option,
    progress_bar,
    repeat_option,
    samples_option,
    seed_option,
    show,
    show_table,
    table,
    tests_and_hanger,
    told_doubts,
    update_options,
)

calibrated_by_option = click.option(
    "--calibrated-by",
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
    metavar="MODES.json",
    help="Tests with a measured tension (tension_read_n) of this hanger, or of one of its family.",
)


def calibrated(
    options: UpdateOptions,
    path: Path | None,
    hanger: Hanger,
    models: Sequence[Model],
    progress: Progress,
) -> UpdateOptions:
    """The options with what the tests of `path` teach, by the most probable of the classes.

    Raises UsageError where the priors leave nothing to learn, BadInput where no tension was read,
    or one that contradicts the frequencies.
    """
    if path is None:
        return options
    if any(model.priors != DESCRIPTION for model in models):
        raise UsageError(
            "--calibrated-by needs priors of the description: the thesis's take it as exact.",
            remedy="Leave --priors thesis out.",
        )
    tests = load_modes(path)
    if not any(math.isfinite(test.tension_read_n) for test in tests):
        raise BadInput(
            "no test has a tension_read_n to calibrate by.",
            file=path,
            remedy="Give the tension that a load cell or a lift-off showed, and its sd.",
        )

    def tell(label: str, fraction: float) -> None:
        progress(f"{label} (calibrating)", fraction)

    posterior = select(tests, models, options, tell).selected
    if posterior.faults:
        raise BadInput(
            f"the tension read does not fit the frequencies. {posterior.faults[0]}",
            file=path,
            remedy="Check the reading (in N), the orders and the description.",
        )
    own = tests[0].hanger in (None, hanger.id)
    from shm.pipeline.steps import calibration  # it opens what identifies: not before

    return replace(options, calibration=calibration(Taught(posterior, own), hanger))


_POOR_FIT_PERCENT = 5.0
"""Model errors beyond it are blunders: clamped ends where springs are right cost some 2 %."""

modes_argument = click.argument(
    "modes_file",
    metavar="[MODES.json]",
    required=False,
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
)


@click.command()
@modes_argument
@click.option(
    "--model",
    default="beam2",
    show_default=True,
    shell_complete=completion.models,
    help="The model class.",
)
@hanger_option()
@hanger_file_option
@seed_option
@samples_option
@repeat_option
@method_option
@priors_option
@calibrated_by_option
@json_option
@click.pass_context
def command(
    ctx: click.Context,
    modes_file: Path | None,
    model: str,
    hanger_id: int | None,
    hanger_file: Path | None,
    seed: int,
    samples: int,
    repeat: int,
    method: str,
    priors: str,
    calibrated_by: Path | None,
    as_json: bool,
) -> None:
    """Posterior of tension and end stiffness.

    The tests come from MODES.json, or are the latest of a hanger of the workspace.

    \b
    Example: shm update hanger3.modes.json --hanger-file H.toml --model beam2
    """
    options = update_options(samples, seed, repeat, method, priors)
    tests, hanger = tests_and_hanger(ctx, modes_file, hanger_file, hanger_id)
    doubts = told_doubts(tests, hanger, apart=as_json)
    tell_irregular(tests)
    with progress_bar("updating") as progress:
        chosen = build(model, hanger, priors)
        options = calibrated(options, calibrated_by, hanger, [chosen], progress)
        posterior = update(tests, chosen, options, progress)
    tell_poor_fit(posterior)
    if as_json:
        show({**posterior_document(posterior), "doubts": doubts})
        return
    show_posterior(posterior, hanger.limits)


def tell_irregular(tests: Sequence[ModalTest]) -> None:
    """Says on stderr which modes are left out, and what to do."""
    for test in tests:
        for mode in test.modes:
            if mode.irregular:
                click.echo(
                    f"Left out: {mode.plane} {mode.order} of test {test.id}, "
                    f"{mode.frequency_hz:.3f} Hz, is well off the bar that the other modes follow. "
                    "For the cause: shm gap diagnose",
                    err=True,
                )


def tell_poor_fit(posterior: Posterior) -> None:
    """Says on stderr where a class misses the frequencies as no class of this bar should."""
    if posterior.misfit_percent > _POOR_FIT_PERCENT:
        click.echo(
            f"Poor fit: {posterior.model} misses the frequencies by {posterior.misfit_percent:.0f} "
            "% (root mean square). Do "
            "not trust its tension: look at the orders of the modes and at the hanger's "
            "description. For the cause: shm gap diagnose",
            err=True,
        )


def show_stated(averaged: Averaged) -> None:
    """What keeps a tension from being taken at its word, then the tension with both intervals."""
    for caveat in averaged.caveats:
        click.echo(paragraph(caveat))
    for sentence in stated(averaged).sentences:
        click.echo(paragraph(sentence))


def show_posterior(posterior: Posterior, limits: Limits | None = None) -> None:
    """The tension in words, parameters and predicted frequencies as tables."""
    show_stated(averaged_now(posterior, limits=limits))
    made = table(
        f"{posterior.model}: posterior of hanger {posterior.hanger}, "
        f"log evidence {posterior.log_evidence:.2f} ± {posterior.log_evidence_sd:.2f}",
        "parameter", "mean", "sd", "5 %", "median", "95 %", "most probable",
    )  # fmt: skip
    tension_n = summary(
        posterior.tension_n, posterior.most_probable[0] * posterior.nominal_tension_n
    )
    unit = force_unit(tension_n["mean"])
    places = unit.decimals(tension_n["mean"])
    made.add_row(
        f"tension ({unit.name})", *(f"{unit.of(each):.{places}f}" for each in tension_n.values())
    )
    for name, best in zip(posterior.names, posterior.most_probable, strict=True):
        figures = summary(posterior.parameter(name), best)
        made.add_row(name, *(f"{value:.4g}" for value in figures.values()))
    show_table(made)
    made = table("predicted frequencies", "mode", "measured (Hz)", "mean (Hz)", "sd (Hz)", "ratio")
    for row in posterior.predicted:
        made.add_row(
            f"{row.plane} {row.order}",
            f"{row.measured_hz:.3f}",
            f"{row.mean_hz:.3f}",
            f"{row.sd_hz:.3f}",
            f"{row.mean_hz / row.measured_hz:.4f}",
        )
    show_table(made)
    click.echo(
        f"{len(posterior.samples)} samples ({posterior.effective_sample_size:.0f} effective), "
        f"R-hat {posterior.r_hat:.3f}, {posterior.evaluations} model evaluations, "
        f"{posterior.seconds:.1f} s, seed {posterior.seed}"
    )
