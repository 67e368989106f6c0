"""What goes into the pattern over the bridge, and what comes out."""

from __future__ import annotations

from dataclasses import dataclass, field
from datetime import datetime
from types import MappingProxyType
from typing import Literal

from shm.values import NAN

ExplanationName = Literal[
    "no change", "load redistribution", "load gain", "common shift", "independent shifts"
]
REDISTRIBUTION: ExplanationName = "load redistribution"
Way = Literal["gained", "lost", "unchanged"]


@dataclass(frozen=True)
class HangerShift:
    """How far a hanger's tension lies from its baseline at its latest test, by itself.

    `place` counts the hangers along the bridge, those without a test too; two rows of hangers stand
    in one count if three places or more are left free between them. `temperature_change_k` is that
    of the latest test from the baseline's mean, NaN where unknown; `logger` is empty where unknown.
    """

    hanger: int
    place: int
    time: datetime
    baseline_n: float
    shift_n: float
    shift_sd_n: float
    position_m: float = NAN
    temperature_change_k: float = NAN
    logger: str = ""


# Judgement: why, says `NeighbourOptions`.
_PRIOR: dict[ExplanationName, float] = {
    "no change": 0.70,
    "load redistribution": 0.10,
    "load gain": 0.04,
    "common shift": 0.08,
    "independent shifts": 0.08,
}


@dataclass(frozen=True)
class NeighbourOptions:
    """What is taken for granted before any data.

    - `prior`: most looks at a bridge find nothing; a hanger that slackens is what one watches for;
      one that gains was tightened, and somebody would know; faults of a whole campaign and of
      single hangers (a sensor moved, a wrong description) are about as frequent as damage.
    - `sizes_fraction`: a shift, if there is one, is normal with one of these standard deviations,
      fractions of the tension, equally likely: half a decade apart, no size preferred.
    - `nearest_share`, `next_share`: what each neighbour takes up of a lost load on average, as a
      stiff deck spreads it; the shares scatter as a Dirichlet of `share_concentration` does, which
      is a standard deviation of 0.19 and 0.15.
    - `two_hangers`: the prior share of two hangers shedding load at once.
    - `scatter_fraction`: what parked loads and the like add to each hanger's standard deviation.
    - `common_scatter_fraction`: what the temperature correction leaves in all hangers together.
    - `noise_scales`, `noise_prior`: the stated standard deviations may be too small by one of these
      factors, as those of any identification may; without it such noise would be named a move.
    - `negligible_fraction`: a shift within it counts as unchanged.
    - `named_from`: the probability from which an explanation is named.
    """

    window_days: float = 30.0
    prior: MappingProxyType[ExplanationName, float] = field(
        default_factory=lambda: MappingProxyType(_PRIOR)
    )
    sizes_fraction: tuple[float, ...] = (0.01, 0.03, 0.1, 0.3)
    nearest_share: float = 0.35
    next_share: float = 0.15
    share_concentration: float = 5.0
    two_hangers: float = 0.2
    scatter_fraction: float = 0.001
    common_scatter_fraction: float = 0.002
    noise_scales: tuple[float, ...] = (1.0, 1.5, 2.25)
    noise_prior: tuple[float, ...] = (0.7, 0.2, 0.1)
    negligible_fraction: float = 0.005
    named_from: float = 0.8


@dataclass(frozen=True)
class Explanation:
    """One explanation of all shifts together; the probabilities of a pattern's five add to 1."""

    name: ExplanationName
    probability: float


@dataclass(frozen=True)
class Suspect:
    """The hangers (one or two) that shed or gained load, if any did.

    `probability` is given all the data, all explanations admitted; `shift_n` and `shift_sd_n` hold
    the shift of each if it is they, in which their neighbours have a say.
    """

    name: ExplanationName
    hangers: tuple[int, ...]
    probability: float
    shift_n: tuple[float, ...]
    shift_sd_n: tuple[float, ...]


@dataclass(frozen=True)
class HangerRow:
    """One hanger: its shift as measured, with 90 % interval, and which way it moved.

    `probability` is that of `way`, all explanations weighed; a shift of all hangers alike counts as
    a move too. Fractions are of the baseline tension.
    """

    hanger: int
    place: int
    position_m: float
    time: datetime
    baseline_n: float
    shift_n: float
    low_n: float
    high_n: float
    shift_fraction: float
    low_fraction: float
    high_fraction: float
    way: Way
    probability: float
    gained_probability: float
    lost_probability: float


@dataclass(frozen=True)
class SumKept:
    """Whether the tensions of `hangers` add to what they did.

    `probability` is that of the explanations which keep the sum. `complete` is false where a hanger
    among them has no shift, or where the bridge's end may have taken a share.
    """

    hangers: tuple[int, ...]
    sum_n: float
    sum_sd_n: float
    probability: float
    complete: bool


@dataclass(frozen=True)
class NotCompared:
    """A hanger that the pattern leaves out, and why; `time` is None where it has no test."""

    hanger: int
    place: int
    time: datetime | None
    why: str


@dataclass(frozen=True)
class BridgePattern:
    """What moved over the bridge: five explanations, the likeliest first, and each hanger.

    `suspects` are the likeliest hangers to have shed or gained load. `alike_fraction` and its sd
    are the common shift if all moved alike, and `alike_cause` what that would be put down to.
    `sentence` says it to the owner.
    """

    newest: datetime
    explanations: tuple[Explanation, ...]
    suspects: tuple[Suspect, ...]
    rows: tuple[HangerRow, ...]
    sum_kept: SumKept
    alike_fraction: float
    alike_sd: float
    alike_cause: str
    not_compared: tuple[NotCompared, ...]
    sentence: str
    remarks: tuple[str, ...] = ()

    def probability(self, name: ExplanationName) -> float:
        """The probability of one explanation."""
        return next(each.probability for each in self.explanations if each.name == name)
