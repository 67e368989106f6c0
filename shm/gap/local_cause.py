"""Local causes of a gap: one effect of the catalogue, its size, and places to try it at."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from shm.gap.contract import Hypothesis
from shm.gap.problem import GapProblem
from shm.models.effects import EFFECTS, Parameter, parameters_of
from shm.values import FloatArray

_SMALL_SHARE = 0.25
_EXTENT = 0.05
_KINDS = {
    "point_mass": "point mass",
    "intermediate_support": "lateral spring",
    "section_loss": "section loss",
}
_END = "rotational_end_flexibility"


@dataclass(frozen=True, eq=False)
class LocalCause:
    """A `kind` of cause at `places_m` (n,), all of one `hypothesis`.

    Its size counts from 0 (no cause) in the effect's unit, that of a spring at an end as a
    compliance. `small` is a size whose effect is of first order, `largest` the catalogue's.
    """

    kind: str
    hypothesis: Hypothesis
    places_m: FloatArray
    small: float
    largest: float

    def at(self, places_m: FloatArray) -> LocalCause:
        return replace(self, places_m=places_m)

    def predicted(self, problem: GapProblem, baseline: FloatArray, size: FloatArray) -> FloatArray:
        """The data (n, data) with sizes (n,), and the baseline's parameters at z (n, d)."""
        theta = problem.theta(Hypothesis(), baseline)
        return problem.predict_at(
            self.hypothesis, np.concatenate([theta, self._values(problem, size)], axis=1)
        )

    def _values(self, problem: GapProblem, size: FloatArray) -> FloatArray:
        """The effect's parameters (n, parameters)."""
        ((name, variant),) = self.hypothesis.effects
        if name == _END:
            return np.repeat(-np.log10(size)[:, None], len(variant.planes), axis=1)
        extent_m = np.full(len(size), _EXTENT * problem.hanger.length_m)
        values = {"x_m": self.places_m, "extent_m": extent_m}
        own = parameters_of(name, problem.hanger, variant)
        return np.stack([size, *(values[each.name] for each in own[1:])], axis=1)


def local_causes(problem: GapProblem) -> tuple[LocalCause, ...]:
    """Those that may sit anywhere, in all planes that were measured."""
    return tuple(_anywhere(problem, name, kind) for name, kind in _KINDS.items())


def flexible_ends(problem: GapProblem) -> tuple[LocalCause, ...]:
    """The ends that are clamped, each turning alike in all planes that were measured."""
    return tuple(_flexible_end(problem, end) for end in problem.hanger.supports.ends("clamped"))


def _anywhere(problem: GapProblem, name: str, kind: str) -> LocalCause:
    survey = problem.observations.design.survey
    hypothesis = Hypothesis(((name, EFFECTS[name].variants(problem.hanger, survey)[0]),))
    size = _size(problem, hypothesis)
    small = float(size.value(np.array(_SMALL_SHARE)))
    return LocalCause(kind, hypothesis, np.zeros(0), small, size.upper)


def _flexible_end(problem: GapProblem, end: int) -> LocalCause:
    survey = problem.observations.design.survey
    variants = EFFECTS[_END].variants(problem.hanger, survey)
    variant = next(each for each in variants if each.ends == (end,))
    hypothesis = Hypothesis(((_END, variant),))
    stiffness = _size(problem, hypothesis)
    small = 10.0 ** -float(stiffness.value(np.array(1 - _SMALL_SHARE)))
    place_m = np.array([end * problem.hanger.length_m])
    return LocalCause("flexible end", hypothesis, place_m, small, 10.0**-stiffness.lower)


def _size(problem: GapProblem, hypothesis: Hypothesis) -> Parameter:
    ((name, variant),) = hypothesis.effects
    return parameters_of(name, problem.hanger, variant)[0]
