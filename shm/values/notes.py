"""Notes of people on what they saw or did at a hanger or at the bridge."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from enum import StrEnum


class NoteKind(StrEnum):
    NOTE = "note"
    INSPECTION = "inspection"
    REPAIR = "repair"


@dataclass(frozen=True)
class Note:
    """A note of `who` on a hanger, or on the bridge where `hanger` is None.

    `at` is when it was seen or done.
    """

    id: int
    hanger: int | None
    at: datetime
    kind: NoteKind
    text: str
    who: str
    written_at: datetime
    has_photo: bool = False

    @property
    def of(self) -> str:
        return "the bridge" if self.hanger is None else f"hanger {self.hanger}"
