"""The scale and sign of predicted mode shapes: unit length, turned to a reference."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shm.gap.contract import Design, Observations
from shm.values import FloatArray, IntArray


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


def _counted(design: Design) -> IntArray:
    """The shapes' numbers (S,) from 0; components of a shape stand together in a design."""
    return np.asarray(np.unique(design.shape_mode, return_inverse=True)[1])
