"""A round rod with or without end plates, as a map from unit cells, its steel and supports.

x is transverse, y longitudinal, z along the hanger from the deck end. Only the quarter x, y >= 0 is
meshed. In the section, unit (0, 0) is the core that rod and plates share, (1, 0) and (0, 1) are
the rest of the rod within a plate's thickness, (1, 1) is the rod outside of both plates, and the
units beyond 2 are a plate's wing: along y at the deck end, along x at the arch end. So one grid
serves rod and both plates, which are rotated by 90 degrees to each other.

Springs stand along the edges of the end faces: k per node acts as the line stiffness k / node
spacing. k1 (deck end) and k4 (arch end) stand on the large edges, k2 and k3 on the small ones, all
along the hanger's axis. krx and kry (deck end, the thesis's right side), klx and kly (arch end)
stand on all edges of their face, in its plane.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np

from shm.values import EndPlate, FloatArray, Plane

_WING_GRADING = 1.4  # judgement: elements get smaller towards the rod, where stress gathers
AXIAL: dict[str, Edge] = {
    "log10_k1": (False, True),
    "log10_k2": (False, False),
    "log10_k3": (True, False),
    "log10_k4": (True, True),
}
LATERAL = {
    "transverse": {"log10_krx": False, "log10_klx": True},
    "longitudinal": {"log10_kry": False, "log10_kly": True},
}


@dataclass(frozen=True)
class Fineness:
    """Cells along the free rod, each overlap, each bare plate; units across each plate's wing.

    `section` is how often each unit of the section is divided, both ways.
    """

    rod: int = 36
    overlap: int = 4
    bare_plate: int = 4
    wing: int = 3
    section: int = 1

    @property
    def plate_cells(self) -> int:
        """Cells from the axis to the far edge of a plate."""
        return (2 + self.wing) * self.section


@dataclass(frozen=True)
class Zone:
    """A stretch of the hanger with the same cells in every section."""

    start_m: float
    end_m: float
    cells: int
    has_rod: bool
    plate_along: str = ""


@dataclass(frozen=True)
class Geometry:
    """A rod of `diameter_m` over `length_m`, or slotted into a plate at each end."""

    length_m: float
    diameter_m: float
    plate: EndPlate | None
    fineness: Fineness

    @property
    def radius_m(self) -> float:
        return self.diameter_m / 2

    @property
    def core_m(self) -> float:
        """Half the side of the square core: half the plate's thickness, where there is one."""
        return self.plate.thickness_m / 2 if self.plate else 0.5 * self.radius_m

    def zones(self) -> tuple[Zone, ...]:
        """Return the stretches from the deck end to the arch end."""
        fine, length, plate = self.fineness, self.length_m, self.plate
        if plate is None:
            return (Zone(0.0, length, fine.rod, has_rod=True),)
        bare, end = plate.length_m - plate.slot_m, plate.length_m
        return (
            Zone(0.0, bare, fine.bare_plate, has_rod=False, plate_along="y"),
            Zone(bare, end, fine.overlap, has_rod=True, plate_along="y"),
            Zone(end, length - end, fine.rod, has_rod=True),
            Zone(length - end, length - bare, fine.overlap, has_rod=True, plate_along="x"),
            Zone(length - bare, length, fine.bare_plate, has_rod=False, plate_along="x"),
        )

    def section_cells(self, zone: Zone) -> Iterator[tuple[int, int]]:
        """Return the cells (i, j) of the grid that the sections of `zone` have."""
        across = self.fineness.section
        if zone.has_rod:
            yield from product(range(2 * across), repeat=2)
        if zone.plate_along:
            begin = 2 * across if zone.has_rod else 0
            for far, near in product(range(begin, self.fineness.plate_cells), range(across)):
                yield (far, near) if zone.plate_along == "x" else (near, far)

    def layers_m(self) -> FloatArray:
        """Heights z of the grid's levels, shape (layers + 1,)."""
        parts = [np.linspace(zone.start_m, zone.end_m, zone.cells + 1) for zone in self.zones()]
        return np.concatenate([parts[0][:1], *(part[1:] for part in parts)])

    def place(self, grid: FloatArray) -> FloatArray:
        """Positions x, y, z (3, points) of places (3, points) in the grid."""
        a, b, level = grid[0] / self.fineness.section, grid[1] / self.fineness.section, grid[2]
        layers = self.layers_m()
        z = np.interp(level, np.arange(len(layers)), layers)
        mirrored = b > a
        near, far = np.where(mirrored, a, b), np.where(mirrored, b, a)
        along, across = self._half_section(near, far, z)
        return np.stack([np.where(mirrored, across, along), np.where(mirrored, along, across), z])

    def _half_section(
        self, near: FloatArray, far: FloatArray, z: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Positions along and across the plate for grid coordinates far >= near."""
        core, inner = self.core_m, np.clip(near, 0.0, 1.0)
        across = core * inner
        surface = np.sqrt(self.radius_m**2 - across**2)
        along = core * far.clip(0, 1) + (surface - core) * (far - 1).clip(0, 1)
        if self.plate is not None:
            share = ((far - 2).clip(0) / self.fineness.wing) ** _WING_GRADING
            along = along + share * (self._half_width_m(self.plate, z) - surface)
        corner_along, corner_across = self._corner(far - 1, near - 1)
        in_corner = near > 1
        return np.where(in_corner, corner_along, along), np.where(in_corner, corner_across, across)

    def _corner(self, u: FloatArray, v: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the unit (1, 1), blended from its two straight and two circular sides.

        Coons 1967: u and v run from 0 to 1 along and across the plate.
        """
        radius, core = self.radius_m, self.core_m
        first = np.arcsin(core / radius)
        straight = radius * np.cos(first) - core
        far_side, top_side = (first + t * (np.pi / 4 - first) for t in (v, u))
        along = (1 - v) * (core + u * straight) + v * radius * np.sin(top_side)
        along += (1 - u) * core + u * radius * np.cos(far_side)
        along -= (1 - u) * core + u * ((1 - v) * (core + straight) + v * radius / np.sqrt(2))
        across = (1 - v) * core + v * radius * np.cos(top_side)
        across += (1 - u) * (core + v * straight) + u * radius * np.sin(far_side)
        across -= (1 - v) * core + v * ((1 - u) * (core + straight) + u * radius / np.sqrt(2))
        return along, across

    def _half_width_m(self, plate: EndPlate, z: FloatArray) -> FloatArray:
        depth = np.minimum(z, self.length_m - z).clip(0, plate.length_m) / plate.length_m
        return np.asarray(plate.end_width_m + (plate.neck_width_m - plate.end_width_m) * depth) / 2


@dataclass(frozen=True)
class Material:
    """Isotropic and linear elastic, with these constants in the bar as tension has stretched it.

    `is_unstressed` says that the geometry and the density are those without tension, which then
    stretches the bar; else they are those of the hanger as it hangs.
    """

    elastic_modulus_pa: float
    poissons_ratio: float
    density_kg_m3: float
    is_unstressed: bool = False

    @property
    def lame_pa(self) -> tuple[float, float]:
        """Lame's first parameter and the shear modulus."""
        modulus, ratio = self.elastic_modulus_pa, self.poissons_ratio
        shear = modulus / (2 * (1 + ratio))
        return 2 * shear * ratio / (1 - 2 * ratio), shear


Edge = tuple[bool, bool]
"""Whether it is at the arch end, and whether it is a large one."""


@dataclass(frozen=True)
class Support:
    """Tell whether the end faces stand on springs along the axis, and in their plane.

    What is not on springs is held.
    """

    axial_springs: bool
    lateral_springs: bool

    def springs(self, plane: Plane) -> tuple[str, ...]:
        """Return the parameters of the springs that act on motions in `plane`."""
        axial = tuple(AXIAL) if self.axial_springs else ()
        return axial + (tuple(LATERAL[plane]) if self.lateral_springs else ())


FIXED = Support(axial_springs=False, lateral_springs=False)
AXIAL_SPRINGS = Support(axial_springs=True, lateral_springs=False)
ALL_SPRINGS = Support(axial_springs=True, lateral_springs=True)


def face_springs_n_m_rad(
    plate: EndPlate, large_n_m: FloatArray, small_n_m: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Rotational stiffness (n,) of a rigid face on its axial springs (n,), per node.

    First against rotation in the direction of the plate's thickness, then of its width.
    """
    thickness, width = plate.thickness_m, plate.end_width_m
    large, small = (2 * k / plate.edge_node_spacing_m for k in (large_n_m, small_n_m))
    across = large * width * thickness**2 / 4 + small * thickness**3 / 12
    along = large * width**3 / 12 + small * thickness * width**2 / 4
    return across, along
