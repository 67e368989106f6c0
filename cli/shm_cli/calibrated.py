"""`--calibrated-by MODES.json`: tests whose tension was measured teach what the bar is made of."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import rich_click as click

from shm.errors import BadInput, UsageError
from shm.inference import Progress, UpdateOptions, select
from shm.models import DESCRIPTION, Model
from shm.modes_document import load_modes
from shm.pipeline.calibrating import calibration
from shm.pipeline.lineage import Taught
from shm.values import Hanger

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
    return replace(options, calibration=calibration(Taught(posterior, own), hanger))
