"""Why a recording is not taken at its word, and what tells a copy of its samples from another."""

from __future__ import annotations

from dataclasses import dataclass

from shm.values.kinds import FloatArray


@dataclass(frozen=True)
class Doubt:
    """One reason to hold a test until a person has looked: three short texts for that person.

    `state` says what is the matter and `action` what to do, both without a full stop; `why` is a
    sentence on how that was found. `check` names the check that raised it. `time_unknown`: the
    test's time is certainly wrong, and one that is confirmed without another counts from its
    receipt.
    """

    check: str
    state: str
    action: str
    why: str
    time_unknown: bool = False


@dataclass(frozen=True, eq=False)
class Fingerprint:
    """What the samples of a recording look like, whatever the file around them says.

    `digest` is a SHA-256 of the samples of all channels, each to single precision and in whatever
    order. `shapes` (channels, samples) is a stretch of each channel from its first strong motion
    on, centred and of unit norm: the same for other units, and for a record cut at its ends.
    """

    digest: str
    shapes: FloatArray


@dataclass(frozen=True, eq=False)
class KnownSamples:
    """An earlier recording, how to call it, and what its samples look like."""

    name: str
    hanger: int | None
    fingerprint: Fingerprint
