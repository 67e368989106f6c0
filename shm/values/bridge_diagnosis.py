"""What a joint diagnosis of several hangers finds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from shm.values.diagnosis import NO_GAP_STANDS_FROM, Diagnosis, EffectEstimate, TensionEstimate

BridgeLeads = Literal["shared cause", "each for itself", "shared unknown"]


@dataclass(frozen=True)
class SharedMember:
    """One hanger of a family: the probability that it has the shared cause, and of which size."""

    hanger: int
    probability: float
    size: EffectEstimate


@dataclass(frozen=True)
class SharedCause:
    """One effect of the catalogue as a cause that several hangers have in common.

    `at` is where it likeliest acts, `also_at` are places about as likely. `log_bayes_factor`
    compares it with each hanger having causes of its own, averaged over places and families.
    `likeness` says what the hangers of the likeliest family have in common, `family` which they
    are; `members` holds each with its probability. `size` is that of the whole family, `scatter`
    by which fraction its members differ (of the range, where a size has no scale of its own).
    `group` is the index of the group of causes that the data cannot tell apart, None for none.
    """

    effect: str
    at: str
    probability: float
    log_bayes_factor: float
    likeness: str
    family: tuple[int, ...]
    members: tuple[SharedMember, ...]
    size: EffectEstimate
    scatter: float
    group: int | None = None
    also_at: tuple[str, ...] = ()

    @property
    def named(self) -> tuple[int, ...]:
        """The hangers that likelier have it than not."""
        return tuple(each.hanger for each in self.members if each.probability > 0.5)


@dataclass(frozen=True)
class HangerTensions:
    """The tension of a hanger by the baseline, by its own diagnosis, and by that of the bridge."""

    hanger: int
    before_n: TensionEstimate
    alone_n: TensionEstimate
    jointly_n: TensionEstimate


@dataclass(frozen=True)
class BridgeDiagnosis:
    """Whether hangers of a bridge share a cause, which, who has it, and what that changes.

    The probabilities of `causes` (best first), `each_for_itself_probability` and
    `unknown_probability` (something that the catalogue lacks is shared) add to 1. `groups` are
    causes that the data cannot tell apart. `diagnoses` are those of each hanger alone.
    """

    baseline: str
    hangers: tuple[int, ...]
    each_for_itself_probability: float
    unknown_probability: float
    causes: tuple[SharedCause, ...]
    groups: tuple[tuple[str, ...], ...]
    tensions: tuple[HangerTensions, ...]
    diagnoses: tuple[Diagnosis, ...]
    left_out: tuple[str, ...]
    seed: int
    seconds: float

    def claim(self, cause: SharedCause) -> float:
        """The probability of a cause together with those that the data cannot tell it from."""
        if cause.group is None:
            return cause.probability
        return sum(each.probability for each in self.causes if each.group == cause.group)

    @property
    def leads(self) -> BridgeLeads:
        """What it says. As with no gap, sharing is not shown while its absence keeps 0.05."""
        if self.each_for_itself_probability >= NO_GAP_STANDS_FROM:
            return "each for itself"
        claim = max((self.claim(cause) for cause in self.causes), default=0.0)
        return "shared cause" if claim > self.unknown_probability else "shared unknown"

    @property
    def leading(self) -> SharedCause | None:
        """The likeliest cause of the likeliest group; None where no shared cause leads."""
        if self.leads != "shared cause":
            return None
        return max(self.causes, key=lambda cause: (self.claim(cause), cause.probability))
