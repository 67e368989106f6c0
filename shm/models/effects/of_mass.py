"""Effects of mass: all along, over a stretch, at one place, of sensors; and of a lateral spring."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from shm.models.effects import base
from shm.models.effects.base import (
    Case,
    Effect,
    OverTime,
    Parameter,
    Survey,
    Variant,
)
from shm.models.hanger.physical import LateralSpring, PhysicalHanger, PointMass
from shm.values import NAN, FloatArray, Hanger


class DistributedMass(Effect):
    """The bar has more mass per length than described: coating, grout, a pipe round it, ice."""

    name = "distributed_mass"
    title = "More mass along the hanger"
    phrase = "a mass per length {mass_change:higher|lower} than described"
    check = "look for paint, a sheath or grout that the description leaves out"
    source = (
        "Blevins (1979), Formulas for Natural Frequency and Mode Shape; ISO 12494:2001, "
        "Atmospheric icing of structures."
    )
    seen_by = ("frequencies", "a known mass")
    imitated_by = (
        "timebase",
        "bending_stiffness",
        "effective_length",
        "stiff_end_zones",
        "section_size",
        "partial_mass",
    )
    size = Parameter(
        "mass_change",
        "fraction",
        0.002,
        1.0,
        0.0,
        "0.2 to 100 % of the mass: from a coat of paint to a grouted pipe or thick ice; things "
        "are put on hangers, not taken off.",
        spread="logarithmic",
    )

    def act(self, bar: PhysicalHanger, values: FloatArray, case: Case) -> PhysicalHanger:
        mass = bar.mass_per_length_kg_m * (1 + values[:, 0])
        return replace(bar, mass_per_length_kg_m=mass)


class UnknownPointMass(Effect):
    """Something heavy sits at one place: a clamp, a coupler, a lamp, a bracket left behind.

    It lowers the modes that move there and leaves those with a node there alone. Frequencies of a
    uniform hanger cannot tell its place from the mirrored one; shapes can.
    """

    name = "point_mass"
    title = "A mass at one place"
    localised_as = "point mass"
    phrase = "a point mass of {mass_kg} at {x_m}"
    over_time = OverTime(
        fell="a mass was added",
        rose="a mass was removed",
        check="look for a lamp, clamp, cable or ice on the hanger, or for what was removed",
    )
    source = "Chen (1963), On the vibration of beams or rods carrying a concentrated mass."
    seen_by = ("frequencies of many orders", "shapes")
    imitated_by = (
        "translational_end_flexibility",
        "intermediate_support",
        "section_loss",
        "sensor_mass",
        "partial_mass",
    )

    def parameters(self, hanger: Hanger, variant: Variant) -> tuple[Parameter, ...]:
        hanger_kg = base.mass_kg(hanger)
        size = Parameter(
            "mass_kg",
            "kg",
            5e-5 * hanger_kg,
            0.1 * hanger_kg,
            0.0,
            "0.005 to 10 % of the hanger's mass: from a cable tie to a coupler or a heavy clamp.",
            spread="logarithmic",
        )
        return size, base.place_along(hanger)

    def act(self, bar: PhysicalHanger, values: FloatArray, case: Case) -> PhysicalHanger:
        mass_kg, x_m = values.T
        return replace(bar, masses=(*bar.masses, PointMass(x_m, mass_kg)))


class PartialMass(Effect):
    """Over a part of its length the bar carries more mass: ice, grout, a pipe or sleeve round it.

    It bends as before: what is put on does not stiffen it.
    """

    name = "partial_mass"
    title = "More mass over a stretch"
    phrase = "a mass per length {mass_change} higher around {x_m}, over {extent_m}"
    check = "look for a sheath, grout or ice on a part of the hanger"
    source = (
        "Chen (1963), On the vibration of beams or rods carrying a concentrated mass; ISO "
        "12494:2001, Atmospheric icing of structures."
    )
    seen_by = ("frequencies of many orders", "shapes")
    imitated_by = ("distributed_mass", "point_mass", "section_loss", "intermediate_support")

    def parameters(self, hanger: Hanger, variant: Variant) -> tuple[Parameter, ...]:
        size = Parameter(
            "mass_change",
            "fraction",
            0.005,
            1.0,
            0.0,
            "0.5 to 100 % of the mass there: from a wrapping to a grouted pipe or thick ice.",
            spread="logarithmic",
        )
        extent = Parameter(
            "extent_m",
            "m",
            0.05 * hanger.length_m,
            0.8 * hanger.length_m,
            NAN,
            "5 to 80 % of the length: shorter is a point mass, longer is mass all along.",
            spread="logarithmic",
        )
        return size, base.place_along(hanger), extent

    def act(self, bar: PhysicalHanger, values: FloatArray, case: Case) -> PhysicalHanger:
        change, middle_m, extent_m = values.T
        zone = base.zone_about(middle_m, extent_m, np.ones_like(change), 1 + change)
        return replace(bar, zones=(*bar.zones, zone))


class SensorMass(Effect):
    """Sensors with their clamps and magnets are heavy: each adds the same mass where it sits."""

    name = "sensor_mass"
    title = "Heavy sensors"
    phrase = "the mass of the sensors, {mass_kg} each"
    over_time = OverTime(
        fell="sensors are heavier or elsewhere",
        rose="sensors are lighter or elsewhere",
        check="check which sensors were mounted, and where",
        apart_by="the sensors of the baseline at their old places",
    )
    source = (
        "Ewins (2000), Modal Testing: Theory, Practice and Application; Maes, Peeters, Reynders, "
        "Lombaert and De Roeck (2013), Identification of axial forces in beam members by local "
        "vibration measurements."
    )
    seen_by = ("frequencies of many orders", "known places of the sensors")
    imitated_by = ("point_mass", "section_loss")
    of_the_hanger = False
    size = Parameter(
        "mass_kg",
        "kg",
        0.01,
        20.0,
        0.0,
        "10 g to 20 kg each: from a piezo on wax to a boxed seismometer on a clamp.",
        spread="logarithmic",
    )

    def invisible(self, hanger: Hanger, survey: Survey) -> str:
        if survey.sensor_places_m:
            return ""
        return "It takes sensors with known places: give the mode shapes with their x_m."

    def variants(self, hanger: Hanger, survey: Survey) -> tuple[Variant, ...]:
        return (Variant("all sensors", places_m=survey.sensor_places_m),)

    def act(self, bar: PhysicalHanger, values: FloatArray, case: Case) -> PhysicalHanger:
        mass_kg = values[:, 0]
        added = tuple(
            PointMass(np.full_like(mass_kg, place_m), mass_kg) for place_m in case.variant.places_m
        )
        return replace(bar, masses=bar.masses + added)


class IntermediateSupport(Effect):
    """The hanger touches or is tied to something between its ends: a handrail, a tie, a damper.

    A spring to a place that stands still, in both planes alike or in one.
    """

    name = "intermediate_support"
    title = "Held between the ends"
    localised_as = "lateral spring"
    phrase = "an intermediate support of {stiffness_n_m} at {x_m}"
    check = "look for a guide, clamp, cable or neighbour that touches the hanger"
    source = "Grossi and Albarracín (2003), Eigenfrequencies of generally restrained beams."
    seen_by = ("frequencies of low orders", "the other plane", "shapes")
    imitated_by = ("sag", "support_motion", "section_loss", "point_mass", "partial_mass")

    def variants(self, hanger: Hanger, survey: Survey) -> tuple[Variant, ...]:
        return base.planes(survey)

    def parameters(self, hanger: Hanger, variant: Variant) -> tuple[Parameter, ...]:
        stiffness = _lateral_stiffness_n_m(hanger)
        size = Parameter(
            "stiffness_n_m",
            "N/m",
            1e-3 * stiffness,
            100 * stiffness,
            0.0,
            "0.001 to 100 times T/L, what the tension itself resists with (without any, 100 "
            "EI/L^3, the bar): from a cable that leans on the hanger to a stiff tie.",
            spread="logarithmic",
        )
        return size, base.place_along(hanger)

    def act(self, bar: PhysicalHanger, values: FloatArray, case: Case) -> PhysicalHanger:
        stiffness = np.zeros_like(bar.bending_stiffness_n_m2)
        stiffness[:, list(case.variant.planes)] = values[:, :1]
        spring = LateralSpring(values[:, 1], stiffness, np.zeros(len(values)))
        return replace(bar, springs=(*bar.springs, spring))


def _lateral_stiffness_n_m(hanger: Hanger) -> float:
    if hanger.nominal_tension_n:
        return hanger.nominal_tension_n / hanger.length_m
    return 100 * hanger.bending_stiffness_n_m2 / hanger.length_m**3
