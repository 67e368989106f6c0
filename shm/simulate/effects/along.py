"""What differs along the bar: section, mass, shear, sag, and what hangs on it or holds it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from shm.simulate.bar.description import Bar, Mass, Pair, Spring, Stretch
from shm.simulate.effects.base import Range, Scene, Where
from shm.values import Hanger

Values = Mapping[str, float]


def in_planes(scene: Scene, value: float, otherwise: float) -> Pair:
    """A value in the planes that are meant, another elsewhere."""
    planes = scene.where.planes
    return value if 0 in planes else otherwise, value if 1 in planes else otherwise


def stiffness_ranges(hanger: Hanger, where: Where) -> dict[str, Range]:
    return {"stiffness_change": Range(0.005, 0.8, 0.0, logarithmic=True, signed=True)}


def stiffness(bar: Bar, values: Values, scene: Scene) -> Bar:
    """Strands that slip, a grouted tube, another steel: the whole bar is softer or stiffer."""
    factor = in_planes(scene, 1 + values["stiffness_change"], 1.0)
    own = bar.bending_stiffness_n_m2
    return replace(bar, bending_stiffness_n_m2=(own[0] * factor[0], own[1] * factor[1]))


def heaviness_ranges(hanger: Hanger, where: Where) -> dict[str, Range]:
    return {"mass_change": Range(0.002, 0.3, 0.0, logarithmic=True)}


def heaviness(bar: Bar, values: Values, scene: Scene) -> Bar:
    """Paint, wrapping, ice, a cable tied on."""
    return replace(bar, mass_per_length_kg_m=bar.mass_per_length_kg_m * (1 + values["mass_change"]))


def clamp_ranges(hanger: Hanger, where: Where) -> dict[str, Range]:
    own = hanger.mass_per_length_kg_m * hanger.length_m
    return {
        "mass_kg": Range(5e-5 * own, 0.1 * own, 0.0, logarithmic=True),
        "x_m": Range(0.0, hanger.length_m),
    }


def clamp(bar: Bar, values: Values, scene: Scene) -> Bar:
    """A clamp, a lamp, a sign."""
    return replace(bar, masses=(*bar.masses, Mass(values["x_m"], values["mass_kg"])))


def loss_ranges(hanger: Hanger, where: Where) -> dict[str, Range]:
    return {
        "loss": Range(0.005, 0.6, 0.0, logarithmic=True),
        "x_m": Range(0.0, hanger.length_m),
        "extent_m": Range(0.02 * hanger.length_m, 0.5 * hanger.length_m, logarithmic=True),
    }


def loss(bar: Bar, values: Values, scene: Scene) -> Bar:
    """Corrosion: area and mass fall by the loss, bending stiffness by its square."""
    left, half = 1 - values["loss"], values["extent_m"] / 2
    worn = Stretch(values["x_m"] - half, values["x_m"] + half, (left**2, left**2), left)
    return replace(bar, stretches=(*bar.stretches, worn))


def size_ranges(hanger: Hanger, where: Where) -> dict[str, Range]:
    return {"diameter_change": Range(0.003, 0.15, 0.0, logarithmic=True, signed=True)}


def size(bar: Bar, values: Values, scene: Scene) -> Bar:
    """Another bar than drawn: mass as the diameter squared, stiffness as its fourth power."""
    ratio = 1 + values["diameter_change"]
    own = bar.bending_stiffness_n_m2
    return replace(
        bar,
        mass_per_length_kg_m=bar.mass_per_length_kg_m * ratio**2,
        bending_stiffness_n_m2=(own[0] * ratio**4, own[1] * ratio**4),
        shear_compliance_1_n=bar.shear_compliance_1_n / ratio**2,
        rotary_inertia_kg_m=bar.rotary_inertia_kg_m * ratio**4,
    )


def coat_ranges(hanger: Hanger, where: Where) -> dict[str, Range]:
    return {
        "mass_change": Range(0.005, 1.0, 0.0, logarithmic=True),
        "x_m": Range(0.0, hanger.length_m),
        "extent_m": Range(0.05 * hanger.length_m, 0.8 * hanger.length_m, logarithmic=True),
    }


def coat(bar: Bar, values: Values, scene: Scene) -> Bar:
    """Ice, grout or a pipe over a part of the length; the bar bends as before."""
    half = values["extent_m"] / 2
    heavier = Stretch(
        values["x_m"] - half, values["x_m"] + half, (1.0, 1.0), 1 + values["mass_change"]
    )
    return replace(bar, stretches=(*bar.stretches, heavier))


def shear_ranges(hanger: Hanger, where: Where) -> dict[str, Range]:
    return {"share": Range(0.5, 1.5, 0.0)}


def shear(bar: Bar, values: Values, scene: Scene) -> Bar:
    """Timoshenko's theory of a round section (G. R. Cowper, J. Appl. Mech. 33, 1966)."""
    hanger = scene.hanger
    ratio = hanger.poissons_ratio
    coefficient = 6 * (1 + ratio) / (7 + 6 * ratio)
    rigidity = hanger.elastic_modulus_pa / (2 * (1 + ratio)) * hanger.area_m2
    inertia = hanger.mass_per_length_kg_m / hanger.area_m2 * hanger.second_moment_m4
    return replace(
        bar,
        shear_compliance_1_n=values["share"] / (coefficient * rigidity),
        rotary_inertia_kg_m=values["share"] * inertia,
    )


def sag_ranges(hanger: Hanger, where: Where) -> dict[str, Range]:
    return {"sag_parameter": Range(0.001, 20.0, 0.0, logarithmic=True)}


def sag(bar: Bar, values: Values, scene: Scene) -> Bar:
    """An inclined hanger sags in one plane, and stretches when it swings there."""
    added = in_planes(scene, values["sag_parameter"], 0.0)
    own = bar.sag_parameter
    return replace(bar, sag_parameter=(own[0] + added[0], own[1] + added[1]))


def brace_ranges(hanger: Hanger, where: Where) -> dict[str, Range]:
    chord = hanger.nominal_tension_n / hanger.length_m
    return {
        "stiffness_n_m": Range(1e-3 * chord, 100 * chord, 0.0, logarithmic=True),
        "x_m": Range(0.0, hanger.length_m),
    }


def brace(bar: Bar, values: Values, scene: Scene) -> Bar:
    """A guide, a railing or a tie touches the bar."""
    spring = Spring(values["x_m"], in_planes(scene, values["stiffness_n_m"], 0.0))
    return replace(bar, springs=(*bar.springs, spring))
