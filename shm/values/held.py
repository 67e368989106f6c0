"""Why a recording is not taken at its word, and what tells a copy of its samples from another."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from shm.values.kinds import IntArray


@dataclass(frozen=True)
class Doubt:
    """One reason to hold a test until a person has looked: three short texts for that person.

    `state` says what is the matter and `action` what to do, both without a full stop; `why` is a
    sentence on how that was found. `check` names the check that raised it. `time_unknown`: the
    test's time is certainly wrong, and one that is confirmed without another counts from its
    receipt. `instead_of` are the numbers of recordings of which it holds more than they do: they
    are to be discarded if it shall count.
    """

    check: str
    state: str
    action: str
    why: str
    time_unknown: bool = False
    instead_of: tuple[int, ...] = ()


@dataclass(frozen=True, eq=False)
class Fingerprint:
    """What the samples of a recording look like, whatever the file around them says.

    `digest` is a SHA-256 of the samples of all channels, each to single precision and in whatever
    order. `shapes` (shapes, samples) are stretches of the channels about places that the samples
    near by choose, the same for other units, and in a part of the record. `marks` (shapes, 4) says
    of each its channel, how many samples that has, its place and its reach to either side; prints
    of before there were places have none, and tell by their digest alone.

    `noise` (2, channels, bytes) says of a stretch of each channel, a bit a sample, whether what no
    prediction foresees is positive, and whether it is background and no hit. `places` (channels, 5)
    says of each channel how many samples it has, where its stretch begins, and where its record's
    three strongest onsets lie; prints of before there was a background have neither.
    """

    digest: str
    shapes: NDArray[np.int16]
    marks: IntArray = field(default_factory=lambda: np.empty((0, 4), dtype=np.int64))
    noise: NDArray[np.uint8] = field(default_factory=lambda: np.empty((2, 0, 0), dtype=np.uint8))
    places: IntArray = field(default_factory=lambda: np.empty((0, 5), dtype=np.int64))


@dataclass(frozen=True, eq=False)
class KnownSamples:
    """An earlier recording, how to call it, and what its samples look like.

    `counts` is false of one that is held itself: it may be a copy, too.
    """

    name: str
    hanger: int | None
    fingerprint: Fingerprint
    recording_id: int = 0
    counts: bool = True
