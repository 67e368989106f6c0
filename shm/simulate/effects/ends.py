"""Ends that turn, move, wear, or sit elsewhere than the description says."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

from shm.simulate.bar.description import Bar, BarEnd, Pair, Stretch
from shm.simulate.effects.along import in_planes
from shm.simulate.effects.base import Range, Scene, Where
from shm.values import Hanger

Values = Mapping[str, float]
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
