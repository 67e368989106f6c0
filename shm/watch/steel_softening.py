"""What a kelvin does to a hanger's frequencies, since warm steel is softer."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from shm.models import Model, described
from shm.models.base import Conditions
from shm.values import FloatArray, Hanger
from shm.watch.quantities import MeasuredMode, log_frequencies

# Of steel's modulus: Ledbetter and Reed (1973), Elastic properties of metals and alloys, I.
MODULUS_PER_KELVIN = -3e-4
_STIFFER = 0.01
_CLAMPED = "beam1"


def softening(
    model: Model, base: FloatArray, hanger: Hanger, modes: Sequence[MeasuredMode]
) -> FloatArray:
    """By what the log frequency of each mode (modes,) goes with a kelvin, as steel softens.

    Nothing where the class follows the temperature itself: it was fitted to what softens, too.
    Where the class is expensive, that of a clamped beam: it differs by a few percent.
    """
    mild, warm = (
        model.frequencies_at(base[None], 1, Conditions(temperature_shift_k=kelvin))
        for kelvin in (0.0, 1.0)
    )
    if not np.array_equal(mild, warm):
        return np.zeros(len(modes))
    if model.expensive:
        known = dict(zip(model.parameter_names, base.tolist(), strict=True))
        model = described(_CLAMPED, hanger)
        base = np.array([known.get(each, 1.0) for each in model.parameter_names])
    stiffer = replace(hanger, elastic_modulus_pa=hanger.elastic_modulus_pa * (1 + _STIFFER))
    stiff = described(model.name, stiffer, model.priors)
    change = log_frequencies(stiff, base[None], modes)
    change = change - log_frequencies(model, base[None], modes)
    return np.asarray(MODULUS_PER_KELVIN * change[0] / _STIFFER)
