"""Mode shapes: scale and sign of predicted ones, and errors of the direction of measured ones."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shm.gap.contract import Design, Observations
from shm.values import BoolArray, FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class ShapeScaling:
    """How shapes of a design are scaled. All fields are (S,).

    `shape` counts the shapes from 0 and goes up, `weight` is that of a component in its shape's
    length, `reference` is what a component is compared with for the sign.
    """

    shape: IntArray
    weight: FloatArray
    reference: FloatArray

    @classmethod
    def measured(cls, observations: Observations) -> ShapeScaling:
        """To lengths weighted by certainty, as measured ones have, and to their signs."""
        design = observations.design
        shape = _counted(design)
        precision = 1 / observations.sd[design.frequencies :] ** 2
        mean = np.bincount(shape, precision) / np.bincount(shape)
        value = observations.value[design.frequencies :]
        return cls(shape, precision / mean[shape], precision * value)

    @classmethod
    def of(cls, design: Design, length_m: float) -> ShapeScaling:
        """To unit length, and to the sign of sin(order pi x/L) in the mode's plane."""
        mode = design.shape_mode
        x_m = np.array(design.places_m)[design.shape_place]
        sine = np.sin(design.frequency_order[mode] * np.pi * x_m / length_m)
        in_plane = design.frequency_plane[mode] == design.shape_component
        return cls(_counted(design), np.ones(len(mode)), np.where(in_plane, sine, 0.0))

    def scaled(self, raw: FloatArray) -> FloatArray:
        """Shapes (n, S) of any scale, scaled."""
        if raw.shape[1] == 0:
            return raw
        begins = np.flatnonzero(np.diff(self.shape, prepend=-1))
        length = np.sqrt(np.add.reduceat(raw**2 * self.weight, begins, axis=1))
        agrees = np.add.reduceat(raw * self.reference, begins, axis=1)
        factor = np.where(agrees < 0, -1.0, 1.0) / np.maximum(length, np.finfo(float).tiny)
        return np.asarray(raw * factor[:, self.shape])


def turn_loads(observations: Observations) -> FloatArray:
    """Loads (S, k) of the turns of modes whose direction is uncertain, two for each.

    The first is that of a small turn; the second what a larger one takes off the length along the
    measured shape: turn^2 / 2, whose root mean square is sqrt(3) / 2 times the turn's variance.
    """
    design, columns = observations.design, []
    value = observations.value[design.frequencies :]
    for mode in np.unique(design.shape_mode[turned_modes(observations)]):
        own = design.shape_mode == mode
        turned = own * _turned(observations)
        variance = (turned @ turned) / (value[own] @ value[own])
        columns += [turned, np.sqrt(3) / 2 * variance * own * value]
    return np.column_stack(columns) if columns else np.zeros((len(value), 0))


def turned_modes(observations: Observations) -> BoolArray:
    """Which components (S,) are of shapes whose direction is uncertain."""
    mode = observations.design.shape_mode
    return np.asarray(np.isin(mode, mode[_turned(observations) != 0]))


def _turned(observations: Observations) -> FloatArray:
    """What one standard deviation of its mode's turn does to each component (S,)."""
    count = observations.design.frequencies
    if observations.turned is None:
        return np.zeros(len(observations.value) - count)
    return observations.turned[count:]


def _counted(design: Design) -> IntArray:
    """The shapes' numbers (S,) from 0; components of a shape stand together in a design."""
    return np.asarray(np.unique(design.shape_mode, return_inverse=True)[1])
