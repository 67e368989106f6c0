"""`shm select`: model classes compared by their evidence."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import rich_click as click

from shm.documents import selection_document
from shm.errors import UsageError
from shm.inference import Sigma, select
from shm.models import applicable, build, competing_names
from shm.settings import load_settings
from shm.values import Limits, Selection
from shm.values.rounding import force_unit
from shm_cli import completion, flags
from shm_cli.common import (
    opened_store,
    progress_bar,
    show,
    show_rows,
    tests_and_hanger,
    told_doubts,
    update_options,
)
from shm_cli.update import (
    calibrated,
    calibrated_by_option,
    modes_argument,
    show_stated,
    tell_irregular,
    tell_poor_fit,
)


@click.command()
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
@click.option(
    "--sigma",
    type=click.Choice(("one", "plane", "mode")),
    default="one",
    show_default=True,
    help="One model error of all modes, or one of each plane or mode; with --priors thesis.",
)
@flags.hanger()
@flags.hanger_file
@flags.seed
@flags.samples
@flags.repeat
@flags.method
@flags.priors
@calibrated_by_option
@flags.json
@click.pass_context
def command(
    ctx: click.Context,
    modes_file: Path | None,
    models: str | None,
    class_priors: str | None,
    sigma: Sigma,
    hanger_id: int | None,
    hanger_file: Path | None,
    seed: int,
    samples: int,
    repeat: int,
    method: str,
    priors: str,
    calibrated_by: Path | None,
) -> None:
    """Compare model classes by their evidence.

    The classes are equally probable beforehand, but for clamped ones, which weigh 0.15 to 0.22
    beside one with springs; --priors thesis has all equal, and --prior says otherwise. Those that
    do not apply to the hanger are left out and say why. The tests come from MODES.json, or are the
    latest of a hanger of the workspace, which brings the classes that it has adopted.

    \b
    Example: shm select hanger3.modes.json --hanger-file H.toml --models beam1,beam2
    Example: shm select hanger3.modes.json --hanger-file H.toml --priors thesis --sigma plane
    """
    options = replace(update_options(samples, seed, repeat, method, priors), sigma=sigma)
    stated = None if class_priors is None else _stated_priors(class_priors)
    tests, hanger = tests_and_hanger(ctx, modes_file, hanger_file, hanger_id)
    names = _names(ctx, models, None if hanger_file else hanger.id)
    _, not_applicable = applicable(hanger, names)
    chosen = [build(name, hanger, priors) for name in competing_names(hanger, names)]
    doubts = told_doubts(tests, hanger, apart=flags.wants_json())
    tell_irregular(tests)
    with progress_bar("updating") as progress:
        options = calibrated(options, calibrated_by, hanger, chosen, progress)
        selection = select(tests, chosen, options, progress, stated)
    tell_poor_fit(selection.selected)
    if flags.wants_json():
        document = selection_document(selection, hanger.limits)
        show({**document, "not_applicable": not_applicable, "doubts": doubts})
        return
    show_selection(selection, hanger.limits)
    for name, reason in not_applicable.items():
        click.echo(f"{name} does not apply: {reason}")


def _names(ctx: click.Context, models: str | None, hanger_id: int | None) -> tuple[str, ...]:
    """The classes asked for, or those of the setting and, of a workspace's hanger, the adopted."""
    if models is not None:
        return load_settings({"models": models}, environment={}).model_names
    if hanger_id is None:
        return load_settings().model_names
    with opened_store(ctx) as (workspace, store):
        adopted = [each.adoption.model for each in store.posteriors.list_adoptions(hanger_id)]
    return tuple(dict.fromkeys([*workspace.settings.model_names, *adopted]))


def _stated_priors(text: str) -> dict[str, float]:
    """beam1=0.25,beam2=0.75 as numbers by class."""
    pairs = [part.partition("=") for part in text.split(",")]
    try:
        return {name.strip(): float(value) for name, _, value in pairs}
    except ValueError as error:
        raise UsageError(
            f"--prior {text}: not one number a class.",
            remedy="Write beam1=0.25,beam2=0.75, say.",
        ) from error


def show_selection(selection: Selection, limits: Limits | None = None) -> None:
    """The tension over all classes in words, and the classes as a table, most probable first."""
    show_stated(selection.averaged(limits))
    unit = force_unit(*(float(each.tension_n.mean()) for each in selection.posteriors))
    headings = (
        "class", "probability", "log evidence", f"tension ({unit.name})",
        f"90 % interval ({unit.name})", "to nominal", "most probable values",
    )  # fmt: skip
    rows = []
    for posterior, probability in zip(selection.posteriors, selection.probabilities, strict=True):
        low, high = unit.of(np.quantile(posterior.tension_n, [0.05, 0.95]))
        mean = float(posterior.tension_n.mean())
        places = unit.decimals(mean)
        best = zip(posterior.names, posterior.most_probable, strict=True)
        cells = (
            posterior.model,
            f"{probability:.3f}",
            f"{posterior.log_evidence:.2f} ± {posterior.log_evidence_sd:.2f}",
            f"{unit.of(mean):.{places}f}",
            f"{low:.{places}f} to {high:.{places}f}",
            f"{mean / posterior.nominal_tension_n - 1:+.1%}",
            ", ".join(f"{name} {value:.3g}" for name, value in best),
        )
        rows.append(cells)
    title = f"model classes of hanger {selection.selected.hanger}, most probable first"
    show_rows(title, headings, rows)
