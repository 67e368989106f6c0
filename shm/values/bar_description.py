"""Describe the bar that a report is about, and where it was measured."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from shm.values.hanger import EndPlate, Hanger, Supports, Turnbuckle
from shm.values.kinds import NAN
from shm.values.modes import ModalTest
from shm.values.recording import FrequencyResponse, Recording, ResponsePoint


@dataclass(frozen=True)
class BarDescription:
    """The bar of a report, as its owner describes it; NaN, None or empty where not stated.

    `density_kg_m3` is mass over area. `length_by` and `length_measured` say how the length was
    taped, `measured_by` who measured the bar. `sensors` are those of the test that the report is
    about; with a roving hammer they are the places that it hit. `hits` are where the hammer hit,
    as far as the file says. `ends` is how the ends are held,
    `end_kind` how they are made; `inclination_deg` is counted from the horizontal.
    """

    hanger: int | None = None
    name: str = ""
    diameter_m: float = NAN
    area_m2: float = NAN
    length_m: float = NAN
    length_by: str = ""
    length_measured: str = ""
    elastic_modulus_pa: float = NAN
    density_kg_m3: float = NAN
    mass_per_length_kg_m: float = NAN
    fittings_m: tuple[float, float] | None = None
    plate: EndPlate | None = None
    turnbuckles: tuple[Turnbuckle, ...] = ()
    ends: Supports | None = None
    end_kind: str = ""
    inclination_deg: float = NAN
    sensors: tuple[ResponsePoint, ...] = ()
    hits: tuple[ResponsePoint, ...] = ()
    measured_by: str = ""


def describe_bar(
    hanger: Hanger | None,
    sensors: Sequence[ResponsePoint] = (),
    hits: Sequence[ResponsePoint] = (),
) -> BarDescription:
    """Return the description of a hanger's bar; of None only the sensors are known.

    Fittings and ends at their defaults count as stated only where the owner wrote them.
    """
    if hanger is None:
        return BarDescription(sensors=tuple(sensors), hits=tuple(hits))
    survey = hanger.survey
    has_fittings = any(hanger.fittings_m) or "fittings_m" in survey.stated_keys
    has_ends = hanger.supports != Supports() or "supports" in survey.stated_keys
    return BarDescription(
        hanger=hanger.id,
        name=hanger.name,
        diameter_m=hanger.diameter_m,
        area_m2=hanger.area_m2,
        length_m=hanger.length_m,
        length_by=survey.length_by,
        length_measured=survey.length_measured,
        elastic_modulus_pa=hanger.elastic_modulus_pa,
        density_kg_m3=hanger.mass_per_length_kg_m / hanger.area_m2,
        mass_per_length_kg_m=hanger.mass_per_length_kg_m,
        fittings_m=hanger.fittings_m if has_fittings else None,
        plate=hanger.plate,
        turnbuckles=hanger.turnbuckles,
        ends=hanger.supports if has_ends else None,
        end_kind=hanger.ends,
        inclination_deg=hanger.inclination_deg,
        sensors=tuple(sensors),
        hits=tuple(hits),
        measured_by=survey.measured_by,
    )


def list_sensors(
    test: ModalTest,
    response: FrequencyResponse | None = None,
    records: Sequence[Recording | FrequencyResponse] = (),
) -> tuple[ResponsePoint, ...]:
    """Return the sensors of a test: of its response or records, else the places of its shapes."""
    if response is not None:
        return response.points
    found: list[ResponsePoint] = []
    for record in records:
        if isinstance(record, Recording):
            found += [ResponsePoint(c.name, c.plane, c.x_m) for c in record.accelerations]
        else:
            found += record.points
    if not found:
        places = {(mode.plane, point.x_m) for mode in test.modes for point in mode.shape}
        found = [ResponsePoint("", plane, x_m) for plane, x_m in sorted(places)]
    return tuple(dict.fromkeys(found))


def list_hits(records: Sequence[Recording | FrequencyResponse]) -> tuple[ResponsePoint, ...]:
    """Return where the hammer hit, by the places of the force channels, each place once."""
    found = (
        ResponsePoint("hit", channel.plane, channel.x_m)
        for record in records
        if isinstance(record, Recording)
        for channel in record.channels
        if channel.quantity == "force"
    )
    return tuple(dict.fromkeys(found))
