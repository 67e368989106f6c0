"""Make one measurement of each set-up of a test.

Records belong to one set-up where the same sensors and the hammer were at the same places. A test
with a roving hammer or a roving sensor has several. Sensors stand on the hanger: what is said to be
off it is mistyped.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from shm.errors import BadInput, NotIdentifiable
from shm.identify.contract import Dropped, Measurement, point_of
from shm.identify.measuring.ambient import ambient_measurement
from shm.identify.measuring.band import LEAST_SAMPLES, band_limited, filter_reach
from shm.identify.measuring.frf import Window, averaged_response, common_window
from shm.identify.measuring.hits import RINGING_SAMPLES, HitRecord
from shm.identify.measuring.responses import measurement_of_responses
from shm.identify.measuring.screening import Screening, pulses_of, screen
from shm.identify.measuring.signal_faults import FEWEST_TO_COMPARE, HITS_NOT_SHOWN, KNOCK
from shm.identify.options import IdentifyOptions
from shm.values import (
    Channel,
    FloatArray,
    FrequencyResponse,
    Hanger,
    Recording,
    collect_conditions,
)

_MOST_SECONDS_A_HIT = 90.0  # judgement: crews wait half a minute at most
_SAME_RATE = 1e-5
"""Rates read off columns of rounded times differ by less, and no frequency feels it."""


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
    """Return one measurement a set-up of time records; see `measure_set_ups`."""
    hammered = any(record.force is not None for record in records)
    for record in records:
        _refuse_unusable(record, records[0], hammered, options)
    set_ups: dict[Hashable, list[int]] = {}
    for place, record in enumerate(records):
        set_ups.setdefault(_layout(record), []).append(place)
    if not hammered and not all(_has_hits(record, options) for record in records):
        return tuple(
            ambient_measurement([records[place] for place in places], options)
            for places in set_ups.values()
        )
    try:
        found = _measured(records, list(set_ups.values()), options)
        if hammered and _misses_hits(records, found, options):
            raise NotIdentifiable("the force does not show most hits.", file=found[0].source)
    except NotIdentifiable as refused:
        return _by_motion_alone(records, refused, options)
    return found


def without_unused_force(
    records: Sequence[Recording], measurements: Sequence[Measurement]
) -> list[Recording]:
    """Return the records as they were measured: without a force that does not show the hits."""
    if all(m.frequency_response is not None for m in measurements):
        return list(records)
    return [replace(record, channels=record.accelerations) for record in records]


def _misses_hits(
    records: Sequence[Recording], found: Sequence[Measurement], options: IdentifyOptions
) -> bool:
    """Return whether the motion of a set-up shows hits that the force does not, in ring-downs."""
    hits = found[0].hits
    few = len(found) == 1 and sum(hit.used for hit in hits) < FEWEST_TO_COMPARE
    if not few or all(hit.cut != KNOCK for hit in hits):
        return False
    rest = [replace(record, channels=record.accelerations) for record in records]
    return sum(len(pulses_of(record, options)) for record in rest) > len(hits)


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


def _refuse_unusable(
    record: Recording, first: Recording, hammered: bool, options: IdentifyOptions
) -> None:
    """Raise BadInput for a record that lacks a channel, is too slow, short or of another rate."""
    rate = record.sampling_rate_hz
    fault = remedy = ""
    if (hammered and record.force is None) or not record.accelerations:
        missing = "force" if hammered and record.force is None else "acceleration"
        fault = f"no {missing} channel."
        remedy = "State the unit of each column: N for the hammer, m/s^2 for accelerometers."
    elif rate < 2 * options.band_high_hz:
        fault = f"sampled at {rate:g} Hz, too slow for modes up to {options.band_high_hz:g} Hz."
        remedy = "Sample faster, or lower band_high_hz to less than half the sampling rate."
    elif record.duration_s * options.band_high_hz < 1:
        fault = f"lasts {record.duration_s:.2g} s at {rate:g} Hz, less than any mode's period."
        remedy = "Correct the sampling rate that the file or its sidecar states."
    elif not math.isclose(rate, first.sampling_rate_hz, rel_tol=_SAME_RATE):
        fault = f"its sampling rate differs from that of {first.source}."
        remedy = "Identify records of different sampling rates one by one."
    if fault:
        raise BadInput(fault, file=record.source, remedy=remedy)


def _layout(record: Recording) -> Hashable:
    """Return a key that is equal for records of one set-up: sensors and the hammer's position."""
    sensors = tuple((c.name, *_place(c)) for c in record.accelerations)
    return sensors, _place(record.force) if record.force else None


def _place(channel: Channel) -> tuple[str | None, float | None]:
    return channel.plane, None if math.isnan(channel.x_m) else channel.x_m


def _measured(
    records: Sequence[Recording], set_ups: Sequence[Sequence[int]], options: IdentifyOptions
) -> tuple[Measurement, ...]:
    """Return the measurements of set-ups with hits, all with the same window.

    A set-up without a hit to use is left out if another has one; else NotIdentifiable is raised.
    """
    usable, failures = [], []
    for places in set_ups:
        try:
            usable.append((places, screen([records[place] for place in places], options)))
        except NotIdentifiable as failure:
            failures.append(failure)
    if not usable:
        raise failures[0]
    hits = [hit for _, found in usable for hit in found.used]
    window = common_window(hits, records[0].sampling_rate_hz, options.band_high_hz)
    first, *others = (
        _measurement(records, places, found, window, options) for places, found in usable
    )
    lost = tuple(Dropped(f"set-up {f.file}", 1, f.message) for f in failures)
    return (replace(first, dropped=lost + first.dropped), *others)


def _measurement(
    records: Sequence[Recording],
    places: Sequence[int],
    found: Screening,
    window: Window,
    options: IdentifyOptions,
) -> Measurement:
    """Return the measurement in the records of one set-up, at `places` among those of the test."""
    first = records[places[0]]
    rate, high_hz = first.sampling_rate_hz, options.band_high_hz
    cuts = [cut(hit, rate, high_hz) for hit in found.used]
    measurement = Measurement(
        source=first.source,
        points=tuple(point_of(first.accelerations[row]) for row in found.rows),
        decays=tuple(each.decay for each in cuts),
        sampling_rate_hz=cuts[0].sampling_rate_hz,
        frequency_response=None,
        hits=tuple(replace(hit, record=places[hit.record]) for hit in found.hits),
        dropped=found.dropped,
        unlike=found.unlike,
    )
    if first.force is None:
        return measurement
    average = averaged_response(found.used, rate, high_hz, options.estimator, window)
    response = FrequencyResponse(
        source=first.source,
        points=measurement.points,
        frequency_hz=average.frequency_hz,
        accelerance=average.accelerance,
        coherence=average.coherence,
        **collect_conditions(first),
    )
    return replace(
        measurement,
        frequency_response=response,
        driven=tuple(each.driven for each in cuts),
        spectra=average.spectra,
        hammer=point_of(first.force),
        window_time_constant_s=window.time_constant_s,
    )


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
    first_free = math.ceil((free - begin) / factor)
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
