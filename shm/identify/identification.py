"""From records of one test to its identified modes: the whole of the room in one function."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import compress
from typing import Any, TypeAlias

import numpy as np

from shm.errors import NotIdentifiable, UsageError
from shm.identify.contract import (
    FREQUENCY_FLOOR,
    LEAST_HITS,
    Dropped,
    Finding,
    FoundMode,
    Hit,
    Measurement,
    Poles,
    Tone,
)
from shm.identify.each_hit import HitModes, modes_of_each_hit
from shm.identify.estimation.postprocess import postprocess, without_sidebands
from shm.identify.estimation.pyoma import identify_with_pyoma2
from shm.identify.estimation.ssi import search_windows, summed_hankel_ssi
from shm.identify.measuring.setups import (
    measure_set_ups,
    refuse_off_the_hanger,
    without_unused_force,
)
from shm.identify.mode_ordering.placement import STATE_PLANES, Placement, place_modes
from shm.identify.options import AUTO_CROSS_CHECK, NO_CROSS_CHECK, IdentifyOptions
from shm.identify.quality import CHECKS_OF_NUMBERED, Inspection, assess, refusal, tones
from shm.identify.setup_merging.calm_part import (
    LEFT_OUT,
    late_part_level,
    late_parts,
    linear_below_level,
)
from shm.identify.setup_merging.join_set_ups import JoinedFinding, join_set_ups
from shm.identify.setup_merging.modal_participation import fitted
from shm.identify.setup_merging.products import joined_response
from shm.values import (
    NAN,
    ComplexArray,
    ForeignMode,
    FrequencyResponse,
    Hanger,
    ModalTest,
    QualityCheck,
    Recording,
    ResponsePoint,
    as_test_id,
    collect_known_conditions,
)
from shm.values.showing import Displayable


@dataclass(frozen=True, eq=False)
class Identification(Displayable):
    """Hold what a test says, and how it came to say so.

    `quality` holds a figure for everything that can be wrong with a test; `set_aside` what rings
    in it without being a mode of the hanger; `dropped` counts all that was left out with the
    reason; `notes` are decisions a reader should know of. `frequency_response`, None where nobody
    hit, has the exponential window of `window_time_constant_s` (inf: none) on it, the modes have
    not; `fit` (points, lines) is what the identified modes make of it, window included. `each_hit`
    has the modes in each hit by itself. `band_hz` is where modes were looked for; None where nobody
    says.
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
    each_hit: tuple[HitModes, ...] = ()
    band_hz: tuple[float, float] | None = None

    def __repr__(self) -> str:
        return f"<Identification of {self.test!r}>"

    def with_orders(self, source: str) -> Identification:
        """Return self, where modes have orders; else raise NotIdentifiable listing the modes."""
        if self.test.modes:
            return self
        checks = [each for each in self.quality if each.verdict == "refused"]
        listed = ", ".join(f"{each.frequency_hz:.4g}" for each in self.set_aside)
        raise NotIdentifiable(
            f"{'; '.join(each.found for each in checks)} ({listed} Hz).",
            file=source,
            remedy=" ".join(each.remedy for each in checks),
        )


_DEFAULTS = IdentifyOptions()
_FEWEST_CALM = 3  # judgement: two frequencies fit a bar's tension and stiffness by chance
_KNOCKS = (
    "the hanger does not ring as a bar: something knocks (a guide with play), slips or opens while "
    "it swings far"
)


def identify(
    records: Sequence[Recording | FrequencyResponse],
    options: IdentifyOptions = _DEFAULTS,
    *,
    test_id: str,
    hanger: Hanger | None = None,
) -> Identification:
    """Identify the modes of one test from its records: time records with hits, or responses.

    The description of the `hanger`, where known, helps to number the modes. Raises BadInput
    where the records cannot be used together, NotIdentifiable where no mode can be trusted.
    Modes of unknown order are foreign: the test is without modes where all are.
    """
    refuse_off_the_hanger(records, hanger)
    recordings = [record for record in records if isinstance(record, Recording)]
    slowest_hz = min((record.sampling_rate_hz for record in recordings), default=math.inf)
    options, asked_hz = options.passed_at(slowest_hz), options.band_high_hz
    measurements = measure_set_ups(records, options)
    recordings = without_unused_force(recordings, measurements)
    steady = tones(measurements, recordings, options)
    found = _found(measurements, options.identifier, options)
    look = partial(_looked_at, measurements, found.finding, options)
    placement = place_modes(found.finding.modes, found.points, hanger, steady, look)
    second = _cross_check(measurements, options, hanger)
    inspection = Inspection(
        recordings, measurements, options, steady, found.finding, second, found.points, found.apart
    )
    quality = assess(inspection)
    if refused := refusal(quality, records[0].source):
        raise refused
    calm = None if placement.modes else _once_calm(measurements, options, hanger, steady)
    if calm is not None:
        placement, level_left, note = calm
        free, noted = level_left, [note]
    elif not placement.modes and placement.check is None:
        raise _nothing_found(records[0].source, found.finding, placement, found.points)
    else:
        level_left = 1.0
        free = linear_below_level(measurements, placement.modes) if placement.modes else 1.0
        strange = [f"until {free:.0%} of their level is left, {_KNOCKS}"] if free < 1 else []
        noted = [*found.notes, *strange, *_notes_of_delays(found, slowest_hz, options)]
    hits = _hits_in_time(measurements)
    amplitude = _amplitude(hits, options)
    return Identification(
        test=ModalTest(
            as_test_id(test_id),
            placement.modes,
            amplitude=level_left * amplitude,
            rattles_above=free * amplitude if free < 1 else NAN,
            **_conditions(records),
        ),
        frequency_response=joined_response(measurements),
        hits=hits,
        dropped=_all_dropped(measurements, found.finding),
        poles=found.finding.poles,
        notes=(*placement.notes, *noted, *_notes_of_records(measurements, options, asked_hz)),
        window_time_constant_s=measurements[0].window_time_constant_s,
        quality=(*quality, *_of_placed(inspection, placement, hanger)),
        set_aside=placement.foreign_modes,
        fit=fitted(measurements, found.apart, options) if level_left == 1 else None,
        each_hit=modes_of_each_hit(measurements, found.apart, placement.modes),
        band_hz=(options.band_low_hz, options.band_high_hz),
    )


def _looked_at(
    measurements: Sequence[Measurement],
    found: Finding,
    options: IdentifyOptions,
    at_hz: Sequence[float],
) -> tuple[tuple[FoundMode, ...], tuple[FoundMode, ...]]:
    """Return the modes that windows show around `at_hz` of one set-up, and weak candidates."""
    if len(measurements) > 1 or options.identifier != "ssi":
        return (), found.doubtful
    again = search_windows(measurements[0], options, at_hz)
    if again is None:
        return (), found.doubtful
    again = postprocess(again, measurements[0], options)
    return again.modes, (*found.doubtful, *again.doubtful)


def _of_placed(
    inspection: Inspection, placement: Placement, hanger: Hanger | None
) -> tuple[QualityCheck, ...]:
    """Return the quality checks of numbered modes, their numbers and the sensors."""
    checks = (placement.check,) if placement.check else ()
    if not (hanger and hanger.as_hanger and placement.modes):
        return checks
    numbered = replace(inspection, modes=placement.modes, hanger=hanger)
    return checks + assess(numbered, CHECKS_OF_NUMBERED)


def _once_calm(
    measurements: Sequence[Measurement],
    options: IdentifyOptions,
    hanger: Hanger | None,
    steady: Sequence[Tone],
) -> tuple[Placement, float, str] | None:
    """Return the result of the late parts of ring-downs, once they are a bar's; None if never.

    With it come the fraction of their level that is left by then, and a note. The parts that
    show most modes count.
    """
    if not all(m.driven for m in measurements):
        return None
    found = []
    for left_out in LEFT_OUT:
        later = _found(late_parts(measurements, left_out), options.identifier, options)
        found.append((place_modes(later.finding.modes, later.points, hanger, steady), left_out))
    placement, left_out = max(found, key=lambda each: (len(each[0].modes), each[1]))
    if len(placement.modes) < _FEWEST_CALM:
        return None
    note = f"the first {left_out:.0%} of each ring-down are left out: there {_KNOCKS}"
    return placement, late_part_level(measurements, left_out), note


def _cross_check(
    measurements: Sequence[Measurement], options: IdentifyOptions, hanger: Hanger | None
) -> Finding | None:
    """Return what the second identifier finds; None where none is asked.

    `auto` asks for it where no bar speaks for the modes of the first: of a structure that no model
    describes, and where pyOMA2's own modes are taken.
    """
    name = options.cross_check
    if name == AUTO_CROSS_CHECK:
        modelled = hanger is None or hanger.is_modelled
        name = "ssi" if options.identifier == "pyoma2" else NO_CROSS_CHECK if modelled else "pyoma2"
    if name == NO_CROSS_CHECK:
        return None
    return _found(measurements, name, options).finding


def _found(
    measurements: Sequence[Measurement], name: str, options: IdentifyOptions
) -> JoinedFinding:
    """Run the identifier of that name on each set-up and return its findings joined."""
    function = identifier(name)
    # What tests differ by is allowed for once, not set-up by set-up.
    alone = options if len(measurements) == 1 else replace(options, frequency_allowance=0.0)
    findings = [postprocess(function(m, alone), m, options) for m in measurements]
    return _of_modes_alone(join_set_ups(measurements, findings, options), options.shape_allowance)


def _of_modes_alone(found: JoinedFinding, shape_allowance: float) -> JoinedFinding:
    """Return the finding without the sidebands of modes, shapes as sure as tests repeat them."""
    finding = without_sidebands(found.finding)
    remains = [any(mode is other for other in finding.modes) for mode in found.finding.modes]
    apart = tuple(tuple(compress(modes, remains)) for modes in found.apart)
    modes = tuple(
        replace(mode, shape_sd=np.hypot(mode.shape_sd, shape_allowance)) for mode in finding.modes
    )
    return replace(found, finding=replace(finding, modes=modes), apart=apart)


def _conditions(records: Sequence[Recording | FrequencyResponse]) -> dict[str, Any]:
    """Return the earliest time, the mean temperature, and of all else what is stated first."""
    found: dict[str, Any] = {}
    for record in reversed(records):
        found |= collect_known_conditions(record)
    if times := [each.time for each in records if each.time is not None]:
        found["time"] = min(times)
    temperatures = [each.temperature_c for each in records if not math.isnan(each.temperature_c)]
    if temperatures:
        found["temperature_c"] = float(np.mean(temperatures))
    return found


def _nothing_found(
    source: str, found: Finding, placement: Placement, points: Sequence[ResponsePoint]
) -> NotIdentifiable:
    """Return the refusal of a test without a mode, missing planes before all that is dropped."""
    reasons = [f"{d.count} {d.what}: {d.reason}" for d in found.dropped if d.count]
    reasons += [f"{mode.frequency_hz:.4g} Hz: {mode.reason}" for mode in placement.foreign_modes]
    remedy = (
        "Check that hits ring down undisturbed, that the band holds modes and that nothing knocks "
        "while the hanger swings far: hit softer."
    )
    if not any(point.plane for point in points):
        reasons.insert(0, "no channel states its plane")
        remedy = f"{STATE_PLANES} {remedy}"
    return NotIdentifiable(
        f"no mode can be trusted ({'; '.join(reasons)}).", file=source, remedy=remedy
    )


def _all_dropped(measurements: Sequence[Measurement], found: Finding) -> tuple[Dropped, ...]:
    early = [entry for measurement in measurements for entry in measurement.dropped]
    return tuple(entry for entry in (*early, *found.dropped) if entry.count)


def _hits_in_time(measurements: Sequence[Measurement]) -> tuple[Hit, ...]:
    """Return the hits of all measurements, by record and start."""
    hits = (hit for measurement in measurements for hit in measurement.hits)
    return tuple(sorted(hits, key=lambda hit: (hit.record, hit.start)))


def _notes_of_delays(
    found: JoinedFinding, sampling_rate_hz: float, options: IdentifyOptions
) -> Iterator[str]:
    """Yield which channels are late by more than a converter that goes from one to the next.

    Delays are known to some percent of the shortest period: less than a quarter says little.
    """
    late_s = found.finding.late_s
    if late_s is None:
        return
    least_s = max(1 / sampling_rate_hz, 0.25 / options.band_high_hz)
    for point, seconds in zip(found.points, late_s - late_s.min(), strict=True):
        if seconds > least_s:
            yield (
                f"{point.name} is {1e3 * seconds:.2g} ms late: removed from the shapes; check the "
                "clocks of the sensors"
            )


def _notes_of_records(
    measurements: Sequence[Measurement], options: IdentifyOptions, asked_hz: float
) -> Iterator[str]:
    """Yield what hits that are few, or of unknown force, and a slow logger do not tell."""
    if len(measurements) < LEAST_HITS and all(len(m.decays) < LEAST_HITS for m in measurements):
        yield (
            "fewer than three hits: a frequency's standard deviation is the stated "
            f"{FREQUENCY_FLOOR:.1%}, those of damping and shape are not known"
        )
    if any(m.hits and m.frequency_response is None for m in measurements):
        yield (
            "no force is known: hits are known by the motion after them, amplitudes and frequency "
            "responses are not"
        )
    if options.band_high_hz < asked_hz:
        yield (
            f"modes were looked for up to {options.band_high_hz:g} Hz: a logger passes 0.4 of its "
            "sampling rate, and what lies higher may be an image of a faster vibration"
        )


def _amplitude(hits: Sequence[Hit], options: IdentifyOptions) -> float:
    """Return the median peak force of the used hits over that of the reference level."""
    forces = [hit.peak_force_n for hit in hits if hit.used and math.isfinite(hit.peak_force_n)]
    return float(np.median(forces)) / options.reference_force_n if forces else NAN


Identifier: TypeAlias = Callable[[Measurement, IdentifyOptions], Finding]
"""Finds the modes of a measurement; an empty finding is a valid answer."""
IDENTIFIERS: dict[str, Identifier] = {
    "ssi": summed_hankel_ssi,
    "pyoma2": identify_with_pyoma2,
}


def identifier(name: str) -> Identifier:
    """Return the identifier of that name; raises UsageError for an unknown one."""
    if name not in IDENTIFIERS:
        raise UsageError(
            f"unknown identifier {name!r}.", remedy=f"Known: {', '.join(IDENTIFIERS)}."
        )
    return IDENTIFIERS[name]
