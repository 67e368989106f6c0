"""A deck or an arch that swings along with the hanger."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from shm.models.conditions import Conditions
from shm.models.effects import places, scales
from shm.models.effects.base import Effect, Parameter, Survey, Variant
from shm.models.hanger.physical import PhysicalHanger
from shm.values import NAN, FloatArray, Hanger


class SupportMotion(Effect):
    """What holds the hanger vibrates itself, as a mass on a spring, and drags the end along.

    A cross beam or the deck with a frequency near one of the hanger's shifts that mode, down where
    the support's frequency is the higher one, up where it is the lower one. The support's own mode
    is not counted among the hanger's.
    """

    name = "support_motion"
    title = "A support that swings along"
    source = (
        "Gattulli and Lepidi (2007), Localization and veering in the dynamics of cable-stayed "
        "bridges."
    )
    seen_by = ("frequencies near the support's own", "the other plane", "shapes near the ends")
    imitated_by = ("intermediate_support", "sag", "translational_end_flexibility")

    def invisible(self, hanger: Hanger, survey: Survey) -> str:
        return "" if hanger.supports.ends("clamped", "pinned") else "Nothing holds either end."

    def variants(self, hanger: Hanger, survey: Survey) -> tuple[Variant, ...]:
        held = hanger.supports.ends("clamped", "pinned")
        everywhere = places.at_ends(places.ends_and_planes(survey), held)
        return tuple(each for each in everywhere if len(each.ends) == len(each.planes) == 1)

    def parameters(self, hanger: Hanger, variant: Variant) -> tuple[Parameter, ...]:
        own_kg = scales.mass_kg(hanger)
        size = Parameter(
            "support_mass_kg",
            "kg",
            0.3 * own_kg,
            1000 * own_kg,
            np.inf,
            "0.3 to 1000 times the hanger's mass: from a light bracket to a span of the deck.",
            spread="logarithmic",
        )
        frequency = Parameter(
            "support_frequency_hz",
            "Hz",
            0.5,
            60.0,
            NAN,
            "0.5 to 60 Hz: from the first mode of a bridge to a local mode of a cross beam.",
            spread="logarithmic",
        )
        return size, frequency

    def applied(
        self,
        physical: PhysicalHanger,
        values: FloatArray,
        variant: Variant,
        conditions: Conditions,
        hanger: Hanger,
    ) -> PhysicalHanger:
        mass_kg, frequency_hz = values.T
        where = (slice(None), variant.ends[0], variant.planes[0])
        compliance = physical.translational_compliance_m_n.copy()
        support_kg = physical.support_mass_kg.copy()
        compliance[where] += 1 / (mass_kg * (2 * np.pi * frequency_hz) ** 2)
        support_kg[where] += np.where(np.isinf(mass_kg), 0.0, mass_kg)
        return replace(
            physical, translational_compliance_m_n=compliance, support_mass_kg=support_kg
        )
