"""What a score is: which cases it is asked of, what enters, and the bounds that it must keep."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal, get_args

import numpy as np

from shm.blind.scoring.estimates import Estimator, Samples
from shm.values import MIX, CaseScore, MarkName, PlantedKind, Richness

Asks = Callable[[CaseScore], bool]
Value = Callable[[CaseScore], float]

LEAST_PROBABILITY = 1e-4
"""No probability counts for less in the log score: a pair that was not tried has none."""
# Judgement, to the harm of who does not answer: a tension that is all wrong, next to no error that
# he could have shrunk, and a misfit that has grown tenfold.
_FAILED_PERCENT, _UNKNOWN_PERCENT, _FAILED_RATIO = 100.0, 0.01, 10.0


@dataclass(frozen=True)
class Bounds:
    """From where to where a score is right; infinite: no bound."""

    lower: float = -math.inf
    upper: float = math.inf


def at_least(lower: float) -> Bounds:
    return Bounds(lower=lower)


def at_most(upper: float) -> Bounds:
    return Bounds(upper=upper)


def every(bounds: Bounds) -> dict[Richness, Bounds]:
    """The same bounds at every richness."""
    return dict.fromkeys(get_args(Richness), bounds)


@dataclass(frozen=True)
class Question:
    """One score of the cases that `asks` lets through and whose planted size is above `above`.

    Cases without any effect have no size and are not held back by it. `samples` makes figures of
    the cases, `estimate` the score of the figures. `overall` bounds it over all cases, `each` by
    richness. `better` is the sign of what is better, and 0 where the way of a case is no matter.
    """

    name: MarkName
    asks: Asks
    samples: Callable[[Sequence[CaseScore]], Samples]
    estimate: Estimator
    overall: Bounds = Bounds()
    each: Mapping[Richness, Bounds] = field(default_factory=dict)
    better: Literal[-1, 0, 1] = 0
    above: float = 0.0
    round: Literal["first", "left out"] = "first"

    def of(self, cases: Sequence[CaseScore]) -> list[CaseScore]:
        """The cases that it is asked of."""
        large = [case for case in cases if case.kind == "none" or case.size > self.above]
        return [case for case in large if self.asks(case)]


def figures(*values: Value) -> Callable[[Sequence[CaseScore]], Samples]:
    """One array for each of `values`."""
    return lambda cases: tuple(
        np.array([float(value(case)) for case in cases], dtype=float) for value in values
    )


def mixed(value: Value) -> Callable[[Sequence[CaseScore]], Samples]:
    """Weights that restore the mix of kinds, and values; nothing where a kind is missing."""

    def samples(cases: Sequence[CaseScore]) -> Samples:
        counts = {kind: sum(case.kind == kind for case in cases) for kind in MIX}
        if not all(counts.values()):
            return np.zeros(0), np.zeros(0)
        weight = [MIX[case.kind] / counts[case.kind] for case in cases]
        return np.array(weight), np.array([value(case) for case in cases])

    return samples


def everything(case: CaseScore) -> bool:
    return True


def planted(case: CaseScore) -> bool:
    return case.kind != "none"


def known(case: CaseScore) -> bool:
    """Whether what was planted is in the catalogue."""
    return case.kind in ("one", "two")


def of_kind(kind: PlantedKind) -> Asks:
    return lambda case: case.kind == kind


def log_score(case: CaseScore) -> float:
    """In natural logarithms (Good 1952), 0 the best."""
    return -math.log(max(case.truth_probability, LEAST_PROBABILITY))


def leading(case: CaseScore) -> float:
    """The leading probability; a failure counts as a sure answer that is wrong."""
    return 1.0 if case.failure else case.leading_probability


def before_percent(case: CaseScore) -> float:
    """The error of the baseline's tension; next to none where it is unknown: no flattery."""
    error = case.tension_error_before
    return 100 * abs(error) if math.isfinite(error) else _UNKNOWN_PERCENT


def after_percent(case: CaseScore) -> float:
    """The error of the answer's tension; 100 where there is none."""
    error = case.tension_error_after
    return 100 * abs(error) if math.isfinite(error) else _FAILED_PERCENT


def held_out(case: CaseScore) -> float:
    """The ratio of held-out errors; ten times worse where the answer failed."""
    return _FAILED_RATIO if case.failure else case.held_out_ratio
