"""A bar that shears and whose sections resist turning: Timoshenko's beam."""

from __future__ import annotations

from dataclasses import replace

from shm.models.conditions import Conditions
from shm.models.effects.base import Effect, Parameter, Variant
from shm.models.hanger.physical import PhysicalHanger
from shm.values import FloatArray, Hanger


class ShearAndRotaryInertia(Effect):
    """The bar is not slender: it shears, and its sections have inertia against turning.

    Shear stiffness kappa G A with the coefficient of a round section, kappa = 6 (1 + nu) / (7 + 6
    nu), and rotary inertia rho I. It lowers the high orders. A share of 1 is the theory.
    """

    name = "shear_and_rotary_inertia"
    title = "Shear and rotary inertia"
    source = (
        "Timoshenko (1921), On the correction for shear of the differential equation for "
        "transverse vibrations of prismatic bars; Cowper (1966), The shear coefficient in "
        "Timoshenko's beam theory."
    )
    seen_by = ("frequencies of high orders",)
    imitated_by = ("translational_end_flexibility", "stiff_end_zones", "point_mass")

    def parameters(self, hanger: Hanger, variant: Variant) -> tuple[Parameter, ...]:
        size = Parameter(
            "share",
            "of the theory",
            0.5,
            1.5,
            0.0,
            "Half to one and a half times the theory of a round bar: a tube or a flat bar has "
            "another shear coefficient.",
            least=0.0,
        )
        return (size,)

    def applied(
        self,
        physical: PhysicalHanger,
        values: FloatArray,
        variant: Variant,
        conditions: Conditions,
        hanger: Hanger,
    ) -> PhysicalHanger:
        density_kg_m3 = hanger.mass_per_length_kg_m / hanger.area_m2
        inertia_kg_m = density_kg_m3 * hanger.second_moment_m4
        share = values[:, 0]
        return replace(
            physical,
            shear_compliance_1_n=physical.shear_compliance_1_n + share / _shear_stiffness_n(hanger),
            rotary_inertia_kg_m=physical.rotary_inertia_kg_m + share * inertia_kg_m,
        )


def _shear_stiffness_n(hanger: Hanger) -> float:
    """Kappa G A of a round section (Cowper 1966, table 1)."""
    ratio = hanger.poissons_ratio
    coefficient = 6 * (1 + ratio) / (7 + 6 * ratio)
    return coefficient * hanger.elastic_modulus_pa / (2 * (1 + ratio)) * hanger.area_m2
