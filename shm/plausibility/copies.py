"""Whether the samples were here before: one impact must not confirm itself under another name.

The digest finds the same numbers again in whatever file; the shapes find them rescaled, rounded,
in another order, or cut by some samples.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence

import numpy as np

from shm.plausibility.candidate import Candidate
from shm.values import Doubt, Fingerprint, FloatArray, FrequencyResponse, Recording

_SAMPLES = 128
"""Of each channel from its onset on, and as many spread over the rest: a kilobyte a channel."""

_ONSET = 0.5
"""The shape begins where a channel first reaches half of its peak: rounding seldom moves that."""

_SAME = 1e-7
"""1 - correlation of a copy at most. Numbers rounded to four digits stay below 1e-8; of 780 pairs
of simulated tests of one hanger the closest came to 0.1, and to 7e-6 with a single hit each."""


def fingerprint_of(records: Sequence[Recording | FrequencyResponse]) -> Fingerprint | None:
    """What the samples of one test look like; None where nothing moves in them."""
    moved = [row for record in records for row in _motions(record)]
    shapes = [shape for row in moved if (shape := _shape(row)) is not None]
    if not shapes:
        return None
    forces = [each.force for each in records if isinstance(each, Recording) and each.force]
    with np.errstate(over="ignore"):  # a number beyond single precision is infinite in each copy
        numbers = [row.astype("<f4") for row in (*moved, *(force.values for force in forces))]
    hashes = sorted(hashlib.sha256(row.tobytes()).digest() for row in numbers)
    return Fingerprint(hashlib.sha256(b"".join(hashes)).hexdigest(), np.array(shapes))


def copied(candidate: Candidate) -> Doubt | None:
    """The samples of another recording, wholly or in most channels; the same modes at one time."""
    own = candidate.fingerprint
    if own is None:
        twin = next((t for t in candidate.same_time if t.modes == candidate.test.modes), None)
        return None if twin is None else _doubt(f"the modes of test {twin.id}")
    for known in candidate.copies:
        if is_copy(own, known.fingerprint):
            where = "" if known.hanger == candidate.hanger.id else f" of hanger {known.hanger}"
            return _doubt(f"the samples of {known.name}{where}")
    return None


def is_copy(own: Fingerprint, other: Fingerprint) -> bool:
    """Whether one recording holds the other's impacts: at least half of the channels of the smaller
    one, lest a dead channel that always hums alike condemns a test."""
    if own.digest == other.digest:
        return True
    alike = 1 - np.abs(own.shapes @ other.shapes.T) < _SAME
    shared = min(int(alike.any(axis=1).sum()), int(alike.any(axis=0).sum()))
    return bool(2 * shared >= min(alike.shape))


def _doubt(what: str) -> Doubt:
    return Doubt(
        "copy",
        f"it holds {what} again",
        "Discard it, unless the other is the wrong one",
        "One impact counted twice would confirm itself.",
    )


def _motions(record: Recording | FrequencyResponse) -> list[FloatArray]:
    """The numbers of each response, bad ones as 0: pulses of a hammer are too much alike."""
    if isinstance(record, FrequencyResponse):
        lines = record.accelerance
        return [np.nan_to_num(np.concatenate([row.real, row.imag])) for row in lines]
    return [np.nan_to_num(channel.values) for channel in record.accelerations]


def _shape(row: FloatArray) -> FloatArray | None:
    """The first strong motion of a channel and samples spread over what follows; None where it
    does not move.

    One impact rings much like another, but neither hits nor noise come at the same moments after
    it: each half has the same weight, so that the weak one tells, too. They are spread by a power
    of two, which a record cut by some samples keeps.
    """
    moving = np.abs(row - np.median(row)) if len(row) else row
    peak = moving.max(initial=0.0)
    if not 0 < peak < np.inf:
        return None
    rest = row[int(np.argmax(moving >= _ONSET * peak)) :]
    step = 2 ** max(0, int(np.log2(len(rest) / _SAMPLES)))
    halves = [_unit(rest[:_SAMPLES]), _unit(rest[_SAMPLES::step][:_SAMPLES])]
    return _unit(np.concatenate(halves), centred=False)


def _unit(values: FloatArray, centred: bool = True) -> FloatArray:
    """Of zero mean and unit norm, filled up with zeros; all zeros where nothing moves."""
    found = np.zeros(max(_SAMPLES, len(values)))
    found[: len(values)] = values - values.mean() if centred and len(values) else values
    norm = np.linalg.norm(found)
    return found / norm if norm > 0 else found
