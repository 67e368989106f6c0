"""Second-order elements on the grid of a geometry: hexahedra, the end faces and their edges."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.polynomial.legendre import leggauss
from scipy.sparse import coo_array, csr_array
from skfem import Basis, ElementQuad2, LinearForm, MeshHex1, MeshHex2, MeshQuad1, MeshQuad2

from shm.models.solid.geometry import Geometry
from shm.models.solid.support import Edge
from shm.values import BoolArray, FloatArray, IntArray

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
        """The quarter of the hanger."""
        corners = _cells(geometry)[:, None, :] + _HEXAHEDRON
        points, index = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
        linear = MeshHex1(points.T.astype(float), index.reshape(len(corners), 8).T, validate=False)
        grid = MeshHex2.from_mesh(linear).doflocs
        return cls(geometry, MeshHex2(geometry.place(grid), linear.t, validate=False), grid)

    @property
    def nodes(self) -> int:
        return int(self.grid.shape[1])

    def on_plane(self, axis: int) -> BoolArray:
        """Which nodes (nodes,) lie on the plane of symmetry x = 0 (axis 0) or y = 0 (axis 1)."""
        return np.asarray(self.grid[axis] == 0)

    def on_end(self, arch: bool) -> BoolArray:
        """Which nodes (nodes,) lie on the face at the deck end or the arch end."""
        return np.asarray(self.grid[2] == self._level(arch))

    def face_shares(self, arch: bool) -> FloatArray:
        """Each node's share (nodes,) of a uniform traction on that end face."""
        zone = self.geometry.zones()[-1 if arch else 0]
        corners = np.array(list(self.geometry.section_cells(zone)))[:, None, :] + _QUADRILATERAL
        points, index = np.unique(corners.reshape(-1, 2), axis=0, return_inverse=True)
        linear = MeshQuad1(points.T.astype(float), index.reshape(len(corners), 4).T, validate=False)
        grid = MeshQuad2.from_mesh(linear).doflocs
        grid = np.vstack([grid, np.full(grid.shape[1], self._level(arch))])
        # A face of its own: scikit-fem's boundary integrals on curved cells may not converge.
        face = MeshQuad2(self.geometry.place(grid)[:2], linear.t, validate=False)
        load = LinearForm(lambda v, _: v).assemble(Basis(face, ElementQuad2()))
        shares = np.zeros(self.nodes)
        shares[self._find(grid)] = load / load.sum()
        return shares

    def edges(self, edges: Sequence[Edge]) -> csr_array:
        """The integral of u v ds along edges of the end faces' quarters, (nodes, nodes), in m."""
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
        """The nodes at places (3, points) of the grid."""
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
