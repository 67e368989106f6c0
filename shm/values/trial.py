"""What a blind trial of the gap diagnosis knows of its cases, and how it scores the answers."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from shm.values.diagnosis import Diagnosis
from shm.values.kinds import NAN, Plane

PlantedKind = Literal["none", "one", "two", "unknown"]
"""Nothing, one effect of the catalogue, two of them, something that the catalogue lacks."""

MIX: Mapping[PlantedKind, float] = {"none": 1 / 4, "one": 1 / 2, "two": 1 / 8, "unknown": 1 / 8}
"""How often each is planted: judgement, the same as the diagnosis's priors
(`shm.gap.model_probabilities`)."""

Richness = Literal["one plane", "two planes", "known mass", "shapes", "conditions", "everything"]
"""What a case's tests measure: both planes from `two planes` on, and then what is named besides."""

Way = Literal["modes", "recordings"]
"""Whether a case holds identified modes, or recordings that are still to be identified."""


@dataclass(frozen=True)
class TrueEffect:
    """What was planted: its name, where it acts, its parameters, its size by itself.

    `size` is the square root of the best attainable chi-square difference.
    """

    name: str
    at: str
    values: Mapping[str, float]
    size: float


@dataclass(frozen=True)
class TrueFrequency:
    """The frequency that a test would have shown without any error."""

    test: str
    plane: Plane
    order: int
    frequency_hz: float


@dataclass(frozen=True)
class TrueCase:
    """One case of the key. `size` is that of all effects together, 0 for none.

    `tension_n` is the true tension, at the mean temperature and the reference level.
    `left_out` are the effects that the second round takes out of the catalogue.
    """

    case: str
    kind: PlantedKind
    richness: Richness
    way: Way
    effects: tuple[TrueEffect, ...]
    size: float
    tension_n: float
    frequencies: tuple[TrueFrequency, ...]
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
class Score:
    """A figure with its 90 % interval (bootstrap over the cases), from `cases` cases."""

    value: float
    low: float = NAN
    high: float = NAN
    cases: int = 0


MarkName = Literal[
    "detected",
    "false alarms",
    "named first",
    "among the first two",
    "in its group",
    "two effects told",
    "right where sure",
    "unknown called unexplained",
    "unknown misattributed",
    "left out called unexplained",
    "left out misattributed",
    "calibration error",
    "calibration error as counted",
    "calibration error by chance",
    "calibration missed if perfect",
    "calibration error above size four",
    "log score",
    "Brier score",
    "tension error of sound hangers, %",
    "tension error before, %",
    "tension error after, %",
    "tension error after over before",
    "tension covered",
    "size covered",
    "held-out misfit after over before",
    "held-out misfit worse",
    "failed",
]


@dataclass(frozen=True)
class Mark:
    """A score beside the bounds that it must keep; an infinite bound is none.

    It is asked of planted sizes greater than `above`. `richness`, `way` and `effect` are empty
    where all count. With the way `recordings less modes` the score is the difference of two.
    `met` is None where nothing is asked or too few cases speak.
    """

    name: MarkName
    score: Score
    lower: float
    upper: float
    richness: Richness | Literal[""] = ""
    way: Way | Literal["recordings less modes", ""] = ""
    met: bool | None = None
    above: float = 0.0
    effect: str = ""

    @property
    def asked(self) -> bool:
        """Whether it has a bound to keep."""
        return math.isfinite(self.lower) or math.isfinite(self.upper)

    @property
    def by_whole_interval(self) -> bool:
        """Whether the whole interval is on the side of its value: chance alone hardly did it."""
        low, high = self.score.low, self.score.high
        if self.met:
            return self.lower <= low and high <= self.upper
        return self.met is False and (high < self.lower or low > self.upper)


@dataclass(frozen=True)
class Bin:
    """Cases alike in size or in probability: from where to where, the mean, a share of them."""

    low: float
    high: float
    mean: float
    score: Score
    richness: Richness | Literal[""] = ""


@dataclass(frozen=True)
class CaseScore:
    """One answer beside its truth, flattened for scores, figures and tables.

    `first` and `first_two` say whether the planted effect is named first or among the first two of
    all causes, `in_group` whether it is in the first's group, `detected` whether anything but no
    gap leads. `leader` is what leads: a cause's name, `no gap` or `unexplained`;
    `leading_probability` that of its group and `right` whether it is the truth or its group.
    `truth_probability` is what was given to the truth. `covered` is whether the planted size lies
    in its 90 % interval, None where it was not estimated at its place; `tension_covered` that of
    the tension in its 95 % interval. Errors of the tension are fractions. `held_out_ratio` is the
    error of held-out predictions of the true frequencies after over before.

    `alike` are the other members of the leader's group. `misattributed` says that an effect was
    named with more than 0.9 outside the truth's group, `pair_told` how the answer did on two
    effects, None for all other kinds. `brier` is the Brier score over no gap, every cause and
    unexplained. An answer that failed has no leader; its Brier score is the worst there is.
    """

    case: str
    kind: PlantedKind
    richness: Richness
    way: Way
    size: float
    planted: str
    leader: str
    leading_probability: float
    right: bool
    detected: bool
    first: bool
    first_two: bool
    in_group: bool
    truth_probability: float
    no_gap: float
    unexplained: float
    covered: bool | None = None
    tension_error_before: float = NAN
    tension_error_after: float = NAN
    tension_covered: bool | None = None
    held_out_ratio: float = NAN
    seconds: float = NAN
    failure: str = ""
    brier: float = NAN
    misattributed: bool = False
    pair_told: bool | None = None
    alike: tuple[str, ...] = ()


@dataclass(frozen=True)
class TrialScore:
    """All scores of a trial: its marks, and each case in both rounds.

    `detection` holds the share detected by size and richness, `reliability` the share right by
    leading probability.
    """

    cases: int
    seed: int
    key_sha256: str
    answers_sha256: str
    marks: tuple[Mark, ...]
    first_round: tuple[CaseScore, ...]
    left_out: tuple[CaseScore, ...] = ()
    detection: tuple[Bin, ...] = ()
    reliability: tuple[Bin, ...] = ()
