"""One bending plane of a solid hanger on its supports, as an affine system.

Stiffness, mass and initial-stress stiffness of a solid hanger under unit tension.

The matrices of linear elasticity are put together from the nine scalar integrals of products of
two gradients (Zienkiewicz and Taylor 2000, vol. 1, 4.5); the initial-stress stiffness is that of
vol. 2, 10.2. Unknown 3 n + i is the displacement of node n along axis i.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from scipy.sparse import csc_array, csr_array, eye_array, kron
from skfem import Basis, BilinearForm, ElementHex2

from shm.models.solid.affine import AffineSystem, factorised
from shm.models.solid.geometry import Geometry
from shm.models.solid.material import Material
from shm.models.solid.mesh import Mesh
from shm.models.solid.support import AXIAL, LATERAL, Edge, Support
from shm.values import PLANES, BoolArray, FloatArray, Plane


def assembled(
    geometry: Geometry, material: Material, support: Support, plane: Plane
) -> AffineSystem:
    """The system of a hanger's motions in `plane`."""
    return bending_plane(Solid.of(Mesh.of(geometry), material), support, plane)


def bending_plane(solid: Solid, support: Support, plane: Plane) -> AffineSystem:
    """The system of motions in `plane`: antisymmetric to the plane across it."""
    axis = PLANES.index(plane)
    free = ~_held(solid, support, axis).ravel()
    springs = _springs(solid, support, plane)

    def kept(matrix: csr_array) -> csr_array:
        return csr_array(matrix[free][:, free])

    axis_deflection, axis_m = _deflections(solid, free, axis)
    return AffineSystem(
        kept(solid.stiffness),
        kept(solid.initial_stress),
        {name: kept(matrix) for name, matrix in springs.items()},
        kept(solid.mass),
        axis_deflection,
        axis_m,
    )


def _deflections(solid: Solid, free: BoolArray, axis: int) -> tuple[csr_array, FloatArray]:
    """Deflections along `axis` of the hanger's axis from the free unknowns, and where they lie."""
    mesh = solid.mesh
    nodes = np.flatnonzero(mesh.on_plane(0) & mesh.on_plane(1))
    nodes = nodes[np.argsort(mesh.cells.doflocs[2, nodes])]
    picked = csr_array(eye_array(3 * mesh.nodes, format="csr")[3 * nodes + axis][:, free])
    return picked, mesh.cells.doflocs[2, nodes]


def _held(solid: Solid, support: Support, axis: int) -> BoolArray:
    """Which displacements (nodes, 3) are zero."""
    mesh, other = solid.mesh, 1 - axis
    held = np.zeros((mesh.nodes, 3), dtype=bool)
    held[mesh.on_plane(axis), other] = True
    held[mesh.on_plane(axis), 2] = True
    held[mesh.on_plane(other), other] = True
    ends = mesh.on_end(arch=False) | mesh.on_end(arch=True)
    if not support.lateral_springs:
        held[ends, :2] = True
    if not support.axial_springs:
        held[ends, 2] = True
    return held


def _springs(solid: Solid, support: Support, plane: Plane) -> dict[str, csr_array]:
    springs = {}
    for name in support.springs(plane):
        if name in AXIAL:
            springs[name] = _along(solid, 2, [AXIAL[name]])
        else:
            arch = LATERAL[plane][name]
            springs[name] = _along(solid, PLANES.index(plane), [(arch, True), (arch, False)])
    return springs


def _along(solid: Solid, axis: int, edges: list[Edge]) -> csr_array:
    """Springs along `axis` on `edges`, 1 N/m per node."""
    plate = solid.mesh.geometry.plate
    if plate is None:
        raise ValueError("only a hanger with end plates can stand on springs.")
    line = solid.mesh.edges(edges) / plate.edge_node_spacing_m
    along = csr_array(([1.0], ([axis], [axis])), shape=(3, 3))
    return csr_array(kron(line, along, format="csr"))


@dataclass(frozen=True, eq=False)
class Solid:
    """Matrices (3 nodes, 3 nodes) of the free quarter.

    `initial_stress` is the stiffness due to 1 N of tension in the whole hanger.
    """

    mesh: Mesh
    stiffness: csr_array
    mass: csr_array
    initial_stress: csr_array

    @classmethod
    def of(cls, mesh: Mesh, material: Material) -> Solid:
        """Assembles all; the tension acts as a uniform traction on both end faces."""
        # Three points along the axis lock thin long cells: the curvature's quadratic term is
        # then constrained by an axial strain that second-order cells cannot follow.
        basis = Basis(mesh.cells, ElementHex2(), quadrature=_gauss(3, 3, 2))
        gradients = [[_gradient_product(basis, i, j) for j in range(3)] for i in range(3)]
        stiffness = _stiffness(gradients, material)
        stress = _stress(basis, _pulled(mesh, stiffness), material)
        exact = Basis(mesh.cells, ElementHex2(), quadrature=_gauss(3, 3, 3))
        mass = BilinearForm(lambda u, v, _: material.density_kg_m3 * u * v).assemble(exact)
        return cls(
            mesh, stiffness, _each_axis(csr_array(mass)), _each_axis(_initial_stress(basis, stress))
        )


def _gauss(*points: int) -> tuple[FloatArray, FloatArray]:
    """The product rule with that many points along each axis of the unit cell."""
    rules = [np.polynomial.legendre.leggauss(n) for n in points]
    places = np.meshgrid(*((x + 1) / 2 for x, _ in rules), indexing="ij")
    weights = np.einsum("i,j,k->ijk", *(w / 2 for _, w in rules))
    return np.stack([place.ravel() for place in places]), weights.ravel()


def _gradient_product(basis: Basis, i: int, j: int) -> csr_array:
    return csr_array(BilinearForm(lambda u, v, _: v.grad[i] * u.grad[j]).assemble(basis))


def _initial_stress(basis: Basis, stress: dict[str, FloatArray]) -> csr_array:
    """The form grad v . s grad u for the stress field s."""

    def form(u: Any, v: Any, w: Any) -> Any:
        terms = [w[f"s{i}{j}"] * u.grad[j] * v.grad[i] for i in range(3) for j in range(3)]
        return np.sum(terms, axis=0)

    return csr_array(BilinearForm(form).assemble(basis, **stress))


def _stiffness(gradients: list[list[csr_array]], material: Material) -> csr_array:
    lame, shear = material.lame_pa
    total = shear * _each_axis(gradients[0][0] + gradients[1][1] + gradients[2][2])
    for i, j in product(range(3), repeat=2):
        block = lame * gradients[i][j] + shear * gradients[j][i]
        total = total + kron(block, _unit(i, j), format="csr")
    return csr_array(total)


def _unit(i: int, j: int) -> csr_array:
    return csr_array(([1.0], ([i], [j])), shape=(3, 3))


def _each_axis(matrix: csr_array) -> csr_array:
    return csr_array(kron(matrix, eye_array(3), format="csr"))


def _pulled(mesh: Mesh, stiffness: csr_array) -> FloatArray:
    """Displacements (3 nodes,) under 1 N of tension, the rigid motion along the axis held."""
    load = np.zeros((mesh.nodes, 3))
    load[:, 2] = (mesh.face_shares(arch=True) - mesh.face_shares(arch=False)) / 4
    held = np.stack([mesh.on_plane(0), mesh.on_plane(1), np.zeros(mesh.nodes, bool)], axis=1)
    axis_node = np.flatnonzero(mesh.on_plane(0) & mesh.on_plane(1) & mesh.on_end(arch=False))
    held[axis_node, 2] = True
    free = ~held.ravel()
    displacement = np.zeros(3 * mesh.nodes)
    displacement[free] = factorised(csc_array(stiffness[free][:, free])).solve(load.ravel()[free])
    return displacement


def _stress(basis: Basis, displacement: FloatArray, material: Material) -> dict[str, FloatArray]:
    """The stress field at the points of integration, by component."""
    lame, shear = material.lame_pa
    gradient = np.stack([basis.interpolate(displacement[i::3]).grad for i in range(3)])
    dilation = lame * np.trace(gradient)
    return {
        f"s{i}{j}": shear * (gradient[i, j] + gradient[j, i]) + (dilation if i == j else 0.0)
        for i in range(3)
        for j in range(3)
    }
