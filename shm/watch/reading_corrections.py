"""Corrections of a reading: warm steel is softer, large motions slip, ends loosen.

Amplitude: what the swing does to a hanger's frequencies where its joints slip or it stretches.

Identification gives the frequency of small amplitude where the slope is sure, and so tests at any
amplitude compare. Where it is not sure in a test but was in the baseline, so much of the baseline's
slope is taken off, at the test's own amplitude, as such a frequency holds.

Loosening: the baseline tells what the ends give together and hardly which of them gives how much: a
fork plate or a turnbuckle stiffens what a pin softens, and an end that gives looks clamped. As it
loosens, the modes go by how soft it is: all alike where it is stiff, the lower ones more where it
is soft, nearly as they go with tension. Without this the rest would be read as tension: an end
whose spring falls to a third as 3 to 6 % of it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from shm.models import Model, described
from shm.models.base import Conditions
from shm.values import (
    TENSION,
    FloatArray,
    Hanger,
    IntArray,
    ModalTest,
    Mode,
    WatchedQuantity,
)
from shm.watch.quantities import MeasuredMode, log_frequencies, moved

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
    return np.asarray(hanger.assumptions.modulus_per_kelvin.value * change[0] / _STIFFER)


# Of the slope, in a frequency that is not of small amplitude. The mean weighted with the energy of
# a ring-down, while the amplitude falls as exp(-t), has 2/3 of it: the integral of exp(-3t) over
# that of exp(-2t). Measured of softening and hardening hangers: median 0.5, quartiles 0.2 and 1.1
# (tests/benchmarks/identify_ablation.py); the sd is half of their distance over 0.674.
SHARE, SHARE_SD = 0.5, 0.65


@dataclass(frozen=True, eq=False)
class AmplitudeSlopes:
    """Of the baseline, by mode (modes,): change of the log frequency by unit amplitude, its sd, and
    the usual amplitude; 0 of a mode of which no test is sure."""

    slope: FloatArray
    sd: FloatArray
    usual: FloatArray

    @classmethod
    def of(cls, tests: Sequence[ModalTest], modes: Sequence[MeasuredMode]) -> AmplitudeSlopes:
        """From those tests that are sure, weighted by their errors."""
        found = np.zeros((3, len(modes)))
        for column, key in enumerate(modes):
            seen = [
                (mode.amplitude_slope, mode.amplitude_slope_sd, test.amplitude)
                for test in tests
                for mode in test.regular_modes
                if (mode.plane, mode.order) == key and mode.depends_on_amplitude
            ]
            if seen:
                slope, sd, level = np.array(seen).T
                level = np.where(level > 0, level, 1.0)
                # A slope that is known to 1 % is known well enough; none is known exactly.
                weight = (level / np.maximum(sd, 0.01 * np.abs(slope))) ** 2
                mean = weight @ (slope / level) / weight.sum()
                found[:, column] = mean, weight.sum() ** -0.5, level.mean()
        return cls(*found)

    def at(
        self, test: ModalTest, modes: Sequence[Mode], own: IntArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return the shifts of log frequencies (n,) from those of small amplitude, and the sds.

        `own` (n,) are the columns of the test's `modes`. An amplitude not known is the baseline's.
        """
        level = test.amplitude if test.amplitude > 0 else self.usual[own]
        level = np.where([mode.depends_on_amplitude for mode in modes], 0.0, level)
        slope, sd = level * self.slope[own], level * self.sd[own]
        return SHARE * slope, np.hypot(SHARE * sd, SHARE_SD * np.hypot(slope, sd))


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
        its = float(base[each].min())
        for level in (its, *(level for level in levels if level < its)):
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
    chosen = strength > _OF_A_STEP * np.linalg.norm(like[0])
    return np.asarray(strength[chosen, None] * axes[chosen])
