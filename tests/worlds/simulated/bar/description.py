"""What the finite elements are told of a hanger in one test: plain numbers, one bar with all that
it consists of or carries.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from shm.simulate.state import HangerState
from shm.values import Hanger

# Of EI/L: a spring that stands for a hinge changes a pinned bar's frequencies by 2e-10; its
# compliance must not exceed 1e12 times the other plane's, or that one counts as rigid (`_joints`).
_SOFT = 1e-9
_CLOSED = 1e-9  # of the length: rounding between turnbuckles that touch


@dataclass(frozen=True)
class BarEnd:
    """How an end is held, values by plane.

    `turning_rad_n_m` is the compliance of the rotations against moments, `cross_rad_n_m` between
    the planes, 0 for a clamped end. `held_n_m` is the spring against deflection, infinite for an
    end that does not move; `support_mass_kg` moves with it. What moves may have a second
    mode that adds to the end's deflection, by plane (spring, mass), mass 0 for none. `loss_factor`
    is that of the joint.
    """

    turning_rad_n_m: Pair = (0.0, 0.0)
    cross_rad_n_m: float = 0.0
    held_n_m: Pair = (math.inf, math.inf)
    support_mass_kg: Pair = (0.0, 0.0)
    loss_factor: Pair = (0.0, 0.0)
    second_mode: tuple[Pair, Pair] = ((0.0, 0.0), (0.0, 0.0))


@dataclass(frozen=True)
class Bar:
    """One hanger in one test. Planes: transverse, longitudinal; ends: deck, arch.

    It goes from `deck_end_m` to `arch_end_m` of the hanger's axis. `shear_compliance_1_n` is
    1/(kappa G A), `rotary_inertia_kg_m` rho I; `sag_parameter` Irvine's lambda squared in each
    plane; `damping_ratio` that of every mode without the joints'. The logger reports frequencies
    times `clock_factor`; the sensor at a place of `turned_rad` is turned about the bar's axis, from
    transverse to longitudinal. `tension_share` is the tension in each plane's tests over
    `tension_n`. With `sags_as_it_bends` the sagging shape is the bar's own under its weight, else a
    string's.
    """

    deck_end_m: float
    arch_end_m: float
    tension_n: float
    bending_stiffness_n_m2: Pair
    mass_per_length_kg_m: float
    ends: tuple[BarEnd, BarEnd]
    stretches: tuple[Stretch, ...] = ()
    masses: tuple[Mass, ...] = ()
    springs: tuple[Spring, ...] = ()
    shear_compliance_1_n: float = 0.0
    rotary_inertia_kg_m: float = 0.0
    sag_parameter: Pair = (0.0, 0.0)
    damping_ratio: float = 0.0
    clock_factor: float = 1.0
    turned_rad: tuple[tuple[float, float], ...] = ()
    profiles: tuple[Profile, ...] = ()
    attached: tuple[Attached, ...] = ()
    part_time: tuple[PartTime, ...] = ()
    tension_share: Pair = (1.0, 1.0)
    sags_as_it_bends: bool = False

    @property
    def length_m(self) -> float:
        return self.arch_end_m - self.deck_end_m

    @property
    def coupled(self) -> bool:
        """Whether an end couples the planes."""
        return any(end.cross_rad_n_m != 0 for end in self.ends)

    def turn_rad(self, x_m: float) -> float:
        """By how much the sensor at a place is turned."""
        return sum(angle for place, angle in self.turned_rad if abs(place - x_m) < 1e-6)

    def with_end(self, index: int, end: BarEnd) -> Bar:
        """The bar with another deck (0) or arch (1) end."""
        ends = (end, self.ends[1]) if index == 0 else (self.ends[0], end)
        return replace(self, ends=ends)


def bar_of(hanger: Hanger, state: HangerState) -> Bar:
    """The bar of a hanger in a state, with its turnbuckles and no effect."""
    length_m = state.effective_length_m(hanger)
    hinge = _SOFT * hanger.bending_stiffness_n_m2 / length_m
    deck, arch = (
        BarEnd(turning_rad_n_m=(1 / max(springs[0], hinge), 1 / max(springs[1], hinge)))
        for springs in (
            (state.k1_n_m_rad, state.k2_n_m_rad),
            (state.k3_n_m_rad, state.k4_n_m_rad),
        )
    )
    return Bar(
        deck_end_m=0.0,
        arch_end_m=length_m,
        tension_n=state.tension_n,
        bending_stiffness_n_m2=(hanger.bending_stiffness_n_m2, hanger.bending_stiffness_n_m2),
        mass_per_length_kg_m=hanger.mass_per_length_kg_m,
        ends=(deck, arch),
        stretches=_turnbuckles(hanger, length_m),
        damping_ratio=state.damping_ratio,
    )


def _turnbuckles(hanger: Hanger, length_m: float) -> tuple[Stretch, ...]:
    found, start = [], 0.0
    for piece in pieces_of(hanger, length_m) if hanger.turnbuckles else ():
        stiffness = piece.bending_stiffness_n_m2 / hanger.bending_stiffness_n_m2
        mass = piece.mass_per_length_kg_m / hanger.mass_per_length_kg_m
        if (stiffness, mass) != (1.0, 1.0):
            found.append(Stretch(start, start + piece.length_m, (stiffness, stiffness), mass))
        start += piece.length_m
    return tuple(found)


@dataclass(frozen=True)
class Piece:
    """A part of a hanger of one section."""

    length_m: float
    bending_stiffness_n_m2: float
    mass_per_length_kg_m: float


def pieces_of(hanger: Hanger, effective_length_m: float) -> Sequence[Piece]:
    """The pieces from the deck end up at an effective length.

    Turnbuckles keep their length; the bar between them takes up what the effective length differs
    from the hanger's own, in proportion.
    """
    clear = _gaps(hanger)
    turnbuckles = sorted(hanger.turnbuckles, key=lambda each: each.x_m)
    stretch = 1 + (effective_length_m - hanger.length_m) / sum(clear)
    found = []
    for gap, turnbuckle in zip(clear, [*turnbuckles, None], strict=True):
        if gap > _CLOSED * hanger.length_m:
            found.append(
                Piece(gap * stretch, hanger.bending_stiffness_n_m2, hanger.mass_per_length_kg_m)
            )
        if turnbuckle is not None:
            mass = turnbuckle.mass_kg / turnbuckle.length_m
            found.append(Piece(turnbuckle.length_m, turnbuckle.bending_stiffness_n_m2, mass))
    return found


def _gaps(hanger: Hanger) -> list[float]:
    """Lengths of bar below, between and above the turnbuckles."""
    turnbuckles = sorted(hanger.turnbuckles, key=lambda each: each.x_m)
    starts = [each.x_m - each.length_m / 2 for each in turnbuckles]
    ends = [each.x_m + each.length_m / 2 for each in turnbuckles]
    pairs = zip([0.0, *ends], [*starts, hanger.length_m], strict=True)
    return [start - end for end, start in pairs]


Pair = tuple[float, float]


@dataclass(frozen=True)
class Stretch:
    """A part of the bar whose bending stiffness, by plane, and mass are multiplied.

    Parts may overlap.
    """

    start_m: float
    end_m: float
    stiffness_factor: Pair = (1.0, 1.0)
    mass_factor: float = 1.0


@dataclass(frozen=True)
class Profile:
    """Factors of bending stiffness, by plane, and of mass that go linearly from place to place.

    `x_m` ascends; beyond the first and the last place nothing changes.
    """

    x_m: tuple[float, ...]
    stiffness_factor: tuple[Pair, ...]
    mass_factor: tuple[float, ...]


@dataclass(frozen=True)
class Mass:
    """A mass clamped on, and its moment of inertia against turning with the bar's axis."""

    x_m: float
    mass_kg: float
    rotary_inertia_kg_m2: float = 0.0


@dataclass(frozen=True)
class Spring:
    """A spring against something that stands still; its stiffness in each plane."""

    x_m: float
    stiffness_n_m: Pair


@dataclass(frozen=True)
class Attached:
    """Something that vibrates itself, tied to the bar at a place by a spring, in some planes.

    `modes` are its own: (mass, angular frequency squared) with a deflection of 1 where it is tied;
    a mass that nothing else holds has the square 0.
    """

    x_m: float
    planes: tuple[int, ...]
    spring_n_m: float
    modes: tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class Ringing:
    """The part of an effect that a mode feels while it rings down with all others.

    What grows with the motion's square decays twice as fast as the modes that cause it. Where mode
    1 carries it and all have one damping ratio, mode n feels f_n/(f_1 + f_n) of it in the mean over
    its own decay; counted here in the mean of a string's first eight modes.
    """


@dataclass(frozen=True)
class Beyond:
    """The part of its cycle in which a mode moves beyond a threshold at a place.

    Deflection or, with `curvature`, bending counts; the mode with most of it after a hit has 1. It
    is arccos(threshold/own)/pi on one side, as for any harmonic motion.
    """

    x_m: float
    threshold: float
    curvature: bool = False
    both_sides: bool = False


@dataclass(frozen=True)
class PartTime:
    """What acts for a part of each mode's time only: its period is the mean weighted by time.

    S. W. Shaw and P. J. Holmes, J. Sound Vib. 90 (1983): the period of a bilinear oscillator is
    half that of either stiffness. Shapes are those without it.
    """

    when: Ringing | Beyond
    tension_change: float = 0.0
    stretches: tuple[Stretch, ...] = ()
    springs: tuple[Spring, ...] = ()
