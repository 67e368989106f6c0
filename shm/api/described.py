"""A hanger, as its owner describes it."""

from __future__ import annotations

from pathlib import Path

from shm import bridge
from shm.bridge.hanger import hanger_of
from shm.values import Hanger


def load_hanger(path: str | Path, hanger_id: int | None = None) -> Hanger:
    """A hanger described in a TOML file: a `bridge.toml`, or a file with one `[[hanger]]` table.

    `hanger_id` says which, and may be left out where the file has one only. Raises BadInput naming
    the table and key at fault, or the hangers that there are.

    Example:
        >>> hanger = shm.load_hanger("bridge.toml", 3)
        >>> hanger.length_m
        12.0
    """
    return bridge.load_hanger(Path(path), hanger_id)


def round_bar(
    id: int,
    *,
    diameter_m: float,
    length_m: float,
    elastic_modulus_pa: float,
    density_kg_m3: float,
    nominal_tension_n: float,
    name: str = "",
) -> Hanger:
    """A solid round bar, clamped at both ends: section and mass follow from diameter and density.

    The same checks are made as of a `[[hanger]]` table, which can say more (end plates,
    turnbuckles, strands, supports). A nominal tension of 0 is a bar without any. Raises BadInput
    naming the figure that cannot be.

    Example:
        >>> hanger = shm.round_bar(
        ...     3, diameter_m=0.130, length_m=12.0, elastic_modulus_pa=200e9,
        ...     density_kg_m3=7800, nominal_tension_n=711e3,
        ... )
        >>> round(hanger.mass_per_length_kg_m, 1)
        103.5
    """
    values = {
        "id": id,
        "diameter_m": diameter_m,
        "length_m": length_m,
        "elastic_modulus_pa": elastic_modulus_pa,
        "density_kg_m3": density_kg_m3,
        "nominal_tension_n": nominal_tension_n,
        "name": name,
    }
    return hanger_of(values, Path())
