"""The lead of a message to a person: state of a hanger, action and urgency.

The urgency is read off the words of the action, so that the two cannot disagree.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Literal

Urgency = Literal["none", "next_test", "week", "today"]
URGENCIES: tuple[Urgency, ...] = ("none", "next_test", "week", "today")
"""From the least to the most urgent."""
NEXT_TEST, WEEK, TODAY = "at the next planned test", "within a week", "today"
"""The words of each; without any of them nothing needs doing."""

_PATTERNS: dict[Urgency, re.Pattern[str]] = {
    "today": re.compile(r"\btoday\b", re.IGNORECASE),
    "week": re.compile(r"\bwithin (a week|days)\b", re.IGNORECASE),
    # Former versions wrote `date`, and stored messages keep their words.
    "next_test": re.compile(
        r"(?<!needed )\b(at|before) the next planned (test|date|inspection)\b", re.IGNORECASE
    ),
}
_SENTENCES = re.compile(r"(?<=[.?]) (?=[A-Z±`])")


@dataclass(frozen=True)
class Lead:
    """The first two sentences of a message: what is the matter, and what to do how soon."""

    state: str
    action: str

    @classmethod
    def of(cls, message: str) -> Lead:
        """Return that of a whole message."""
        state, *others = _SENTENCES.split(message.strip(), maxsplit=2)
        return cls(state, others[0] if others else "")

    @property
    def urgency(self) -> Urgency:
        """The most urgent of what the action says."""
        found = (each for each, pattern in _PATTERNS.items() if pattern.search(self.action))
        return next(found, "none")

    @property
    def words(self) -> str:
        return f"{self.state} {self.action}".strip()
