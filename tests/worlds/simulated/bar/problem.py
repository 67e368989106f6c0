"""The finite-element problem of a bar in one plane, or in both at once.

What vibrates beside the bar: a support's second mode, and what is tied to the bar.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import scipy

from shm.errors import UsageError
from shm.values import FloatArray
from tests.worlds.simulated.bar.description import Attached, Bar, BarEnd
from tests.worlds.simulated.bar.mesh import (
    Mesh,
    assembled,
    interpolation,
    load_of,
    mass_of,
    slopes,
    stiffness_of,
)


@dataclass(frozen=True, eq=False)
class Solved:
    """Eigenvectors of the planes that were solved together, mass-normalised.

    `squares` (modes,) of the angular frequency; `deflection` and `rotation` (planes, nodes, modes);
    `moved` (planes, modes) is twice the kinetic energy in each plane at unit frequency;
    `elsewhere` (freedoms, modes) the same in what vibrates beside bar and supports, whose own
    squares are `others_squares` (freedoms,); `added_damping_ratio` (modes,).
    """

    squares: FloatArray
    deflection: FloatArray
    rotation: FloatArray
    moved: FloatArray
    added_damping_ratio: FloatArray
    elsewhere: FloatArray
    others_squares: FloatArray


@dataclass(frozen=True, eq=False)
class _Joint:
    """A direction in which an end rotates: its share of each plane, stiffness, loss factor."""

    end: int
    direction: FloatArray
    stiffness_n_m_rad: float
    loss_factor: float


def solved(bar: Bar, mesh: Mesh, planes: Sequence[int], modes: int) -> Solved:
    """The lowest modes of the planes; raises UsageError where the bar buckles."""
    joints = [joint for end in (0, 1) for joint in _joints(bar.ends[end], end, planes)]
    others = others_of(bar, mesh, planes)
    turn, springs, weights = _unknowns(bar, mesh, planes, joints, others)
    matrices = [_matrices(bar, mesh, plane) for plane in planes]
    mass = _diagonal_blocks([each[1] for each in matrices])
    stiffness = turn.T @ _diagonal_blocks([each[0] for each in matrices]) @ turn
    stiffness = tied(stiffness + scipy.sparse.diags_array(springs), turn, others)
    sags = turn.T @ _sags(bar, mesh, planes)
    if bar.sags_as_it_bends and np.any(sags):
        sags = _as_it_bends(bar, mesh, stiffness, turn, sags)
    reduced_mass = turn.T @ mass @ turn + scipy.sparse.diags_array(weights)
    squares, vectors = _lowest(stiffness, reduced_mass, sags, modes)
    first = len(vectors) - len(others.masses_kg)
    full = (turn @ vectors).reshape(len(planes), len(mesh.nodes_m), 2, modes)
    return Solved(
        squares,
        full[:, :, 0],
        full[:, :, 1],
        _moved(full.reshape(len(planes), -1, modes), [each[1] for each in matrices]),
        _damping(joints, vectors[first - len(joints) : first], squares),
        np.array(others.masses_kg)[:, None] * vectors[first:] ** 2,
        others.squares,
    )


def _matrices(bar: Bar, mesh: Mesh, plane: int) -> tuple[Any, Any]:
    """Stiffness and mass of the free bar with what it carries, sparse."""
    bending = bar.bending_stiffness_n_m2[plane] * mesh.stiffness_factor[plane]
    shear, size = bar.shear_compliance_1_n, mesh.size_m
    per_length = bar.mass_per_length_kg_m * mesh.mass_factor
    stiffness = stiffness_of(size, bending, shear, bar.tension_n * bar.tension_share[plane])
    mass = mass_of(size, bending, shear, per_length, bar.rotary_inertia_kg_m)
    springs = [(each.x_m, each.stiffness_n_m[plane]) for each in bar.springs]
    _add_at_points(stiffness, mesh, springs)
    _add_at_points(mass, mesh, [(each.x_m, each.mass_kg) for each in bar.masses])
    for each in bar.masses:
        if each.rotary_inertia_kg_m2 and mesh.nodes_m[0] <= each.x_m <= mesh.nodes_m[-1]:
            element, slope = slopes(mesh.nodes_m, each.x_m)
            mass[element] += each.rotary_inertia_kg_m2 * np.outer(slope, slope)
    return assembled(stiffness), assembled(mass)


def _add_at_points(elements: FloatArray, mesh: Mesh, points: Sequence[tuple[float, float]]) -> None:
    """Adds what acts at single places (x_m, amount) to the element matrices; none beyond an end."""
    for x_m, amount in points:
        if mesh.nodes_m[0] <= x_m <= mesh.nodes_m[-1]:
            element, weights = interpolation(mesh.nodes_m, np.array([x_m]))
            elements[element[0]] += amount * weights @ weights.T


def _diagonal_blocks(blocks: Sequence[Any]) -> Any:
    if len(blocks) == 1:
        return blocks[0]
    coordinates = [block.tocoo() for block in blocks]
    size = blocks[0].shape[0]
    rows = np.concatenate([size * i + each.row for i, each in enumerate(coordinates)])
    columns = np.concatenate([size * i + each.col for i, each in enumerate(coordinates)])
    values = np.concatenate([each.data for each in coordinates])
    return scipy.sparse.csc_array((values, (rows, columns)), shape=(2 * size, 2 * size))


def _joints(end: BarEnd, index: int, planes: Sequence[int]) -> list[_Joint]:
    """The principal directions of an end's compliance that are not rigid."""
    compliance = np.diag([end.turning_rad_n_m[plane] for plane in planes])
    if len(planes) == 2:
        compliance[0, 1] = compliance[1, 0] = end.cross_rad_n_m
    loss = np.array([end.loss_factor[plane] for plane in planes])
    values, vectors = np.linalg.eigh(compliance)
    return [
        _Joint(index, vectors[:, i], float(1 / value), float(vectors[:, i] ** 2 @ loss))
        for i, value in enumerate(values)
        if value > 1e-12 * values[-1]
    ]


def _unknowns(
    bar: Bar, mesh: Mesh, planes: Sequence[int], joints: Sequence[_Joint], others: Others
) -> tuple[Any, FloatArray, FloatArray]:
    """What the bar's 2 nodes x planes freedoms are of the unknowns (sparse), and what springs and
    masses act on these (unknowns,). The joints' unknowns are the last but for the others'.
    """
    a_plane = 2 * len(mesh.nodes_m)
    springs, weights = np.zeros(a_plane * len(planes)), np.zeros(a_plane * len(planes))
    free = np.ones(a_plane * len(planes), bool)
    for number, plane in enumerate(planes):
        for index, node in ((0, 0), (1, a_plane - 2)):
            end, unknown = bar.ends[index], number * a_plane + node
            held = end.held_n_m[plane]
            free[[unknown, unknown + 1]] = math.isfinite(held), False
            springs[unknown] = held if math.isfinite(held) else 0.0
            weights[unknown] = end.support_mass_kg[plane]
    kept = np.flatnonzero(free)
    rows, columns, shares = [kept], [np.arange(len(kept))], [np.ones(len(kept))]
    for order, joint in enumerate(joints):
        node = 1 if joint.end == 0 else a_plane - 1
        rows.append(node + a_plane * np.arange(len(planes)))
        columns.append(np.full(len(planes), len(kept) + order))
        shares.append(joint.direction)
    first = len(kept) + len(joints)
    for own, freedom in enumerate(others.adds_to):
        if freedom >= 0:
            rows.append(np.array([freedom]))
            columns.append(np.array([first + own]))
            shares.append(np.ones(1))
    entries = (np.concatenate(rows), np.concatenate(columns))
    shape = (a_plane * len(planes), first + len(others.masses_kg))
    turn = scipy.sparse.csc_array((np.concatenate(shares), entries), shape=shape)
    stiff = np.array([joint.stiffness_n_m_rad for joint in joints])
    return (
        turn,
        np.concatenate([springs[kept], stiff, others.springs_n_m]),
        np.concatenate([weights[kept], 0 * stiff, others.masses_kg]),
    )


def _sags(bar: Bar, mesh: Mesh, planes: Sequence[int]) -> FloatArray:
    """Vectors b of the stiffness b b^T that a sagging bar's stretching adds, (freedoms, planes).

    The motion's area takes up chord length: lambda^2 T/L^3 times its square (H. M. Irvine, Cable
    Structures, 1981, 3.3).
    """
    a_plane = 2 * len(mesh.nodes_m)
    vectors = np.zeros((a_plane * len(planes), len(planes)))
    for number, plane in enumerate(planes):
        loads = load_of(mesh.size_m)
        area = np.zeros(a_plane)
        np.add.at(area, 2 * np.arange(len(loads))[:, None] + np.arange(4), loads)
        strength = bar.sag_parameter[plane] * bar.tension_n / bar.length_m**3
        vectors[number * a_plane : (number + 1) * a_plane, number] = math.sqrt(strength) * area
    return vectors


def _as_it_bends(bar: Bar, mesh: Mesh, stiffness: Any, turn: Any, sags: FloatArray) -> FloatArray:
    """The vectors of `_sags` (unknowns, planes) for the shape in which the bar itself hangs.

    Moved by that shape it stretches as much as a string does whose motion has the same area.
    """
    bent = scipy.sparse.linalg.splu(stiffness.tocsc()).solve(sags)
    tight = turn.T @ _tightened(bar, mesh, turn @ bent)
    stretch, area = np.sum(bent * tight, axis=0), np.sum(bent * sags, axis=0)
    return np.asarray(tight * np.divide(area, stretch, out=np.zeros_like(area), where=stretch > 0))


def _tightened(bar: Bar, mesh: Mesh, bent: FloatArray) -> FloatArray:
    """The tension's part of the stiffness times deflections, (freedoms, planes).

    A bar that hangs as y under a unit load stretches by the integral of T y' w' when it moves by w:
    a string's y makes that the area of w.
    """
    size, bending, shear = mesh.size_m, bar.bending_stiffness_n_m2, bar.shear_compliance_1_n
    blocks = []
    for own in range(bent.shape[1]):
        stiff = bending[own] * mesh.stiffness_factor[own]
        tight = stiffness_of(size, stiff, shear, bar.tension_n)
        blocks.append(assembled(tight - stiffness_of(size, stiff, shear, 0.0)))
    return np.asarray(_diagonal_blocks(blocks) @ bent)


def _lowest(
    stiffness: Any, mass: Any, sags: FloatArray, modes: int
) -> tuple[FloatArray, FloatArray]:
    """The lowest squares (modes,) and mass-normalised vectors of stiffness + sags sags^T."""
    factor = scipy.sparse.linalg.splu(stiffness.tocsc())
    lifted = factor.solve(sags)
    core = np.linalg.inv(np.eye(sags.shape[1]) + sags.T @ lifted)

    def with_sags(load: FloatArray) -> FloatArray:
        plain = factor.solve(load)
        return np.asarray(plain - lifted @ (core @ (sags.T @ plain)))

    solve = with_sags if np.any(sags) else factor.solve
    inverse = scipy.sparse.linalg.LinearOperator(stiffness.shape, matvec=solve, dtype=float)
    start = np.ones(stiffness.shape[0])  # a fixed start, so that the same input gives the same bits
    squares, vectors = scipy.sparse.linalg.eigsh(
        stiffness, k=modes, M=mass, sigma=0.0, OPinv=inverse, v0=start
    )
    order = np.argsort(squares)
    squares, vectors = squares[order], vectors[:, order]
    if not squares[0] > 0:
        raise UsageError(
            "the compression buckles the hanger: it has no lowest frequency.",
            remedy="Give a larger tension.",
        )
    return squares, vectors


def _moved(full: FloatArray, masses: Sequence[Any]) -> FloatArray:
    return np.array(
        [np.sum(own * (mass @ own), axis=0) for own, mass in zip(full, masses, strict=True)]
    )


def _damping(joints: Sequence[_Joint], turns: FloatArray, squares: FloatArray) -> FloatArray:
    """Half the loss factor: each joint's times its share of the mode's strain energy.

    C. D. Johnson and D. A. Kienholz, AIAA Journal 20 (1982).
    """
    loss = np.zeros_like(squares)
    for joint, turned in zip(joints, turns, strict=True):
        loss += joint.loss_factor * joint.stiffness_n_m_rad * turned**2
    return np.asarray(loss / squares / 2)


@dataclass(frozen=True)
class _Tie:
    """A spring between the bar (its freedoms, their shares) and others (their numbers)."""

    freedoms: tuple[int, ...]
    shares: tuple[float, ...]
    others: tuple[int, ...]
    spring_n_m: float


@dataclass
class Others:
    """Freedoms of their own: springs to the ground and masses, the freedom of the bar that each
    adds to (-1 for none), and what ties them to the bar.
    """

    springs_n_m: list[float] = field(default_factory=list)
    masses_kg: list[float] = field(default_factory=list)
    adds_to: list[int] = field(default_factory=list)
    ties: list[_Tie] = field(default_factory=list)

    def add(self, spring_n_m: float, mass_kg: float, adds_to: int = -1) -> int:
        """Another freedom; returns its number."""
        self.springs_n_m.append(spring_n_m)
        self.masses_kg.append(mass_kg)
        self.adds_to.append(adds_to)
        return len(self.masses_kg) - 1

    @property
    def squares(self) -> FloatArray:
        """Each freedom's own angular frequency squared, the bar at rest, (freedoms,)."""
        held = np.array(self.springs_n_m)
        for tie in self.ties:
            held[list(tie.others)] += tie.spring_n_m
        return np.asarray(held / np.array(self.masses_kg))


def others_of(bar: Bar, mesh: Mesh, planes: Sequence[int]) -> Others:
    """All that vibrates beside the bar in these planes."""
    found, a_plane = Others(), 2 * len(mesh.nodes_m)
    for number, plane in enumerate(planes):
        for end, node in zip(bar.ends, (0, a_plane - 2), strict=True):
            spring, mass = end.second_mode[plane]
            if mass and np.isfinite(end.held_n_m[plane]):
                found.add(spring, mass, number * a_plane + node)
        for each in bar.attached:
            if plane in each.planes and mesh.nodes_m[0] <= each.x_m <= mesh.nodes_m[-1]:
                _tie(found, each, mesh, number * a_plane)
    return found


def _tie(found: Others, attached: Attached, mesh: Mesh, first: int) -> None:
    own = tuple(found.add(mass * square, mass) for mass, square in attached.modes)
    element, weights = interpolation(mesh.nodes_m, np.array([attached.x_m]))
    freedoms = tuple(int(first + 2 * element[0] + i) for i in range(4))
    shares = tuple(float(each) for each in weights[:, 0])
    found.ties.append(_Tie(freedoms, shares, own, attached.spring_n_m))


def tied(stiffness: Any, turn: Any, others: Others) -> Any:
    """The stiffness of the unknowns with the springs that tie others to the bar.

    The others are the last unknowns.
    """
    first = turn.shape[1] - len(others.masses_kg)
    for tie in others.ties:
        on_bar = np.zeros(turn.shape[0])
        on_bar[list(tie.freedoms)] = tie.shares
        apart = turn.T @ on_bar
        apart[[first + own for own in tie.others]] -= 1
        column = scipy.sparse.csc_array(apart[:, None])
        stiffness = stiffness + tie.spring_n_m * (column @ column.T)
    return stiffness
