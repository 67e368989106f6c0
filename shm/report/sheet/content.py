"""What the figures and the page of one hammer test are made from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from typing import ClassVar

from shm.identify import Dropped, Hit, Identification
from shm.values import FrequencyResponse, Hanger, Mode, Recording


@dataclass(frozen=True, eq=False)
class TestSheet:
    """One identified test as a person checks it.

    `records` are those it came from, in the order in which they were given; empty where they are
    not at hand. `band_hz` is where modes were looked for; None where nobody says. `lineage` names
    what it was made from, as in a hanger's report; who made the sheet when is empty where unsaid.
    """

    __test__: ClassVar[bool] = False  # Told to pytest, which takes every `Test...` for a test.

    identification: Identification
    records: Sequence[Recording | FrequencyResponse] = ()
    hanger: Hanger | None = None
    band_hz: tuple[float, float] | None = None
    bridge: str = ""
    lineage: Mapping[str, str] = field(default_factory=dict)
    settings: Mapping[str, str] = field(default_factory=dict)
    generated_at: datetime | None = None
    version: str = ""

    @property
    def recordings(self) -> tuple[Recording, ...]:
        return tuple(record for record in self.records if isinstance(record, Recording))

    @property
    def modes(self) -> tuple[Mode, ...]:
        """The modes by plane and order."""
        return self.identification.test.modes

    @property
    def hits(self) -> tuple[Hit, ...]:
        return self.identification.hits

    @property
    def used_hits(self) -> tuple[Hit, ...]:
        return tuple(hit for hit in self.hits if hit.used)

    @property
    def dropped(self) -> tuple[Dropped, ...]:
        return self.identification.dropped

    @property
    def channel_faults(self) -> dict[str, str]:
        """Why a channel was left out, by its name."""
        prefix = "channel "
        return {
            each.what.removeprefix(prefix): each.reason
            for each in self.dropped
            if each.what.startswith(prefix)
        }
