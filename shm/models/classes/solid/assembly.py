"""One bending plane of a solid hanger on its supports, as an affine system.

Stiffness, mass and initial-stress stiffness under unit tension, on second-order hexahedra, end
faces and their edges.

The matrices of linear elasticity are put together from the nine scalar integrals of products of
two gradients (Zienkiewicz and Taylor 2000, vol. 1, 4.5); the initial-stress stiffness is that of
vol. 2, 10.2. Unknown 3 n + i is the displacement of node n along axis i.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np
from numpy.polynomial.legendre import leggauss
from scipy.sparse import coo_array, csc_array, csr_array, eye_array, kron
from skfem import (
    Basis,
    BilinearForm,
    ElementHex2,
    ElementQuad2,
    LinearForm,
    MeshHex1,
    MeshHex2,
    MeshQuad1,
    MeshQuad2,
)

from shm.models.classes.solid.geometry import AXIAL, LATERAL, Edge, Geometry, Material, Support
from shm.models.classes.solid.reduction import AffineSystem, factorised
from shm.values import PLANES, BoolArray, FloatArray, IntArray, Plane

# A cell's corners in the order of scikit-fem, as steps along the three axes of the grid.
_HEXAHEDRON = np.array(
    [[0, 0, 0], [0, 0, 1], [0, 1, 0], [1, 0, 0], [0, 1, 1], [1, 0, 1], [1, 1, 0], [1, 1, 1]]
)
_QUADRILATERAL = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
# Gauss points and weights on a line from 0 to 1, its three shape functions and their slopes there.
_POINTS, _WEIGHTS = leggauss(3)
_POINTS, _WEIGHTS = (_POINTS + 1) / 2, _WEIGHTS / 2
_SHAPES = np.stack(
    [(2 * _POINTS - 1) * (_POINTS - 1), 4 * _POINTS * (1 - _POINTS), _POINTS * (2 * _POINTS - 1)]
)
_SLOPES = np.stack([4 * _POINTS - 3, 4 - 8 * _POINTS, 4 * _POINTS - 1])

# Numerical: that of hanger 3 at four times its tension, small enough for two orders.
_STRAIN = 1e-3


def assembled(
    geometry: Geometry, material: Material, support: Support, plane: Plane
) -> AffineSystem:
    """Return the system of a hanger's motions in `plane`."""
    return bending_plane(Solid.of(Mesh.of(geometry), material), support, plane)


def bending_plane(solid: Solid, support: Support, plane: Plane) -> AffineSystem:
    """Return the system of motions in `plane`: antisymmetric to the plane across it."""
    axis = PLANES.index(plane)
    free = ~_held(solid, support, axis).ravel()
    springs = _springs(solid, support, plane)

    def restrict(matrix: csr_array) -> csr_array:
        return csr_array(matrix[free][:, free])

    axis_deflection, axis_m = _deflections(solid, free, axis)
    return AffineSystem(
        restrict(solid.stiffness),
        restrict(solid.by_tension),
        restrict(solid.by_square),
        {name: restrict(matrix) for name, matrix in springs.items()},
        restrict(solid.mass),
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
    """Return True for displacements (nodes, 3) that are zero."""
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

    `by_tension` is the stiffness due to 1 N of tension in the whole hanger, `by_square` that due to
    1 N^2 (see `AffineSystem`).
    """

    mesh: Mesh
    stiffness: csr_array
    mass: csr_array
    by_tension: csr_array
    by_square: csr_array

    @classmethod
    def of(cls, mesh: Mesh, material: Material) -> Solid:
        """Assembles all; the tension acts as a uniform traction on both end faces."""
        stiffness, by_tension, pulled = _stiff(mesh, material)
        # Steel is neither lost nor won when it is stretched: the mass is that of any tension.
        basis = Basis(mesh.cells, ElementHex2(), quadrature=_gauss(3, 3, 3))
        mass = BilinearForm(lambda u, v, _: material.density_kg_m3 * u * v).assemble(basis)
        by_square = csr_array(stiffness.shape)
        if material.is_unstressed:
            pull_n = _STRAIN * mesh.geometry.length_m / np.ptp(pulled[2::3])
            longer, shorter = (
                _stiff(mesh.moved(each * pulled), material) for each in (pull_n, -pull_n)
            )
            # Bending leaves shear strain no energy, for rotations of the stretched bar: without the
            # second order the string's part would be off by 0.65 of the strain.
            bent = longer[0] + shorter[0] - 2 * stiffness
            by_square = (longer[1] - shorter[1]) / (2 * pull_n) + bent / (2 * pull_n**2)
            by_tension = by_tension + (longer[0] - shorter[0]) / (2 * pull_n)
        return cls(mesh, stiffness, _each_axis(csr_array(mass)), by_tension, by_square)


def _stiff(mesh: Mesh, material: Material) -> tuple[csr_array, csr_array, FloatArray]:
    """Elastic and initial-stress stiffness, and displacements (3 nodes,), under 1 N of tension."""
    # Three points along the axis lock thin long cells: the curvature's quadratic term is then
    # constrained by an axial strain that second-order cells cannot follow.
    basis = Basis(mesh.cells, ElementHex2(), quadrature=_gauss(3, 3, 2))
    gradients = [[_gradient_product(basis, i, j) for j in range(3)] for i in range(3)]
    stiffness = _stiffness(gradients, material)
    pulled = _pulled(mesh, stiffness)
    stress = _stress(basis, pulled, material)
    return stiffness, _each_axis(_initial_stress(basis, stress)), pulled


def _gauss(*points: int) -> tuple[FloatArray, FloatArray]:
    """Return the product rule with that many points along each axis of the unit cell."""
    rules = [np.polynomial.legendre.leggauss(n) for n in points]
    places = np.meshgrid(*((x + 1) / 2 for x, _ in rules), indexing="ij")
    weights = np.einsum("i,j,k->ijk", *(w / 2 for _, w in rules))
    return np.stack([place.ravel() for place in places]), weights.ravel()


def _gradient_product(basis: Basis, i: int, j: int) -> csr_array:
    return csr_array(BilinearForm(lambda u, v, _: v.grad[i] * u.grad[j]).assemble(basis))


def _initial_stress(basis: Basis, stress: dict[str, FloatArray]) -> csr_array:
    """Return the form grad v . s grad u for the stress field s."""

    def form(u: Any, v: Any, w: Any) -> Any:
        terms = [w[f"s{i}{j}"] * u.grad[j] * v.grad[i] for i in range(3) for j in range(3)]
        return np.sum(terms, axis=0)

    return csr_array(BilinearForm(form).assemble(basis, **stress))


def _stiffness(gradients: list[list[csr_array]], material: Material) -> csr_array:
    lame, shear = material.lame_pa
    total = shear * _each_axis(gradients[0][0] + gradients[1][1] + gradients[2][2])
    for i, j in product(range(3), repeat=2):
        block = lame * gradients[i][j] + shear * gradients[j][i]
        total = total + kron(block, csr_array(([1.0], ([i], [j])), shape=(3, 3)), format="csr")
    return csr_array(total)


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
    """Return the stress field at the points of integration, by component."""
    lame, shear = material.lame_pa
    gradient = np.stack([basis.interpolate(displacement[i::3]).grad for i in range(3)])
    dilation = lame * np.trace(gradient)
    return {
        f"s{i}{j}": shear * (gradient[i, j] + gradient[j, i]) + (dilation if i == j else 0.0)
        for i in range(3)
        for j in range(3)
    }


def _by_column(points: IntArray, cells: IntArray) -> tuple[FloatArray, IntArray]:
    """As scikit-fem takes them; it warns of a large one that lies otherwise in memory."""
    return points.T.astype(float, order="C"), cells.T.copy()


@dataclass(frozen=True, eq=False)
class Mesh:
    """Hexahedra of 27 nodes; `grid` holds each node's place in the grid, shape (3, nodes).

    Every cell's third axis runs along the hanger.
    """

    geometry: Geometry
    cells: MeshHex2
    grid: FloatArray

    @classmethod
    def of(cls, geometry: Geometry) -> Mesh:
        """Return the quarter of the hanger."""
        corners = _cells(geometry)[:, None, :] + _HEXAHEDRON
        points, index = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
        linear = MeshHex1(*_by_column(points, index.reshape(len(corners), 8)), validate=False)
        grid = MeshHex2.from_mesh(linear).doflocs
        return cls(geometry, MeshHex2(geometry.place(grid), linear.t, validate=False), grid)

    def moved(self, displacement_m: FloatArray) -> Mesh:
        """Return the mesh with its nodes displaced by (3 nodes,)."""
        places = self.cells.doflocs + displacement_m.reshape(-1, 3).T
        cells = MeshHex2(np.ascontiguousarray(places), self.cells.t, validate=False)
        return replace(self, cells=cells)

    @property
    def nodes(self) -> int:
        return int(self.grid.shape[1])

    def on_plane(self, axis: int) -> BoolArray:
        """Return True for nodes (nodes,) on the plane of symmetry x = 0 (axis 0) or y = 0 (1)."""
        return np.asarray(self.grid[axis] == 0)

    def on_end(self, arch: bool) -> BoolArray:
        """Return True for nodes (nodes,) on the face at the deck end or the arch end."""
        return np.asarray(self.grid[2] == self._level(arch))

    def face_shares(self, arch: bool) -> FloatArray:
        """Each node's share (nodes,) of a uniform traction on that end face."""
        zone = self.geometry.zones()[-1 if arch else 0]
        corners = np.array(list(self.geometry.section_cells(zone)))[:, None, :] + _QUADRILATERAL
        points, index = np.unique(corners.reshape(-1, 2), axis=0, return_inverse=True)
        linear = MeshQuad1(*_by_column(points, index.reshape(len(corners), 4)), validate=False)
        grid = MeshQuad2.from_mesh(linear).doflocs
        grid = np.vstack([grid, np.full(grid.shape[1], self._level(arch))])
        # A face of its own: scikit-fem's boundary integrals on curved cells may not converge.
        face = MeshQuad2(self.geometry.place(grid)[:2], linear.t, validate=False)
        load = LinearForm(lambda v, _: v).assemble(Basis(face, ElementQuad2()))
        shares = np.zeros(self.nodes)
        shares[self._find(grid)] = load / load.sum()
        return shares

    def edges(self, edges: Sequence[Edge]) -> csr_array:
        """Return the integral (nodes, nodes) of u v ds along edges of the end faces' quarters."""
        total = csr_array((self.nodes, self.nodes))
        for arch, large in edges:
            total = total + self._edge(arch, large)
        return csr_array(total)

    def _edge(self, arch: bool, large: bool) -> csr_array:
        section, reach = self.geometry.fineness.section, self.geometry.fineness.plate_cells
        cells = np.arange(reach if large else section)
        running = (cells[:, None] + np.array([0.0, 0.5, 1.0])).ravel()
        fixed = np.full(len(running), section if large else reach)
        level = np.full(len(running), self._level(arch))
        # The arch-end plate lies along x, the deck-end plate along y.
        first, second = (running, fixed) if large == arch else (fixed, running)
        lines = self._find(np.stack([first, second, level])).reshape(-1, 3)
        places = self.cells.doflocs[int(large != arch), lines]
        where = np.repeat(lines, 3, axis=1).ravel(), np.tile(lines, 3).ravel()
        values = np.einsum("ap,bp,p,lp->lab", _SHAPES, _SHAPES, _WEIGHTS, places @ _SLOPES).ravel()
        return csr_array(coo_array((values, where), shape=(self.nodes, self.nodes)))

    def _level(self, arch: bool) -> float:
        return float(self.grid[2].max()) if arch else 0.0

    def _find(self, grid: FloatArray) -> IntArray:
        """Return the nodes at places (3, points) of the grid."""
        numbers = {tuple(place): number for number, place in enumerate(self.grid.T.tolist())}
        return np.array([numbers[tuple(place)] for place in grid.T.tolist()])


def _cells(geometry: Geometry) -> IntArray:
    """Places (cells, 3) of all cells in the grid."""
    cells, level = [], 0
    for zone in geometry.zones():
        section = list(geometry.section_cells(zone))
        for layer in range(level, level + zone.cells):
            cells += [(i, j, layer) for i, j in section]
        level += zone.cells
    return np.array(cells)
