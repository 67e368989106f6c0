"""From the records of one test to a measurement of each of its set-ups.

Records belong to one set-up where the same sensors and the hammer were at the same places. A test
with a roving hammer or a roving sensor has several.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace

from shm.errors import BadInput, NotIdentifiable
from shm.identify.contract import Dropped, Hit, Measurement
from shm.identify.measuring.ambient import ambient_measurement
from shm.identify.measuring.frf import common_window
from shm.identify.measuring.recordings import measurement_of_recordings, screened_measurement
from shm.identify.measuring.responses import measurement_of_responses
from shm.identify.measuring.screening import Screening, screened
from shm.identify.options import IdentifyOptions
from shm.values import Channel, FrequencyResponse, Recording

_SAME_RATE = 1e-5
"""Rates read off columns of rounded times differ by less, and no frequency feels it."""


@dataclass(frozen=True, eq=False)
class _SetUp:
    """Records of one set-up and where they stand among those of the test."""

    records: tuple[Recording, ...]
    places: tuple[int, ...]


def measured(
    records: Sequence[Recording | FrequencyResponse], options: IdentifyOptions
) -> tuple[Measurement, ...]:
    """One measurement a set-up; those of hits have frequency responses on the same lines.

    Raises BadInput where records lack a channel or do not belong together, NotIdentifiable where
    no set-up can be used.
    """
    recordings = [record for record in records if isinstance(record, Recording)]
    responses = [record for record in records if isinstance(record, FrequencyResponse)]
    if not records or (recordings and responses):
        raise BadInput(
            "time records and frequency responses together." if records else "no record is given.",
            file=records[0].source if records else "",
            remedy="Give the records of one test, all of one kind.",
        )
    if responses:
        return (measurement_of_responses(responses, options),)
    return measured_recordings(recordings, options)


def measured_recordings(
    records: Sequence[Recording], options: IdentifyOptions
) -> tuple[Measurement, ...]:
    """One measurement a set-up of time records; see `measured`."""
    hammered = any(record.force is not None for record in records)
    for record in records:
        _refuse_incomplete(record, hammered, options)
        _refuse_other_rate(records[0], record)
    set_ups = _grouped(records)
    if not hammered:
        return tuple(ambient_measurement(set_up.records, options) for set_up in set_ups)
    if len(set_ups) == 1:
        return (measurement_of_recordings(records, options),)
    return _measured_apart(set_ups, options)


def _measured_apart(set_ups: Sequence[_SetUp], options: IdentifyOptions) -> tuple[Measurement, ...]:
    """Several set-ups, seen through the same window."""
    usable, lost = _screened(set_ups, options)
    hits = [hit for _, found in usable for hit in found.used]
    rate = set_ups[0].records[0].sampling_rate_hz
    window = common_window(hits, rate, options.band_high_hz)
    measurements = [
        screened_measurement(set_up.records, _renumbered(found, set_up), window, options)
        for set_up, found in usable
    ]
    first = replace(measurements[0], dropped=lost + measurements[0].dropped)
    return (first, *measurements[1:])


def _refuse_incomplete(record: Recording, hammered: bool, options: IdentifyOptions) -> None:
    missing = [
        name
        for name, absent in (
            ("force", hammered and record.force is None),
            ("acceleration", not record.accelerations),
        )
        if absent
    ]
    if missing:
        raise BadInput(
            f"no {missing[0]} channel.",
            file=record.source,
            remedy="State the unit of each column: N for the hammer, m/s^2 for accelerometers.",
        )
    if record.sampling_rate_hz < 2 * options.band_high_hz:
        raise BadInput(
            f"sampled at {record.sampling_rate_hz:g} Hz, too slow for modes up to "
            f"{options.band_high_hz:g} Hz.",
            file=record.source,
            remedy="Sample faster, or lower band_high_hz to less than half the sampling rate.",
        )


def _refuse_other_rate(first: Recording, record: Recording) -> None:
    if not math.isclose(record.sampling_rate_hz, first.sampling_rate_hz, rel_tol=_SAME_RATE):
        raise BadInput(
            f"its sampling rate differs from that of {first.source}.",
            file=record.source,
            remedy="Identify records of different sampling rates one by one.",
        )


def _grouped(records: Sequence[Recording]) -> list[_SetUp]:
    groups: dict[Hashable, list[int]] = {}
    for place, record in enumerate(records):
        groups.setdefault(_layout(record), []).append(place)
    return [
        _SetUp(tuple(records[place] for place in places), tuple(places))
        for places in groups.values()
    ]


def _layout(record: Recording) -> Hashable:
    """Equal for records of one set-up: sensors by name and place, and the hammer's place."""
    sensors = tuple((c.name, *_place(c)) for c in record.accelerations)
    return sensors, _place(record.force) if record.force else None


def _place(channel: Channel) -> tuple[str | None, float | None]:
    return channel.plane, None if math.isnan(channel.x_m) else channel.x_m


def _screened(
    set_ups: Sequence[_SetUp], options: IdentifyOptions
) -> tuple[list[tuple[_SetUp, Screening]], tuple[Dropped, ...]]:
    """The set-ups with something to use; a set-up without is left out if another has."""
    usable, failures = [], []
    for set_up in set_ups:
        try:
            usable.append((set_up, screened(set_up.records, options)))
        except NotIdentifiable as failure:
            failures.append(failure)
    if not usable:
        raise failures[0]
    return usable, tuple(Dropped(f"set-up {f.file}", 1, f.message) for f in failures)


def _renumbered(found: Screening, set_up: _SetUp) -> Screening:
    """`found` with each hit's record counted among all records of the test."""
    hits: tuple[Hit, ...] = tuple(
        replace(hit, record=set_up.places[hit.record]) for hit in found.hits
    )
    return replace(found, hits=hits)
