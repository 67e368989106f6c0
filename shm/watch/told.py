"""What an owner has been told of a hanger and still stands; kept between its tests as a text."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from datetime import datetime
from typing import Any, Literal

from shm.errors import BadInput
from shm.values import Change, Moved

Way = Literal["up", "down"]


@dataclass(frozen=True)
class Told:
    """What stands: when each quantity was told to be beyond its threshold, and when a call was.

    `called` are the changes that were called, told or not: after a call the sequential test speaks
    of a further change, no longer of that one.
    """

    beyond: Mapping[tuple[str, Way], datetime] = field(default_factory=dict)
    call: datetime | None = None
    called: tuple[Change, ...] = ()

    def to_text(self) -> str:
        """JSON, from which `from_text` makes an equal one."""
        return json.dumps(
            {
                "beyond": [[*condition, at] for condition, at in self.beyond.items()],
                "call": self.call,
                "called": [asdict(change) for change in self.called],
            },
            default=datetime.isoformat,
        )

    @classmethod
    def from_text(cls, text: str) -> Told:
        """What `to_text` wrote, nothing where the text is empty; raises BadInput for another."""
        if not text:
            return cls()
        try:
            kept = json.loads(text)
            return cls(
                {(quantity, way): _time(at) for quantity, way, at in kept["beyond"]},
                kept["call"] and _time(kept["call"]),
                tuple(_change(each) for each in kept["called"]),
            )
        except (AttributeError, KeyError, TypeError, ValueError) as error:
            raise BadInput(
                f"what was told of a hanger cannot be read: {error!r}.",
                remedy="Go over the hanger's tests from its baseline on.",
            ) from error


def _time(text: str) -> datetime:
    return datetime.fromisoformat(text)


def _change(entry: dict[str, Any]) -> Change:
    moved = tuple(
        Moved(**{**each, **{name: tuple(each[name]) for name in ("alike", "together")}})
        for each in entry["moved"]
    )
    times = {name: _time(entry[name]) for name in ("began_after", "began_by")}
    return Change(**{**entry, **times, "moved": moved})
