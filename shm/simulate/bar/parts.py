"""What a bar consists of or carries, beside its ends."""

from __future__ import annotations

from dataclasses import dataclass

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
