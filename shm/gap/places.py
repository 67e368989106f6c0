"""Local causes of a gap: one effect of the catalogue at places along the hanger, its likeliest size
at each, and what it does.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from shm.gap.contract import Fit, Hypothesis
from shm.gap.misfit import Change, Misfit
from shm.gap.problem import GapProblem
from shm.models.effects import EFFECTS, Effect, Parameter, parameters_of
from shm.values import BoolArray, FloatArray

_SMALL_SHARE = 0.25  # of a size's range, in which effects are linear still and well above rounding
_EXTENT = 0.05  # judgement: of the length, a corroded stretch: shorter than half a wave of any mode
_END = "rotational_end_flexibility"
# Technical: a size of 0 has no slope; slopes by a change of 5 %; a step that led up is tried anew
# at less than half. They cost passes and change no optimum.
_SMALLEST_SHARE, _FURTHER, _SHORTER = 1e-2, 1.05, 0.3


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
    return tuple(_anywhere(problem, each) for each in EFFECTS.values() if each.localised_as)


def flexible_ends(problem: GapProblem) -> tuple[LocalCause, ...]:
    """The ends that are clamped, each turning alike in all planes that were measured."""
    return tuple(_flexible_end(problem, end) for end in problem.hanger.supports.ends("clamped"))


def _anywhere(problem: GapProblem, effect: Effect) -> LocalCause:
    survey = problem.observations.design.survey
    hypothesis = Hypothesis(((effect.name, effect.variants(problem.hanger, survey)[0]),))
    size = _size(problem, hypothesis)
    small = float(size.value(np.array(_SMALL_SHARE)))
    return LocalCause(effect.localised_as, hypothesis, np.zeros(0), small, size.upper)


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


@dataclass(frozen=True, eq=False)
class _State:
    """Sizes (n,) of a cause and the parameters z (n, p) of the misfit with them, what they leave
    (n,), and the change about them."""

    size: FloatArray
    z: FloatArray
    left: FloatArray
    change: Change

    def better_of(self, other: _State) -> tuple[_State, BoolArray]:
        """Place by place the state that leaves less, and where it is `other`."""
        better = other.left < self.left
        rows = better[:, None]
        change = Change(
            np.where(rows, other.change.deviation, self.change.deviation),
            np.where(rows, other.change.per_size, self.change.per_size),
            self.change.largest,
        )
        size, left = (
            np.where(better, getattr(other, name), getattr(self, name)) for name in ("size", "left")
        )
        return _State(size, np.where(rows, other.z, self.z), left, change), better


def tried(
    problem: GapProblem, before: Fit, misfit: Misfit, cause: LocalCause, passes: int
) -> Change:
    """The cause at its places, linear about its likeliest size and the baseline that goes with it.

    A large gap has driven the baseline's fit far off, so the prediction is made anew there in each
    of the `passes`, and a step that does not lower the misfit is shortened.
    """
    state = _without(problem, before, misfit, cause)
    length = np.ones(len(cause.places_m))
    for _ in range(passes):
        wanted = np.maximum(state.change.sizes(misfit), _SMALLEST_SHARE * cause.small)
        rest = state.change.deviation - wanted[:, None] * state.change.per_size
        size = state.size + length * (wanted - state.size)
        step = misfit.parameters(rest) - state.z
        try:
            moved = _at(problem, misfit, cause, state.z + length[:, None] * step, size)
        except np.linalg.LinAlgError:
            # So stiff that rounding leaves the model no modes: no step down.
            moved = replace(state, left=np.full(len(size), np.inf))
        state, better = state.better_of(moved)
        length = np.where(better, 1.0, _SHORTER * length)
    return state.change


def _without(problem: GapProblem, before: Fit, misfit: Misfit, cause: LocalCause) -> _State:
    """No cause yet, but what a small one would do."""
    count = len(cause.places_m)
    z = np.zeros((count, misfit.slopes.shape[1]))
    z[:, : misfit.own] = before.z
    small = cause.predicted(problem, z[:, : misfit.own], np.full(count, cause.small))
    per_size = (small - before.predicted)[:, misfit.rows] / cause.small
    change = Change(np.repeat(misfit.deviation[None], count, axis=0), per_size, cause.largest)
    left = misfit.at(before.predicted[misfit.rows][None], z)
    return _State(np.zeros(count), z, left, change)


def _at(
    problem: GapProblem,
    misfit: Misfit,
    cause: LocalCause,
    z: FloatArray,
    size: FloatArray,
) -> _State:
    here, further = (
        cause.predicted(problem, z[:, : misfit.own], each)[:, misfit.rows] + misfit.repeated(z)
        for each in (size, _FURTHER * size)
    )
    per_size = (further - here) / ((_FURTHER - 1) * size[:, None])
    expected = z @ misfit.slopes.T + size[:, None] * per_size
    change = Change(misfit.value - here + expected, per_size, cause.largest)
    return _State(size, z, misfit.at(here, z), change)
