"""The description of a hanger by its owner."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields
from typing import Literal, TypeAlias

from shm.assumptions import DEFAULTS, Assumptions
from shm.values.kinds import NAN
from shm.values.showing import Displayable

_ENDS_BELOW = 0.5  # judgement: so that a state at the limit does not come and go from test to test


@dataclass(frozen=True)
class Thresholds:
    """Thresholds of alerts: the size of a shift that matters, and the required probability.

    `false_call_years` is the mean time until the hanger is called changed though it has not; None:
    the setting of that name.
    """

    tension_shift_fraction: float = 0.05
    stiffness_shift_decades: float = 0.5
    alert_probability: float = 0.95
    false_call_years: float | None = None

    @property
    def end_probability(self) -> float:
        """Below this a condition that an alert told of has ended."""
        return _ENDS_BELOW * self.alert_probability


@dataclass(frozen=True)
class EndPlate:
    """The plate welded to each end of a round rod, which is slotted into it over `slot_m`.

    Its width goes linearly from `end_width_m` at the end face to `neck_width_m`. The deck-end
    plate lies along the bridge, the arch-end plate across it. Springs on the end faces' edges are
    given per node; the nodes are `edge_node_spacing_m` apart.
    """

    length_m: float
    thickness_m: float
    end_width_m: float
    neck_width_m: float
    slot_m: float
    edge_node_spacing_m: float


@dataclass(frozen=True)
class Turnbuckle:
    """A coupler in the bar, centred at `x_m`; its mass and stiffness replace the bar's there."""

    x_m: float
    length_m: float
    mass_kg: float
    bending_stiffness_n_m2: float


@dataclass(frozen=True)
class Scatter:
    """Standard deviations, as fractions, by which a bar as made differs from its description.

    The defaults and their reasons are rows of `shm.assumptions`. `section` is that of the area;
    `along` is by which the section varies along the bar about its own mean.
    `tension` is how far the tension may be from the nominal one where that was weighed or measured;
    infinite where the nominal one says next to nothing. `bending_factor` is that of a strand's
    stated `bending_stiffness_factor`; NaN: anything in the assumed range.
    `sensor_gain` (a fraction), `sensor_place_m` and `sensor_turn_deg` are what sensors err by in
    all tests. `sensor_cross_axis` is what of one axis another reads, each axis on its own.
    `effective_length` is by which the length that swings may differ from the taped one; NaN: by
    the tape's own error, and what `Hanger.fittings_m` leave open.
    """

    section: float = DEFAULTS.section_sd.value
    density: float = DEFAULTS.density_sd.value
    length: float = DEFAULTS.length_sd.value
    modulus: float = DEFAULTS.modulus_sd.value
    along: float = DEFAULTS.section_along_sd.value
    tension: float = math.inf
    bending_factor: float = NAN
    effective_length: float = NAN
    sensor_gain: float = DEFAULTS.sensor_gain_sd.value
    sensor_place_m: float = DEFAULTS.sensor_place_sd_m.value
    sensor_turn_deg: float = DEFAULTS.sensor_turn_sd_deg.value
    sensor_cross_axis: float = DEFAULTS.sensor_cross_axis_sd.value

    @classmethod
    def of(cls, assumed: Assumptions) -> Scatter:
        """Return the scatter of a bar and of sensors of which the description states none."""
        return cls(
            section=assumed.section_sd.value,
            density=assumed.density_sd.value,
            length=assumed.length_sd.value,
            modulus=assumed.modulus_sd.value,
            along=assumed.section_along_sd.value,
            sensor_gain=assumed.sensor_gain_sd.value,
            sensor_place_m=assumed.sensor_place_sd_m.value,
            sensor_turn_deg=assumed.sensor_turn_sd_deg.value,
            sensor_cross_axis=assumed.sensor_cross_axis_sd.value,
        )

    @property
    def sensor_turn(self) -> float:
        """In radians, with the part of both axes' cross sensitivities that looks like a turn."""
        return math.hypot(math.radians(self.sensor_turn_deg), self.sensor_cross_mean)

    @property
    def sensor_cross_mean(self) -> float:
        """Of the mean of both axes' cross sensitivities, and of half their difference."""
        return self.sensor_cross_axis / math.sqrt(2)

    @property
    def swinging_length(self) -> float:
        """By which the length that swings may differ from the taped one, the tape's error in it."""
        stated = self.effective_length
        return math.hypot(self.length, stated if math.isfinite(stated) else 0.0)


@dataclass(frozen=True)
class Limits:
    """Limits of the tension in N: overloaded above `tension_max_n`, slack below `tension_min_n`.

    NaN where the owner sets none.
    """

    tension_max_n: float = NAN
    tension_min_n: float = NAN


Kind: TypeAlias = Literal["rod", "strand", "any"]
"""Whether a hanger bends as one solid section, or its wires may slip; `any`: a structure that no
model class describes, of which frequencies alone are watched."""

Support: TypeAlias = Literal["clamped", "pinned", "free"]
"""How an end is held: fast, turning freely, or not at all."""


@dataclass(frozen=True)
class Supports:
    """Supports of the two ends, and the mass that hangs from a free end.

    The mass swings along with the end, sideways; its weight is part of the nominal tension.
    """

    deck: Support = "clamped"
    arch: Support = "clamped"
    hanging_mass_kg: float = 0.0

    @property
    def clamped(self) -> bool:
        """Return True if both ends are clamped."""
        return self.ends("clamped") == (0, 1)

    def ends(self, *kinds: Support) -> tuple[int, ...]:
        """Return the ends (deck 0, arch 1) that are supported in one of these ways."""
        return tuple(end for end, support in enumerate((self.deck, self.arch)) if support in kinds)


LengthBy: TypeAlias = Literal["faces", "pins", "nodes"]
"""Between which points a hanger was taped: its fittings' faces, its pins, the system lines."""


EndKind: TypeAlias = Literal["socket", "fork", "plate", "threaded", "welded"]
"""How the ends of a hanger are made: both alike."""


@dataclass(frozen=True)
class Survey:
    """Statements on how the bar was measured, for reports; no result rests on them. "": not stated.

    `length_measured` is with what and when the length was taped, `measured_by` who measured the
    bar, `stated_keys` the keys of its description, which tell a default from a statement.
    """

    length_by: LengthBy | Literal[""] = ""
    length_measured: str = ""
    measured_by: str = ""
    stated_keys: tuple[str, ...] = ()


@dataclass(frozen=True)
class EffectPrior:
    """The owner's range of one parameter of an effect of the gap diagnosis, in its unit."""

    effect: str
    parameter: str
    lower: float
    upper: float


@dataclass(frozen=True)
class Hanger(Displayable):
    """One hanger as its owner describes it: geometry, material, nominal tension.

    `diameter_m` is NaN where the section is not round. `bending_stiffness_factor` is the share of
    the solid section's bending stiffness that a strand has. Hangers of one `family` were made
    alike, of one delivery: what a measured tension says of the mass and stiffness of one holds for
    its siblings. `fittings_m` is over which length forks, sockets or threads stiffen the deck and
    the arch end: so far the length that swings is open. `models` names the model classes that
    the owner admits; empty: all that the settings name. `effect_priors` replace ranges of the
    catalogue of effects. A bar with a nominal tension of 0 carries none. `survey` is for reports.
    `ends` is how its ends are made, "" where it is not stated. `inclination_deg` is counted from
    the horizontal, 90 is vertical; NaN where it is not stated.
    `assumptions` is what is taken of it, of sensors and of measurements before any data.
    """

    id: int
    length_m: float
    elastic_modulus_pa: float
    area_m2: float
    second_moment_m4: float
    mass_per_length_kg_m: float
    nominal_tension_n: float
    name: str = ""
    thresholds: Thresholds = field(default_factory=Thresholds)
    diameter_m: float = NAN
    poissons_ratio: float = DEFAULTS.poissons_ratio.value
    bending_stiffness_factor: float = 1.0
    plate: EndPlate | None = None
    turnbuckles: tuple[Turnbuckle, ...] = ()
    models: tuple[str, ...] = ()
    scatter: Scatter = field(default_factory=Scatter)
    effect_priors: tuple[EffectPrior, ...] = ()
    supports: Supports = field(default_factory=Supports)
    kind: Kind = "rod"
    family: str = ""
    limits: Limits = field(default_factory=Limits)
    fittings_m: tuple[float, float] = (0.0, 0.0)
    ends: EndKind | Literal[""] = ""
    inclination_deg: float = NAN
    survey: Survey = field(default_factory=Survey)
    assumptions: Assumptions = DEFAULTS

    @property
    def shear_coefficient(self) -> float:
        """Return the coefficient of a round section, solid or hollow (Cowper 1966, table 1).

        The second moment over that of a solid section of the same area tells how hollow it is.
        """
        nu, ratio = self.poissons_ratio, 4 * math.pi * self.second_moment_m4 / self.area_m2**2
        hollow = max(ratio - 1, 0.0) / (ratio + 1)  # square of inner over outer diameter
        both = (1 + hollow) ** 2
        return 6 * (1 + nu) * both / ((7 + 6 * nu) * both + (20 + 12 * nu) * hollow)

    @property
    def shear_stiffness_n(self) -> float:
        """Return shear coefficient times shear modulus times area."""
        modulus_pa = self.elastic_modulus_pa / (2 * (1 + self.poissons_ratio))
        return self.shear_coefficient * modulus_pa * self.area_m2

    @property
    def bending_stiffness_n_m2(self) -> float:
        return self.elastic_modulus_pa * self.second_moment_m4 * self.bending_stiffness_factor

    def slenderness(self, tension_n: float) -> float:
        """Return L sqrt(T/EI): about 10 of a bar, above 100 of a string; NaN of a slack one."""
        if not (tension_n > 0 and self.bending_stiffness_n_m2 > 0):
            return NAN
        return self.length_m * math.sqrt(tension_n / self.bending_stiffness_n_m2)

    @property
    def end_kind(self) -> str:
        """Return how its ends are made: as stated; a strand's fittings are sockets."""
        has_sockets = self.kind == "strand" and any(self.fittings_m)
        return self.ends or ("socket" if has_sockets else "unstated")

    @classmethod
    def without_model(
        cls, id_: int, name: str = "", thresholds: Thresholds | None = None
    ) -> Hanger:
        """Return a structure without a model class: it has no length, no section, no tension."""
        limits = Thresholds() if thresholds is None else thresholds
        return cls(id_, NAN, NAN, NAN, NAN, NAN, NAN, name, limits, kind="any")

    @property
    def is_modelled(self) -> bool:
        """Return True if a model class may describe it."""
        return self.kind != "any"

    @property
    def has_sensors(self) -> bool:
        """Return True if sensors stay on it, so that nobody is asked to hit it."""
        return False

    @property
    def is_control(self) -> bool:
        """Return True if its tension is known and checks the measurement: see `ControlHanger`."""
        return False

    @property
    def as_hanger(self) -> bool:
        """Return True if it is clamped at both ends and in tension."""
        return self.supports.clamped and self.nominal_tension_n > 0


class MonitoredHanger(Hanger):
    """The same with sensors that stay, which is no part of what results rest on."""

    @classmethod
    def of(cls, hanger: Hanger) -> MonitoredHanger:
        return cls(**{each.name: getattr(hanger, each.name) for each in fields(hanger)})

    @property
    def has_sensors(self) -> bool:
        return True


@dataclass(frozen=True)
class ControlHanger(Hanger):
    """A hanger of known tension, which checks each campaign and is never watched (record 0028).

    `known_tension_sd_n` is the standard uncertainty of the known tension, in N like it.
    """

    known_tension_n: float = NAN
    known_tension_sd_n: float = NAN

    @property
    def is_control(self) -> bool:
        return True
