"""Modes of a bar, to be read at any place."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from shm.simulate.bar.mesh import interpolation
from shm.values import FloatArray


@dataclass(frozen=True, eq=False)
class BarModes:
    """Modes that belong to one plane, mass-normalised, ascending.

    `angular_frequency_rad_s` (modes,); `nodes_m` (nodes,); `deflection` and `rotation` (planes,
    nodes, modes) in kg^-1/2 and kg^-1/2/m; `added_damping_ratio` (modes,) is what joints add.
    """

    angular_frequency_rad_s: FloatArray
    nodes_m: FloatArray
    deflection: FloatArray
    rotation: FloatArray
    added_damping_ratio: FloatArray

    def at(self, places_m: Sequence[float]) -> FloatArray:
        """Deflections, (places, planes, modes); 0 beyond the ends."""
        places = np.asarray(places_m, float)
        beyond = (places < self.nodes_m[0]) | (places > self.nodes_m[-1])
        element, weights = interpolation(self.nodes_m, np.where(beyond, self.nodes_m[0], places))
        ends = (
            self.deflection[:, element],
            self.rotation[:, element],
            self.deflection[:, element + 1],
            self.rotation[:, element + 1],
        )
        seen = np.einsum("wx,wpxm->xpm", weights, np.array(ends))
        return np.where(beyond[:, None, None], 0.0, seen)
