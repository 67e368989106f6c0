"""A crack that opens and closes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from shm.simulate.bar.description import Bar, Beyond, PartTime, Stretch
from shm.simulate.effects.along import in_planes
from shm.simulate.effects.base import Range, Scene, Where
from shm.values import Hanger

_LONG = 0.002  # of the length: the stretch that stands for the crack's hinge


def ranges(hanger: Hanger, where: Where) -> dict[str, Range]:
    own = hanger.length_m / hanger.bending_stiffness_n_m2
    return {
        "compliance_rad_n_m": Range(1e-4 * own, 0.3 * own, 0.0, logarithmic=True),
        "x_m": Range(0.03 * hanger.length_m, 0.97 * hanger.length_m),
        "opening_level": Range(0.2, 0.8, logarithmic=True),
    }


def apply(bar: Bar, values: Mapping[str, float], scene: Scene) -> Bar:
    """A crack that the hit opens on one side of the swing, as a hinge with a compliance.

    It opens where the bending at the crack exceeds `opening_level` of what the mode that bends most
    there has at the reference level: each mode has its own level above which it falls. S. M. Cheng
    et al., J. Sound Vib. 225 (1999), a breathing crack as a bilinear spring.
    """
    long = _LONG * bar.length_m
    soft = 1 / (1 + values["compliance_rad_n_m"] * min(bar.bending_stiffness_n_m2) / long)
    start = values["x_m"] - long / 2
    opened = Stretch(start, start + long, in_planes(scene, soft, 1.0))
    level = values["opening_level"] / scene.conditions.amplitude
    breathing = PartTime(Beyond(values["x_m"], level, curvature=True), stretches=(opened,))
    return replace(bar, part_time=(*bar.part_time, breathing))
