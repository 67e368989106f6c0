"""Effects of the ends: springs, lengths, stiff zones, a support that swings."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from shm.models.effects import base
from shm.models.effects.base import Case, Effect, Parameter, Survey, Variant
from shm.models.hanger.physical import PhysicalHanger, Zone
from shm.values import NAN, PLANES, FloatArray, Hanger


class RotationalEndFlexibility(Effect):
    """The joint, the gusset plate or the deck behind it turns when the hanger bends.

    A rotational spring stands between the bar and the structure; k1 and k3 act in the transverse
    plane (deck end, arch end), k2 and k4 in the longitudinal one. It lowers all frequencies, the
    low orders most, and so passes for less tension where ends are taken as clamped. At both ends
    the ends are alike: k3 = k1 and k4 = k2. Where the description has a hinge it is the other way
    round: what holds the end resists its turning.
    """

    name = "rotational_end_flexibility"
    title = "Ends that turn"
    phrase = "ends that turn against springs of {log10_k}"
    source = (
        "Monforton and Wu (1963), Matrix analysis of semi-rigidly connected frames; "
        "Geier, De Roeck and Flesch (2006), Accurate cable force determination using ambient "
        "vibration measurements."
    )
    seen_by = ("frequencies", "the other plane", "shapes near the ends")
    imitated_by = (
        "joint_softening",
        "skewed_principal_axes",
        "effective_length",
        "bending_stiffness",
        "translational_end_flexibility",
    )

    def invisible(self, hanger: Hanger, survey: Survey) -> str:
        return "" if hanger.supports.ends("clamped", "pinned") else "Nothing holds either end."

    def variants(self, hanger: Hanger, survey: Survey) -> tuple[Variant, ...]:
        everywhere = base.springs(survey)
        turning = base.at_ends(everywhere, hanger.supports.ends("pinned"))
        return base.at_ends(everywhere, hanger.supports.ends("clamped")) + turning

    def parameters(self, hanger: Hanger, variant: Variant) -> tuple[Parameter, ...]:
        first = 1 + 2 * variant.ends[0]
        hinge = variant.ends[0] in hanger.supports.ends("pinned")
        return tuple(
            base.rotational_stiffness(f"log10_k{first + plane}", hanger, hinge)
            for plane in base.free_planes(variant)
        )

    def act(self, bar: PhysicalHanger, values: FloatArray, case: Case) -> PhysicalHanger:
        compliance = bar.rotational_compliance_rad_n_m.copy()
        for end in case.variant.ends:
            for plane in case.variant.planes:
                column = 0 if case.variant.isotropic else case.variant.planes.index(plane)
                present, added = compliance[:, end, plane, plane], 10.0 ** -values[:, column]
                compliance[:, end, plane, plane] = np.where(
                    np.isinf(present), added, present + added
                )
        return replace(bar, rotational_compliance_rad_n_m=compliance)


# Judgement: three decades from a support about as soft as the bar to one that gives way by less
# than the noise of frequencies.
_SOFT, _STIFF = 3.0, 3000.0


class TranslationalEndFlexibility(Effect):
    """What holds the end bends: a thin cross beam, a long bracket, a soft bearing.

    A spring without mass holds the end in the plane; kt1 and kt3 act in the transverse plane (deck
    end, arch end), kt2 and kt4 in the longitudinal one. At both ends the ends are alike.
    """

    name = "translational_end_flexibility"
    title = "Ends that give way sideways"
    phrase = "ends that give way sideways against springs of {log10_kt}"
    source = "Rao and Mirza (1989), A note on vibrations of generally restrained beams."
    seen_by = ("frequencies", "the other plane", "shapes near the ends")
    imitated_by = ("support_motion", "shear_and_rotary_inertia", "stiff_end_zones", "point_mass")

    def invisible(self, hanger: Hanger, survey: Survey) -> str:
        return "" if hanger.supports.ends("clamped", "pinned") else "Nothing holds either end."

    def variants(self, hanger: Hanger, survey: Survey) -> tuple[Variant, ...]:
        held = hanger.supports.ends("clamped", "pinned")
        return base.at_ends(base.springs(survey), held)

    def parameters(self, hanger: Hanger, variant: Variant) -> tuple[Parameter, ...]:
        first = 1 + 2 * variant.ends[0]
        stiffness = _lateral_stiffness_n_m(hanger)
        return tuple(
            Parameter(
                f"log10_kt{first + plane}",
                "N/m",
                math.log10(_SOFT * stiffness),
                math.log10(_STIFF * stiffness),
                np.inf,
                "3 to 3000 times T/L + 100 EI/L^3, what the bar itself resists with: what holds a "
                "hanger is stiffer than the hanger, nobody knows by how many orders of magnitude.",
            )
            for plane in base.free_planes(variant)
        )

    def act(self, bar: PhysicalHanger, values: FloatArray, case: Case) -> PhysicalHanger:
        compliance = bar.translational_compliance_m_n.copy()
        for end in case.variant.ends:
            for plane in case.variant.planes:
                column = 0 if case.variant.isotropic else case.variant.planes.index(plane)
                compliance[:, end, plane] += 10.0 ** -values[:, column]
        return replace(bar, translational_compliance_m_n=compliance)


def _lateral_stiffness_n_m(hanger: Hanger) -> float:
    length_m = hanger.length_m
    return hanger.nominal_tension_n / length_m + 100 * hanger.bending_stiffness_n_m2 / length_m**3


class EffectiveLength(Effect):
    """The bar vibrates over another length than the one given.

    It is held inside of its plate or socket (negative), or beyond the face that the drawing shows
    (positive). At both ends the change is shared evenly. A fitting goes with its end.
    """

    name = "effective_length"
    title = "Another length than the drawing's"
    phrase = "an effective length {length_change_m:longer|shorter} than described"
    source = (
        "Amabili, Carra, Collini, Garziera and Panno (2010), Estimation of tensile force in "
        "tie-rods using a frequency-based identification method."
    )
    seen_by = ("frequencies", "shapes", "a known mass")
    imitated_by = (
        "distributed_mass",
        "timebase",
        "bending_stiffness",
        "stiff_end_zones",
        "rotational_end_flexibility",
        "section_size",
    )

    def variants(self, hanger: Hanger, survey: Survey) -> tuple[Variant, ...]:
        return base.ends()

    def parameters(self, hanger: Hanger, variant: Variant) -> tuple[Parameter, ...]:
        size = Parameter(
            "length_change_m",
            "m",
            0.001 * hanger.length_m,
            0.12 * hanger.length_m,
            0.0,
            "0.1 to 12 % of the length, either way: from the tolerance of a drawing to a whole end "
            "plate that holds the bar or does not.",
            spread="logarithmic",
            signed=True,
            most=hanger.length_m / 2,
        )
        return (size,)

    def act(self, bar: PhysicalHanger, values: FloatArray, case: Case) -> PhysicalHanger:
        each = values[:, 0] / len(case.variant.ends)
        deck_m, arch_m = -each * (0 in case.variant.ends), each * (1 in case.variant.ends)
        return replace(
            bar,
            deck_end_m=bar.deck_end_m + deck_m,
            arch_end_m=bar.arch_end_m + arch_m,
            zones=tuple(_move_with_ends(zone, bar, deck_m, arch_m) for zone in bar.zones),
        )


def _move_with_ends(
    zone: Zone, bar: PhysicalHanger, deck_m: FloatArray, arch_m: FloatArray
) -> Zone:
    """Move a zone with the end that it reaches, with both if it reaches both."""
    near_m = 1e-9 * bar.length_m  # rounding
    at_deck = zone.start_m <= bar.deck_end_m + near_m
    at_arch = zone.end_m >= bar.arch_end_m - near_m
    start_m = np.where(at_deck, deck_m, np.where(at_arch, arch_m, 0.0))
    end_m = np.where(at_arch, arch_m, np.where(at_deck, deck_m, 0.0))
    return replace(zone, start_m=zone.start_m + start_m, end_m=zone.end_m + end_m)


class StiffEndZones(Effect):
    """Next to its end the bar is stiffer: a slotted plate, a fork, a socket, a threaded sleeve.

    The zone keeps the bar's mass per length; its bending stiffness is multiplied, by a plate in its
    own plane alone.
    """

    name = "stiff_end_zones"
    title = "Stiff zones at the ends"
    phrase = "end zones of {zone_m} with a bending stiffness of {stiffness_ratio}"
    check = "measure how far sockets and sleeves stiffen the ends"
    source = "Jang and Bert (1989), Free vibration of stepped beams: exact and numerical solutions."
    seen_by = ("frequencies", "shapes near the ends")
    imitated_by = (
        "effective_length",
        "bending_stiffness",
        "shear_and_rotary_inertia",
        "section_size",
    )

    def variants(self, hanger: Hanger, survey: Survey) -> tuple[Variant, ...]:
        return base.ends_and_planes(survey)

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

    def act(self, bar: PhysicalHanger, values: FloatArray, case: Case) -> PhysicalHanger:
        deck_m, arch_m = bar.deck_end_m, bar.arch_end_m
        reach_m, ratio = values.T
        same = np.ones_like(ratio)
        factor = np.ones((len(ratio), len(PLANES)))
        factor[:, list(case.variant.planes)] = ratio[:, None]
        both = (
            Zone(deck_m, deck_m + reach_m, factor, same),
            Zone(arch_m - reach_m, arch_m, factor, same),
        )
        zones = (both[end] for end in case.variant.ends)
        return replace(bar, zones=(*bar.zones, *zones))


class SupportMotion(Effect):
    """The support vibrates itself, as a mass on a spring, and drags the end along.

    A cross beam or the deck with a frequency near one of the hanger's shifts that mode, down where
    the support's frequency is the higher one, up where it is the lower one. The support's own modes
    are not counted among the hanger's.
    """

    name = "support_motion"
    title = "A support that swings along"
    phrase = (
        "a support that moves as a mass of {support_mass_kg} with a frequency of its "
        "own of {support_frequency_hz}"
    )
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
        everywhere = base.at_ends(base.ends_and_planes(survey), held)
        return tuple(each for each in everywhere if len(each.ends) == len(each.planes) == 1)

    def parameters(self, hanger: Hanger, variant: Variant) -> tuple[Parameter, ...]:
        hanger_kg = base.mass_kg(hanger)
        size = Parameter(
            "support_mass_kg",
            "kg",
            0.3 * hanger_kg,
            1000 * hanger_kg,
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

    def act(self, bar: PhysicalHanger, values: FloatArray, case: Case) -> PhysicalHanger:
        mass_kg, frequency_hz = values.T
        where = (slice(None), case.variant.ends[0], case.variant.planes[0])
        compliance_m_n = bar.translational_compliance_m_n.copy()
        compliance_m_n[where] += 1 / (mass_kg * (2 * np.pi * frequency_hz) ** 2)
        moving_kg = bar.support_mass_kg.copy()
        moving_kg[where] += np.where(np.isinf(mass_kg), 0.0, mass_kg)
        return replace(bar, translational_compliance_m_n=compliance_m_n, support_mass_kg=moving_kg)
