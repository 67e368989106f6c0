"""What the size of an effect is measured against in a given hanger, and the priors it makes."""

from __future__ import annotations

import math

import numpy as np

from shm.models.as_made import RESTRAINT
from shm.models.base import Model
from shm.models.effects.base import Parameter
from shm.values import Hanger

_MIDDLE_ORDER = 4  # of the seven or so orders that a hammer test finds


def mass_kg(hanger: Hanger) -> float:
    """The hanger's own mass."""
    return hanger.mass_per_length_kg_m * hanger.length_m


def rotational_stiffness(name: str, hanger: Hanger, hinge: bool = False) -> Parameter:
    """The log10 of an end spring's stiffness, scaled by EI p of a mode of order 4.

    No effect is an infinite stiffness, or none at all where the description has a `hinge`.
    """
    own = Model(hanger).wave_stiffness_n_m_rad(_MIDDLE_ORDER)
    return Parameter(
        name,
        "N m/rad",
        math.log10(RESTRAINT[0] * own),
        math.log10(RESTRAINT[1] * own),
        -np.inf if hinge else np.inf,
        "0.03 to 1000 times EI p, what the bar itself resists with in mode 4: softer is a hinge, "
        "stiffer a clamp; nobody knows the order of magnitude.",
    )
