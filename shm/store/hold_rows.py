"""What the store hands out of recordings that are or were held: frozen rows."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from enum import StrEnum

from shm.values import NAN, Doubt


class Decision(StrEnum):
    """What a person made of a held recording; `REPLACED`: it was done again before one had.

    `WITHDRAWN`: it counted, and was discarded then; `REINSTATED`: what was discarded counts again.
    Of these two nothing was held, and no alert told.
    """

    CONFIRMED = "confirmed"
    DISCARDED = "discarded"
    REPLACED = "replaced"
    WITHDRAWN = "withdrawn"
    REINSTATED = "reinstated"


@dataclass(frozen=True)
class HeldTest:
    """One test that is held and why: its place in its file, and the shift of the tension that it
    implies (a fraction, NaN where that cannot be said)."""

    position: int
    name: str
    doubts: tuple[Doubt, ...]
    tension_shift: float = NAN


@dataclass(frozen=True)
class Hold:
    """A recording that is or was held; `message` is what its owner was told of it.

    `time` is the one that a person gave its test. All of `decision`, `decided_at`, `who`, `why` are
    empty while nobody has decided.
    """

    id: int
    recording_id: int
    file_name: str
    hanger: int
    held_at: datetime
    message: str
    tests: tuple[HeldTest, ...]
    sidecar_as: str | None = None
    decision: Decision | None = None
    decided_at: datetime | None = None
    who: str = ""
    why: str = ""
    time: datetime | None = None

    @property
    def is_for_its_clock(self) -> bool:
        """Whether nothing but the time of its tests is in doubt: what they measured is not."""
        return bool(self.doubts) and all(each.check.startswith("clock") for each in self.doubts)

    @property
    def doubts(self) -> tuple[Doubt, ...]:
        """Of all its tests, each check once."""
        return tuple({d.check: d for test in self.tests for d in test.doubts}.values())

    @property
    def time_unknown(self) -> bool:
        """Whether the time that its test claims is certainly wrong."""
        return any(doubt.time_unknown for doubt in self.doubts)

    @property
    def is_in(self) -> bool:
        """Whether a person said that it counts."""
        return self.decision in (Decision.CONFIRMED, Decision.REINSTATED)

    @property
    def is_out(self) -> bool:
        """Whether a person said that it does not."""
        return self.decision in (Decision.DISCARDED, Decision.WITHDRAWN)
