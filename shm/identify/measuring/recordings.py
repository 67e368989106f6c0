"""From time records of hits, as received, to the measurement of one set-up."""

from __future__ import annotations

from collections.abc import Sequence

from shm.identify.contract import Measurement
from shm.identify.measuring.cuts import cut
from shm.identify.measuring.frf import Window, averaged_response, common_window
from shm.identify.measuring.points import point_of
from shm.identify.measuring.screening import Screening, screened
from shm.identify.options import IdentifyOptions
from shm.values import ComplexArray, FrequencyResponse, Recording


def measurement_of_recordings(
    records: Sequence[Recording], options: IdentifyOptions
) -> Measurement:
    """The measurement in records of one set-up, each with one hit or several.

    Raises NotIdentifiable where no hit is left to use.
    """
    found = screened(records, options)
    window = common_window(found.used, records[0].sampling_rate_hz, options.band_high_hz)
    return screened_measurement(records, found, window, options)


def screened_measurement(
    records: Sequence[Recording], found: Screening, window: Window, options: IdentifyOptions
) -> Measurement:
    """The measurement in records of one set-up, of which `found` says what can be used."""
    rate = records[0].sampling_rate_hz
    cuts = [cut(hit, rate, options.band_high_hz) for hit in found.used]
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
    )


def _response(
    first: Recording, found: Screening, window: Window, options: IdentifyOptions
) -> tuple[FrequencyResponse, ComplexArray]:
    """The frequency response of a set-up, and the spectra it is an average of."""
    average = averaged_response(
        found.used, first.sampling_rate_hz, options.band_high_hz, options.estimator, window
    )
    response = FrequencyResponse(
        source=first.source,
        points=tuple(point_of(first.accelerations[row]) for row in found.rows),
        frequency_hz=average.frequency_hz,
        accelerance=average.accelerance,
        coherence=average.coherence,
        hanger=first.hanger,
        time=first.time,
        temperature_c=first.temperature_c,
        added_mass=first.added_mass,
    )
    return response, average.spectra
