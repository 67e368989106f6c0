"""What a blind trial knows of its cases, what was answered, and how an answer is scored."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from shm.values import NAN, Diagnosis

PlantedKind = Literal["none", "one", "two", "unknown"]
"""Nothing, one effect of the catalogue, two of them, something that the catalogue lacks."""

MIX: Mapping[PlantedKind, float] = {"none": 1 / 4, "one": 1 / 2, "two": 1 / 8, "unknown": 1 / 8}
"""How often each is planted: judgement, the same as the diagnosis's priors
(`shm.gap.probabilities`)."""

Richness = Literal[
    "one plane", "two planes", "known mass", "shapes", "conditions", "everything", "three modes"
]
"""What a case's tests measure: both planes from `two planes` on, and then what is named besides."""


@dataclass(frozen=True)
class TrueEffect:
    """What was planted: its name, where it acts, its parameters, its size alone.

    `size` is the square root of the best attainable chi-square difference.
    """

    name: str
    at: str
    values: Mapping[str, float]
    size: float


@dataclass(frozen=True)
class TrueCase:
    """One case of the key. `size` is that of all effects together, 0 for none.

    `tension_n` is the true tension, at the mean temperature and the reference level.
    `left_out` are the effects that the second round takes out of the catalogue.
    """

    case: str
    kind: PlantedKind
    richness: Richness
    effects: tuple[TrueEffect, ...]
    size: float
    tension_n: float
    left_out: tuple[str, ...] = ()


@dataclass(frozen=True)
class Answer:
    """What the diagnosis said of a case, in the round with or without its effect.

    `diagnosis` is None where it failed, and `failure` says why.
    """

    case: str
    left_out: tuple[str, ...]
    diagnosis: Diagnosis | None
    failure: str = ""


@dataclass(frozen=True)
class CaseScore:
    """One answer next to its truth.

    `leader` is what leads: a cause's name, `no gap` or `unexplained`; `alike` are the other members
    of its group, `leading_probability` is that of the group, and `right` whether it is the truth or
    its group. `first` says whether the planted effect is named first of all causes, `in_group`
    whether it is in the first's group. `tension_covered` is whether the tension lies in its 95 %
    interval; its error is a fraction. `misattributed` says that an effect was named with more than
    0.9 outside the truth's group. An answer that failed has no leader.
    """

    case: str
    kind: PlantedKind
    size: float
    planted: str
    leader: str = ""
    leading_probability: float = 0.0
    right: bool = False
    first: bool = False
    in_group: bool = False
    tension_error_after: float = NAN
    tension_covered: bool = False
    failure: str = ""
    misattributed: bool = False
    alike: tuple[str, ...] = ()
