"""Find copies of samples: one impact must not confirm itself under another name.

The digest finds the same numbers in whatever file; the shapes find them rescaled, rounded, in
another order, or cut to a part. A shape is a stretch of one channel about a place where the motion
resembles a fixed chirp more than anywhere within a reach to either side: a part chooses the same
places as the whole. All shapes of a copy are moved by the same number of samples.
"""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Sequence

import numpy as np
import scipy
from numpy.typing import NDArray

from shm.plausibility.candidate import Candidate
from shm.plausibility.limits import LIMITS
from shm.values import (
    Doubt,
    Fingerprint,
    FloatArray,
    FrequencyResponse,
    IntArray,
    KnownSamples,
    Recording,
)
from shm.values.rounding import listed

_CHIRP = np.cos(np.pi * np.arange(-LIMITS.half, LIMITS.half + 1) ** 2 / (4 * LIMITS.half) + 1)
"""Runs from half of the highest frequency to 0 and back: a hanger rings below that."""


_WHY = "One impact counted twice would confirm itself."


def fingerprint_of(records: Sequence[Recording | FrequencyResponse]) -> Fingerprint | None:
    """Return what the samples of one test look like; None where nothing moves in them."""
    moved = [row for record in records for row in _motions(record) if _moves(row)]
    if not moved:
        return None
    forces = [each.force for each in records if isinstance(each, Recording) and each.force]
    with np.errstate(over="ignore"):  # a number beyond single precision is infinite in each copy
        numbers = [row.astype("<f4") for row in (*moved, *(force.values for force in forces))]
    hashes = sorted(hashlib.sha256(row.tobytes()).digest() for row in numbers)
    most = max(2, min(LIMITS.most_a_channel, LIMITS.most // len(moved)))
    found = [_shapes(row, channel, most) for channel, row in enumerate(moved)]
    return Fingerprint(
        hashlib.sha256(b"".join(hashes)).hexdigest(),
        np.concatenate([shapes for shapes, _ in found])[: LIMITS.most],
        np.concatenate([marks for _, marks in found])[: LIMITS.most],
    )


def copied(candidate: Candidate) -> Doubt | None:
    """Doubt the samples of another recording, in most channels; the same modes at one time.

    Of several recordings those that count are named first, and of these the longest: a copy may
    have been copied.
    """
    its = candidate.fingerprint
    if its is None:
        twin = next((t for t in candidate.same_time if t.modes == candidate.test.modes), None)
        return None if twin is None else _again(f"it holds the modes of test {twin.id} again")
    similar = [each for each in candidate.copies if shared(its, each.fingerprint)]
    if not similar:
        return None
    similar.sort(key=lambda each: (not each.counts, -_samples(each.fingerprint)))
    known = similar[0]
    longer, name = _samples(its) - _samples(known.fingerprint), _name(known, candidate.hanger.id)
    if longer < 0:
        return _again(f"it is a part of {name}, sent again")
    if longer == 0:
        return _again(f"it holds the samples of {name} again")
    parts = [each for each in similar if each.counts == known.counts]
    names = [_name(each, candidate.hanger.id) for each in parts[: LIMITS.most_named]]
    more = len(parts) - len(names)
    return Doubt(
        "copy",
        f"it holds {listed(names)}" + (f" and of {more} more recordings" if more else ""),
        "It is the longer one: usually discard the part and confirm the whole",
        _WHY,
        instead_of=tuple(each.recording_id for each in parts),
    )


def shared(first: Fingerprint, other: Fingerprint) -> bool:
    """Return True if one recording holds the other's impacts.

    In at least half of the channels of the smaller one, lest a dead channel that always hums alike
    condemns a test.
    """
    if first.digest == other.digest:
        return True
    if not len(first.marks) or not len(other.marks):
        return False
    here, there = _equal_shapes(first, other)
    shifts = first.marks[here, LIMITS.place] - other.marks[there, LIMITS.place]
    pairs: set[tuple[int, int]] = set()
    for shift in np.unique(shifts):
        by = shifts == shift
        if by.sum() >= LIMITS.least:
            pairs |= _channels(first.marks[here[by]], other.marks[there[by]], first, other)
    similar = min(len({pair[side] for pair in pairs}) for side in (0, 1))
    return bool(pairs) and 2 * similar >= min(len(_lengths(each)) for each in (first, other))


def _lengths(fingerprint: Fingerprint) -> dict[int, int]:
    """Return the number of samples of each channel, by the first two columns of the marks."""
    return dict(fingerprint.marks[:, :2].tolist())


def _samples(fingerprint: Fingerprint) -> int:
    return sum(_lengths(fingerprint).values())


def _equal_shapes(first: Fingerprint, other: Fingerprint) -> tuple[IntArray, IntArray]:
    """Return the shapes that are equal: roughly first, as hundreds are looked through."""
    rough = [each.shapes.astype(np.float32) for each in (first, other)]
    mine, its = (each / np.linalg.norm(each, axis=1, keepdims=True) for each in rough)
    here, there = np.nonzero(np.abs(mine @ its.T) > 1 - LIMITS.roughly)
    one, two = _unit(first.shapes[here]), _unit(other.shapes[there])
    same = 1 - np.abs(np.sum(one * two, axis=1)) < LIMITS.same
    same &= first.marks[here, LIMITS.reach] == other.marks[there, LIMITS.reach]
    return here[same], there[same]


def _channels(
    mine: IntArray, its: IntArray, first: Fingerprint, other: Fingerprint
) -> set[tuple[int, int]]:
    """Return the pairs of channels that are copies if one is moved as these marks are.

    Most of the shapes that both should have, where both have samples, are the same.
    """
    shift = int(mine[0, LIMITS.place] - its[0, LIMITS.place])
    found = set()
    pairs = Counter(zip(mine[:, 0].tolist(), its[:, 0].tolist(), strict=True))
    for (one, two), count in pairs.items():
        both = first.marks[first.marks[:, 0] == one], other.marks[other.marks[:, 0] == two].copy()
        both[1][:, LIMITS.place] += shift
        start, end = max(0, shift), min(both[0][0, 1], both[1][0, 1] + shift)
        within = [
            (marks[:, LIMITS.place] - marks[:, LIMITS.reach] >= start)
            & (marks[:, LIMITS.place] + marks[:, LIMITS.reach] < end)
            for marks in both
        ]
        if count >= LIMITS.share * min(int(each.sum()) for each in within):
            found.add((one, two))
    return found


def _again(what: str) -> Doubt:
    return Doubt("copy", what, "Discard it, unless the other is the wrong one", _WHY)


def _name(known: KnownSamples, hanger: int) -> str:
    return known.name + ("" if known.hanger == hanger else f" of hanger {known.hanger}")


def _motions(record: Recording | FrequencyResponse) -> list[FloatArray]:
    """Return the numbers of each response, bad ones as 0: pulses of a hammer are too much alike."""
    if isinstance(record, FrequencyResponse):
        lines = record.accelerance
        return [np.nan_to_num(np.concatenate([row.real, row.imag])) for row in lines]
    return [np.nan_to_num(channel.values) for channel in record.accelerations]


def _moves(row: FloatArray) -> bool:
    with np.errstate(over="ignore"):
        return bool(len(row) and 0 < np.ptp(row) < np.inf)


def _shapes(row: FloatArray, channel: int, most: int) -> tuple[NDArray[np.int16], IntArray]:
    """At most so many shapes of a channel with their marks, those of the widest reach."""
    row = row / np.abs(row).max()
    likeness = _likeness(row)
    reach = _reach(likeness)
    places = np.flatnonzero(reach)
    places = places[np.lexsort((-likeness[places], -reach[places]))[:most]]
    reach = reach[places]
    spread = np.outer(
        2 * reach // LIMITS.samples, np.arange(-LIMITS.samples // 2, LIMITS.samples // 2)
    )
    shapes = _unit(row[places[:, None] + spread])
    twins = (1 - np.abs(shapes @ shapes.T) < LIMITS.repeated) & (reach == reach[:, None])
    once = (twins.sum(axis=1) == 1) & shapes.any(axis=1)
    once &= once.mean() >= LIMITS.telling if len(once) else True
    shapes, places, reach = shapes[once], places[once], reach[once]
    highest = np.abs(shapes).max(axis=1, keepdims=True)
    marks = np.full((len(places), 4), (channel, len(row), 0, 0))
    marks[:, LIMITS.place], marks[:, LIMITS.reach] = places, reach
    return np.rint(shapes / highest * np.iinfo(np.int16).max).astype(np.int16), marks


def _likeness(row: FloatArray) -> FloatArray:
    """Of the motion about each place to the chirp; 0 where it does not cross zero.

    A crossing is where it was whatever is rounded; a crest is flat, and its highest sample may
    change.
    """
    if len(row) <= 4 * LIMITS.half:
        return np.zeros(len(row))
    ones = np.ones(2 * LIMITS.half + 1)
    motion = row - np.convolve(row, ones / len(ones), "same")
    below = motion < 0
    crossing = np.append(False, below[1:] != below[:-1])
    power = np.convolve(motion**2, ones, "same")
    likeness = np.abs(np.convolve(motion, _CHIRP, "same"))
    return np.where(crossing & (power > 0), likeness / np.sqrt(np.where(power > 0, power, 1)), 0)


def _reach(likeness: FloatArray) -> IntArray:
    """The largest power of two of samples to either side, all in the record, without a greater
    likeness; 0 where it is below what the likeness looks at."""
    found = np.zeros(len(likeness), dtype=int)
    reach = 2 * LIMITS.half
    while len(likeness) > 2 * reach:
        inside = slice(reach, len(likeness) - reach)
        around = scipy.ndimage.maximum_filter1d(likeness, 2 * reach + 1)
        highest = (around == likeness) & (likeness > 0)
        found[inside][highest[inside]] = reach
        reach *= 2
    return found


def _unit(shapes: FloatArray | NDArray[np.int16]) -> FloatArray:
    """Each of zero mean and unit norm; zeros where nothing moves."""
    centred = shapes - shapes.mean(axis=1, keepdims=True)
    centred /= np.maximum(np.abs(centred).max(axis=1, keepdims=True, initial=0), 1e-300)
    norm = np.linalg.norm(centred, axis=1, keepdims=True)
    return np.asarray(centred / np.where(norm > 0, norm, 1))
