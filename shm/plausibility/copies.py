"""Find copies of samples: one impact must not confirm itself under another name.

The digest finds the same numbers again in whatever file; the shapes find them rescaled, rounded,
in another order, or cut to a part.

A shape is a stretch of one channel about a place that the samples near by choose: there the motion
resembles a fixed chirp more than anywhere within a reach to either side. So a part that was cut out
chooses the same places as the whole, but for those whose reach is cut, and a shape lies
within its reach. The places with the widest reach are kept: they lie spread over the record, in
strong and in weak motion alike. One impact rings much like another, but neither its fraction of a
sample nor noise comes again; and all shapes of a copy are moved by the same number of samples.
"""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from shm.plausibility.candidate import Candidate
from shm.values import (
    Doubt,
    Fingerprint,
    FloatArray,
    FrequencyResponse,
    IntArray,
    KnownSamples,
    Recording,
)

_SAMPLES = 32
"""Of each shape, from its reach before its place up to its reach after it."""

_MOST_A_CHANNEL, _MOST = 48, 800
"""Shapes: some 3 kB a channel, and 60 kB a recording at most."""

_HALF = 32
"""Samples to either side that the choice of a place looks at; the mean of as many is taken off."""

_CHIRP = np.cos(np.pi * np.arange(-_HALF, _HALF + 1) ** 2 / (4 * _HALF) + 1)
"""Runs from half of the highest frequency to 0 and back: a hanger rings below that."""

_PLACE, _REACH = 2, 3  # columns of the marks, after the channel and the number of its samples

_LEAST = 2
"""Shapes that must be moved alike: a single one may look like another by chance."""

_SHARE = 0.75
"""Of the shapes that both should have; numbers rounded to four digits keep 90 % of them."""

_SAME = 5e-8
"""1 - correlation of two shapes of copies at most. Numbers rounded to four digits come to 8e-9 in
the median and stay below 4.5e-8 in 2,500 shapes.

It would have to be above 1e-4 for any of 780 pairs of simulated tests of one hanger with a single
hit each to pass as copies, or of 780 with three, or of the five real hits in shared/data; 3e-6 with
a tenth of the noise, 0.2 mm/s2. With a hundredth, which no sensor has, the closest of 378 pairs
came to 5.6e-8: its hits fell at the same fraction of a sample.
"""

_ROUGHLY = 1e-4  # single precision errs by far less

_REPEATED = 1e-5
"""1 - correlation of two shapes in one channel, at which neither tells anything: a hum, or a mode
that rings alone without noise, comes again in other tests, too."""

_ALL = 0.995
"""Share of the samples from which one recording is as good as wholly in the other: an export that
begins a fraction of a second later loses less."""

_MOST_NAMED = 3  # recordings in one message

_WHY = "One impact counted twice would confirm itself."

_TELLING = 0.25
"""Of the shapes of a channel must come once: else those of another reach are only not seen twice.
It is 0.1 of a hum at most, and all of each simulated or real response that was tried."""


def fingerprint_of(records: Sequence[Recording | FrequencyResponse]) -> Fingerprint | None:
    """Return what the samples of one test look like; None where nothing moves in them."""
    moved = [row for record in records for row in _motions(record) if _moves(row)]
    if not moved:
        return None
    forces = [each.force for each in records if isinstance(each, Recording) and each.force]
    with np.errstate(over="ignore"):  # a number beyond single precision is infinite in each copy
        numbers = [row.astype("<f4") for row in (*moved, *(force.values for force in forces))]
    hashes = sorted(hashlib.sha256(row.tobytes()).digest() for row in numbers)
    most = max(2, min(_MOST_A_CHANNEL, _MOST // len(moved)))
    found = [_shapes(row, channel, most) for channel, row in enumerate(moved)]
    return Fingerprint(
        hashlib.sha256(b"".join(hashes)).hexdigest(),
        np.concatenate([shapes for shapes, _ in found])[:_MOST],
        np.concatenate([marks for _, marks in found])[:_MOST],
    )


@dataclass(frozen=True)
class Common:
    """The samples that two recordings have in common, as a share of those of each."""

    of_own: float
    of_other: float

    @property
    def own_is_whole(self) -> bool:
        """The one is in the other, but for some samples at an end."""
        return self.of_own >= _ALL

    @property
    def other_is_whole(self) -> bool:
        return self.of_other >= _ALL

    @property
    def own_is_longer(self) -> bool:
        return self.of_own < min(self.of_other, _ALL)


def copied(candidate: Candidate) -> Doubt | None:
    """The samples of another recording, wholly or in most channels; the same modes at one time.

    Of several recordings those that count are named first, and of these the one that has most of
    it: a copy may have been copied.
    """
    its = candidate.fingerprint
    if its is None:
        twin = next((t for t in candidate.same_time if t.modes == candidate.test.modes), None)
        return None if twin is None else _again(f"it holds the modes of test {twin.id} again")
    found = [(each, shared(its, each.fingerprint)) for each in candidate.copies]
    similar = [(known, common) for known, common in found if common is not None]
    if not similar:
        return None
    similar.sort(key=lambda each: (not each[0].counts, -round(each[1].of_own, 2)))
    known, common = similar[0]
    if not common.own_is_longer:
        return _again(_what_of(known, common, candidate.hanger.id))
    shorter = [each for each in similar if each[1].own_is_longer and each[0].counts == known.counts]
    reported = [_what_it_has(*each, candidate.hanger.id) for each in shorter[:_MOST_NAMED]]
    more = len(shorter) - len(reported)
    return Doubt(
        "copy",
        f"it holds {' and '.join(reported)}" + (f" and of {more} more recordings" if more else ""),
        "It is the longer one: usually discard the part and confirm the whole",
        _WHY,
        instead_of=tuple(each.recording_id for each, _ in shorter),
    )


def shared(own: Fingerprint, other: Fingerprint) -> Common | None:
    """Return what two recordings have in common where one holds the other's impacts.

    In at least half of the channels of the smaller one, lest a dead channel that always hums alike
    condemns a test. None where it does not.
    """
    if own.digest == other.digest:
        return Common(1.0, 1.0)
    if not len(own.marks) or not len(other.marks):
        return None
    here, there = _alike(own, other)
    if not len(here):
        return None
    shifts = own.marks[here, _PLACE] - other.marks[there, _PLACE]
    pairs: dict[tuple[int, int], int] = {}
    for shift in np.unique(shifts):
        by = shifts == shift
        if by.sum() >= _LEAST:
            moved = _channels(own.marks[here[by]], other.marks[there[by]], own, other)
            for pair, samples in moved.items():
                pairs[pair] = max(samples, pairs.get(pair, 0))
    similar = min(len({pair[side] for pair in pairs}) for side in (0, 1))
    if 2 * similar < min(len(np.unique(each.marks[:, 0])) for each in (own, other)):
        return None
    return Common(_share(pairs, _lengths(own.marks), 0), _share(pairs, _lengths(other.marks), 1))


def _lengths(rows: IntArray) -> dict[int, int]:
    """Return the number of samples of each channel, by the first two columns of the marks."""
    return {int(channel): int(length) for channel, length in rows[:, :2]}


def _share(pairs: Mapping[tuple[int, int], int], samples: Mapping[int, int], side: int) -> float:
    """Return how much of a recording, of so many samples a channel, lies in pairs that are copies.

    A channel of the one may hold several of the other, as that of a whole its cuts.
    """
    common = Counter[int]()
    for pair, length in pairs.items():
        common[pair[side]] += length
    found = sum(min(common[channel], length) for channel, length in samples.items())
    return found / sum(samples.values())


def _alike(own: Fingerprint, other: Fingerprint) -> tuple[IntArray, IntArray]:
    """Return the shapes that are equal: roughly first, as hundreds are looked through."""
    rough = [each.shapes.astype(np.float32) for each in (own, other)]
    mine, its = (each / np.linalg.norm(each, axis=1, keepdims=True) for each in rough)
    here, there = np.nonzero(np.abs(mine @ its.T) > 1 - _ROUGHLY)
    one, two = _unit(own.shapes[here]), _unit(other.shapes[there])
    same = 1 - np.abs(np.sum(one * two, axis=1)) < _SAME
    same &= own.marks[here, _REACH] == other.marks[there, _REACH]
    return here[same], there[same]


def _channels(
    mine: IntArray, its: IntArray, own: Fingerprint, other: Fingerprint
) -> dict[tuple[int, int], int]:
    """The pairs of channels that are copies if one is moved as these marks are against each other:
    most of the shapes that both should have, where both have samples, are the same. Of each how
    many samples that are."""
    shift = int(mine[0, _PLACE] - its[0, _PLACE])
    pairs = Counter(zip(mine[:, 0].tolist(), its[:, 0].tolist(), strict=True))
    found: dict[tuple[int, int], int] = {}
    for (one, two), count in pairs.items():
        both = own.marks[own.marks[:, 0] == one], other.marks[other.marks[:, 0] == two].copy()
        both[1][:, _PLACE] += shift
        start, end = max(0, shift), min(both[0][0, 1], both[1][0, 1] + shift)
        within = [
            (marks[:, _PLACE] - marks[:, _REACH] >= start)
            & (marks[:, _PLACE] + marks[:, _REACH] < end)
            for marks in both
        ]
        if count >= _SHARE * min(int(each.sum()) for each in within):
            found[one, two] = int(end - start)
    return found


def _again(what: str) -> Doubt:
    return Doubt("copy", what, "Discard it, unless the other is the wrong one", _WHY)


def _what_of(known: KnownSamples, common: Common, hanger: int) -> str:
    """Return what of another recording is in one that has no more than that."""
    name, share = _named(known, hanger), _percent(common.of_other)
    if not common.own_is_whole:
        return f"{_percent(common.of_own)} of its samples are in {name}, {share} of that one"
    if common.other_is_whole:
        return f"it holds the samples of {name} again"
    return f"it is a part of {name}, {share} of that one, sent again"


def _what_it_has(known: KnownSamples, common: Common, hanger: int) -> str:
    """Return what of another recording is in one that has more."""
    how_much = "all" if common.other_is_whole else _percent(common.of_other)
    return f"{how_much} of {_named(known, hanger)}, {_percent(common.of_own)} of its own samples"


def _percent(share: float) -> str:
    return f"{100 * share:.0f} %"


def _named(known: KnownSamples, hanger: int) -> str:
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
    spread = np.outer(2 * reach // _SAMPLES, np.arange(-_SAMPLES // 2, _SAMPLES // 2))
    shapes = _unit(row[places[:, None] + spread])
    twins = (1 - np.abs(shapes @ shapes.T) < _REPEATED) & (reach == reach[:, None])
    once = (twins.sum(axis=1) == 1) & shapes.any(axis=1)
    once &= once.mean() >= _TELLING if len(once) else True
    shapes, places, reach = shapes[once], places[once], reach[once]
    highest = np.abs(shapes).max(axis=1, keepdims=True)
    marks = np.full((len(places), 4), (channel, len(row), 0, 0))
    marks[:, _PLACE], marks[:, _REACH] = places, reach
    return np.rint(shapes / highest * np.iinfo(np.int16).max).astype(np.int16), marks


def _likeness(row: FloatArray) -> FloatArray:
    """Of the motion about each place to the chirp; 0 where it does not cross zero.

    A crossing is where it was whatever is rounded; a crest is flat, and its highest sample may
    change.
    """
    if len(row) <= 4 * _HALF:
        return np.zeros(len(row))
    ones = np.ones(2 * _HALF + 1)
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
    reach = 2 * _HALF
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
