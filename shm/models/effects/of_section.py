"""Effects of the section: its stiffness, a stretch that has lost some, shear and rotary inertia."""

from __future__ import annotations

import math
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
from shm.models.hanger.physical import PhysicalHanger
from shm.values import NAN, FloatArray, Hanger


class BendingStiffness(Effect):
    """EI differs from the description, all along the hanger.

    Wires of a strand slide (less), a tube or grout round the bar bends with it (more), or the
    section is not the one of the drawing. In one plane only: a section that is not round, which a
    hanger with a diameter has not.
    """

    name = "bending_stiffness"
    title = "Another bending stiffness"
    phrase = "a bending stiffness {stiffness_change:higher|lower} than described"
    over_time = OverTime(
        fell="bending stiffness fell",
        rose="bending stiffness rose",
        check="check for broken wires, a loose sleeve or new grout",
    )
    source = (
        "Papailiou (1997), On the bending stiffness of transmission line conductors; Cardou and "
        "Jolicoeur (1997), Mechanical models of helical strands."
    )
    seen_by = ("frequencies", "the other plane")
    imitated_by = (
        "distributed_mass",
        "timebase",
        "effective_length",
        "stiff_end_zones",
        "rotational_end_flexibility",
        "section_size",
    )
    size = Parameter(
        "stiffness_change",
        "fraction",
        0.005,
        0.8,
        0.0,
        "0.5 to 80 %, either way: from a rolling tolerance to wires that slide freely or a "
        "grouted tube.",
        spread="logarithmic",
        signed=True,
        most=0.99,
    )

    def variants(self, hanger: Hanger, survey: Survey) -> tuple[Variant, ...]:
        round_section = math.isfinite(hanger.diameter_m)
        return (Variant(),) if round_section else base.planes(survey)

    def act(self, bar: PhysicalHanger, values: FloatArray, case: Case) -> PhysicalHanger:
        factor = np.ones_like(bar.bending_stiffness_n_m2)
        factor[:, list(case.variant.planes)] += values[:, :1]
        return replace(bar, bending_stiffness_n_m2=bar.bending_stiffness_n_m2 * factor)


class SectionSize(Effect):
    """The whole hanger has another section than described: a wrong diameter, another bar or strand.

    Area and mass go with the square of the diameter, bending stiffness and rotary inertia with its
    fourth power. Where no diameter is known it is that of a round section of the same area.
    """

    name = "section_size"
    title = "Another diameter"
    phrase = "a diameter {diameter_change:larger|smaller} than described"
    source = "EN 10060:2003, Hot rolled round steel bars for general purposes."
    seen_by = ("frequencies of many orders", "a measured diameter")
    imitated_by = (
        "distributed_mass",
        "bending_stiffness",
        "timebase",
        "effective_length",
        "stiff_end_zones",
    )
    size = Parameter(
        "diameter_change",
        "fraction",
        0.003,
        0.15,
        0.0,
        "0.3 to 15 %, either way: from a rolling tolerance to the next bar but one.",
        spread="logarithmic",
        signed=True,
        most=0.9,
    )

    def act(self, bar: PhysicalHanger, values: FloatArray, case: Case) -> PhysicalHanger:
        area = (1 + values[:, 0]) ** 2
        return replace(
            bar,
            mass_per_length_kg_m=bar.mass_per_length_kg_m * area,
            bending_stiffness_n_m2=bar.bending_stiffness_n_m2 * area[:, None] ** 2,
            shear_compliance_1_n=bar.shear_compliance_1_n / area,
            rotary_inertia_kg_m=bar.rotary_inertia_kg_m * area**2,
        )


class SectionLoss(Effect):
    """Corrosion, wear or a machined neck: over a stretch the bar has lost a share of its area.

    Mass falls with the area, bending stiffness with its square, as in a thinner round bar.
    """

    name = "section_loss"
    title = "Lost section over a stretch"
    localised_as = "section loss"
    phrase = "a loss of {loss} of the section around {x_m}, over {extent_m}"
    over_time = OverTime(
        fell="section was lost over a stretch",
        rose="section was lost over a stretch",
        check="check the rod for corrosion, wear or a crack",
    )
    source = (
        "Cawley and Adams (1979), The location of defects in structures from measurements of "
        "natural frequencies."
    )
    seen_by = ("frequencies of many orders", "shapes")
    imitated_by = ("intermediate_support", "point_mass", "stiff_end_zones", "partial_mass")

    def parameters(self, hanger: Hanger, variant: Variant) -> tuple[Parameter, ...]:
        size = Parameter(
            "loss",
            "fraction",
            0.005,
            0.6,
            0.0,
            "0.5 to 60 % of the area: from surface rust to a bar about to break.",
            spread="logarithmic",
            most=0.99,
        )
        extent = Parameter(
            "extent_m",
            "m",
            0.02 * hanger.length_m,
            0.5 * hanger.length_m,
            NAN,
            "2 to 50 % of the length: from a splash zone or a notch at the socket to half the bar.",
            spread="logarithmic",
        )
        return size, base.place_along(hanger), extent

    def act(self, bar: PhysicalHanger, values: FloatArray, case: Case) -> PhysicalHanger:
        loss, middle_m, extent_m = values.T
        zone = base.zone_about(middle_m, extent_m, (1 - loss) ** 2, 1 - loss)
        return replace(bar, zones=(*bar.zones, zone))


class ShearAndRotaryInertia(Effect):
    """The bar is not slender: it shears, and its sections have inertia against turning.

    Shear stiffness kappa G A with the coefficient of a round section, kappa = 6 (1 + nu) / (7 + 6
    nu), and rotary inertia rho I. It lowers the high orders. A share of 1 is the theory.
    """

    name = "shear_and_rotary_inertia"
    title = "Shear and rotary inertia"
    phrase = "shear and rotary inertia, {share} of Timoshenko"
    source = (
        "Timoshenko (1921), On the correction for shear of the differential equation for "
        "transverse vibrations of prismatic bars; Cowper (1966), The shear coefficient in "
        "Timoshenko's beam theory."
    )
    seen_by = ("frequencies of high orders",)
    imitated_by = ("translational_end_flexibility", "stiff_end_zones", "point_mass")
    size = Parameter(
        "share",
        "of the theory",
        0.5,
        1.5,
        0.0,
        "Half to one and a half times the theory of a round bar: a tube or a flat bar has "
        "another shear coefficient.",
        least=0.0,
    )

    def act(self, bar: PhysicalHanger, values: FloatArray, case: Case) -> PhysicalHanger:
        density_kg_m3 = case.hanger.mass_per_length_kg_m / case.hanger.area_m2
        inertia_kg_m = density_kg_m3 * case.hanger.second_moment_m4
        share = values[:, 0]
        return replace(
            bar,
            shear_compliance_1_n=bar.shear_compliance_1_n + share / case.hanger.shear_stiffness_n,
            rotary_inertia_kg_m=bar.rotary_inertia_kg_m + share * inertia_kg_m,
        )
