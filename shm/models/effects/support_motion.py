"""A deck or an arch that swings along with the hanger."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from shm.models.conditions import Conditions
from shm.models.effects import places, scales
from shm.models.effects.base import Effect, Parameter, Survey, Variant
from shm.models.hanger.physical import PhysicalHanger, SupportMode
from shm.values import NAN, FloatArray, Hanger

_FASTER = (1.6, 2.0, 2.5, 3.2, 4.0, 5.0)
"""A beam's second mode lies at 2.8 (clamped) to 4 times (pinned) the first; with several spans, or
where a deck turns, lower."""
_HEAVIER = 4.0
"""A second mode deflects less than the first where the hanger is fixed: more mass goes with it."""


class SupportMotion(Effect):
    """What holds the hanger vibrates itself, as a mass on a spring, and drags the end along.

    A cross beam or the deck with a frequency near one of the hanger's shifts that mode, down where
    the support's frequency is the higher one, up where it is the lower one. The support's own modes
    are not counted among the hanger's.

    A support is a structure: where the hanger is fixed it deflects by the sum of its modes, and one
    of them may lie near another of the hanger's.
    """

    name = "support_motion"
    title = "A support that swings along"
    source = (
        "Gattulli and Lepidi (2007), Localization and veering in the dynamics of cable-stayed "
        "bridges."
    )
    seen_by = ("frequencies near the support's own", "the other plane", "shapes near the ends")
    imitated_by = ("intermediate_support", "sag", "translational_end_flexibility")
    other_laws = tuple(
        f"with a second mode at {faster:g} times the frequency, {_HEAVIER:g} times as heavy"
        for faster in _FASTER
    )

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
        first = _mode(physical, where, mass_kg, frequency_hz)
        physical = replace(
            physical,
            translational_compliance_m_n=physical.translational_compliance_m_n
            + first.compliance_m_n,
            support_mass_kg=physical.support_mass_kg + first.mass_kg,
        )
        if not variant.law:
            return physical
        faster = _FASTER[variant.law - 1]
        further = _mode(physical, where, _HEAVIER * mass_kg, faster * frequency_hz)
        return replace(physical, support_modes=(*physical.support_modes, further))


def _mode(
    physical: PhysicalHanger,
    where: tuple[slice, int, int],
    mass_kg: FloatArray,
    frequency_hz: FloatArray,
) -> SupportMode:
    """A mode at one end in one plane; none where the mass is infinite."""
    compliance, moving = np.zeros((2, *physical.support_mass_kg.shape))
    compliance[where] = 1 / (mass_kg * (2 * np.pi * frequency_hz) ** 2)
    moving[where] = np.where(np.isinf(mass_kg), 0.0, mass_kg)
    return SupportMode(compliance, moving)
