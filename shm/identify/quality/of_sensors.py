"""Check unit, gain, position and direction of the sensors.

A hit's residue is the shape at the sensor times that at the hammer, each for unit modal mass. Away
from its ends a hanger of mass M has the shape sqrt(2/M) sin(beta s + theta), whatever tension and
ends, so that a unit that is wrong by 9.81 shows. With several positions each mode's shape shows
whether one reads too much or too little, or is elsewhere: that one change corrects all modes.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from shm.identify.contract import FoundMode, Measurement
from shm.identify.mode_ordering.bars import HIGHEST_ORDER, described_shapes
from shm.identify.quality.table import Inspection, Reading, Row
from shm.identify.setup_merging.modal_participation import ringing
from shm.values import (
    NAN,
    PLANES,
    FloatArray,
    Hanger,
    IntArray,
    Mode,
    Plane,
)

LARGEST_FACTOR = 2.0
"""Of motion over force."""
_LEAST_SHAPE = 0.3  # judgement, of the largest: nearer to a node a decimetre counts for too much
_LEAST_ENTRIES = 3  # a median that one mode cannot make
_SAME_MODE = 0.005  # judgement: set-ups see one mode as far apart
_LARGEST_SLOPE = 1e-3  # with 3e-3 the motion came out 2.3 times too small, with 1e-3 at most 1.5
LARGEST_MISFIT = 0.005
"""1 - MAC of the shapes, mean over the modes of a plane. Of 76 planes of sound tests, of
tests/worlds/recordings.py and of tests/benchmarks/right_signals.py, 18 were above, and none was
mended by as much as `_LEAST_MOVE_M` or `_LEAST_FACTOR`."""
_SURELY_OFF = 0.04
"""In 61 sound tests of an adversary's bars the misfit was 0.013 at most; with two places exchanged
or one off by 0.2 m it was 0.07 to 0.36."""
_TYPICAL = 0.6  # judgement: of that, in the median mode; one mode that is misnumbered is no sensor
_LEAST_PLACES, _LEAST_MODES = 2, 3
_EXPLAINED = 0.2  # judgement: of the misfit, what one wrong sensor may leave of it
_LEAST_MOVE_M, _LEAST_FACTOR = 0.25, 1.3  # judgement: less moves no order and no tension
_NEARLY = 2.0  # judgement: another place explains it nearly as well
_FACTORS = np.concatenate([np.geomspace(1 / 30, 30, 103), -np.geomspace(1 / 30, 30, 103)])
_TRIED = np.linspace(0.005, 0.995, 199)


@dataclass(frozen=True)
class _Wrong:
    """One sensor's factor or place that would mend the shapes, and what misfit it leaves."""

    misfit: float
    is_large: bool
    text: str


def _gain(inspection: Inspection) -> Reading | None:
    """Return the motion per force over that of the described mass, the median over the hits.

    Of frequencies that change much with amplitude the residues are too small. Not checked where
    no hammer's position is stated.
    """
    modes, hanger, measurements = inspection.modes, inspection.hanger, inspection.measurements
    hammers = [measurement.hammer for measurement in measurements if measurement.driven]
    if hammers and not any(hammer and np.isfinite(hammer.x_m) for hammer in hammers):
        found = "not checked: the hammer's place is not stated"
        remedy = "State where the hammer hits: `x_m` of the force, in m from the deck end."
        return Reading(NAN, verdict="unknown", found=found, remedy=remedy)
    if hanger is None or any(
        m.depends_on_amplitude and abs(m.amplitude_slope) > _LARGEST_SLOPE for m in modes
    ):
        return None
    factors = [
        factor
        for measurement, modes_of in zip(measurements, inspection.apart, strict=True)
        if measurement.driven and modes_of
        for factor in _factors(measurement, modes_of, modes, hanger)
    ]
    if not factors:
        return None
    value = float(np.median(factors))
    times = max(value, 1 / value)
    cause = ", as accelerations in g do under the name m/s2" if 7 < 1 / value < 14 else ""
    words = {"times": times, "side": "more" if value > 1 else "less", "cause": cause}
    return Reading(value, words, "good" if times < LARGEST_FACTOR else "warning")


def _factors(
    measurement: Measurement, found: Sequence[FoundMode], modes: Sequence[Mode], hanger: Hanger
) -> FloatArray:
    """Return each hit's motion over that of the described hanger, both planes together."""
    hammer = measurement.hammer
    if hammer is None or not np.isfinite(hammer.x_m):
        return np.empty(0)
    residue = np.abs(ringing(measurement, found).residue)
    measured = {point.plane for point in measurement.points}
    squares = []
    for plane in PLANES:
        rows = [n for n, p in enumerate(measurement.points) if p.plane == plane and p.x_m == p.x_m]
        numbered = list(_numbered(found, modes, plane))
        if not rows or not numbered or (len(measured) == 1 and hammer.plane not in measured):
            continue  # a hit across the only plane that is measured moves little in it
        at, orders = (np.array(each) for each in zip(*numbered, strict=True))
        places_m = [measurement.points[row].x_m for row in rows]
        part = residue[:, rows][:, :, at]
        squares.append(_ratio(part, orders, [*places_m, hammer.x_m], hanger) ** 2)
    total = np.sqrt(np.nansum(squares, axis=0)) if squares else np.empty(0)
    return np.asarray(total[total > 0])


def _numbered(
    found: Sequence[FoundMode], modes: Sequence[Mode], plane: Plane
) -> Iterator[tuple[int, int]]:
    """Yield index and order of each found mode of a plane."""
    for mode in modes:
        away = [abs(each.frequency_hz / mode.frequency_hz - 1) for each in found]
        if mode.plane == plane and mode.order <= HIGHEST_ORDER and min(away) < _SAME_MODE:
            yield int(np.argmin(away)), mode.order


def _ratio(
    residue: FloatArray, orders: IntArray, places_m: Sequence[float], hanger: Hanger
) -> FloatArray:
    """Return the median ratio of residues (hits, points, modes) to the described ones, per hit.

    The hammer's is the last of the positions. Of all end springs those whose ratios agree best.
    """
    best, least = np.full(len(residue), np.nan), np.inf
    for shape in described_shapes(np.array(places_m), orders, hanger):
        at_sensor, at_hammer = np.abs(shape[:, :-1].T), np.abs(shape[:, -1])
        near = (at_sensor > _LEAST_SHAPE) & (at_hammer > _LEAST_SHAPE)
        if near.sum() < _LEAST_ENTRIES:
            continue
        mass_kg = hanger.mass_per_length_kg_m * hanger.length_m
        ratio = np.maximum((residue / (2 / mass_kg * at_sensor * at_hammer))[:, near], 1e-9)
        middle = np.median(ratio, axis=1)
        spread = float(np.nanmedian(np.abs(np.log(ratio / middle[:, np.newaxis]))))
        if spread < least:
            best, least = middle, spread
    return np.asarray(best)


def _places(inspection: Inspection) -> Reading | None:
    """Return the misfit of shapes that one sensor's factor or position may explain.

    None where shapes do not tell, as those of a bar with turnbuckles, which bend otherwise by
    as much as a wrong position does.
    """
    hanger = inspection.hanger
    if hanger is None or hanger.turnbuckles:
        return None
    of_planes = [[m for m in inspection.modes if m.plane == plane] for plane in PLANES]
    results = [found for modes in of_planes if (found := _in_plane(modes, hanger)) is not None]
    return max(results, key=lambda reading: reading.value, default=None)


def _in_plane(modes: Sequence[Mode], hanger: Hanger) -> Reading | None:
    modes = [mode for mode in modes if mode.order <= HIGHEST_ORDER]
    values = np.array([[point.value for point in mode.shape] for mode in modes])
    if len(modes) < _LEAST_MODES or values.shape[1] < _LEAST_PLACES:
        return None
    seen = np.isfinite(values).all(axis=0)
    places_m = np.array([point.x_m for point in modes[0].shape])[seen]
    if len(places_m) < _LEAST_PLACES:
        return None
    orders = np.array([mode.order for mode in modes])
    misfit, typical, wrong = _explained(values[:, seen], places_m, orders, hanger)
    best = min(wrong, key=lambda each: each.misfit)
    in_most = typical >= _TYPICAL * LARGEST_MISFIT
    one_explains = in_most and best.is_large and best.misfit <= _EXPLAINED * misfit
    if misfit >= LARGEST_MISFIT and not one_explains:
        return Reading(
            misfit,
            verdict="warning" if in_most and misfit > _SURELY_OFF else "unknown",
            found="the shapes are not those of the described hanger, and no one sensor explains it",
            remedy="Compare the sensors' places with the sheet: two may be exchanged, or one 0.2 m "
            "off.",
        )
    candidates = [each for each in wrong if each.misfit < _NEARLY * best.misfit]
    text = " or ".join(each.text for each in sorted(candidates, key=lambda each: each.misfit)[:3])
    return Reading(misfit, {"count": len(modes), "plane": modes[0].plane, "cause": text})


def _explained(
    values: FloatArray, places_m: FloatArray, orders: IntArray, hanger: Hanger
) -> tuple[float, float, list[_Wrong]]:
    """Return misfits of shapes (modes, places): mean, median, and the fix of each position.

    The fix is by its factor or its position.
    """
    every = np.concatenate([places_m, _TRIED * hanger.length_m])
    shapes = described_shapes(every, orders, hanger)
    at_places, elsewhere = shapes[:, :, : len(places_m)], shapes[:, :, len(places_m) :]
    wrong = []
    for n, x_m in enumerate(places_m):
        scaled = np.repeat(values[np.newaxis], len(_FACTORS), axis=0)
        scaled[:, :, n] *= _FACTORS[:, np.newaxis]
        left = np.min([_misfits(scaled, shape).mean(axis=-1) for shape in at_places], axis=0)
        wrong.append(_mended_by_factor(float(left.min()), x_m, _FACTORS[int(np.argmin(left))]))
        moved = np.repeat(at_places[np.newaxis], len(_TRIED), axis=0)
        moved[:, :, :, n] = elsewhere.transpose(2, 0, 1)
        left = _misfits(values, moved).mean(axis=-1).min(axis=1)
        there_m = float(every[len(places_m) + int(np.argmin(left))])
        text = f"the sensor said to be at {x_m:.3g} m is at {there_m:.1f} m"
        wrong.append(_Wrong(float(left.min()), abs(there_m - x_m) > _LEAST_MOVE_M, text))
    least = min((_misfits(values, shape) for shape in at_places), key=np.mean)
    return float(np.mean(least)), float(np.median(least)), wrong


def _mended_by_factor(misfit: float, x_m: float, factor: float) -> _Wrong:
    times = float(max(abs(factor), 1 / abs(factor)))
    side, turned = (
        "little" if abs(factor) > 1 else "much",
        " with the wrong sign" if factor < 0 else "",
    )
    text = f"the sensor at {x_m:.3g} m reads {times:.2g} times too {side}{turned}"
    return _Wrong(misfit, times > _LEAST_FACTOR or bool(factor < 0), text)


def _misfits(values: FloatArray, shapes: FloatArray) -> FloatArray:
    """Return 1 - MAC of each mode (..., modes); both arguments are (..., modes, places)."""
    product = np.sum(values * shapes, axis=-1) ** 2
    norms = np.sum(values**2, axis=-1) * np.sum(shapes**2, axis=-1)
    return np.asarray(1 - product / np.maximum(norms, 1e-300))


LARGEST_DEGREES = 15.0
"""Judgement: three times what a sensor clamped on by eye is off; it then sees 7 % of the other
plane's energy."""
_EXCHANGED_DEGREES = 45.0  # beyond it the other plane's name fits better
_SHARE_SEEN = 0.25  # judgement, of the largest motion: nearer to a node the direction is noise
_MODES_SEEN = 3  # a median that one mode cannot make


def _directions(inspection: Inspection) -> Reading | None:
    """Return the largest angle between places with axes in both planes; None below two such."""
    modes = inspection.finding.modes if inspection.finding else ()
    rows = [
        {
            p.x_m: row
            for row, p in enumerate(inspection.points)
            if p.plane == plane and not math.isnan(p.x_m)
        }
        for plane in PLANES
    ]
    biaxial = {x_m: (rows[0][x_m], rows[1][x_m]) for x_m in rows[0].keys() & rows[1].keys()}
    apart = [
        (degrees, one, other)
        for one, other in combinations(sorted(biaxial), 2)
        if not math.isnan(degrees := _apart(modes, biaxial[one], biaxial[other]))
    ]
    if not apart:
        return None
    worst, one, other = max(apart)
    words = {"one": one, "other": other}
    if worst > _EXCHANGED_DEGREES:
        remedy = "The planes of one of them are exchanged: correct its axes or its description."
        return Reading(worst, words, "refused", remedy=remedy)
    return Reading(worst, words)


def _apart(modes: Sequence[FoundMode], one: tuple[int, int], other: tuple[int, int]) -> float:
    """Return the degrees, 0 to 90, between directions at two positions; the median over modes."""
    pairs = [(mode.shape[list(one)], mode.shape[list(other)]) for mode in modes]
    sizes = [(np.hypot(*here), np.hypot(*there)) for here, there in pairs]
    cosines = [
        min(1.0, abs(float(here @ there)) / float(np.prod(size)))
        for (here, there), size in zip(pairs, sizes, strict=True)
        if min(size) >= _SHARE_SEEN
    ]
    if len(cosines) < _MODES_SEEN:
        return math.nan
    return math.degrees(math.acos(float(np.median(cosines))))


_SEE_APART = "the sensors at {one:g} m and {other:g} m see the modes move {value:.0f} degrees apart"
GAIN = Row(
    "gain", _gain, LARGEST_FACTOR, "",
    "the response agrees with the described mass (ratio {value:.2f})",
    "the hanger moves {times:.2g} times {side} than its described mass allows{cause}",
    "Check unit and sensitivity of hammer and accelerometers, the hammer's place, and the "
    "described section and length.",
)  # fmt: skip
PLACES = Row(
    "places", _places, LARGEST_MISFIT, "",
    "the sensors' shapes are those of the described hanger",
    "{count} {plane} modes fit the described hanger if {cause}",
    "Check place, unit, sensitivity and sign of that sensor.",
)  # fmt: skip
DIRECTIONS = Row(
    "directions", _directions, LARGEST_DEGREES, "degrees", _SEE_APART, _SEE_APART,
    "Align both sensors with the planes of the bridge.",
)  # fmt: skip
