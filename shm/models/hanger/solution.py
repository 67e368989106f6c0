"""Modes of the general hanger model, how sensors see them, and how joints and springs damp them.

A mode is of one plane, though planes may be coupled.

The eigenvalues are mu = 1/omega^2 of A = L^-1 M L^-T with K = L L^T: the stiffness is factorised,
not the mass, so that springs from soft to rigid do no harm and the lowest modes, which have the
largest mu, come out best. Where supports let a hanger go, or it is in compression, K + shift M
takes the place of K.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from shm.models.hanger.bar import Bar, along, bar_of, by_plane, gradient_ratio, stiffness_ratio
from shm.models.hanger.functions import SLOPES
from shm.models.hanger.physical import HangerModes, LateralSpring, PhysicalHanger
from shm.models.hanger.system import (
    Oscillator,
    System,
    are_coupled,
    invert_root,
    rotational_n_m_rad,
    system,
)
from shm.values import PLANES, BoolArray, FloatArray, IntArray

_PLANES = len(PLANES)


def solve(
    physical: PhysicalHanger, modes: int, places_m: FloatArray, shapes: bool = True
) -> HangerModes:
    """Return the first `modes` modes of each plane of n hangers, as sensors at `places_m` see them.

    With `shapes` false the shapes are empty, (n, 2, modes, 0, 2), and the damping that loss factors
    add is not found (NaN): the frequencies alone cost half as much. Motions of a free bar as a
    whole are no modes, nor are a support's own: for each of its masses the one with the largest
    share of the kinetic energy there. Joints lose energy by their rotation. A bar that buckles gets
    a first frequency next to nothing. Frequencies are right to 1e-6 for L sqrt(T/EI) up to 150;
    with the heaviest masses and deepest changes of section of the catalogue to 3e-5 up to 15, to
    1e-4 beyond.
    """
    bar, parts, found = _solve_motion(physical, modes, shapes)
    frequency = found.omega_rad_s / (2 * np.pi) * physical.clock_factor[:, None, None]
    frequency = _both(frequency)
    for law in physical.mode_laws:
        frequency = frequency * law.factor(modes)
    if not shapes:
        unknown = np.nan if has_losses(physical) else 0.0
        none = np.empty((*frequency.shape, 0, 2))
        return HangerModes(frequency, none, np.full(frequency.shape, unknown))
    assert found.vectors is not None
    vectors = _both_axes(found.vectors)
    both = Motion(_both(found.omega_rad_s), vectors)
    damping = (
        damping_ratios(physical, bar, parts, both, vectors)
        if has_losses(physical)
        else np.zeros(frequency.shape)
    )
    return HangerModes(frequency, shapes_seen(physical, bar, parts, vectors, places_m), damping)


def _solve_motion(
    physical: PhysicalHanger, modes: int, with_vectors: bool
) -> tuple[Bar, System, Motion]:
    """Return the motion with the bar and the system it is of; one plane where both are alike."""
    asked = one_plane(physical) if are_planes_equal(physical) else physical
    extra = _PLANES if asked.gives_way.any() else 0
    bar = bar_of(asked, modes + extra)
    parts = system(asked, bar)
    return bar, parts, motion(asked, parts, modes, with_vectors)


@dataclass(frozen=True, eq=False)
class NormalModes:
    """Mass-normalised modes of one hanger.

    `angular_frequency_rad_s` and `damping_ratio`, what joints and springs add, are (planes, modes).
    """

    angular_frequency_rad_s: FloatArray
    damping_ratio: FloatArray
    _physical: PhysicalHanger
    _bar: Bar
    _system: System
    _vectors: FloatArray

    def deflections(self, x_m: FloatArray) -> FloatArray:
        """Return the deflections at `x_m` (points,) in kg^-1/2: (planes, axes, points, modes).

        The modes of a plane move along the other plane's axis only where an end couples them.
        """
        physical = self._physical
        mass_kg = physical.mass_per_length_kg_m * physical.length_m
        moved = _deflected(self._bar, self._system, self._vectors, along(physical, x_m[None]))
        return np.asarray(moved[0] / np.sqrt(mass_kg[0]))


def normal_modes(physical: PhysicalHanger, modes: int) -> NormalModes:
    """Return the first `modes` modes of each plane of one hanger, with true frequencies.

    The logger's clock plays no part in them. Of what is accurate and what is no mode, see `solve`.
    """
    bar, parts, found = _solve_motion(physical, modes, with_vectors=True)
    assert found.vectors is not None
    both = Motion(_both(found.omega_rad_s), _both_axes(found.vectors))
    assert both.vectors is not None
    damping = np.zeros(both.omega_rad_s.shape)
    if has_losses(physical):
        damping = damping_ratios(physical, bar, parts, both, both.vectors)
    omega = both.omega_rad_s
    for law in physical.mode_laws:
        omega = omega * law.factor(modes)
    return NormalModes(omega[0], damping[0], physical, bar, parts, both.vectors)


def _both(values: FloatArray) -> FloatArray:
    """(n, 1 or 2, modes) to (n, 2, modes)."""
    return np.repeat(values, _PLANES // values.shape[1], axis=1)


def _both_axes(vectors: FloatArray) -> FloatArray:
    """Vectors of one plane stand for the other as well."""
    if vectors.shape[1] == _PLANES:
        return vectors
    both = np.zeros((len(vectors), _PLANES, _PLANES, *vectors.shape[3:]))
    both[:, 0, 0] = both[:, 1, 1] = vectors[:, 0, 0]
    return both


def are_planes_equal(physical: PhysicalHanger) -> bool:
    """Return True where all the hangers are the same in both planes."""
    compliance = physical.rotational_compliance_rad_n_m
    pairs = [
        physical.bending_stiffness_n_m2,
        np.einsum("nepp->nep", compliance),
        physical.translational_compliance_m_n,
        physical.support_mass_kg,
        physical.sag_parameter,
        *(spring.stiffness_n_m for spring in physical.springs),
        *(by_plane(zone) for zone in physical.zones),
    ]
    equal = all(np.array_equal(pair[..., 0], pair[..., -1]) for pair in pairs)
    return equal and not are_coupled(physical)


def one_plane(physical: PhysicalHanger) -> PhysicalHanger:
    """Return the transverse plane alone."""
    return replace(
        physical,
        bending_stiffness_n_m2=physical.bending_stiffness_n_m2[:, :1],
        rotational_compliance_rad_n_m=physical.rotational_compliance_rad_n_m[:, :, :1, :1],
        translational_compliance_m_n=physical.translational_compliance_m_n[:, :, :1],
        support_mass_kg=physical.support_mass_kg[:, :, :1],
        sag_parameter=physical.sag_parameter[:, :1],
        zones=tuple(
            replace(zone, stiffness_factor=by_plane(zone)[:, :1]) for zone in physical.zones
        ),
        springs=tuple(
            LateralSpring(each.x_m, each.stiffness_n_m[:, :1], each.loss_factor)
            for each in physical.springs
        ),
    )


def shapes_seen(
    physical: PhysicalHanger, bar: Bar, parts: System, vectors: FloatArray, places_m: FloatArray
) -> FloatArray:
    """(n, planes, modes, places, 2), largest of all places 1."""
    rows = len(physical.tension_n)
    x = along(physical, np.broadcast_to(places_m, (rows, len(places_m))))
    moved = _deflected(bar, parts, vectors, x).transpose(0, 1, 4, 3, 2)
    turned = _turned(moved, physical.sensor_turn_rad[:, None, None])
    flat = turned.reshape(*turned.shape[:3], -1)
    highest, lowest = flat.max(axis=-1, initial=0.0), flat.min(axis=-1, initial=0.0)
    largest = np.where(highest >= -lowest, highest, lowest)[..., None, None]
    return np.asarray(turned / np.where(largest == 0, 1.0, largest))


def _deflected(bar: Bar, parts: System, vectors: FloatArray, x: FloatArray) -> FloatArray:
    """Deflections at `x` (n, points): (n, planes, axes, points, modes)."""
    w = bar.deflections(x)[:, :, parts.free]
    return np.asarray(w[:, None, None] @ vectors)


def _turned(moved: FloatArray, angle: FloatArray) -> FloatArray:
    """Components (..., places, axes) as sensors turned by `angle` (..., places) see them."""
    if not np.any(angle):
        return moved
    cosine, sine = np.cos(angle), np.sin(angle)
    across, along_bridge = moved[..., 0], moved[..., 1]
    return np.stack(
        [cosine * across + sine * along_bridge, cosine * along_bridge - sine * across], axis=-1
    )


def has_losses(physical: PhysicalHanger) -> bool:
    """Return True where anything adds damping."""
    springs = any(np.any(spring.loss_factor) for spring in physical.springs)
    return springs or bool(np.any(physical.joint_loss_factor))


def damping_ratios(
    physical: PhysicalHanger, bar: Bar, parts: System, found: Motion, vectors: FloatArray
) -> FloatArray:
    """Half the loss factors, weighted by the share of the strain energy, (n, planes, modes)."""
    energy = (physical.mass_per_length_kg_m * physical.length_m**3)[:, None, None]
    energy = energy * found.omega_rad_s**2
    lost = np.zeros_like(energy)
    stiffness = rotational_n_m_rad(physical) * physical.joint_loss_factor[..., None, None]
    for end, slope in enumerate(SLOPES):
        at = parts.unknown(slope)
        if at is not None:
            turn = vectors[:, :, :, at]
            axes = stiffness.shape[-1]
            lost += np.einsum(
                "npam,nab,npbm->npm", turn[:, :, :axes], stiffness[:, end], turn[:, :, :axes]
            )
    for spring in physical.springs:
        x = along(physical, spring.x_m[:, None])
        moved = (
            _deflected(bar, parts, vectors, x)[:, :, :, 0] * physical.length_m[:, None, None, None]
        )
        stiff = (spring.stiffness_n_m * spring.loss_factor[:, None])[:, None, :, None]
        lost += (stiff * moved**2).sum(axis=2)
    return np.asarray(lost / (2 * energy))


_FREE_SHIFT = 1.0
_SEARCHED = 4  # technical: times as many modes hold those of both planes, however they alternate


@dataclass(frozen=True, eq=False)
class Motion:
    """Circular frequencies `omega_rad_s` (n, planes, modes) and mode vectors.

    `vectors` (n, planes, axes, functions kept, modes) have unit modal mass m L^3; None unless asked
    for. With coupled planes a mode moves along both axes.
    """

    omega_rad_s: FloatArray
    vectors: FloatArray | None


def motion(physical: PhysicalHanger, parts: System, modes: int, with_vectors: bool) -> Motion:
    """Return the first `modes` modes of each plane."""
    if are_coupled(physical):
        return _coupled(physical, parts, modes)
    rows, planes, unknowns = parts.stiffness.shape[:3]
    mass = np.broadcast_to(parts.mass, parts.stiffness.shape).reshape(-1, unknowns, unknowns)
    stiffness = parts.stiffness.reshape(mass.shape)
    supported = any(np.any(oscillator.mass) for oscillator in parts.oscillators)
    found = spectrum(stiffness, mass, _shift(physical).ravel(), with_vectors or supported)
    axes = None if found.vectors is None else found.vectors[:, None]
    whole = _motions_as_a_whole(physical).ravel()
    found = _without_supports(found, axes, parts.oscillators, whole).first(modes)
    omega = np.sqrt(found.omega_squared).reshape(rows, planes, modes) * _unit(physical)[..., None]
    if not with_vectors or found.vectors is None:
        return Motion(omega, None)
    of_bar = found.vectors.reshape(rows, planes, unknowns, modes)[:, :, : len(parts.free)]
    vectors = np.zeros((rows, planes, *of_bar.shape[1:]))
    for plane in range(planes):
        vectors[:, plane, plane] = of_bar[:, plane]
    return Motion(omega, vectors)


def _coupled(physical: PhysicalHanger, parts: System, modes: int) -> Motion:
    """Both planes as one system, in the units of the transverse plane."""
    rows, _, unknowns = parts.stiffness.shape[:3]
    bending = physical.bending_stiffness_n_m2
    stiffness = np.zeros((rows, 2, unknowns, 2, unknowns))
    mass = np.zeros_like(stiffness)
    parts_mass = np.broadcast_to(parts.mass, parts.stiffness.shape)
    for plane in range(2):
        ratio = (bending[:, plane] / bending[:, 0])[:, None, None]
        stiffness[:, plane, :, plane] = parts.stiffness[:, plane] * ratio
        mass[:, plane, :, plane] = parts_mass[:, plane]
    cross = rotational_n_m_rad(physical)[..., 0, 1] / (bending[:, 0] / physical.length_m)[:, None]
    for end, slope in enumerate(SLOPES):
        at = parts.unknown(slope)
        if at is not None:
            stiffness[:, 0, at, 1, at] = stiffness[:, 1, at, 0, at] = cross[:, end]
    square = (rows, 2 * unknowns, 2 * unknowns)
    shift = _shift(physical).max(axis=1)
    found = spectrum(stiffness.reshape(square), mass.reshape(square), shift, True)
    assert found.vectors is not None
    axes = found.vectors.reshape(rows, 2, unknowns, -1)
    whole = _motions_as_a_whole(physical).sum(axis=1)
    found = _without_supports(found, axes, parts.oscillators, whole)
    found = found.first(_SEARCHED * modes)
    axes = _axes(found, unknowns)
    share = np.einsum("num,nuv,nvm->nm", axes[:, 0], parts_mass[:, 0], axes[:, 0], optimize=True)
    mine = [found.taken(order) for order in families(share, modes)]
    omega = np.stack([np.sqrt(each.omega_squared) for each in mine], axis=1)
    vectors = np.stack([_axes(each, unknowns)[:, :, : len(parts.free)] for each in mine], axis=1)
    return Motion(omega * _unit(physical)[:, :1, None], vectors)


def _axes(found: Spectrum, unknowns: int) -> FloatArray:
    """(rows, axes, unknowns, modes)."""
    assert found.vectors is not None
    return found.vectors.reshape(len(found.vectors), -1, unknowns, found.vectors.shape[-1])


def _unit(physical: PhysicalHanger) -> FloatArray:
    """sqrt(EI/(m L^4)) (n, planes)."""
    inertia = physical.mass_per_length_kg_m * physical.length_m**4
    return np.asarray(np.sqrt(physical.bending_stiffness_n_m2 / inertia[:, None]))


def _is_free(physical: PhysicalHanger) -> bool:
    return bool(np.any(np.isinf(physical.translational_compliance_m_n)))


def _motions_as_a_whole(physical: PhysicalHanger) -> IntArray:
    """In how many ways the ends let the bar move without bending it, (n, planes).

    Sideways where both are free. It turns where one of them is, or both, nothing resists the ends'
    turning and no tension pulls it straight.
    """
    free = np.isinf(physical.translational_compliance_m_n).sum(axis=1)
    loose = np.isinf(np.einsum("nepp->nep", physical.rotational_compliance_rad_n_m)).all(axis=1)
    slack = (physical.tension_n == 0) & (physical.tension_gradient_n == 0)
    turns = (free > 0) & loose & slack[:, None]
    return np.asarray((free == 2) * 1 + turns)


def _shift(physical: PhysicalHanger) -> FloatArray:
    """Return a shift (n, planes) that makes stiffness + shift * mass positive definite.

    Every stretch of the bar has at least `stiff` times the described bending stiffness and `heavy`
    times the mass. Between ends that are held the least eigenvalue of a uniform bar under
    compression p is above -p^2/4, on ends that give way above -(12 p + p^2): it may turn as a
    whole, and the end of a long bar buckles at a quarter of the load. Springs, shear that is small
    and masses clamped on only add to it.
    """
    stiff, heavy = _least_factors(physical)
    lowest = stiffness_ratio(physical) - np.abs(gradient_ratio(physical)) / 2
    squeezed = np.maximum(-lowest, 0.0) / stiff
    bent = squeezed**2
    least = np.where(_ends_move(physical), 12 * squeezed + bent, bent / 4) * stiff / heavy
    return np.asarray(1.2 * least + (_FREE_SHIFT if _is_free(physical) else 0.0))


def _least_factors(physical: PhysicalHanger) -> tuple[FloatArray, FloatArray]:
    """Return lower bounds of the bar's stiffness and mass factors, each (n, planes or 1).

    Where zones overlap their factors multiply.
    """
    stiff = heavy = np.ones((len(physical.tension_n), 1))
    for zone in physical.zones:
        stiff = stiff * np.minimum(by_plane(zone), 1.0)
        heavy = heavy * np.minimum(zone.mass_factor, 1.0)[:, None]
    return stiff, heavy


def _ends_move(physical: PhysicalHanger) -> BoolArray:
    """Return a mask (n, planes) of the hangers that any end lets deflect."""
    return np.asarray(np.any(physical.translational_compliance_m_n > 0, axis=1))


def _without_supports(
    found: Spectrum, axes: FloatArray | None, oscillators: tuple[Oscillator, ...], whole: IntArray
) -> Spectrum:
    """Without the `whole` (rows,) motions of a free bar as a whole and the supports' own modes.

    `axes` (rows, axes, unknowns, modes) are the vectors.
    """
    out = np.arange(found.omega_squared.shape[1]) < whole[:, None]
    if axes is not None:
        for oscillator in oscillators:
            mass = oscillator.mass.reshape(*axes.shape[:2], 1)
            out = _largest_out(out, mass * axes[:, :, oscillator.at] ** 2)
    return found.without(out) if out.any() else found


def _largest_out(out: BoolArray, share: FloatArray) -> BoolArray:
    """Leaves out the mode with the largest share (rows, axes, modes) of each axis that has any."""
    for axis in range(share.shape[1]):
        left = np.where(out, -1.0, share[:, axis])
        worst = np.argmax(left, axis=1)
        rows = np.flatnonzero(share[:, axis].any(axis=1))
        out = out.copy()
        out[rows, worst[rows]] = True
    return out


_UNDECIDED = 0.15  # share of the energy of a direction within 9 degrees of 45


def families(transverse_share: FloatArray, modes: int) -> tuple[IntArray, IntArray]:
    """Return the indices (n, modes) of transverse and of longitudinal modes, each ascending.

    `transverse_share` (n, all modes, ascending) of the kinetic energy. A mode belongs to the plane
    that holds more than half. Near principal axes at 45 degrees a pair of neighbours would fall to
    one plane by chance: of two undecided neighbours each plane gets one.
    """
    transverse = transverse_share > 0.5
    undecided = np.abs(transverse_share - 0.5) < _UNDECIDED
    paired = np.zeros(len(transverse_share), dtype=bool)
    for index in range(transverse.shape[1] - 1):
        pair = undecided[:, index] & undecided[:, index + 1] & ~paired
        first = transverse_share[:, index] >= transverse_share[:, index + 1]
        transverse[pair, index] = first[pair]
        transverse[pair, index + 1] = ~first[pair]
        paired = pair
    return _first(transverse, modes), _first(~transverse, modes)


def _first(mine: np.ndarray, modes: int) -> IntArray:
    return np.argsort(~mine, axis=1, kind="stable")[:, :modes]


_LEAST = 1e-6
"""What omega^2 is taken for where a bar buckles."""

_ROUNDING = 1e-15
"""Smaller mu than this share of the largest one are noise."""


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Modes of (rows) systems, lowest first: `omega_squared` (rows, modes), inf for those left out.

    `vectors` (rows, unknowns, modes) have unit modal mass; None unless asked for.
    """

    omega_squared: FloatArray
    vectors: FloatArray | None

    def without(self, left_out: BoolArray) -> Spectrum:
        """Return the modes `left_out` (rows, modes) become the last ones."""
        squared = np.where(left_out, np.inf, self.omega_squared)
        order = np.argsort(squared, axis=1, kind="stable")
        return Spectrum(np.take_along_axis(squared, order, axis=1), self._vectors(order))

    def taken(self, order: IntArray) -> Spectrum:
        """Return the modes `order` (rows, fewer modes)."""
        return Spectrum(np.take_along_axis(self.omega_squared, order, axis=1), self._vectors(order))

    def first(self, modes: int) -> Spectrum:
        vectors = None if self.vectors is None else self.vectors[:, :, :modes]
        return Spectrum(self.omega_squared[:, :modes], vectors)

    def _vectors(self, order: IntArray) -> FloatArray | None:
        if self.vectors is None:
            return None
        return np.take_along_axis(self.vectors, order[:, None], axis=2)


def spectrum(
    stiffness: FloatArray, mass: FloatArray, shift: FloatArray, with_vectors: bool
) -> Spectrum:
    """Return all modes of systems (rows, unknowns, unknowns).

    `shift` (rows,) makes K + shift M definite: by how much is lost in rounding where functions are
    nearly dependent, such as kinks close to each other, so its diagonal is raised by that.
    """
    held = stiffness
    if np.any(shift):
        held = stiffness + shift[:, None, None] * mass
        unknowns = np.arange(held.shape[-1])
        # At least a tenth of what cancels in the diagonal is left there.
        rounding = 10 * len(unknowns) * np.finfo(float).eps
        held[:, unknowns, unknowns] *= np.where(shift > 0, 1 + rounding, 1.0)[:, None]
    inverse = invert_root(held)
    transposed = inverse.transpose(0, 2, 1)
    reduced = inverse @ mass @ transposed
    if not with_vectors:
        lone = np.asarray(np.linalg.eigvalsh(reduced)[:, ::-1], dtype=float)
        return Spectrum(_omega_squared(lone, shift), None)
    rising, vectors = np.linalg.eigh(reduced)
    mu = rising[:, ::-1]
    unit = vectors[:, :, ::-1] / np.sqrt(_resolved(mu))[:, None]
    return Spectrum(_omega_squared(mu, shift), transposed @ unit)


def _omega_squared(mu: FloatArray, shift: FloatArray) -> FloatArray:
    return np.asarray(np.maximum(1 / _resolved(mu) - shift[:, None], _LEAST))


def _resolved(mu: FloatArray) -> FloatArray:
    """Of falling mu (rows, modes): what rounding leaves of a motion without mass is none."""
    return np.maximum(mu, _ROUNDING * mu[:, :1])
