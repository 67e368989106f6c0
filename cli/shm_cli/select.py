"""`shm select`: model classes compared by their evidence."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import rich_click as click

from shm.documents import selection_document
from shm.models import build
from shm.update import UpdateOptions, select
from shm.values import Selection
from shm_cli.common import (
    hanger_file_option,
    hanger_option,
    json_option,
    progress_bar,
    repeat_option,
    samples_option,
    seed_option,
    show,
    show_table,
    table,
    tests_and_hanger,
)
from shm_cli.update import modes_argument


@click.command()
@modes_argument
@click.option(
    "--models", default="beam1,beam2", show_default=True, help="Classes, separated by commas."
)
@hanger_option()
@hanger_file_option
@seed_option
@samples_option
@repeat_option
@json_option
@click.pass_context
def command(
    ctx: click.Context,
    modes_file: Path | None,
    models: str,
    hanger_id: int | None,
    hanger_file: Path | None,
    seed: int,
    samples: int,
    repeat: int,
    as_json: bool,
) -> None:
    """Compare model classes by their evidence.

    The classes are equally probable beforehand. The tests come from MODES.json, or are the latest
    of a hanger of the workspace.

    \b
    Example: shm select hanger3.modes.json --hanger-file H.toml --models beam1,beam2
    """
    tests, hanger = tests_and_hanger(ctx, modes_file, hanger_file, hanger_id)
    chosen = [build(name.strip(), hanger) for name in models.split(",") if name.strip()]
    options = UpdateOptions(samples=samples, seed=seed, repeat=repeat)
    with progress_bar("updating") as progress:
        selection = select(tests, chosen, options, progress)
    if as_json:
        show(selection_document(selection))
    else:
        show_selection(selection)


def show_selection(selection: Selection) -> None:
    """The model classes as a table, most probable first."""
    made = table(
        f"model classes of hanger {selection.selected.hanger}, most probable first",
        "class", "probability", "log evidence", "tension (kN)", "90 % interval (kN)", "to nominal",
    )  # fmt: skip
    for posterior, probability in zip(selection.posteriors, selection.probabilities, strict=True):
        low, high = np.quantile(posterior.tension_n, [0.05, 0.95]) / 1e3
        mean = posterior.tension_n.mean()
        made.add_row(
            posterior.model,
            f"{probability:.3f}",
            f"{posterior.log_evidence:.2f} ± {posterior.log_evidence_sd:.2f}",
            f"{mean / 1e3:.1f}",
            f"{low:.1f} to {high:.1f}",
            f"{mean / posterior.nominal_tension_n - 1:+.1%}",
        )
    show_table(made)
