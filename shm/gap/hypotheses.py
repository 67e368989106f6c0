"""The single effects that these data could show, each at each place where it may act."""

from __future__ import annotations

from shm.errors import UsageError
from shm.gap.contract import Hypothesis
from shm.gap.problem import GapProblem
from shm.models.effects import EFFECTS

IN_BASELINE = {
    "beam2": ("rotational_end_flexibility",),
    "solid1": ("rotational_end_flexibility", "translational_end_flexibility"),
    "solid2": ("rotational_end_flexibility",),
}
"""Effects that a baseline class has as parameters of its own."""


def hypotheses(problem: GapProblem, without: tuple[str, ...] = ()) -> tuple[Hypothesis, ...]:
    """Baseline + one effect, for every variant, in the order of the catalogue.

    Left out are the effects `without`, those that the baseline has itself and those that these
    data cannot show. Raises UsageError for a name that is not in the catalogue.
    """
    unknown = sorted(set(without) - set(EFFECTS))
    if unknown:
        raise UsageError(
            f"No effect is called {', '.join(unknown)}. The catalogue has {', '.join(EFFECTS)}."
        )
    survey = problem.observations.design.survey
    return tuple(
        Hypothesis(((name, variant),))
        for name, effect in EFFECTS.items()
        if name not in without and name not in invisible(problem)
        for variant in effect.variants(problem.hanger, survey)
    )


def invisible(problem: GapProblem) -> dict[str, str]:
    """The effects that cannot be told from the baseline, and why in a sentence each."""
    survey = problem.observations.design.survey
    reasons = {name: each.invisible(problem.hanger, survey) for name, each in EFFECTS.items()}
    for name in IN_BASELINE.get(problem.baseline, ()):
        reasons[name] = f"The baseline {problem.baseline} has it as parameters of its own."
    return {name: reason for name, reason in reasons.items() if reason}
