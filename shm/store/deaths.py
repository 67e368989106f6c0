"""What is known of processes that died while they worked on a recording."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from enum import StrEnum


class Death(StrEnum):
    """How a process died that worked on a recording, as a kind of event; the first two: alone."""

    BY_ITSELF = "worker died"
    FROM_OUTSIDE = "worker killed"
    BESIDE_OTHERS = "worker died beside others"


@dataclass(frozen=True)
class Deaths:
    """How often a process that worked on a recording alone died since the recording last moved on.

    `from_outside` counts those in a row: it begins anew where another recording's was killed.
    """

    by_itself: int
    from_outside: int
    last_at: datetime
