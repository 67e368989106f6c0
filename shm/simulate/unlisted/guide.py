"""A guide with play."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from shm.simulate.bar.description import Bar, Beyond, PartTime, Spring
from shm.simulate.effects.along import in_planes
from shm.simulate.effects.base import Range, Scene, Where
from shm.values import Hanger


def ranges(hanger: Hanger, where: Where) -> dict[str, Range]:
    chord = hanger.nominal_tension_n / hanger.length_m
    return {
        "stiffness_n_m": Range(1e-3 * chord, 30 * chord, 0.0, logarithmic=True),
        "x_m": Range(0.05 * hanger.length_m, 0.95 * hanger.length_m),
        "gap_level": Range(0.3, 0.8, logarithmic=True),
    }


def apply(bar: Bar, values: Mapping[str, float], scene: Scene) -> Bar:
    """A guide that the bar meets on both sides once its swing exceeds the gap.

    The gap is `gap_level` of the swing, at the guide and at the reference level, of the mode that
    swings most there. A. H. Nayfeh and D. T. Mook, Nonlinear Oscillations (1979), 3.3.
    """
    guide = Spring(values["x_m"], in_planes(scene, values["stiffness_n_m"], 0.0))
    level = values["gap_level"] / scene.conditions.amplitude
    met = PartTime(Beyond(values["x_m"], level, both_sides=True), springs=(guide,))
    return replace(bar, part_time=(*bar.part_time, met))
