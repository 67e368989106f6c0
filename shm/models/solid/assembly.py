"""One bending plane of a solid hanger on its supports, as an affine system."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array, eye_array, kron

from shm.models.solid.affine import AffineSystem
from shm.models.solid.elasticity import Solid
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
