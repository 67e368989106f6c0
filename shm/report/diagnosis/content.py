"""What the page of a gap diagnosis is made from, and which explanation it may claim."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from shm.values import Cause, Diagnosis, Residual

_LIKELIER_THAN_NOT = 0.5


class Answer(Enum):
    """What a diagnosis says, in two or three words."""

    EXPLAINED = "Explained"
    ALIKE = "Explained, causes alike"
    NO_GAP = "No gap"
    UNEXPLAINED = "Not explained"
    UNDECIDED = "Undecided"


@dataclass(frozen=True)
class Claim:
    """One cause, or the causes that these data cannot tell apart, likeliest first."""

    causes: tuple[Cause, ...]

    @property
    def probability(self) -> float:
        return sum(cause.probability for cause in self.causes)

    @property
    def leading(self) -> Cause:
        return self.causes[0]


def claims(diagnosis: Diagnosis) -> tuple[Claim, ...]:
    """The causes, those of a group together, likeliest first."""
    together: dict[str, list[Cause]] = {}
    for cause in sorted(diagnosis.causes, key=lambda cause: -cause.probability):
        key = cause.effect if cause.group is None else f"group {cause.group}"
        together.setdefault(key, []).append(cause)
    found = [Claim(tuple(causes)) for causes in together.values()]
    return tuple(sorted(found, key=lambda claim: -claim.probability))


def claimed(diagnosis: Diagnosis) -> Claim | None:
    """The likeliest claim; None where no gap or something unknown is likelier than each."""
    leading = diagnosis.leading
    return next((claim for claim in claims(diagnosis) if claim.leading is leading), None)


def answer(diagnosis: Diagnosis) -> Answer:
    """What the diagnosis says; undecided where nothing is likelier than not."""
    claim = claimed(diagnosis)
    if claim is not None:
        sure, said = claim.probability, Answer.EXPLAINED if len(claim.causes) == 1 else Answer.ALIKE
    elif diagnosis.leads == "no gap":
        sure, said = diagnosis.no_gap_probability, Answer.NO_GAP
    else:
        sure, said = diagnosis.unexplained_probability, Answer.UNEXPLAINED
    return said if sure >= _LIKELIER_THAN_NOT else Answer.UNDECIDED


def is_set_aside(diagnosis: Diagnosis, residual: Residual) -> bool:
    """Whether a frequency was taken for a gross error."""
    named = [(each.plane, each.order, each.test) for each in diagnosis.outliers]
    return (residual.plane, residual.order, residual.test) in named
