"""A measured tension teaches what the bar is made of: for its later tests, and for its siblings.

Frequencies see tension, mass and length together; where the tension was read as well, what is left
is mass, stiffness and length of that bar. Siblings of one delivery share its steel and its rolling,
not its tape: their own scatter about the one that was weighed is taken for a third of the stated.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from shm.inference import UpdateOptions
from shm.inference.priors import Calibration, calibration_of
from shm.models import DESCRIPTION, described
from shm.models.as_made import BENDING, DENSITY, LENGTH, MODULUS, SECTION
from shm.pipeline.lineage import Taught, Terms
from shm.values import BaselineCheck, Hanger, ModalTest, Posterior
from shm.watch.baseline_check import check_baseline

_CHECKED_BY = "beam2"  # fast, and any bar is such a beam as far as a mistaken mode goes
_SHARE_WITHIN_A_FAMILY = 1 / 3  # judgement: one bar of a delivery from another, to one delivery
_UNSTATED_BENDING_SD = 0.3  # judgement: a strand's wires slip by layers (DESIGN: 0.3 to 1)


def options_of(terms: Terms, hanger: Hanger) -> UpdateOptions:
    """The terms of an update as its options."""
    learnt = calibration(terms.taught, hanger)
    return UpdateOptions(samples=terms.samples, seed=terms.seed, calibration=learnt)


def checked(tests: Sequence[ModalTest], hanger: Hanger, terms: Terms) -> BaselineCheck:
    """What is mistaken among the tests of a baseline, by a beam on springs whatever competes."""
    return check_baseline(tests, described(_CHECKED_BY, hanger, terms.priors))


def calibration(taught: Taught | None, hanger: Hanger) -> Calibration | None:
    """What a measured tension has taught of `hanger`; None where there is nothing to learn from."""
    if taught is None or not is_teacher(taught.posterior):
        return None
    learnt = calibration_of(taught.posterior.names, taught.posterior.samples, hanger)
    return learnt if taught.own else of_sibling(learnt, hanger)


def is_teacher(posterior: Posterior) -> bool:
    """Whether the bar as made is among its parameters, and nothing is wrong with it."""
    return posterior.priors == DESCRIPTION and SECTION in posterior.names and not posterior.faults


def of_sibling(learnt: Calibration, hanger: Hanger) -> Calibration:
    """The same for a hanger of the same family, whose length was taped on its own."""
    scatter = hanger.scatter
    bending = scatter.bending_factor
    sds = {
        SECTION: scatter.section,
        DENSITY: scatter.density,
        MODULUS: scatter.modulus,
        BENDING: bending if np.isfinite(bending) else _UNSTATED_BENDING_SD,
    }
    kept = [index for index, name in enumerate(learnt.names) if name != LENGTH]
    names = tuple(learnt.names[index] for index in kept)
    own = np.array([_SHARE_WITHIN_A_FAMILY * sds[name] for name in names])
    covariance = learnt.covariance[np.ix_(kept, kept)] + np.diag(own**2)
    return replace(learnt, names=names, mean=learnt.mean[kept], covariance=covariance)
