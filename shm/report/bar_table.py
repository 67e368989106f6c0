"""The bar that a report is about, as rows of label and value: one source for every report."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import asdict, replace
from typing import Any

from shm.report import formatting
from shm.report.paper import Table
from shm.values import PLANES, ResponsePoint
from shm.values.bar_description import BarDescription

NOT_STATED = "not stated"
_TAPED = {
    "faces": "over all, fittings included",
    "pins": "pin to pin",
    "nodes": "between system points",
}


def bar_rows(bar: BarDescription) -> tuple[tuple[str, str], ...]:
    """Return label and value with unit of all that is described; of no bar only the sensors."""
    if bar.hanger is None:
        return (("Bar", "not described"), ("Sensors", _sensors(bar.sensors)))
    return (
        ("Section", _section(bar)),
        ("Length", _length(bar)),
        ("Length taped", _taped(bar)),
        ("Elastic modulus", f"{formatting.plain(bar.elastic_modulus_pa / 1e9, 4)} GPa"),
        ("Density", _density(bar)),
        ("Fittings", _fittings(bar)),
        ("Ends", _ends(bar)),
        ("Sensors", _sensors(bar.sensors)),
        ("Bar measured by", bar.measured_by or NOT_STATED),
    )


def bar_table(bar: BarDescription) -> Table:
    """Return the table of one bar; what is not stated is named in one row."""
    rows = bar_rows(bar)
    stated = [row for row in rows if row[1] != NOT_STATED]
    missing = [label.lower() for label, value in rows if value == NOT_STATED]
    if missing:
        stated.append((NOT_STATED.capitalize(), formatting.listed(missing)))
    return Table("The bar as described", ("what", "value"), tuple(stated), is_folded=True)


def bars_table(bars: Sequence[BarDescription]) -> Table:
    """Return a table with a row a bar; what all bars have in common is in its note."""
    rows = [dict(bar_rows(bar)) for bar in bars]
    if not rows:
        return Table("The bars as described", (), ())
    labels = list(rows[0])
    common = {k: rows[0][k] for k in labels if len(rows) > 1 and len({r[k] for r in rows}) == 1}
    shown = [label for label in labels if label not in common]
    if not shown:
        return replace(bar_table(bars[0]), title=f"The bars as described, all {len(bars)} alike")
    stated = {label: value for label, value in common.items() if value != NOT_STATED}
    wording = "; ".join(f"{label.lower()} {value}" for label, value in stated.items())
    return Table(
        "The bars as described",
        ("hanger", *(label.lower() for label in shown)),
        tuple(
            (f"{bar.hanger} {bar.name}".strip(), *(row[label] for label in shown))
            for bar, row in zip(bars, rows, strict=True)
        ),
        note=f"All bars: {wording}." if wording else "",
        may_break=True,
    )


def bar_document(bar: BarDescription) -> dict[str, Any]:
    """Return the bar for `shm.documents.dump`, in SI units; what is not stated becomes null."""
    return {key: None if value == "" else value for key, value in asdict(bar).items()}


def _section(bar: BarDescription) -> str:
    area = f"area {formatting.plain(1e6 * bar.area_m2, 4)} mm²"
    if math.isnan(bar.diameter_m):
        return area
    return f"diameter {formatting.plain(1e3 * bar.diameter_m, 4)} mm, {area}"


def _length(bar: BarDescription) -> str:
    """Return `12 m`, or `12 m, 60° from the horizontal` where the inclination is stated."""
    if math.isnan(bar.inclination_deg):
        return f"{bar.length_m:g} m"
    return f"{bar.length_m:g} m, {bar.inclination_deg:g}° from the horizontal"


def _taped(bar: BarDescription) -> str:
    how = (_TAPED.get(bar.length_by, ""), bar.length_measured)
    return ", ".join(each for each in how if each) or NOT_STATED


def _density(bar: BarDescription) -> str:
    per_metre = formatting.plain(bar.mass_per_length_kg_m, 4)
    return f"{formatting.plain(bar.density_kg_m3, 4)} kg/m³ ({per_metre} kg/m)"


def _fittings(bar: BarDescription) -> str:
    found = []
    if bar.fittings_m is not None and not any(bar.fittings_m):
        found.append("none")
    elif bar.fittings_m is not None:
        deck_m, arch_m = bar.fittings_m
        found.append(f"{deck_m:g} m (deck), {arch_m:g} m (arch)")
    if bar.plate is not None:
        plate = bar.plate
        found.append(f"end plates {plate.length_m:g} m long, {1e3 * plate.thickness_m:g} mm thick")
    found += [f"turnbuckle of {each.mass_kg:g} kg at {each.x_m:g} m" for each in bar.turnbuckles]
    return "; ".join(found) or NOT_STATED


def _ends(bar: BarDescription) -> str:
    """Return how the ends are made and how they are held, as far as it is stated."""
    found = [bar.end_kind] if bar.end_kind else []
    if bar.ends is not None:
        kg = bar.ends.hanging_mass_kg
        mass = f", {kg:g} kg hang from the free end" if kg else ""
        found.append(f"{bar.ends.deck} (deck), {bar.ends.arch} (arch){mass}")
    return "; ".join(found) or NOT_STATED


def _sensors(sensors: Sequence[ResponsePoint]) -> str:
    """Return `both planes at 2.5 and 4.4 m`; how many, where their places are not stated."""
    if not sensors:
        return NOT_STATED
    if not all(math.isfinite(each.x_m) for each in sensors):
        return f"{formatting.counted(len(sensors), 'channel')}, places {NOT_STATED}"
    places = {
        plane: _places(each.x_m for each in sensors if each.plane == plane)
        for plane in (*PLANES, None)
    }
    first, second, unknown = places.values()
    if first == second and not unknown:
        return f"both planes at {first}"
    wording = [f"{plane or 'plane not stated,'} at {at}" for plane, at in places.items() if at]
    return "; ".join(wording)


def _places(x_m: Iterable[float]) -> str:
    found = sorted(set(x_m))
    return f"{formatting.listed([f'{round(each, 3):g}' for each in found])} m" if found else ""
