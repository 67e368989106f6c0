"""Learn of a bar from tests with a measured tension, its own or a sibling's, before its update.

Frequencies see tension, mass and length together; where the tension was read as well, what is left
is mass, stiffness and length of that bar. Siblings of one delivery share its steel and its rolling,
not its tape: their own scatter about the one that was weighed is taken for a third of the stated.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from shm.errors import BadInput, UsageError
from shm.inference.answer.updating import select
from shm.inference.options import Calibration, Progress, UpdateOptions
from shm.inference.problem.data_checks import check_data
from shm.inference.problem.priors import calibration_of
from shm.models import DESCRIPTION, Model
from shm.models.one_hanger.hanger_model import BENDING, DENSITY, LENGTH, MODULUS, SECTION
from shm.values import Hanger, ModalTest, Posterior

_SHARE_WITHIN_A_FAMILY = 1 / 3  # judgement: one bar of a delivery from another, to one delivery


def calibrate(
    options: UpdateOptions,
    tests: Sequence[ModalTest],
    models: Sequence[Model],
    progress: Progress,
    file: Path | str = "",
) -> UpdateOptions:
    """Return the options with what `tests` teach, by the most probable of the classes.

    The tests are of the models' hanger or of one of its family; `file` is where they come from.
    Without any the options stay. Raises UsageError where the priors leave nothing to learn,
    BadInput where no tension was read, or one that contradicts the frequencies.
    """
    if not tests:
        return options
    hanger = models[0].hanger
    if any(model.priors != DESCRIPTION for model in models):
        raise UsageError(
            "calibration needs priors of the description: the thesis's take it as exact.",
            remedy="Leave the priors of the thesis out.",
        )
    checked = check_data(tests, hanger)
    if not any(math.isfinite(test.tension_read_n) for test in checked.tests):
        raise BadInput(
            " ".join(["no test has a tension_read_n to calibrate by.", *checked.remarks]),
            file=file,
            remedy="Give the tension that a load cell or a lift-off showed, in N, and its sd.",
        )

    def tell(label: str, fraction: float) -> None:
        progress(f"{label} (calibrating)", fraction)

    posterior = select(tests, models, options, tell).selected
    if posterior.faults:
        raise BadInput(
            f"the tension read does not fit the frequencies. {posterior.faults[0]}",
            file=file,
            remedy="Check the reading (in N), the orders and the description.",
        )
    same_hanger = tests[0].hanger in (None, hanger.id)
    return replace(options, calibration=learn(posterior, hanger, same_hanger))


def learn(posterior: Posterior, hanger: Hanger, same_hanger: bool) -> Calibration | None:
    """Return what a posterior with a measured tension teaches; None where it teaches nothing.

    The test is of the `same_hanger` or of a sibling.
    """
    if not _is_teacher(posterior):
        return None
    learnt = calibration_of(posterior.names, posterior.samples, hanger)
    return learnt if same_hanger else _of_sibling(learnt, hanger)


def _is_teacher(posterior: Posterior) -> bool:
    """Return True where the bar as made is among its parameters, and nothing is wrong with it."""
    return posterior.priors == DESCRIPTION and SECTION in posterior.names and not posterior.faults


def _of_sibling(learnt: Calibration, hanger: Hanger) -> Calibration:
    """Return the same for a hanger of the same family, whose length was taped on its own."""
    scatter = hanger.scatter
    bending = scatter.bending_factor
    unstated = hanger.assumptions.strand_bending_log_sd.value
    sds = {
        SECTION: scatter.section,
        DENSITY: scatter.density,
        MODULUS: scatter.modulus,
        BENDING: bending if np.isfinite(bending) else unstated,
    }
    shared = [index for index, name in enumerate(learnt.names) if name != LENGTH]
    names = tuple(learnt.names[index] for index in shared)
    sd = np.array([_SHARE_WITHIN_A_FAMILY * sds[name] for name in names])
    covariance = learnt.covariance[np.ix_(shared, shared)] + np.diag(sd**2)
    return replace(learnt, names=names, mean=learnt.mean[shared], covariance=covariance)
