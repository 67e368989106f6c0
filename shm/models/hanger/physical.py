"""A batch of hangers as physics sees them in one test: what the general model is asked to solve."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from shm.values import BoolArray, FloatArray, Hanger


@dataclass(frozen=True, eq=False)
class Zone:
    """A stretch of the bar whose bending stiffness and mass are multiplied; fields are (n,).

    `stiffness_factor` is (n, planes) where the planes differ. Overlapping zones multiply. A zone
    may reach beyond the hanger's ends.
    """

    start_m: FloatArray
    end_m: FloatArray
    stiffness_factor: FloatArray
    mass_factor: FloatArray


@dataclass(frozen=True, eq=False)
class PointMass:
    """A mass clamped on; fields are (n,). Beyond an end it moves with the end.

    It turns with the bar's axis as one with this radius of gyration; None for a point, which does
    not.
    """

    x_m: FloatArray
    mass_kg: FloatArray
    radius_of_gyration_m: FloatArray | None = None


@dataclass(frozen=True, eq=False)
class LateralSpring:
    """A spring between the bar and something that stands still.

    `x_m` (n,); `stiffness_n_m` (n, planes); `loss_factor` (n,) of the spring's material.
    """

    x_m: FloatArray
    stiffness_n_m: FloatArray
    loss_factor: FloatArray


@dataclass(frozen=True, eq=False)
class ModeLaw:
    """A change of the frequencies whose mechanism nobody knows, only its law.

    Logarithms of frequencies change by `shift` (n, planes) times what `over_orders` makes of the
    orders (modes,). Shapes stay.
    """

    shift: FloatArray
    over_orders: Callable[[FloatArray], FloatArray]

    def factor(self, modes: int) -> FloatArray:
        """By which the frequencies (n, planes, modes) are multiplied."""
        over = self.over_orders(np.arange(1.0, modes + 1))
        return np.asarray(np.exp(self.shift[:, :, None] * over))


@dataclass(frozen=True, eq=False)
class PhysicalHanger:
    """`n` hangers in one test. Ends are deck 0, arch 1; planes transverse 0, longitudinal 1.

    The bar goes from `deck_end_m` to `arch_end_m` (n,) on the axis of the hanger's description,
    along which all places are given. `tension_n` is that at mid-length; the arch end carries
    `tension_gradient_n` more than the deck end. `bending_stiffness_n_m2` is (n, planes),
    `rotational_compliance_rad_n_m` (n, ends, planes, planes), symmetric, 0 for clamped,
    `translational_compliance_m_n` (n, ends, planes), 0 for held, infinite for free;
    `support_mass_kg` (n, ends, planes) moves with an end that is not held.
    `shear_compliance_1_n` (n,) is 1/(kappa G A), 0 for a bar that does not shear;
    `rotary_inertia_kg_m` (n,) is rho I. `sag_parameter` (n, planes) is Irvine's lambda squared,
    of a string's parabola. `joint_loss_factor` (n, ends) is that
    of the end springs. `clock_factor` (n,) multiplies the frequencies that the logger reports;
    `sensor_turn_rad` (n, places) is the angle by which each sensor is turned about the hanger's
    axis, from the transverse axis to the longitudinal one. `mode_laws` change the frequencies.
    """

    deck_end_m: FloatArray
    arch_end_m: FloatArray
    tension_n: FloatArray
    tension_gradient_n: FloatArray
    bending_stiffness_n_m2: FloatArray
    mass_per_length_kg_m: FloatArray
    rotational_compliance_rad_n_m: FloatArray
    translational_compliance_m_n: FloatArray
    support_mass_kg: FloatArray
    shear_compliance_1_n: FloatArray
    rotary_inertia_kg_m: FloatArray
    sag_parameter: FloatArray
    joint_loss_factor: FloatArray
    clock_factor: FloatArray
    sensor_turn_rad: FloatArray
    zones: tuple[Zone, ...] = ()
    masses: tuple[PointMass, ...] = ()
    springs: tuple[LateralSpring, ...] = ()
    mode_laws: tuple[ModeLaw, ...] = ()

    @classmethod
    def clamped(cls, hanger: Hanger, tension_n: FloatArray, sensors: int = 0) -> PhysicalHanger:
        """Return the bar as described with its turnbuckles, at tensions (n,), both ends clamped."""
        n = len(tension_n)
        one = np.ones(n)
        return cls(
            deck_end_m=0 * one,
            arch_end_m=hanger.length_m * one,
            tension_n=tension_n,
            tension_gradient_n=0 * one,
            bending_stiffness_n_m2=np.full((n, 2), hanger.bending_stiffness_n_m2),
            mass_per_length_kg_m=hanger.mass_per_length_kg_m * one,
            rotational_compliance_rad_n_m=np.zeros((n, 2, 2, 2)),
            translational_compliance_m_n=np.zeros((n, 2, 2)),
            support_mass_kg=np.zeros((n, 2, 2)),
            shear_compliance_1_n=0 * one,
            rotary_inertia_kg_m=0 * one,
            sag_parameter=np.zeros((n, 2)),
            joint_loss_factor=np.zeros((n, 2)),
            clock_factor=one,
            sensor_turn_rad=np.zeros((n, sensors)),
            zones=tuple(
                Zone(
                    (each.x_m - each.length_m / 2) * one,
                    (each.x_m + each.length_m / 2) * one,
                    each.bending_stiffness_n_m2 / hanger.bending_stiffness_n_m2 * one,
                    each.mass_kg / each.length_m / hanger.mass_per_length_kg_m * one,
                )
                for each in hanger.turnbuckles
            ),
        )

    @classmethod
    def held(cls, hanger: Hanger, tension_n: FloatArray, sensors: int = 0) -> PhysicalHanger:
        """Return the same on the described supports; what hangs from a free end is a mass."""
        supports = hanger.supports
        bar = cls.clamped(hanger, tension_n, sensors)
        for end in supports.ends("pinned", "free"):
            bar.rotational_compliance_rad_n_m[:, end, [0, 1], [0, 1]] = np.inf
        for end in supports.ends("free"):
            bar.translational_compliance_m_n[:, end] = np.inf
        if not supports.hanging_mass_kg:
            return bar
        one = np.ones(len(tension_n))
        at_end_m = np.array([-np.inf, np.inf])[list(supports.ends("free"))]
        return replace(bar, masses=(PointMass(at_end_m * one, supports.hanging_mass_kg * one),))

    def on_springs(self, springs_n_m_rad: tuple[FloatArray, FloatArray]) -> PhysicalHanger:
        """Return the same on rotational springs at the deck and the arch end, each (n, planes)."""
        springs = np.stack(springs_n_m_rad, axis=1)
        compliance = (1 / springs)[..., None] * np.eye(2)
        return replace(self, rotational_compliance_rad_n_m=compliance)

    @property
    def gives_way(self) -> BoolArray:
        """Return True for ends (ends,) that are not held in all the hangers and planes."""
        return np.asarray(np.any(self.translational_compliance_m_n, axis=(0, 2)))

    @property
    def length_m(self) -> FloatArray:
        return np.asarray(self.arch_end_m - self.deck_end_m)


@dataclass(frozen=True, eq=False)
class HangerModes:
    """Hold what the logger would report of `n` hangers.

    `frequency_hz` (n, planes, modes), ascending in each plane; `shape` (n, planes, modes, places,
    2): the transverse and longitudinal components that the sensors at the places see, largest of
    all places 1; `damping_ratio` (n, planes, modes): what joints and springs add by their loss
    factors (modal strain energy, Johnson and Kienholz 1982), 0 where none has any.
    """

    frequency_hz: FloatArray
    shape: FloatArray
    damping_ratio: FloatArray
