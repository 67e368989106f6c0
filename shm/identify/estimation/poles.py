"""Find mode candidates: poles of state-space models followed over rising model orders.

A mode stays at its frequency and shape, noise moves; it is there again with each hit left out.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import numpy as np
import scipy
from numpy.typing import NDArray

from shm.identify.contract import Dropped, Poles
from shm.identify.estimation.shapes import aligned, collinearity, median_shape
from shm.identify.options import IdentifyOptions
from shm.values import ComplexArray, FloatArray

BoolArray: TypeAlias = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class PoleSet:
    """The oscillating poles of one model order.

    `frequency_hz`, `damping_ratio` (poles,); `shapes` (channels, poles), complex, unscaled. A
    pair of conjugate poles counts once. `dropped` counts the order's other poles.
    """

    order: int
    frequency_hz: FloatArray
    damping_ratio: FloatArray
    shapes: ComplexArray
    dropped: tuple[Dropped, ...] = ()

    def chosen(self, keep: BoolArray) -> PoleSet:
        """Return the poles where `keep` (poles,) is true."""
        return PoleSet(
            self.order,
            self.frequency_hz[keep],
            self.damping_ratio[keep],
            self.shapes[:, keep],
            self.dropped,
        )


def in_band(poles: PoleSet, options: IdentifyOptions) -> BoolArray:
    """Return the mask (poles,) of poles in the band."""
    return np.asarray(
        (poles.frequency_hz >= options.band_low_hz) & (poles.frequency_hz <= options.band_high_hz)
    )


def plausibly_damped(poles: PoleSet, options: IdentifyOptions) -> BoolArray:
    """Return the mask (poles,) of poles that decay, and no faster than a hanger's mode."""
    return np.asarray((poles.damping_ratio > 0) & (poles.damping_ratio < options.max_damping_ratio))


# judgement: noise moves a mode by less than max_frequency_sd, 0.1 %, from order to order, and poles
# of noise by percents; 1 - MAC of a mode 20 dB above the noise is 0.01
FREQUENCY_TOLERANCE = 0.005
SHAPE_TOLERANCE = 0.1
_ORDERS_MISSED_AT_MOST = 8  # judgement: one step of 4 or three of 2 missed
_DOUBLE = "double of a mode too near to be told apart"
FAR = 1e6  # of a pair that must not be: far above the cost of any allowed one, 2


@dataclass(frozen=True, eq=False)
class Candidate:
    """A track of stable poles, and those of its poles that its estimates are taken from.

    `blur_hz` is a standard deviation of the frequency that no other hit or order shows.
    """

    track: Track
    poles: tuple[Pole, ...]
    blur_hz: float = 0.0

    @cached_property
    def frequency_hz(self) -> float:
        return float(np.median([pole.frequency_hz for pole in self.poles]))

    @cached_property
    def damping_ratio(self) -> float:
        return float(np.median([pole.damping_ratio for pole in self.poles]))

    @cached_property
    def shape(self) -> FloatArray:
        """Median real shape over the orders, (channels,); its largest absolute value is 1."""
        return median_shape([pole.shape for pole in self.poles])

    @property
    def collinearity(self) -> float:
        return float(collinearity(self.poles[-1].shape))

    @property
    def frequency_spread(self) -> float:
        """Return the relative spread of the frequency over model orders; one outlier is free."""
        return _spread([pole.frequency_hz for pole in self.poles])

    @property
    def damping_spread(self) -> float:
        """Return the relative spread of the damping over model orders; one outlier is free."""
        return _spread([pole.damping_ratio for pole in self.poles])


def _spread(values: Sequence[float]) -> float:
    """Return the second largest relative deviation from the median; below three, the largest."""
    deviations = np.sort(np.abs(np.array(values) / np.median(values) - 1))
    return float(deviations[-2] if len(values) > 2 else deviations[-1])


def stable_candidates(
    sets: Sequence[PoleSet],
    final_orders: Sequence[int],
    options: IdentifyOptions,
    *,
    gaps: bool = True,
) -> tuple[list[Candidate], tuple[Dropped, ...]]:
    """Return tracks that last over the model orders, and a count of the poles dropped on the way.

    Without `gaps` they must be there at all of `final_orders` but one; else at more than half.
    """
    banded = [poles.chosen(in_band(poles, options)) for poles in sets]
    damped = [poles.chosen(plausibly_damped(poles, options)) for poles in banded]
    lasting = _lasting(link(damped), len(sets), final_orders, options)
    least = len(final_orders) // 2 + 1 if gaps else len(final_orders) - 1
    candidates = [c for c in lasting if len(c.poles) >= least]
    total, inside, light = (_count(group) for group in (sets, banded, damped))
    stable = sum(len(candidate.track) for candidate in candidates)
    limit = f"damping ratio not between 0 and {options.max_damping_ratio:g}"
    return candidates, (
        *_left_out_before(sets),
        Dropped("poles", total - inside, "outside of the band"),
        Dropped("poles", inside - light, limit),
        Dropped("poles", light - stable, "not stable over the model orders"),
    )


def _left_out_before(sets: Sequence[PoleSet]) -> tuple[Dropped, ...]:
    """Count the poles that the models of all orders left out, by reason."""
    counts: Counter[str] = Counter()
    for poles in sets:
        counts.update({each.reason: each.count for each in poles.dropped})
    return tuple(Dropped("poles", count, reason) for reason, count in counts.items())


def _lasting(
    tracks: list[Track], orders: int, final_orders: Sequence[int], options: IdentifyOptions
) -> list[Candidate]:
    """Return tracks seen at enough orders as candidates, with their poles at the final ones."""
    return [
        Candidate(track, tuple(pole for pole in track if pole.order in final_orders))
        for track in tracks
        if len(track) >= options.min_presence * orders
    ]


def resolved(
    candidates: Sequence[Candidate], seconds: float
) -> tuple[list[Candidate], tuple[Dropped, ...]]:
    """Return the candidates that `seconds` of ring-down can separate, and the doubles dropped.

    Two of similar shape (MAC above 0.9) closer than 1/seconds are one mode whose frequency
    falls with its amplitude; the one that varies less over the model orders stays.
    """
    accepted: list[Candidate] = []
    dropped: list[Dropped] = []
    for candidate in sorted(candidates, key=lambda c: c.frequency_spread):
        if any(_double(candidate, other, seconds) for other in accepted):
            what = f"mode at {candidate.frequency_hz:.4g} Hz"
            dropped.append(Dropped(what, 1, _DOUBLE, candidate.frequency_hz))
        else:
            accepted.append(candidate)
    return accepted, tuple(dropped)


def _double(one: Candidate, other: Candidate, seconds: float) -> bool:
    near = abs(one.frequency_hz - other.frequency_hz) < 1 / seconds
    likeness = abs(np.vdot(one.poles[-1].shape, other.poles[-1].shape)) ** 2
    return bool(near and likeness > 1 - SHAPE_TOLERANCE)


def _count(sets: Sequence[PoleSet]) -> int:
    return sum(len(poles.frequency_hz) for poles in sets)


def diagram(
    sets: Sequence[PoleSet], candidates: Sequence[Candidate], options: IdentifyOptions
) -> Poles:
    """Return all plausibly damped poles in the band; stable are those of `candidates`."""
    shown = [poles.chosen(in_band(poles, options)) for poles in sets]
    shown = [poles.chosen(plausibly_damped(poles, options)) for poles in shown]
    tracked = {(p.order, p.frequency_hz) for c in candidates for p in c.track}
    order = np.concatenate([np.full(len(p.frequency_hz), p.order) for p in shown])
    frequency = np.concatenate([p.frequency_hz for p in shown])
    damping = np.concatenate([p.damping_ratio for p in shown])
    stable = [(int(n), float(f)) in tracked for n, f in zip(order, frequency, strict=True)]
    return Poles(order, frequency, damping, np.array(stable, dtype=bool))


@dataclass(frozen=True, eq=False)
class Pole:
    """One pole of one model order; `shape` (channels,) complex, of norm 1."""

    order: int
    frequency_hz: float
    damping_ratio: float
    shape: ComplexArray


Track = tuple[Pole, ...]


def link(sets: Sequence[PoleSet]) -> list[Track]:
    """Link poles that agree from order to order (0.5 % of frequency, MAC 0.9) to tracks."""
    closed: list[list[Pole]] = []
    open_tracks: list[list[Pole]] = []
    for poles in sets:
        recent = [t for t in open_tracks if poles.order - t[-1].order <= _ORDERS_MISSED_AT_MOST]
        closed += [t for t in open_tracks if poles.order - t[-1].order > _ORDERS_MISSED_AT_MOST]
        open_tracks = _extended(recent, _as_poles(poles))
    return [tuple(track) for track in closed + open_tracks]


def _as_poles(poles: PoleSet) -> list[Pole]:
    shapes = poles.shapes / np.linalg.norm(poles.shapes, axis=0)
    return [
        Pole(poles.order, float(frequency), float(damping), shape)
        for frequency, damping, shape in zip(
            poles.frequency_hz, poles.damping_ratio, shapes.T, strict=True
        )
    ]


def _extended(tracks: list[list[Pole]], poles: list[Pole]) -> list[list[Pole]]:
    """Return `tracks` with their best poles appended; a pole without a track starts one."""
    if not tracks or not poles:
        return tracks + [[pole] for pole in poles]
    cost = mismatch([track[-1] for track in tracks], poles)
    taken = set()
    for row, column in zip(*scipy.optimize.linear_sum_assignment(cost), strict=True):
        if cost[row, column] < FAR:
            tracks[row].append(poles[column])
            taken.add(column)
    return tracks + [[pole] for index, pole in enumerate(poles) if index not in taken]


def mismatch(
    known: Sequence[Pole],
    poles: Sequence[Pole],
    frequency_tolerance: float = FREQUENCY_TOLERANCE,
    shape_tolerance: float = SHAPE_TOLERANCE,
) -> FloatArray:
    """Return the cost at which `poles` continue `known`, (known, poles); 1e6 where they cannot."""
    known_hz = np.array([pole.frequency_hz for pole in known])
    ratio = np.array([pole.frequency_hz for pole in poles]) / known_hz[:, np.newaxis]
    known_shapes = np.array([pole.shape for pole in known])
    likeness = np.abs(known_shapes.conj() @ np.array([pole.shape for pole in poles]).T) ** 2
    frequency_cost = np.abs(ratio - 1) / frequency_tolerance
    shape_cost = (1 - likeness) / shape_tolerance
    near = (frequency_cost < 1) & (shape_cost < 1)
    return np.where(near, frequency_cost + shape_cost, FAR)


def continued(known: Sequence[Pole], poles: PoleSet) -> list[Pole | None]:
    """Return for each of `known` the pole of `poles` that repeats it (1 %, MAC 0.8), or None."""
    candidates = _as_poles(poles)
    if not known or not candidates:
        return [None] * len(known)
    cost = mismatch(known, candidates, 2 * FREQUENCY_TOLERANCE, 2 * SHAPE_TOLERANCE)
    best: list[Pole | None] = [None] * len(known)
    for row, column in zip(*scipy.optimize.linear_sum_assignment(cost), strict=True):
        if cost[row, column] < FAR:
            best[row] = candidates[column]
    return best


@dataclass(frozen=True, eq=False)
class Repeats:
    """One candidate found again with each hit left out in turn.

    `frequency_hz`, `damping_ratio` (hits,) and `shape` (hits, channels); NaN where not found.
    """

    frequency_hz: FloatArray
    damping_ratio: FloatArray
    shape: FloatArray


def find_again(
    candidates: Sequence[Candidate], models: Sequence[Sequence[PoleSet]]
) -> list[Repeats]:
    """Return the repeats of each candidate; `models` has pole sets for each left-out hit."""
    matches = [_in_one_model(candidates, sets) for sets in models]
    return [
        repeats_of(candidate, [of_model[index] for of_model in matches])
        for index, candidate in enumerate(candidates)
    ]


def repeats_of(candidate: Candidate, matches: Sequence[Sequence[tuple[Pole, Pole]]]) -> Repeats:
    """Return the repeats from matches: for each left-out hit, old poles and the same again."""
    rows = [_repeat(candidate, of_model) for of_model in matches]
    return Repeats(
        np.array([frequency for frequency, _, _ in rows]),
        np.array([damping for _, damping, _ in rows]),
        np.array([shape for _, _, shape in rows]).reshape(len(rows), len(candidate.shape)),
    )


def _in_one_model(
    candidates: Sequence[Candidate], sets: Sequence[PoleSet]
) -> list[list[tuple[Pole, Pole]]]:
    matches: list[list[tuple[Pole, Pole]]] = [[] for _ in candidates]
    for poles in sets:
        known = [
            (index, pole)
            for index, candidate in enumerate(candidates)
            for pole in candidate.poles
            if pole.order == poles.order
        ]
        again = continued([pole for _, pole in known], poles)
        for (index, pole), match in zip(known, again, strict=True):
            if match is not None:
                matches[index].append((pole, match))
    return matches


def _repeat(
    candidate: Candidate, matches: Sequence[tuple[Pole, Pole]]
) -> tuple[float, float, FloatArray]:
    """Return frequency, damping and shape of a repeat: the candidate's plus the median change."""
    if 2 * len(matches) < len(candidate.poles):
        return np.nan, np.nan, np.full(len(candidate.shape), np.nan)
    change = [
        (b.frequency_hz - a.frequency_hz, b.damping_ratio - a.damping_ratio) for a, b in matches
    ]
    frequency, damping = np.median(change, axis=0)
    shape = aligned(median_shape([match.shape for _, match in matches]), candidate.shape)
    return (
        candidate.frequency_hz + float(frequency),
        candidate.damping_ratio + float(damping),
        shape,
    )
