"""What vibrates beside the bar: a support's second mode, and what is tied to the bar."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.sparse import csc_array

from shm.simulate.bar.description import Bar
from shm.simulate.bar.mesh import Mesh, interpolation
from shm.simulate.bar.parts import Attached
from shm.values import FloatArray


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
        column = csc_array(apart[:, None])
        stiffness = stiffness + tie.spring_n_m * (column @ column.T)
    return stiffness
