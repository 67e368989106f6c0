"""What a campaign measures, under which conditions and how well."""

from __future__ import annotations

from dataclasses import dataclass

from shm.errors import UsageError
from shm.simulate.reality import Reality
from shm.values import PLANES, AddedMass, Hanger, ModalTest, Plane

# Fractions of the length, from the deck and from a lift, near no node of the lowest eight modes.
_PLACES = (0.13, 0.29, 0.45, 0.66)
_MASS_PLACE = 0.3


@dataclass(frozen=True)
class CampaignPlan:
    """What is measured, under which conditions and how well.

    One test at each temperature at the reference level, one at each further level at the middle
    temperature, and one there with a known mass of `mass_share` of the hanger's at 0.3 of
    its length (share 0: none). A NaN temperature or amplitude is one that nobody noted. `sensors`
    (1 to 4) places hold an accelerometer each, unless `sensors_x_m` names them; one that is not
    biaxial measures in the hit plane. `frequency_sd` is a fraction; `shape_sd` a share of the
    shape's largest component; `damping_sd` a fraction of the damping ratio. The tension is drawn
    about the state's with `tension_spread`, a fraction; `as_made` draws the bar's deviations. With
    a `reality` the campaign departs from the textbook as it says.
    """

    planes: tuple[Plane, ...] = PLANES
    modes: int = 8
    sensors: int = 4
    sensors_x_m: tuple[float, ...] = ()
    shapes: bool = True
    biaxial: bool = True
    temperatures_c: tuple[float, ...] = (-5.0, 10.0, 25.0)
    amplitudes: tuple[float, ...] = (0.3, 1.0, 2.0)
    mass_share: float = 0.02
    frequency_sd: float = 1e-4
    shape_sd: float = 0.005
    damping_sd: float = 0.1
    tension_spread: float = 0.1
    as_made: bool = True
    reality: Reality | None = None

    @property
    def own_laws(self) -> bool:
        return self.reality is not None and self.reality.own_laws

    def places_m(self, hanger: Hanger) -> tuple[float, ...]:
        """Where the accelerometers sit."""
        chosen = tuple(round(share * hanger.length_m, 3) for share in _PLACES[: self.sensors])
        return self.sensors_x_m or chosen

    def tests(self, hanger: Hanger) -> tuple[ModalTest, ...]:
        """The tests with their conditions, before anything is measured."""
        _refuse_unless_possible(self)
        middle = sorted(self.temperatures_c)[len(self.temperatures_c) // 2]
        usual, *others = sorted(self.amplitudes, key=lambda level: abs(level - 1))
        conditions = [(each, usual) for each in self.temperatures_c]
        conditions += [(middle, level) for level in self.amplitudes if level in others]
        masses: list[AddedMass | None] = [None] * len(conditions)
        if self.mass_share:
            own = hanger.mass_per_length_kg_m * hanger.length_m
            conditions.append((middle, usual))
            masses.append(AddedMass(self.mass_share * own, _MASS_PLACE * hanger.length_m))
        return tuple(
            ModalTest(f"t{i + 1}", (), hanger.id, None, warmth, level, mass)
            for i, ((warmth, level), mass) in enumerate(zip(conditions, masses, strict=True))
        )


def _refuse_unless_possible(plan: CampaignPlan) -> None:
    if plan.modes < 1 or not plan.planes or not plan.temperatures_c or not plan.amplitudes:
        raise UsageError(
            "a campaign needs planes, modes, a temperature and a level.",
            remedy="Give one of each at least; NaN for a temperature or level that is unknown.",
        )
    if not plan.sensors_x_m and not 1 <= plan.sensors <= len(_PLACES):
        raise UsageError(
            f"{plan.sensors} sensors have no usual places.",
            remedy=f"Take 1 to {len(_PLACES)}, or give their places.",
        )
