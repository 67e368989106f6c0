"""A `[[hanger]]` table: section, ends, turnbuckles, admitted model classes, thresholds, gap.

What an owner says of the ends: how they are held, and what hangs from a free one.

What an owner says of the gap diagnosis: ranges of effects, and how exactly the bar was made.
"""

from __future__ import annotations

import math
from dataclasses import fields, replace
from pathlib import Path
from typing import Any, Literal, cast, get_args

from shm.assumptions import DEFAULTS, FILE, Assumptions
from shm.bridge.assumed import assumptions_of
from shm.bridge.table import Table
from shm.values import (
    NAN,
    ControlHanger,
    EffectPrior,
    EndKind,
    EndPlate,
    Hanger,
    Kind,
    LengthBy,
    Limits,
    Scatter,
    Support,
    Supports,
    Survey,
    Thresholds,
    Turnbuckle,
)

_NOMINAL = "nominal_tension_n"
_REQUIRED = ("id", "length_m", "elastic_modulus_pa", _NOMINAL)
_SECTION = ("area_m2", "second_moment_m4", "mass_per_length_kg_m")
_CONTROL = ("control", "known_tension_n", "known_tension_sd_n")
_OPTIONAL = (
    "name", "diameter_m", "density_kg_m3", "poissons_ratio", "bending_stiffness_factor", "models",
    "plate", "turnbuckle", "thresholds", "scatter", "effects", "supports", "kind", "family",
    "limits", "fittings_m", "ends", "inclination_deg", "length_by", "length_measured",
    "measured_by", "assumptions", *_CONTROL,
)  # fmt: skip
_KNOWN = {*_REQUIRED, *_SECTION, *_OPTIONAL}
_LARGEST_POISSONS_RATIO = 0.499
_LEAST_FACTOR = 1e-6
_SOFTEST_PA, _STIFFEST_PA = 1e6, 2e12
"""Rubber, and twice a diamond: what lies beyond was written in another unit."""
# Light timber and osmium; the strongest carbon fibre.
_LIGHTEST_KG_M3, _DENSEST_KG_M3, _STRONGEST_PA = 300.0, 23000.0, 7e9
_FLATTEST_DEG, _VERTICAL_DEG = 10.0, 90.0  # judgement: a flatter one is no hanger
_LONGEST_M = 1000.0  # judgement: the longest stays have 580 m; of 4000 m and more no mode is solved

# Judgement: from ten false calls a year, which nobody reads, to none in the life of all bridges.
_FALSE_CALL_YEARS = (0.1, 1e6)
_MOST_DECADES = 4.0  # judgement: from a hinge to a clamp


def hanger_of(values: dict[str, Any], path: Path, assumed: Assumptions = DEFAULTS) -> Hanger:
    """Return the hanger of a `[[hanger]]` table; raises BadInput naming table and key at fault.

    `assumed` are the assumptions of the bridge, which the hanger's own table goes before.
    """
    table = Table(values, f"[[hanger]] id {values.get('id', '?')}", path)
    table.refuse_unknown(_KNOWN)
    length_m, elastic_modulus = table.positive("length_m"), _elastic_modulus(table)
    area, second_moment, mass = _section(table)
    diameter = table.positive("diameter_m") if "diameter_m" in table else NAN
    _refuse_length(table, length_m, max(diameter, math.sqrt(area)))
    control = _control(table)
    nominal = "known_tension_n" if control and "nominal_tension_n" not in table else _NOMINAL
    nominal_tension_n = table.not_negative(nominal)
    origin = f"{FILE}, hanger {values.get('id', '?')}"
    assumed = assumptions_of(table.table("assumptions"), assumed, origin)
    usual_ratio = assumed.poissons_ratio.value
    _refuse_other_units(table, mass / area, nominal_tension_n / area)
    fittings_m, plate = _fittings(table, length_m), _plate(table.table("plate"), length_m, diameter)
    open_ends = plate is None and not any(fittings_m)
    hanger = Hanger(
        id=table.value(
            "id", int, "is not a whole number", "Give id = 1, 2, 3, ...", holds=lambda id_: id_ >= 0
        ),
        length_m=length_m,
        elastic_modulus_pa=elastic_modulus,
        area_m2=area,
        second_moment_m4=second_moment,
        mass_per_length_kg_m=mass,
        nominal_tension_n=nominal_tension_n,
        name=str(values.get("name", "")),
        thresholds=_thresholds(table.table("thresholds")),
        diameter_m=diameter,
        poissons_ratio=table.fraction("poissons_ratio", usual_ratio, 0.0, _LARGEST_POISSONS_RATIO),
        bending_stiffness_factor=table.fraction("bending_stiffness_factor", 1.0, _LEAST_FACTOR, 1),
        plate=plate,
        turnbuckles=_turnbuckles(table.tables("turnbuckle"), length_m),
        models=_models(table),
        scatter=_scatter(table, length_m, area, open_ends, assumed),
        effect_priors=effect_priors_of(table.table("effects")),
        supports=supports_of(table.table("supports")),
        kind=_kind(table),
        family=str(values.get("family", "")),
        limits=_limits(table.table("limits")),
        fittings_m=fittings_m,
        ends=_ends(table),
        inclination_deg=_inclination_deg(table),
        survey=_survey(table),
        assumptions=assumed,
    )
    _refuse_less_than_weight(table, hanger)
    if control is None:
        return hanger
    described = {each.name: getattr(hanger, each.name) for each in fields(hanger)}
    return ControlHanger(**described, known_tension_n=control[0], known_tension_sd_n=control[1])


def _control(table: Table) -> tuple[float, float] | None:
    """Return the known tension of a control hanger and its sd in N; None of any other hanger."""
    remedy = "Write control = true of a hanger whose tension is known, or leave the key out."
    if table.value("control", bool, "is neither true nor false", remedy, usual=False):
        return table.positive("known_tension_n", "N"), table.positive("known_tension_sd_n", "N")
    if stated := [key for key in _CONTROL[1:] if key in table]:
        raise table.refusal(f"{stated[0]} is that of a control hanger alone", remedy)
    return None


def _refuse_length(table: Table, length_m: float, widest_m: float) -> None:
    """Refuse a length that is no hanger's, or that a section `widest_m` across cannot have."""
    if length_m > _LONGEST_M:
        raise table.refusal(
            f"length_m = {length_m:g} is longer than any hanger",
            f"Give it in m, at most {_LONGEST_M:g}.",
        )
    if widest_m >= length_m:
        raise table.refusal(
            f"a section of {widest_m:g} m is no hanger of {length_m:g} m",
            "Give lengths and diameters in m, areas in m2.",
        )


def _elastic_modulus(table: Table) -> float:
    """Return Young's modulus in Pa; raises BadInput where it is that of no material."""
    modulus = table.positive("elastic_modulus_pa")
    if not _SOFTEST_PA <= modulus <= _STIFFEST_PA:
        raise table.refusal(
            f"elastic_modulus_pa = {modulus:g} is that of no material",
            "Give it in Pa: steel has 2.0e11 to 2.1e11.",
        )
    return modulus


def _refuse_other_units(table: Table, density_kg_m3: float, stress_pa: float) -> None:
    if not _LIGHTEST_KG_M3 <= density_kg_m3 <= _DENSEST_KG_M3:
        raise table.refusal(
            f"{density_kg_m3:g} kg/m3 is the density of no hanger",
            "Give masses in kg, lengths in m: steel has 7850 kg/m3.",
        )
    if stress_pa > _STRONGEST_PA:
        raise table.refusal(
            f"nominal_tension_n makes a stress of {stress_pa / 1e6:g} MPa, which no hanger carries",
            "Give it in N, lengths in m.",
        )


def _refuse_less_than_weight(table: Table, hanger: Hanger) -> None:
    """Refuse a nominal tension in kN: a hanger in service carries more than its weight."""
    tension_n = hanger.nominal_tension_n
    weight_n = 9.81 * hanger.mass_per_length_kg_m * hanger.length_m
    if hanger.supports == Supports() and 0 < tension_n < weight_n:
        raise table.refusal(
            f"nominal_tension_n = {tension_n:g} is less than the weight of the hanger, "
            f"{weight_n / 1e3:.3g} kN",
            f"Give it in N: {tension_n:g} kN is {tension_n:g}e3.",
        )


def _scatter(
    table: Table, length_m: float, area_m2: float, open_ends: bool, assumed: Assumptions
) -> Scatter:
    """Return the scatter as stated.

    Where nothing is said of ends, the way of taping tells how well the swinging length is known.
    """
    scatter = scatter_of(table.table("scatter"), assumed)
    by = _length_by(table) or "faces"
    if by == "faces" or not open_ends or math.isfinite(scatter.effective_length):
        return scatter
    fork_m = assumed.fork_length.value * math.sqrt(4 * area_m2 / math.pi)
    takes = fork_m / length_m if by == "pins" else assumed.node_length.value
    # Root mean square of what two ends take, each evenly from nothing to all.
    return replace(scatter, effective_length=math.sqrt(7 / 6) * takes)


def _length_by(table: Table) -> LengthBy | Literal[""]:
    """Return how the hanger was taped; empty where the table does not say."""
    if "length_by" not in table:
        return ""
    remedy = 'Write "faces" (over all, fittings included), "pins" or "nodes" (system lines).'
    return cast(LengthBy, table.value("length_by", LengthBy, "is no way to tape a hanger", remedy))


def _survey(table: Table) -> Survey:
    """Return what the table says of how the bar was measured, and which keys it has."""
    return Survey(
        length_by=_length_by(table),
        length_measured=table.text("length_measured", ""),
        measured_by=table.text("measured_by", ""),
        stated_keys=tuple(sorted(table.values)),
    )


def structure_of(values: dict[str, Any], path: Path) -> Hanger:
    """Return the structure of a `[[structure]]` table; raises BadInput naming table and key."""
    table = Table(values, f"[[structure]] id {values.get('id', '?')}", path)
    table.refuse_unknown(("id", "name", "kind", "thresholds"))
    table.value("kind", Literal["any"], "is no kind of structure", 'Write kind = "any".', "any")
    number = table.value(
        "id", int, "is not a whole number", "Give a number that no hanger has.", holds=_is_number
    )
    name = str(values.get("name", ""))
    return Hanger.without_model(number, name, _thresholds(table.table("thresholds")))


def _is_number(id_: int) -> bool:
    return id_ >= 0


def _kind(table: Table) -> Kind:
    """Return a strand where it says so, or where its wires are said to slip."""
    slips = table.fraction("bending_stiffness_factor", 1.0, _LEAST_FACTOR, 1) < 1
    remedy = 'Write "rod" or "strand"; of what no model describes, a [[structure]] table.'
    usual = "strand" if slips else "rod"
    kinds = Literal["rod", "strand"]
    return cast(Kind, table.value("kind", kinds, "is no kind of hanger", remedy, usual))


def _fittings(table: Table, length_m: float) -> tuple[float, float]:
    """Return lengths of the deck-end and the arch-end fitting; 0 where not given."""
    deck_m, arch_m = table.value(
        "fittings_m",
        tuple[float, float],
        "is not two lengths that leave half of the hanger free",
        "Write fittings_m = [DECK, ARCH], the lengths in m of forks, sockets or threads.",
        usual=(0.0, 0.0),
        holds=lambda both: min(both) >= 0 and sum(both) < length_m / 2,
    )
    return deck_m, arch_m


def _ends(table: Table) -> EndKind | Literal[""]:
    """Return how the ends are made; empty where the table does not say."""
    if "ends" not in table:
        return ""
    remedy = 'Write "socket", "fork", "plate", "threaded" or "welded", or leave the key out.'
    return cast(EndKind, table.value("ends", EndKind, "is no kind of end", remedy))


def _inclination_deg(table: Table) -> float:
    """Return the angle from the horizontal in degrees; NaN where the table does not say."""
    if "inclination_deg" not in table:
        return NAN
    angle: float = table.value(
        "inclination_deg",
        float,
        "is not between 10 and 90 degrees",
        "Give the angle from the horizontal: 90 is vertical.",
        holds=lambda angle: _FLATTEST_DEG <= angle <= _VERTICAL_DEG,
    )
    return angle


def _positive(table: Table, kind: Any) -> dict[str, float]:
    """Return the numbers of a kind that a table states; raises BadInput for other keys."""
    table.refuse_unknown(field.name for field in fields(kind))
    return {key: table.positive(key) for key in table.values}


def _limits(table: Table | None) -> Limits:
    if table is None:
        return Limits()
    limits = Limits(**_positive(table, Limits))
    if limits.tension_min_n >= limits.tension_max_n:
        raise table.refusal(
            f"tension_min_n = {limits.tension_min_n:g} is not below tension_max_n = "
            f"{limits.tension_max_n:g}",
            "Both are in N: the hanger is slack below the first and overloaded above the second.",
        )
    return limits


def _section(table: Table) -> tuple[float, float, float]:
    """Return area, second moment and mass per length, given or those of a round bar."""
    if "diameter_m" not in table:
        area, second_moment, mass = (table.positive(key) for key in _SECTION)
        return area, second_moment, mass
    diameter = table.positive("diameter_m")
    round_area, round_moment = math.pi * diameter**2 / 4, math.pi * diameter**4 / 64
    area = table.positive("area_m2") if "area_m2" in table else round_area
    moment = table.positive("second_moment_m4") if "second_moment_m4" in table else round_moment
    if "mass_per_length_kg_m" in table:
        return area, moment, table.positive("mass_per_length_kg_m")
    return area, moment, area * table.positive("density_kg_m3")


def _models(table: Table) -> tuple[str, ...]:
    names: tuple[str, ...] = table.value(
        "models",
        tuple[str, ...],
        "is not a list of different names",
        'Write models = ["beam1", "beam2"], or leave it out to admit all.',
        usual=(),
        holds=lambda names: names and all(names) and len(set(names)) == len(names),
    )
    return names


def _thresholds(table: Table | None) -> Thresholds:
    if table is None:
        return Thresholds()
    values = _positive(table, Thresholds)
    if not 0.5 <= values.get("alert_probability", 0.5) < 1:
        raise table.refusal("alert_probability must be at least 0.5 and below 1", "Give 0.95, say.")
    if values.get("tension_shift_fraction", 0.5) >= 1:
        raise table.refusal(
            "tension_shift_fraction is a fraction of the tension, below 1",
            "Give 0.05 for 5 %.",
        )
    if values.get("stiffness_shift_decades", 0.5) > _MOST_DECADES:
        raise table.refusal(
            f"stiffness_shift_decades is above {_MOST_DECADES:g}, which no end moves by",
            "Give 0.5, a factor of 3.",
        )
    if "false_call_years" in table:
        table.fraction("false_call_years", NAN, *_FALSE_CALL_YEARS)
    return Thresholds(**values)


def _plate(table: Table | None, hanger_length_m: float, diameter_m: float) -> EndPlate | None:
    if table is None:
        return None
    names = [field.name for field in fields(EndPlate)]
    table.refuse_unknown(names)
    plate = EndPlate(**{name: table.positive(name) for name in names})
    if math.isnan(diameter_m):
        raise table.refusal(
            "only a round rod can have plates",
            "Give diameter_m, or leave the plate out.",
        )
    for problem, wrong in _plate_faults(plate, hanger_length_m, diameter_m).items():
        if wrong:
            raise table.refusal(problem, "Check the drawing; all lengths are in m.")
    return plate


def _plate_faults(plate: EndPlate, hanger_length_m: float, diameter_m: float) -> dict[str, bool]:
    rod = f"the rod's diameter_m ({diameter_m:g})"
    return {
        f"the two plates (length_m = {plate.length_m:g} each) leave no free rod in a hanger of "
        f"{hanger_length_m:g} m": 2 * plate.length_m >= hanger_length_m,
        f"slot_m = {plate.slot_m:g} is not shorter than the plate (length_m = "
        f"{plate.length_m:g})": plate.slot_m >= plate.length_m,
        f"thickness_m = {plate.thickness_m:g} is not below {rod}": plate.thickness_m >= diameter_m,
        f"neck_width_m = {plate.neck_width_m:g} is below {rod}": plate.neck_width_m < diameter_m,
        f"end_width_m = {plate.end_width_m:g} is below {rod}": plate.end_width_m < diameter_m,
        f"edge_node_spacing_m = {plate.edge_node_spacing_m:g} is above end_width_m "
        f"({plate.end_width_m:g})": plate.edge_node_spacing_m > plate.end_width_m,
    }


def _turnbuckles(tables: list[Table], hanger_length_m: float) -> tuple[Turnbuckle, ...]:
    """Return the turnbuckles from the deck end up; they may touch, but not overlap."""
    names = [field.name for field in fields(Turnbuckle)]
    found = []
    for table in tables:
        table.refuse_unknown(names)
        found.append((Turnbuckle(**{name: table.positive(name) for name in names}), table))
    found.sort(key=lambda pair: pair[0].x_m)
    reached, before = 0.0, "the deck end (0 m)"
    for turnbuckle, table in found:
        first = turnbuckle.x_m - turnbuckle.length_m / 2
        last = turnbuckle.x_m + turnbuckle.length_m / 2
        if first < reached or last > hanger_length_m:
            raise table.refusal(
                f"it goes from {first:g} m to {last:g} m, beyond "
                + (before if first < reached else f"the arch end ({hanger_length_m:g} m)"),
                "x_m is its middle, measured from the deck end; turnbuckles may not overlap.",
            )
        reached, before = last, f"the turnbuckle that ends at {last:g} m"
    return tuple(turnbuckle for turnbuckle, _ in found)


_KNOWN_SUPPORTS = ("deck", "arch", "both", "hanging_mass_kg")


def supports_of(table: Table | None) -> Supports:
    """Return the `[hanger.supports]` table; raises BadInput naming the key at fault."""
    if table is None:
        return Supports()
    table.refuse_unknown(_KNOWN_SUPPORTS)
    if "both" in table and ("deck" in table or "arch" in table):
        raise table.refusal("both stands beside deck or arch", "Give both, or each end.")
    both = _support_kind(table, "both", "clamped")
    supports = Supports(
        _support_kind(table, "deck", both),
        _support_kind(table, "arch", both),
        table.positive("hanging_mass_kg") if "hanging_mass_kg" in table else 0.0,
    )
    if supports.hanging_mass_kg and len(supports.ends("free")) != 1:
        raise table.refusal(
            "hanging_mass_kg needs one free end that it hangs from",
            'Write deck = "free", or leave the mass out.',
        )
    return supports


def _support_kind(table: Table, key: str, usual: Support) -> Support:
    remedy = f"Known: {', '.join(get_args(Support))}."
    return cast(Support, table.value(key, Support, "is no way to hold an end", remedy, usual))


_LARGEST_SCATTER = 0.5  # judgement: who is half off wrote another unit
_LARGEST_TURN_DEG = 45.0  # nothing is farther from the nearer of two axes


def scatter_of(table: Table | None, assumed: Assumptions = DEFAULTS) -> Scatter:
    """Return the `[hanger.scatter]` table; raises BadInput naming the key at fault."""
    usual_scatter = Scatter.of(assumed)
    if table is None:
        return usual_scatter
    known = {field.name: getattr(usual_scatter, field.name) for field in fields(Scatter)}
    table.refuse_unknown(known)
    most = dict.fromkeys(known, _LARGEST_SCATTER) | {"sensor_turn_deg": _LARGEST_TURN_DEG}
    return Scatter(
        **{key: table.fraction(key, usual, 0.0, most[key]) for key, usual in known.items()}
    )


def effect_priors_of(table: Table | None) -> tuple[EffectPrior, ...]:
    """Return the ranges of all `[hanger.effects.NAME]` tables, in the file's order.

    Whether the catalogue knows the names is for `shm.models.effects.check_effect_priors` to say.
    Raises BadInput where something is no range.
    """
    if table is None:
        return ()
    return tuple(
        EffectPrior(effect, parameter, *_range(inner, parameter))
        for effect in table.values
        for inner in (_effect(table, effect),)
        for parameter in inner.values
    )


def _effect(table: Table, effect: str) -> Table:
    values = table.values[effect]
    if not isinstance(values, dict):
        raise table.refusal(
            f"{effect} is not a table",
            "Write [hanger.effects.NAME], NAME one of `shm gap effects`, and below it the "
            "ranges of its parameters.",
        )
    return Table(values, f"{table.label}.{effect}", table.path)


def _range(table: Table, parameter: str) -> tuple[float, float]:
    remedy = f"Write {parameter} = [LOWER, UPPER], two finite numbers."
    lower, upper = table.value(parameter, tuple[float, float], "is not a range", remedy)
    if lower >= upper:
        raise table.refusal(f"{parameter} = [{lower:g}, {upper:g}] does not rise", remedy)
    return lower, upper
