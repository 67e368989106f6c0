"""What was planted and what the diagnosis made of it."""

from __future__ import annotations

import json
from dataclasses import dataclass

from shm.simulate import PlantedEffect

ABOUT = 1.02
NONE = "no effect"


@dataclass(frozen=True)
class Case:
    """What is planted: an effect of the catalogue at a size in standard deviations, or nothing."""

    effect: str
    size: float
    seed: int
    without: tuple[str, ...] = ()


@dataclass(frozen=True)
class Outcome:
    """How a diagnosis did on a case; `covered` is None where the size was not estimated."""

    case: Case
    planted: PlantedEffect | None
    size: float = 0.0
    first: bool = False
    in_group: bool = False
    led: bool = False
    leader: str = ""
    group: tuple[str, ...] = ()
    probability: float = 0.0
    no_gap: float = 0.0
    unexplained: float = 0.0
    covered: bool | None = None
    p_value: float = 0.0
    tension_before: float = 0.0
    tension_after: float = 0.0
    seconds: float = 0.0

    @property
    def left_out(self) -> bool:
        return self.case.effect in self.case.without


def kept(line: str) -> Outcome:
    """An outcome from a line of the answers."""
    fields = json.loads(line)
    case, planted = fields.pop("case"), fields.pop("planted")
    case["without"] = tuple(case["without"])
    fields["group"] = tuple(fields["group"])
    return Outcome(Case(**case), PlantedEffect(**planted) if planted else None, **fields)
