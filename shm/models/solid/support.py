"""How the ends of the solid classes are held.

Springs stand along the edges of the end faces: k per node acts as the line stiffness k / node
spacing. k1 (deck end) and k4 (arch end) stand on the large edges, k2 and k3 on the small ones, all
along the hanger's axis. krx and kry (deck end, the thesis's right side), klx and kly (arch end)
stand on all edges of their face, in its plane.
"""

from __future__ import annotations

from dataclasses import dataclass

from shm.values import EndPlate, FloatArray, Plane

Edge = tuple[bool, bool]
"""Whether it is at the arch end, and whether it is a large one."""

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
class Support:
    """Whether the end faces stand on springs along the axis, and on springs in their plane.

    What is not on springs is held.
    """

    axial_springs: bool
    lateral_springs: bool

    def springs(self, plane: Plane) -> tuple[str, ...]:
        """The parameters of the springs that act on motions in `plane`."""
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
