"""Values of a joint gap diagnosis of several hangers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from shm.values.diagnosis import Diagnosis, EffectEstimate, TensionEstimate
from shm.values.leading import MIN_NO_GAP_PROBABILITY, find_leading_cause, sum_group_probability

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
    """Diagnosis of a cause shared by hangers of a bridge: its probability, members and effect.

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
        """Return the probability of a cause and of those that the data cannot tell from it."""
        return sum_group_probability(cause, self.causes)

    @property
    def leads(self) -> BridgeLeads:
        """Return whether a shared cause leads, none is shared, or a shared unknown leads."""
        if self.leading is not None:
            return "shared cause"
        is_shared = self.each_for_itself_probability < MIN_NO_GAP_PROBABILITY
        return "shared unknown" if is_shared else "each for itself"

    @property
    def leading(self) -> SharedCause | None:
        """Return the most probable cause of the most probable group; None where none leads."""
        return find_leading_cause(
            self.each_for_itself_probability, self.unknown_probability, self.causes
        )
