"""From the records of one test to a measurement of each of its set-ups.

Records belong to one set-up where the same sensors and the hammer were at the same places. A test
with a roving hammer or a roving sensor has several.

Cuts what belongs to one hit out of its record, low-passed and thinned to the band.

From time records of hits, as received, to the measurement of one set-up.

Sensors stand on the hanger: what is said to be off it is mistyped.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from shm.errors import BadInput, NotIdentifiable
from shm.identify.contract import Dropped, Hit, Measurement
from shm.identify.measuring.ambient import ambient_measurement
from shm.identify.measuring.frf import (
    LEAST_SAMPLES,
    Window,
    averaged_response,
    band_limited,
    common_window,
    filter_reach,
)
from shm.identify.measuring.hits import RINGING_SAMPLES, HitRecord
from shm.identify.measuring.responses import measurement_of_responses, point_of
from shm.identify.measuring.screening import FEWEST_TO_COMPARE, Screening, pulses_of, screen
from shm.identify.measuring.signal_faults import HITS_NOT_SHOWN, KNOCK
from shm.identify.options import IdentifyOptions
from shm.values import (
    Channel,
    ComplexArray,
    FloatArray,
    FrequencyResponse,
    Hanger,
    Recording,
    collect_conditions,
)

_MOST_SECONDS_A_HIT = 90.0  # judgement: crews wait half a minute at most
_SAME_RATE = 1e-5
"""Rates read off columns of rounded times differ by less, and no frequency feels it."""


@dataclass(frozen=True, eq=False)
class _SetUp:
    """Records of one set-up and where they stand among those of the test."""

    records: tuple[Recording, ...]
    places: tuple[int, ...]


def measure_set_ups(
    records: Sequence[Recording | FrequencyResponse], options: IdentifyOptions
) -> tuple[Measurement, ...]:
    """Return one measurement a set-up; those of hits have frequency responses on the same lines.

    Raises BadInput where records lack a channel or do not belong together, NotIdentifiable
    where no set-up can be used.
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
    return measure_recordings(recordings, options)


def measure_recordings(
    records: Sequence[Recording], options: IdentifyOptions
) -> tuple[Measurement, ...]:
    """Return one measurement a set-up of time records; see `measured`."""
    hammered = any(record.force is not None for record in records)
    for record in records:
        _refuse_incomplete(record, hammered, options)
        _refuse_other_rate(records[0], record)
    set_ups = _grouped(records)
    if not hammered and not all(_has_hits(record, options) for record in records):
        return tuple(ambient_measurement(set_up.records, options) for set_up in set_ups)
    try:
        if len(set_ups) == 1:
            found = measurement_of_recordings(records, options)
            if hammered and _misses_hits(records, found, options):
                raise NotIdentifiable("the force does not show most hits.", file=found.source)
            return (found,)
        return _measured_apart(set_ups, options)
    except NotIdentifiable as refused:
        return _by_motion_alone(records, refused, options)


def without_unused_force(
    records: Sequence[Recording], measurements: Sequence[Measurement]
) -> list[Recording]:
    """Return the records as they were measured: without a force that does not show the hits."""
    if all(m.frequency_response is not None for m in measurements):
        return list(records)
    return [replace(record, channels=record.accelerations) for record in records]


def _misses_hits(
    records: Sequence[Recording], found: Measurement, options: IdentifyOptions
) -> bool:
    """Return whether the motion shows more hits than the force does, some in its ring-downs."""
    few = sum(hit.used for hit in found.hits) < FEWEST_TO_COMPARE
    if not few or all(hit.cut != KNOCK for hit in found.hits):
        return False
    rest = [replace(record, channels=record.accelerations) for record in records]
    return sum(len(pulses_of(record, options)) for record in rest) > len(found.hits)


def _by_motion_alone(
    records: Sequence[Recording], refused: NotIdentifiable, options: IdentifyOptions
) -> tuple[Measurement, ...]:
    """Return the measurements by the hits in the accelerations, without the force.

    A logger that samples slowly and without a filter misses a pulse between two samples, and
    noise hides a weak one; the ringing after it is recorded all the same. Raises `refused`
    where the motion shows no hits either, and where the force is dead: its cable must be
    checked.
    """
    forces = [record.force for record in records if record.force is not None]
    rest = [replace(record, channels=record.accelerations) for record in records]
    alive = all(np.ptp(np.nan_to_num(force.values)) > 0 for force in forces)
    alive = alive and all(record.samples >= LEAST_SAMPLES for record in rest)
    if not (forces and alive and all(_has_hits(record, options) for record in rest)):
        raise refused
    first, *others = measure_recordings(rest, options)
    lost = Dropped(f"channel {forces[0].name}", 1, HITS_NOT_SHOWN)
    return (replace(first, dropped=(lost, *first.dropped)), *others)


def _has_hits(record: Recording, options: IdentifyOptions) -> bool:
    """Return whether a record has hammer hits, not only a lorry at the joint in many minutes."""
    return record.duration_s <= _MOST_SECONDS_A_HIT * len(pulses_of(record, options))


def _measured_apart(set_ups: Sequence[_SetUp], options: IdentifyOptions) -> tuple[Measurement, ...]:
    """Return the measurements of several set-ups, with the same window."""
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
    """Return a key that is equal for records of one set-up: sensors and the hammer's position."""
    sensors = tuple((c.name, *_place(c)) for c in record.accelerations)
    return sensors, _place(record.force) if record.force else None


def _place(channel: Channel) -> tuple[str | None, float | None]:
    return channel.plane, None if math.isnan(channel.x_m) else channel.x_m


def _screened(
    set_ups: Sequence[_SetUp], options: IdentifyOptions
) -> tuple[list[tuple[_SetUp, Screening]], tuple[Dropped, ...]]:
    """Return the set-ups with something to use; a set-up without is left out if another has."""
    usable, failures = [], []
    for set_up in set_ups:
        try:
            usable.append((set_up, screen(set_up.records, options)))
        except NotIdentifiable as failure:
            failures.append(failure)
    if not usable:
        raise failures[0]
    return usable, tuple(Dropped(f"set-up {f.file}", 1, f.message) for f in failures)


def _renumbered(found: Screening, set_up: _SetUp) -> Screening:
    """Return `found` with each hit's record counted among all records of the test."""
    hits: tuple[Hit, ...] = tuple(
        replace(hit, record=set_up.places[hit.record]) for hit in found.hits
    )
    return replace(found, hits=hits)


LEAD_SECONDS = 0.02
"""The force's pulse, smeared by the filter, begins at least so long after a cut's first sample."""


@dataclass(frozen=True, eq=False)
class Cut:
    """One hit: `driven` (1 + points, samples), force first, at `sampling_rate_hz`.

    From column `free` on, the filter saw nothing of the force: there the hanger rings freely. The
    first column lies equally long before the hit in all hits of one sampling rate.
    """

    driven: FloatArray
    free: int
    sampling_rate_hz: float

    @property
    def decay(self) -> FloatArray:
        """The free motion, (points, samples)."""
        return self.driven[1:, self.free :]


def cut(hit: HitRecord, sampling_rate_hz: float, band_high_hz: float) -> Cut:
    """Return the hit and its ring-down; force and accelerations pass the same filter.

    Where the record begins too late, the hanger is taken to have been at rest before.
    """
    reach, factor = filter_reach(sampling_rate_hz, band_high_hz)
    lead = int(LEAD_SECONDS * sampling_rate_hz) + reach
    begin = hit.pulse.start - lead - reach
    free = hit.free + min(RINGING_SAMPLES, int(0.002 * sampling_rate_hz) + 1)
    signals = _centred(hit, begin, free)
    driven, rate = band_limited(signals, sampling_rate_hz, band_high_hz)
    first_free = -((begin - free) // factor)
    return Cut(driven, first_free, rate)


def _centred(hit: HitRecord, begin: int, free: int) -> FloatArray:
    """Return force and accelerations from `begin` to the end of the ring-down, without offset."""
    first = max(0, begin)
    stop = hit.pulse.stop
    signals = np.zeros((1 + len(hit.accelerations), stop - begin))
    known = signals[:, first - begin :]
    np.subtract(hit.force[first:stop], np.median(hit.force[free:stop]), out=known[0])
    offset = hit.accelerations[:, free:stop].mean(axis=1, keepdims=True)
    np.subtract(hit.accelerations[:, first:stop], offset, out=known[1:])
    before = known[:, : hit.pulse.start - first]
    before[:] = np.nan_to_num(before)
    return signals


def measurement_of_recordings(
    records: Sequence[Recording], options: IdentifyOptions
) -> Measurement:
    """Return the measurement in records of one set-up, each with one hit or several.

    Raises NotIdentifiable where no hit is left to use.
    """
    found = screen(records, options)
    window = common_window(found.used, records[0].sampling_rate_hz, options.band_high_hz)
    return screened_measurement(records, found, window, options)


def screened_measurement(
    records: Sequence[Recording], found: Screening, window: Window, options: IdentifyOptions
) -> Measurement:
    """Return the measurement in the records of one set-up, of which `found` can be used."""
    rate = records[0].sampling_rate_hz
    cuts = [cut(hit, rate, options.band_high_hz) for hit in found.used]
    if records[0].force is None:
        return Measurement(
            source=records[0].source,
            points=tuple(point_of(records[0].accelerations[row]) for row in found.rows),
            decays=tuple(each.decay for each in cuts),
            sampling_rate_hz=cuts[0].sampling_rate_hz,
            frequency_response=None,
            hits=found.hits,
            dropped=found.dropped,
            unlike=found.unlike,
        )
    response, spectra = _response(records[0], found, window, options)
    force = records[0].force
    return Measurement(
        source=records[0].source,
        points=response.points,
        decays=tuple(each.decay for each in cuts),
        sampling_rate_hz=cuts[0].sampling_rate_hz,
        frequency_response=response,
        driven=tuple(each.driven for each in cuts),
        spectra=spectra,
        hammer=point_of(force) if force else None,
        window_time_constant_s=window.time_constant_s,
        hits=found.hits,
        dropped=found.dropped,
        unlike=found.unlike,
    )


def _response(
    first: Recording, found: Screening, window: Window, options: IdentifyOptions
) -> tuple[FrequencyResponse, ComplexArray]:
    """Return the frequency response of a set-up, and the spectra it is an average of."""
    average = averaged_response(
        found.used, first.sampling_rate_hz, options.band_high_hz, options.estimator, window
    )
    response = FrequencyResponse(
        source=first.source,
        points=tuple(point_of(first.accelerations[row]) for row in found.rows),
        frequency_hz=average.frequency_hz,
        accelerance=average.accelerance,
        coherence=average.coherence,
        **collect_conditions(first),
    )
    return response, average.spectra


_ROUNDED = 0.01
"""Judgement: a place that was taped at the very end, beside a length that was rounded."""


def fault_of_place(x_m: float, hanger: Hanger) -> str:
    """Return why a position cannot be on a hanger; empty where it can, or is not known."""
    if x_m < 0 or x_m > (1 + _ROUNDED) * hanger.length_m:
        return (
            f"it is said to be at {x_m:g} m from the deck end, and the hanger is "
            f"{hanger.length_m:g} m long"
        )
    return ""


def refuse_off_the_hanger(
    records: Sequence[Recording | FrequencyResponse], hanger: Hanger | None
) -> None:
    """Raise BadInput naming a channel whose position cannot be on the hanger."""
    if hanger is None or not hanger.as_hanger:
        return
    for record in records:
        points = record.channels if isinstance(record, Recording) else record.points
        for each in points:
            if fault := fault_of_place(each.x_m, hanger):
                raise BadInput(
                    f"{fault}.",
                    file=record.source,
                    channel=each.name,
                    remedy="Correct its x_m, in metres from the deck end, or the hanger's length.",
                )
