"""Modes of a bar, to be read at any place: each plane by itself, or both together where an end
couples them; also where something acts for a part of each mode's time only.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from shm.values import BoolArray, FloatArray, IntArray
from tests.worlds.simulated.bar.description import Bar, BarEnd, Beyond, Pair, Ringing, Spring
from tests.worlds.simulated.bar.mesh import interpolation, mesh_of
from tests.worlds.simulated.bar.problem import Solved, solved

# The frequency of a Hermite element errs by (wave number x size)^4/1440, 2e-6 in the highest mode;
# with shear by (frequency x size / speed of shear waves)^2/24, so that needs more.
_LEAST_ELEMENTS = 160
_ELEMENTS_PER_MODE = 24
_TIMES_FOR_SHEAR = 3
_SPARE_MODES = 4
_MEAN_RINGING = 0.757  # of n/(n + 1) for n from 1 to 8
_BEND_OVER = 1e-3  # of the length: the second difference of a shape


def bar_modes(
    bar: Bar,
    modes: int,
    places_m: Sequence[float] = (),
    *,
    with_supports: bool = False,
    refined: int = 1,
) -> tuple[BarModes, BarModes]:
    """The lowest `modes` modes of the transverse and of the longitudinal plane.

    A mode belongs to the plane in which it moves most mass. A support's own mode, that with the
    largest share of kinetic energy in the support, is left out unless `with_supports`. The mesh is
    `refined` times as fine as the accuracy asks for. Raises UsageError where the bar buckles.
    """
    if bar.part_time:
        own, *others = (
            bar_modes(each, modes, places_m, with_supports=with_supports, refined=refined)
            for each in alternatives(bar)
        )
        return with_part_time(bar, own, others)
    plain = replace(bar, clock_factor=1.0, turned_rad=(), damping_ratio=0.0)
    places = tuple(sorted(places_m))
    elements = refined * _elements(bar, modes)
    if bar.coupled:
        transverse, longitudinal = (
            _together(plain, plane, modes, places, elements, with_supports) for plane in (0, 1)
        )
        return transverse, longitudinal
    transverse, longitudinal = (
        _alone(_of_one_plane(plain, plane), modes, places, elements, with_supports)
        for plane in (0, 1)
    )
    return transverse, replace(
        longitudinal,
        deflection=longitudinal.deflection[::-1],
        rotation=longitudinal.rotation[::-1],
    )


def _elements(bar: Bar, modes: int) -> int:
    shears = bar.shear_compliance_1_n > 0
    elements = max(_LEAST_ELEMENTS, _ELEMENTS_PER_MODE * modes)
    return elements * (_TIMES_FOR_SHEAR if shears else 1)


def _of_one_plane(bar: Bar, plane: int) -> Bar:
    """The bar with both planes like one of them, so that equal planes are solved once."""

    def alike(pair: Pair) -> Pair:
        return pair[plane], pair[plane]

    def end_alike(end: BarEnd) -> BarEnd:
        return replace(
            end,
            turning_rad_n_m=alike(end.turning_rad_n_m),
            held_n_m=alike(end.held_n_m),
            support_mass_kg=alike(end.support_mass_kg),
            loss_factor=alike(end.loss_factor),
            second_mode=(end.second_mode[plane], end.second_mode[plane]),
        )

    return replace(
        bar,
        bending_stiffness_n_m2=alike(bar.bending_stiffness_n_m2),
        ends=(end_alike(bar.ends[0]), end_alike(bar.ends[1])),
        stretches=tuple(
            replace(each, stiffness_factor=alike(each.stiffness_factor)) for each in bar.stretches
        ),
        springs=tuple(Spring(each.x_m, alike(each.stiffness_n_m)) for each in bar.springs),
        sag_parameter=alike(bar.sag_parameter),
        tension_share=alike(bar.tension_share),
        profiles=tuple(
            replace(each, stiffness_factor=tuple(alike(own) for own in each.stiffness_factor))
            for each in bar.profiles
        ),
        attached=tuple(
            replace(each, planes=(0, 1)) for each in bar.attached if plane in each.planes
        ),
    )


@lru_cache(maxsize=512)
def _alone(
    bar: Bar, modes: int, places_m: tuple[float, ...], elements: int, with_supports: bool
) -> BarModes:
    """Modes of the transverse plane, the other plane's components 0."""
    mesh = mesh_of(bar, places_m, elements)
    supports = sum(end.support_mass_kg[0] > 0 for end in bar.ends)
    supports += sum(end.second_mode[0][1] > 0 for end in bar.ends)
    supports += sum(len(each.modes) for each in bar.attached)
    spare = _SPARE_MODES + supports if supports and not with_supports else 0
    found = solved(bar, mesh, (0,), modes + spare)
    kept = _hangers_own(bar, found, () if with_supports else (0,))
    still = np.zeros_like(found.deflection)
    both = replace(
        found,
        deflection=np.concatenate([found.deflection, still]),
        rotation=np.concatenate([found.rotation, still]),
    )
    return _chosen(both, mesh.nodes_m, kept[:modes])


@lru_cache(maxsize=512)
def _together(
    bar: Bar, plane: int, modes: int, places_m: tuple[float, ...], elements: int, supports: bool
) -> BarModes:
    """Modes that move most mass in one plane, of the coupled planes."""
    mesh = mesh_of(bar, places_m, elements)
    sought = 2 * modes + _SPARE_MODES
    while True:
        found = solved(bar, mesh, (0, 1), sought)
        kept = _hangers_own(bar, found, () if supports else (0, 1))
        own = kept[_mainly(found, plane)[kept]]
        if len(own) >= modes:
            return _chosen(found, mesh.nodes_m, own[:modes])
        sought += modes


def _mainly(found: Solved, plane: int) -> BoolArray:
    """Which modes move more mass in a plane than in the other."""
    transverse = found.moved[0] >= found.moved[1]
    return np.asarray(transverse if plane == 0 else ~transverse, bool)


def _hangers_own(bar: Bar, found: Solved, planes: tuple[int, ...]) -> IntArray:
    """Indices of the modes that are no support's own in these planes."""
    own = np.ones(len(found.squares), bool)
    for index, end in enumerate(bar.ends):
        for number, plane in enumerate(planes):
            mass = end.support_mass_kg[plane]
            if mass > 0:
                share = mass * found.deflection[number, -index] ** 2
                own[int(np.argmax(np.where(own, share, -math.inf)))] = False
    for square, share in zip(found.others_squares, found.elsewhere, strict=True):
        if planes and square < found.squares[-1]:
            own[int(np.argmax(np.where(own, share, -math.inf)))] = False
    return np.flatnonzero(own)


def _chosen(found: Solved, nodes_m: FloatArray, kept: IntArray) -> BarModes:
    return BarModes(
        np.sqrt(found.squares[kept]),
        nodes_m,
        found.deflection[:, :, kept],
        found.rotation[:, :, kept],
        found.added_damping_ratio[kept],
    )


def alternatives(bar: Bar) -> Iterator[Bar]:
    """The bar without what acts part-time, then with each of these for good."""
    plain = replace(bar, part_time=())
    yield plain
    for each in bar.part_time:
        yield replace(
            plain,
            tension_n=bar.tension_n * (1 + each.tension_change),
            stretches=bar.stretches + each.stretches,
            springs=bar.springs + each.springs,
        )


def with_part_time(
    bar: Bar, own: tuple[BarModes, BarModes], others: Sequence[tuple[BarModes, BarModes]]
) -> tuple[BarModes, BarModes]:
    """The bar's own modes, each period moved towards that with what acts part-time."""
    transverse, longitudinal = (
        _moved(bar, own[plane], plane, [other[plane] for other in others]) for plane in (0, 1)
    )
    return transverse, longitudinal


def _moved(bar: Bar, own: BarModes, plane: int, others: Sequence[BarModes]) -> BarModes:
    period = 1 / own.angular_frequency_rad_s
    added = np.zeros_like(period)
    for each, other in zip(bar.part_time, others, strict=True):
        part = _ringing(own) if isinstance(each.when, Ringing) else _beyond(own, plane, each.when)
        added += part * (1 / other.angular_frequency_rad_s - period)
    return replace(own, angular_frequency_rad_s=1 / (period + added))


def _ringing(own: BarModes) -> FloatArray:
    """As in `Ringing`, (modes,)."""
    frequency = own.angular_frequency_rad_s
    return np.asarray(frequency / (frequency + frequency[0]) / _MEAN_RINGING)


def _beyond(own: BarModes, plane: int, when: Beyond) -> FloatArray:
    """As in `Beyond`, (modes,)."""
    step = _BEND_OVER * (own.nodes_m[-1] - own.nodes_m[0])
    before, here, after = own.at((when.x_m - step, when.x_m, when.x_m + step))[:, plane]
    moved = np.abs((before - 2 * here + after) / step**2 if when.curvature else here)
    most = moved / own.angular_frequency_rad_s
    reach = np.maximum(most / most.max(), 1e-9) if most.max() > 0 else np.full_like(most, 1e-9)
    part = np.arccos(np.minimum(1.0, when.threshold / reach)) / np.pi
    return np.asarray(2 * part if when.both_sides else part)


@dataclass(frozen=True, eq=False)
class BarModes:
    """Modes that belong to one plane, mass-normalised, ascending.

    `angular_frequency_rad_s` (modes,); `nodes_m` (nodes,); `deflection` and `rotation` (planes,
    nodes, modes) in kg^-1/2 and kg^-1/2/m; `added_damping_ratio` (modes,) is what joints add.
    """

    angular_frequency_rad_s: FloatArray
    nodes_m: FloatArray
    deflection: FloatArray
    rotation: FloatArray
    added_damping_ratio: FloatArray

    def at(self, places_m: Sequence[float]) -> FloatArray:
        """Deflections, (places, planes, modes); 0 beyond the ends."""
        places = np.asarray(places_m, float)
        beyond = (places < self.nodes_m[0]) | (places > self.nodes_m[-1])
        element, weights = interpolation(self.nodes_m, np.where(beyond, self.nodes_m[0], places))
        ends = (
            self.deflection[:, element],
            self.rotation[:, element],
            self.deflection[:, element + 1],
            self.rotation[:, element + 1],
        )
        seen = np.einsum("wx,wpxm->xpm", weights, np.array(ends))
        return np.where(beyond[:, None, None], 0.0, seen)
