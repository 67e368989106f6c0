"""Check the modes: explained by the force, confirmed by a second identifier, lowest present."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import compress

import numpy as np

from shm.identify.contract import Measurement
from shm.identify.estimation.spread import are_sure
from shm.identify.measuring.frf import response_of
from shm.identify.measuring.hits import hits_by_plane
from shm.identify.mode_ordering.bars import Description, log_factor
from shm.identify.quality.table import Inspection, Reading, Row
from shm.values import (
    NAN,
    PLANES,
    BoolArray,
    FloatArray,
    Hanger,
    Mode,
    Plane,
)
from shm.values.modes import FIRST_ORDERS, SLOPE_OF_NOTE
from shm.values.rounding import listed

# judgement: 0.2 of the response unexplained; sound tests have 0.92 and more: identify_limits.py
_WARNING = 0.8
_LINES_AROUND = 2  # judgement: within the half-power width of most modes
_STRONGEST = 0.05  # judgement: a twentieth of the lines holds the peaks of a dozen modes
_LIMIT = 0.003
"""Largest error of a frequency that the project allows."""
_SAME_MODE = 0.01  # judgement: three times the limit, half of CLOSE in `planes`
_LEAST_COMMON = 0.5
"""In a third of sound simulated tests the fit to frequency responses lacks a weak or close mode."""


def _explained(inspection: Inspection) -> Reading | None:
    """Return the median coherence at the found modes, or else where a point moves most.

    Measured frequency responses below `min_coherence` are refused: what is not explained by the
    force is not a response to it. After hits that are known in time it is a warning: free decays do
    not need the force, and coherence also falls where a hit came before the last had rung down.
    """
    measured = [m for m in inspection.measurements if m.frequency_response is not None]
    if not measured:
        return None
    values = [_coherence(m, inspection) for m in measured]
    known = np.concatenate([v for v in values if v is not None] or [np.empty(0)])
    known = known[np.isfinite(known)]
    given, least = not inspection.records, inspection.options.min_coherence
    limit = max(_WARNING, least)
    if not len(known):
        found = "the responses come without it" if given else "one hit has none"
        remedy = (
            "Export the coherence with the responses." if given else "Hit at least three times."
        )
        return Reading(NAN, {}, "unknown", limit, found, remedy)
    value = float(np.median(known))
    if given and value < least:
        return Reading(
            value, {"more": ": the rest is noise"}, "refused", least,
            remedy="Measure again: check hammer and sensor cables, hit the same point squarely and "
            "let each hit ring down.",
        )  # fmt: skip
    return Reading(value, {"more": ""}, limit=limit)


def _coherence(measurement: Measurement, inspection: Inspection) -> FloatArray | None:
    """Return coherence of all points at the lines that count, flat."""
    response = measurement.frequency_response
    if response is None or response.coherence is None:
        return None
    options, finding = inspection.options, inspection.finding
    frequency, coherence = response.frequency_hz, _coherence_by_plane(measurement)
    in_band = (frequency >= options.band_low_hz) & (frequency <= options.band_high_hz)
    if not np.any(in_band):
        return None
    if finding is not None and finding.modes:
        near = _near(frequency, np.array([mode.frequency_hz for mode in finding.modes]))
        return np.asarray(coherence[:, near & in_band].ravel())
    size = np.where(in_band, np.nan_to_num(np.abs(response.accelerance)), 0.0)
    least = np.quantile(size[:, in_band], 1 - _STRONGEST, axis=1, keepdims=True)
    return np.asarray(coherence[(size >= least) & in_band])


def _coherence_by_plane(measurement: Measurement) -> FloatArray:
    """Return the coherence of each point with the hits of its plane, where both were hit."""
    response = measurement.frequency_response
    assert response is not None
    assert response.coherence is not None
    if measurement.spectra is None:
        return response.coherence
    planes = [point.plane for point in measurement.points]
    force, motion = np.split(np.sum(np.abs(measurement.spectra) ** 2, axis=2), [1], axis=1)
    coherence = response.coherence.copy()
    for plane, hits in hits_by_plane(motion / force, planes).items():
        in_plane = [each == plane for each in planes]
        coherence[in_plane] = response_of(measurement.spectra[hits], "h1")[1][in_plane]
    return coherence


def _near(frequency_hz: FloatArray, modes_hz: FloatArray) -> BoolArray:
    """Return the lines at modes and two to either side."""
    spacing = float(frequency_hz[1] - frequency_hz[0])
    distance = np.abs(frequency_hz[:, None] - modes_hz)
    return np.asarray(np.any(distance <= (_LINES_AROUND + 0.5) * spacing, axis=1))


def _amplitude_dependence(inspection: Inspection) -> Reading | None:
    """Return the largest sure change of a frequency with amplitude, as a fraction, at a hit's."""
    found = inspection.finding.modes if inspection.finding else ()
    known = [mode for mode in found if math.isfinite(mode.amplitude_slope)]
    if not known:
        return None
    slopes = np.array([(mode.amplitude_slope, mode.amplitude_slope_sd) for mode in known])
    sure = list(compress(known, are_sure(*slopes.T)))
    worst = max(sure, key=lambda mode: abs(mode.amplitude_slope), default=None)
    if worst is None:
        return Reading(0.0)
    side = "lower" if worst.amplitude_slope < 0 else "higher"
    words = {"count": len(sure), "hz": worst.frequency_hz, "side": side}
    return Reading(abs(worst.amplitude_slope), words)


def _agreement(inspection: Inspection) -> Reading | None:
    """Return the largest difference of a common mode's frequency; modes that only one saw.

    Modes nearer than 1 % that are each other's nearest are common. That the second misses some is
    told, and a warning only where it misses most.
    """
    finding, second = inspection.finding, inspection.cross_check
    if finding is None or second is None:
        return None
    one = np.array([mode.frequency_hz for mode in finding.modes])
    other = np.array([mode.frequency_hz for mode in second.modes])
    pairs = _pairs(one, other)
    if not pairs:
        found = "the second identifier found none of the modes"
        return Reading(NAN, verdict="warning", found=found)
    differences = [abs(other[j] / one[i] - 1) for i, j in pairs]
    words = {
        "count": len(pairs),
        "worst": one[pairs[int(np.argmax(differences))][0]],
        "this": _alone("this", one, [i for i, _ in pairs]),
        "second": _alone("the second", other, [j for _, j in pairs]),
    }
    few = len(pairs) < _LEAST_COMMON * len(one)
    return Reading(float(max(differences)), words, "warning" if few else None)


_FORCE_EXPLAINS = "the force explains {value:.0%} of the response where the hanger responds"
_IN_COMMON = (
    "{count} modes in common, furthest apart by {value:.3%} at {worst:.2f} Hz{this}{second}"
)
COHERENCE = Row(
    "coherence", _explained, _WARNING, "", _FORCE_EXPLAINS, _FORCE_EXPLAINS + "{more}",
    "Hit the same point in the same direction, and let each hit ring down before the next.",
    is_least=True,
)  # fmt: skip
AMPLITUDE = Row(
    "amplitude", _amplitude_dependence, SLOPE_OF_NOTE, "",
    "frequencies do not depend on amplitude",
    "{count} frequencies change with amplitude; right after a hit that of {hz:.2f} Hz is {side} by "
    "{value:.2%}: those of small amplitude are given",
    "Hit equally hard in every test; look for a joint that slips.",
)  # fmt: skip
AGREEMENT = Row(
    "cross-check", _agreement, _LIMIT, "", _IN_COMMON, _IN_COMMON,
    "Look at the stabilisation diagram and the fit of these modes before using them.",
)  # fmt: skip


def _pairs(one: FloatArray, other: FloatArray) -> list[tuple[int, int]]:
    if not len(one) or not len(other):
        return []
    apart = np.abs(other[None, :] / one[:, None] - 1)
    nearest, back = apart.argmin(axis=1), apart.argmin(axis=0)
    return [(i, int(j)) for i, j in enumerate(nearest) if back[j] == i and apart[i, j] < _SAME_MODE]


def _alone(who: str, frequency_hz: FloatArray, common: list[int]) -> str:
    alone = np.delete(frequency_hz, common)
    names = listed([f"{value:.2f} Hz" for value in alone])
    return f"; {who} identifier alone saw {names}" if len(alone) else ""


def _first_orders(inspection: Inspection) -> Reading | None:
    """Return how many modes of the described hanger are missing below the first of a plane."""
    modes, hanger, low_hz = inspection.modes, inspection.hanger, inspection.options.band_low_hz
    if hanger is None or not modes or not any(point.plane for point in inspection.points):
        return None  # without a stated plane none can lack a mode
    lost = {plane: _below_first(modes, plane, hanger, low_hz) for plane in PLANES}
    names = [
        f"{plane} order {listed([str(order) for order in orders])}"
        for plane, orders in lost.items()
        if orders
    ]
    return Reading(sum(map(len, lost.values())), {"names": listed(names)})


def _below_first(modes: Sequence[Mode], plane: Plane, hanger: Hanger, low_hz: float) -> list[int]:
    of_plane = [mode for mode in modes if mode.plane == plane]
    if not of_plane:
        return []
    first = min(of_plane, key=lambda mode: mode.order)
    orders = np.arange(1, first.order + 1)
    half_fixed = np.full(orders.shape, 0.5)
    log_hz = log_factor(Description.of(hanger).log_xi, half_fixed, orders.astype(float))
    expected_hz = first.frequency_hz * np.exp(log_hz - log_hz[-1])
    return [int(order) for order in orders[:-1][expected_hz[:-1] >= low_hz]]


LOWEST = Row(
    FIRST_ORDERS, _first_orders, 0.0, "", "no mode is missing below the first one of a plane",
    "{names} not found", "Hit nearer to the middle with a softer tip, and record longer.",
)  # fmt: skip
