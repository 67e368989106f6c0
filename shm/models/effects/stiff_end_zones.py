"""Ends of the bar that are stiffer than the rest."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from shm.models.conditions import Conditions
from shm.models.effects import places
from shm.models.effects.base import GRADUAL, Effect, Parameter, Survey, Variant
from shm.models.hanger.physical import PhysicalHanger, Zone
from shm.values import NAN, PLANES, FloatArray, Hanger


class StiffEndZones(Effect):
    """Next to its end the bar is stiffer: a slotted plate, a fork, a socket, a threaded sleeve.

    The zone keeps the bar's mass per length; its bending stiffness is multiplied, by a plate in its
    own plane alone.
    """

    name = "stiff_end_zones"
    title = "Stiff zones at the ends"
    source = "Jang and Bert (1989), Free vibration of stepped beams: exact and numerical solutions."
    seen_by = ("frequencies", "shapes near the ends")
    imitated_by = ("effective_length", "bending_stiffness", "shear_and_rotary_inertia")
    other_laws = (
        "the stiffness falls gradually, as in a socket that tapers",
        "the compliance rises gradually, as in a socket that is cut to a cone",
    )

    def variants(self, hanger: Hanger, survey: Survey) -> tuple[Variant, ...]:
        return places.ends_and_planes(survey)

    def parameters(self, hanger: Hanger, variant: Variant) -> tuple[Parameter, ...]:
        size = Parameter(
            "zone_m",
            "m",
            0.0005 * hanger.length_m,
            0.12 * hanger.length_m,
            0.0,
            "0.05 to 12 % of the length at each end: from a weld to a whole end plate.",
            spread="logarithmic",
            most=hanger.length_m / 2,
        )
        ratio = Parameter(
            "stiffness_ratio",
            "times EI",
            2.0,
            100.0,
            NAN,
            "2 to 100 times the bar's: a sleeve doubles it, a plate in its stiff plane is all but "
            "rigid.",
            spread="logarithmic",
        )
        return size, ratio

    def applied(
        self,
        physical: PhysicalHanger,
        values: FloatArray,
        variant: Variant,
        conditions: Conditions,
        hanger: Hanger,
    ) -> PhysicalHanger:
        deck_m, arch_m = physical.deck_end_m, physical.arch_end_m
        reach_m, ratio = values.T
        same = np.ones_like(ratio)
        zones = []
        for step, times in _steps(ratio, variant.law):
            factor = np.ones((len(ratio), len(PLANES)))
            factor[:, list(variant.planes)] = times[:, None]
            both = (
                Zone(deck_m, deck_m + step * reach_m, factor, same),
                Zone(arch_m - step * reach_m, arch_m, factor, same),
            )
            zones += [both[end] for end in variant.ends]
        return replace(physical, zones=(*physical.zones, *zones))


def _steps(ratio: FloatArray, law: int) -> list[tuple[float, FloatArray]]:
    """The reaches of steps one in another, each with the factor by which it stiffens."""
    if law == 0:
        return [(1.0, ratio)]
    if law == 1:
        return [(reach, ratio ** (1 / len(GRADUAL))) for reach in GRADUAL]
    left = 1 / ratio + (1 - 1 / ratio) * np.array([[0.0], [0.25], [0.75], [1.0]])
    return list(zip(GRADUAL, left[1:] / left[:-1], strict=True))
