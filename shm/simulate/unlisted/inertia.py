"""A heavy coupling that must turn with the bar."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from shm.simulate.bar.description import Bar, Mass
from shm.simulate.effects.base import Range, Scene, Where
from shm.values import Hanger


def ranges(hanger: Hanger, where: Where) -> dict[str, Range]:
    own = hanger.mass_per_length_kg_m * hanger.length_m**3
    return {
        "inertia_kg_m2": Range(1e-7 * own, 1e-3 * own, 0.0, logarithmic=True),
        "x_m": Range(0.15 * hanger.length_m, 0.85 * hanger.length_m),
    }


def apply(bar: Bar, values: Mapping[str, float], scene: Scene) -> Bar:
    """Rotary inertia at a place whose mass is known and in the description.

    It lowers the modes that slope there, as a mass does those that swing there. Lord Rayleigh, The
    Theory of Sound (1894), 8.186.
    """
    heavy = Mass(values["x_m"], 0.0, values["inertia_kg_m2"])
    return replace(bar, masses=(*bar.masses, heavy))
