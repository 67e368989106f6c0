"""Effects by other laws than the catalogue's; a parameter means the same as there.

An effect that stands here acts so where a campaign has its own laws. A new law is a function and
one line of `LAWS`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from shm.values import FloatArray
from tests.worlds.simulated.bar.description import Bar, Mass, PartTime, Profile, Ringing
from tests.worlds.simulated.effects import catalogue_laws as laws
from tests.worlds.simulated.effects.base import Scene
from tests.worlds.simulated.effects.catalogue_laws import in_planes

Values = Mapping[str, float]

# Each only has to differ from the catalogue's law and to be possible: the functions say how.
_LOSS_POINTS, _TAPER_POINTS = 25, 9  # technical: of piecewise linear profiles
# Flanks of one cosine, half an extent long, keep the volume
_PLACES = np.linspace(-0.75, 0.75, _LOSS_POINTS)
_WITHOUT_EDGES = (1 + np.cos(np.pi * ((np.abs(_PLACES) - 0.25) / 0.5).clip(0, 1))) / 2
_PITS = 1.9  # judgement: between 1, a loss at the skin of a tube, and 2, a thinner bar
_FULL, _TAPER = 0.6, 0.8  # 0.6 + 0.8/2 = 1: the compliance of a zone with an edge; judgement else
_CLAMP_WIDTH, _CLAMP_RADIUS = 0.15, 0.10  # judgement: m, of a clamp about a bar of 0.13 m
_SLIP = 0.8  # judgement: within 0 to 1, Segalman (2005)
# Judgement for the mass; 2.76 = (7.853/4.730)^2, the first two modes of a clamped beam
_SECOND_MODE = (6.0, 2.76)


def loss(bar: Bar, values: Values, scene: Scene) -> Bar:
    """Corrosion without edges: half of the loss at the stated ends, all of it in the inner half.

    Bending stiffness goes with the area to the power of 1.9, not 2 as in a thinner bar: pits reach
    into the section, and what is missing at 0.97 of the radius counts 0.95 of what is missing at
    the skin.
    """
    left = 1 - values["loss"] * _WITHOUT_EDGES
    return _along(bar, values, left**_PITS, left)


def coat(bar: Bar, values: Values, scene: Scene) -> Bar:
    """Ice or grout without edges, as `loss` is."""
    heavier = 1 + values["mass_change"] * _WITHOUT_EDGES
    return _along(bar, values, np.ones_like(heavier), heavier)


def _along(bar: Bar, values: Values, stiffness: FloatArray, mass: FloatArray) -> Bar:
    profile = Profile(
        tuple(float(each) for each in values["x_m"] + _PLACES * values["extent_m"]),
        tuple((float(each), float(each)) for each in stiffness),
        tuple(float(each) for each in mass),
    )
    return replace(bar, profiles=(*bar.profiles, profile))


def zone(bar: Bar, values: Values, scene: Scene) -> Bar:
    """A socket that tapers: stiff over 0.6 of the zone, then ever softer over 0.8 of it.

    The compliance rises linearly to the bar's, so that what the zone takes from the bar's bending
    in all, the integral of 1/EI, is that of a zone with an edge.
    """
    long, ratio = values["zone_m"], values["stiffness_ratio"]
    share = np.linspace(0, 1, _TAPER_POINTS)
    from_end = long * np.concatenate([[0.0], _FULL + _TAPER * share])
    factor = np.concatenate([[ratio], 1 / ((1 - share) / ratio + share)])
    by_plane = [in_planes(scene, float(each), 1.0) for each in factor]
    for end in scene.where.ends:
        x_m = bar.deck_end_m + from_end if end == 0 else bar.arch_end_m - from_end
        order = np.argsort(x_m)
        tapered = Profile(
            tuple(float(each) for each in x_m[order]),
            tuple(by_plane[i] for i in order),
            (1.0,) * len(order),
        )
        bar = replace(bar, profiles=(*bar.profiles, tapered))
    return bar


def clamp(bar: Bar, values: Values, scene: Scene) -> Bar:
    """A clamp as a block 0.15 m long: two halves at its radius of gyration, and its own inertia.

    Halves at plus and minus b/sqrt(12) have the block's mass and inertia along the bar; across it
    the block has a radius of gyration of 0.1 m/sqrt(2).
    """
    half, reach = values["mass_kg"] / 2, _CLAMP_WIDTH / math.sqrt(12)
    inertia = half * _CLAMP_RADIUS**2 / 2
    low = max(values["x_m"] - reach, bar.deck_end_m)
    high = min(values["x_m"] + reach, bar.arch_end_m)
    block = (Mass(low, half, inertia), Mass(high, half, inertia))
    return replace(bar, masses=bar.masses + block)


def joint(bar: Bar, values: Values, scene: Scene) -> Bar:
    """A joint that slips by a power law: compliance and loss with the level to the power of 0.8.

    D. J. Segalman, J. Appl. Mech. 72 (2005): the power 1 + chi of lap joints lies between 0 and 1.
    At the reference level it is what is stated.
    """
    slipping = replace(scene.conditions, amplitude=scene.conditions.amplitude**_SLIP)
    return laws.joint(bar, values, replace(scene, conditions=slipping))


def hardening(bar: Bar, values: Values, scene: Scene) -> Bar:
    """A large swing stretches the bar, the less the farther the hit has died away.

    A. H. Nayfeh and D. T. Mook, Nonlinear Oscillations (1979), 7.5: the stretch goes with the
    squared amplitude, here with the first mode's, which decays while the others ring.
    """
    raised = values["hardening"] * scene.conditions.amplitude**2
    return replace(bar, part_time=(*bar.part_time, PartTime(Ringing(), tension_change=raised)))


def support(bar: Bar, values: Values, scene: Scene) -> Bar:
    """A deck with two modes: the stated one, and one 6 times as heavy at 2.76 times its frequency.

    The second frequency is that of a clamped beam; it deflects less where the hanger ends, so that
    more mass goes with it there. R. W. Clough and J. Penzien, Dynamics of Structures (1993), 12: a
    structure deflects by the sum of its modes.
    """
    mass = values["support_mass_kg"]
    if math.isinf(mass):
        return bar
    bar = laws.support(bar, values, scene)
    heavier, faster = _SECOND_MODE
    second = heavier * mass
    spring = second * (2 * math.pi * faster * values["support_frequency_hz"]) ** 2
    for end in scene.where.ends:
        by_plane = list(bar.ends[end].second_mode)
        for plane in scene.where.planes:
            by_plane[plane] = (spring, second)
        moving = replace(bar.ends[end], second_mode=(by_plane[0], by_plane[1]))
        bar = bar.with_end(end, moving)
    return bar


def sag(bar: Bar, values: Values, scene: Scene) -> Bar:
    """A bar that sags as its bending and its ends let it, not as a string's parabola.

    H. M. Irvine, Cable Structures (1981), 2.4 and 3.3: the stretch is the integral of y'' w, y the
    shape at rest. The parameter is the string's that stretches as much when moved by that shape.
    """
    return replace(laws.sag(bar, values, scene), sags_as_it_bends=True)


LAWS: dict[str, Callable[[Bar, Values, Scene], Bar]] = {
    "section_loss": loss,
    "partial_mass": coat,
    "stiff_end_zones": zone,
    "point_mass": clamp,
    "joint_softening": joint,
    "geometric_hardening": hardening,
    "support_motion": support,
    "sag": sag,
}
