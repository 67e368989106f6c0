"""The catalogue's effects as the simulator plants them: along the bar, at its ends, in tests."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

from shm.values import Hanger
from tests.worlds.simulated.bar.description import Bar, BarEnd, Mass, Pair, Spring, Stretch
from tests.worlds.simulated.effects.base import Range, Scene, Where

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
    return {"mass_change": Range(0.002, 1.0, 0.0, logarithmic=True)}


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


_JOINT_LOSS = 0.1  # a joint's loss factor at the reference level


def _number(plane: int, end: int) -> int:
    """The thesis counts springs 1, 2 at the deck end (transverse, longitudinal), 3, 4 above."""
    return plane + 1 + 2 * end


def _spring_names(stem: str, where: Where) -> list[str]:
    """Both ends are alike and named by the deck end's."""
    return [f"{stem}{_number(plane, where.ends[0])}" for plane in where.planes]


def turning_range(hanger: Hanger) -> Range:
    """log10 of a rotational spring, 1000 to 0.03 times EI times the wave number of mode 4."""
    bending = hanger.bending_stiffness_n_m2
    wave_number = math.hypot(
        math.sqrt(hanger.nominal_tension_n / bending), 4 * math.pi / hanger.length_m
    )
    scale = math.log10(bending * wave_number)
    return Range(scale + 3, scale + math.log10(0.03), zero=math.inf)


def turning_ranges(hanger: Hanger, where: Where) -> dict[str, Range]:
    return {name: turning_range(hanger) for name in _spring_names("log10_k", where)}


def turning(bar: Bar, values: Values, scene: Scene) -> Bar:
    """Ends rotate against springs, beside what they do already."""
    for end in scene.where.ends:
        softness = [0.0, 0.0]
        for name, plane in zip(
            _spring_names("log10_k", scene.where), scene.where.planes, strict=True
        ):
            softness[plane] = 10.0 ** -values[name]
        bar = bar.with_end(end, _softer(bar.ends[end], (softness[0], softness[1])))
    return bar


def _softer(end: BarEnd, by_rad_n_m: Pair, cross_rad_n_m: float = 0.0) -> BarEnd:
    own = end.turning_rad_n_m
    return replace(
        end,
        turning_rad_n_m=(own[0] + by_rad_n_m[0], own[1] + by_rad_n_m[1]),
        cross_rad_n_m=end.cross_rad_n_m + cross_rad_n_m,
    )


def moving_ranges(hanger: Hanger, where: Where) -> dict[str, Range]:
    length = hanger.length_m
    own = hanger.nominal_tension_n / length + 100 * hanger.bending_stiffness_n_m2 / length**3
    known = Range(math.log10(3000 * own), math.log10(3 * own), zero=math.inf)
    return dict.fromkeys(_spring_names("log10_kt", where), known)


def moving(bar: Bar, values: Values, scene: Scene) -> Bar:
    """Ends deflect against springs."""
    for end in scene.where.ends:
        for name, plane in zip(
            _spring_names("log10_kt", scene.where), scene.where.planes, strict=True
        ):
            bar = bar.with_end(end, _looser(bar.ends[end], plane, 10.0 ** values[name]))
    return bar


def _looser(end: BarEnd, plane: int, spring_n_m: float, mass_kg: float = 0.0) -> BarEnd:
    held, mass = list(end.held_n_m), list(end.support_mass_kg)
    softness = 1 / held[plane] + 1 / spring_n_m
    held[plane] = 1 / softness if softness else math.inf
    mass[plane] += mass_kg
    return replace(end, held_n_m=(held[0], held[1]), support_mass_kg=(mass[0], mass[1]))


def support_ranges(hanger: Hanger, where: Where) -> dict[str, Range]:
    own = hanger.mass_per_length_kg_m * hanger.length_m
    return {
        "support_mass_kg": Range(1000 * own, 0.3 * own, zero=math.inf, logarithmic=True),
        "support_frequency_hz": Range(0.5, 60.0, logarithmic=True),
    }


def support(bar: Bar, values: Values, scene: Scene) -> Bar:
    """An end deflects with a mass of its own on a spring: a deck or an arch that swings."""
    mass = values["support_mass_kg"]
    if math.isinf(mass):
        return bar
    spring = mass * (2 * math.pi * values["support_frequency_hz"]) ** 2
    for end in scene.where.ends:
        for plane in scene.where.planes:
            bar = bar.with_end(end, _looser(bar.ends[end], plane, spring, mass))
    return bar


def length_ranges(hanger: Hanger, where: Where) -> dict[str, Range]:
    length = hanger.length_m
    return {
        "length_change_m": Range(0.001 * length, 0.12 * length, 0.0, logarithmic=True, signed=True)
    }


def length(bar: Bar, values: Values, scene: Scene) -> Bar:
    """The bar ends elsewhere; what changes is split evenly over the ends that are meant."""
    share = values["length_change_m"] / len(scene.where.ends)
    deck = bar.deck_end_m - (share if 0 in scene.where.ends else 0.0)
    arch = bar.arch_end_m + (share if 1 in scene.where.ends else 0.0)
    return replace(bar, deck_end_m=deck, arch_end_m=arch)


def zone_ranges(hanger: Hanger, where: Where) -> dict[str, Range]:
    length = hanger.length_m
    return {
        "zone_m": Range(0.0005 * length, 0.12 * length, 0.0, logarithmic=True),
        "stiffness_ratio": Range(2.0, 100.0, logarithmic=True),
    }


def zone(bar: Bar, values: Values, scene: Scene) -> Bar:
    """Sockets and plates stiffen the bar next to its ends."""
    long, factor = values["zone_m"], in_planes(scene, values["stiffness_ratio"], 1.0)
    spans = (
        (bar.deck_end_m, bar.deck_end_m + long),
        (bar.arch_end_m - long, bar.arch_end_m),
    )
    added = tuple(Stretch(*spans[end], stiffness_factor=factor) for end in scene.where.ends)
    return replace(bar, stretches=bar.stretches + added) if long else bar


def joint_ranges(hanger: Hanger, where: Where) -> dict[str, Range]:
    return {"log10_k_at_reference_level": turning_range(hanger)}


def joint(bar: Bar, values: Values, scene: Scene) -> Bar:
    """Joints slip the more the harder the hit: softer and with more damping."""
    level = scene.conditions.amplitude
    softness = level * 10.0 ** -values["log10_k_at_reference_level"]
    for end in scene.where.ends:
        made = _softer(bar.ends[end], (softness, softness))
        loss = [_JOINT_LOSS * level * _part(softness, whole) for whole in made.turning_rad_n_m]
        bar = bar.with_end(end, replace(made, loss_factor=(loss[0], loss[1])))
    return bar


def _part(own_rad_n_m: float, whole_rad_n_m: float) -> float:
    """Springs in series share their strain energy as they share the compliance."""
    return own_rad_n_m / whole_rad_n_m if own_rad_n_m else 0.0


def skew_ranges(hanger: Hanger, where: Where) -> dict[str, Range]:
    return {"log10_k": turning_range(hanger), "angle_deg": Range(-90.0, 90.0)}


def skew(bar: Bar, values: Values, scene: Scene) -> Bar:
    """Ends turn in one direction only, and that lies between the planes."""
    softness = 10.0 ** -values["log10_k"]
    angle = math.radians(values["angle_deg"])
    c, s = math.cos(angle), math.sin(angle)
    for end in scene.where.ends:
        by = (softness * c * c, softness * s * s)
        bar = bar.with_end(end, _softer(bar.ends[end], by, softness * c * s))
    return bar


def warmth_ranges(hanger: Hanger, where: Where) -> dict[str, Range]:
    expansion_1_k = hanger.assumptions.thermal_expansion_1_k.value
    held = hanger.elastic_modulus_pa * hanger.area_m2 * expansion_1_k
    return {"tension_per_kelvin_n_k": Range(1e-5 * held, held, 0.0, logarithmic=True, signed=True)}


def warmth(bar: Bar, values: Values, scene: Scene) -> Bar:
    """Bridge and hanger expand differently."""
    shift = values["tension_per_kelvin_n_k"] * scene.conditions.temperature_shift_k
    return replace(bar, tension_n=bar.tension_n + shift)


def hardening_ranges(hanger: Hanger, where: Where) -> dict[str, Range]:
    return {"hardening": Range(1e-6, 0.05, 0.0, logarithmic=True)}


def hardening(bar: Bar, values: Values, scene: Scene) -> Bar:
    """A large swing stretches the bar: tension grows with the amplitude's square."""
    raised = 1 + values["hardening"] * scene.conditions.amplitude**2
    return replace(bar, tension_n=bar.tension_n * raised)


def sensor_ranges(hanger: Hanger, where: Where) -> dict[str, Range]:
    return {"mass_kg": Range(0.01, 20.0, 0.0, logarithmic=True)}


def sensor(bar: Bar, values: Values, scene: Scene) -> Bar:
    """Accelerometers weigh, with their clamps and cables."""
    added = tuple(Mass(place, values["mass_kg"]) for place in scene.where.chosen(scene.places_m))
    return replace(bar, masses=bar.masses + added)


def turn_ranges(hanger: Hanger, where: Where) -> dict[str, Range]:
    return {"angle_deg": Range(0.05, 60.0, 0.0, logarithmic=True, signed=True)}


def turn(bar: Bar, values: Values, scene: Scene) -> Bar:
    """Sensors are clamped on askew."""
    angle = math.radians(values["angle_deg"])
    added = tuple((place, angle) for place in scene.where.chosen(scene.places_m))
    return replace(bar, turned_rad=bar.turned_rad + added)


def clock_ranges(hanger: Hanger, where: Where) -> dict[str, Range]:
    return {"clock_error": Range(1e-6, 0.1, 0.0, logarithmic=True, signed=True)}


def clock(bar: Bar, values: Values, scene: Scene) -> Bar:
    """The logger's clock runs slow: it reports too high frequencies."""
    if scene.where.test not in ("", scene.conditions.test):
        return bar
    return replace(bar, clock_factor=bar.clock_factor * (1 + values["clock_error"]))
