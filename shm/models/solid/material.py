"""What a solid hanger is made of."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Material:
    """Isotropic and linear elastic."""

    elastic_modulus_pa: float
    poissons_ratio: float
    density_kg_m3: float

    @property
    def lame_pa(self) -> tuple[float, float]:
        """Lame's first parameter and the shear modulus."""
        modulus, ratio = self.elastic_modulus_pa, self.poissons_ratio
        shear = modulus / (2 * (1 + ratio))
        return 2 * shear * ratio / (1 - 2 * ratio), shear
