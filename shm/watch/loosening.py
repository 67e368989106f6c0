"""How else frequencies go as an end loosens than the baseline's slopes say.

The baseline tells what the ends give together and hardly which of them gives how much: a fork plate
or a turnbuckle stiffens what a pin softens, and an end that gives looks clamped. As it loosens, the
modes go by how soft it is: all alike where it is stiff, the lower ones more where it is soft,
nearly as they go with tension. Without this the rest would be read as tension: an end whose spring
falls to a third as 3 to 6 % of it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from shm.models import Model
from shm.values import TENSION, FloatArray, Hanger, WatchedQuantity
from shm.watch.quantities import MeasuredMode, log_frequencies, moved

_A_LITTLE_DECADES = 0.3  # technical: half of its stiffness
# Judgement: how stiff an end may be that is found to be stiffer, in units of the bending stiffness
# over its length of decay, sqrt(EI / T): a clamp is infinite, and at 1 an end is half way.
_MAY_BE = (20.0, 7.0, 2.5, 1.0)
_SEEN = 1e-6  # of a mean log frequency: below it a pattern is rounding
_OF_A_STEP = 0.05  # technical: patterns that add less are within a mode's own scatter


def loosening_of(
    model: Model,
    base: FloatArray,
    hanger: Hanger,
    modes: Sequence[MeasuredMode],
    quantities: Sequence[WatchedQuantity],
) -> tuple[FloatArray, ...]:
    """Of each quantity patterns (r, modes): what one step may do beside its mean, of one sd each.

    None of the tension.
    """
    tension_n = base[model.parameter_names.index("theta_F")] * hanger.nominal_tension_n
    of_decay = math.log10(math.sqrt(hanger.bending_stiffness_n_m2 * tension_n))
    levels = [of_decay + math.log10(each) for each in _MAY_BE]
    return tuple(
        np.zeros((0, len(modes)))
        if each.name == TENSION
        else _patterns(model, base, modes, each, levels)
        for each in quantities
    )


def _patterns(
    model: Model,
    base: FloatArray,
    modes: Sequence[MeasuredMode],
    quantity: WatchedQuantity,
    levels: Sequence[float],
) -> FloatArray:
    columns = [model.parameter_names.index(name) for name in quantity.parameters]
    before, after = [], []
    for each in (columns, *([column] for column in columns)):
        own = float(base[each].min())
        for level in (own, *(level for level in levels if level < own)):
            start = base.copy()
            start[each] = np.minimum(start[each], level)
            before.append(start)
            after.append(moved(model, start, each, np.array([-_A_LITTLE_DECADES]))[0])
    shifts = log_frequencies(model, np.array(after), modes)
    shifts = shifts - log_frequencies(model, np.array(before), modes)
    mean = shifts.mean(axis=1, keepdims=True)
    if abs(mean[0, 0]) < _SEEN:
        return np.zeros((0, len(modes)))
    is_seen = np.abs(mean[:, 0]) > _SEEN
    like = quantity.step_sd * shifts[is_seen] / mean[is_seen]
    _, strength, axes = np.linalg.svd(like[1:] - like[0], full_matrices=False)
    strength = strength / math.sqrt(max(len(like) - 1, 1))
    kept = strength > _OF_A_STEP * np.linalg.norm(like[0])
    return np.asarray(strength[kept, None] * axes[kept])
