"""From records of one test to its identified modes: the whole of the room in one function."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from shm.errors import BadInput, NotIdentifiable
from shm.identify.contract import Dropped, Finding, Hit, Measurement, Poles
from shm.identify.finishing import coherent_only, without_window
from shm.identify.jackknife import FREQUENCY_FLOOR, LEAST_HITS
from shm.identify.options import IdentifyOptions
from shm.identify.placing import placed
from shm.identify.recordings import measurement_of_recordings
from shm.identify.registry import identifier
from shm.identify.responses import measurement_of_responses
from shm.values import (
    NAN,
    ComplexArray,
    ForeignMode,
    FrequencyResponse,
    Hanger,
    ModalTest,
    QualityCheck,
    Recording,
)


@dataclass(frozen=True, eq=False)
class Identification:
    """What a test says, and how it came to say so.

    `quality` holds a figure for everything that can be wrong with a test; `set_aside` what rings
    in it without being a mode of the hanger; `dropped` counts all that was left out with the
    reason; `notes` are decisions a reader should know of. `frequency_response`, None where nobody
    hit, has the exponential window of `window_time_constant_s` (inf: none) on it, the modes have
    not; `fit` (points, lines) is what the identified modes make of it, window included.
    """

    test: ModalTest
    frequency_response: FrequencyResponse | None
    hits: tuple[Hit, ...]
    dropped: tuple[Dropped, ...]
    poles: Poles
    notes: tuple[str, ...] = ()
    window_time_constant_s: float = math.inf
    quality: tuple[QualityCheck, ...] = ()
    set_aside: tuple[ForeignMode, ...] = ()
    fit: ComplexArray | None = None


_DEFAULTS = IdentifyOptions()


def identify(
    records: Sequence[Recording | FrequencyResponse],
    options: IdentifyOptions = _DEFAULTS,
    *,
    test_id: str,
    hanger: Hanger | None = None,
) -> Identification:
    """The modes of one test from its records: time records with hits, or frequency responses.

    The description of the `hanger`, where known, helps to number the modes. Raises BadInput
    where the records cannot be used together, NotIdentifiable where no mode can be trusted.
    """
    measurement = _measurement(records, options)
    found = identifier(options.identifier)(measurement, options)
    found = coherent_only(without_window(found, measurement), measurement, options)
    if not found.modes:
        raise _nothing_found(measurement, found)
    placement = placed(found.modes, measurement.points, hanger)
    first = records[0]
    return Identification(
        test=ModalTest(
            id=test_id,
            modes=placement.modes,
            hanger=first.hanger,
            time=first.time,
            temperature_c=first.temperature_c,
            amplitude=_amplitude(measurement.hits, options),
        ),
        frequency_response=measurement.frequency_response,
        hits=measurement.hits,
        dropped=tuple(d for d in measurement.dropped + found.dropped if d.count),
        poles=found.poles,
        notes=placement.notes + _few_hits(measurement),
        window_time_constant_s=measurement.window_time_constant_s,
        set_aside=placement.set_aside,
    )


def _measurement(
    records: Sequence[Recording | FrequencyResponse], options: IdentifyOptions
) -> Measurement:
    recordings = [record for record in records if isinstance(record, Recording)]
    responses = [record for record in records if isinstance(record, FrequencyResponse)]
    if not records or (recordings and responses):
        raise BadInput(
            "time records and frequency responses together." if records else "no record is given.",
            file=records[0].source if records else "",
            remedy="Give the records of one test, all of one kind.",
        )
    if recordings:
        return measurement_of_recordings(recordings, options)
    return measurement_of_responses(responses, options)


def _nothing_found(measurement: Measurement, found: Finding) -> NotIdentifiable:
    reasons = [f"{d.count} {d.what}: {d.reason}" for d in found.dropped if d.count]
    return NotIdentifiable(
        f"no mode can be trusted ({'; '.join(reasons)}).",
        file=measurement.source,
        remedy="Check that the hits ring down undisturbed and that the band holds modes.",
    )


def _few_hits(measurement: Measurement) -> tuple[str, ...]:
    if len(measurement.decays) >= LEAST_HITS:
        return ()
    return (
        "fewer than three hits: a frequency's standard deviation is the stated "
        f"{FREQUENCY_FLOOR:.1%}, those of damping and shape are not known",
    )


def _amplitude(hits: Sequence[Hit], options: IdentifyOptions) -> float:
    """Median peak force of the used hits over that of the reference level."""
    forces = [hit.peak_force_n for hit in hits if hit.used]
    return float(np.median(forces)) / options.reference_force_n if forces else NAN
