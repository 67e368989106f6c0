"""A local cause tried at places along the hanger: its likeliest size at each, and what it does."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shm.gap.contract import Fit
from shm.gap.local_cause import LocalCause
from shm.gap.misfit import Change, Misfit
from shm.gap.problem import GapProblem
from shm.values import BoolArray, FloatArray

_SMALLEST_SHARE = 1e-2
_FURTHER = 1.05
_SHORTER = 0.3


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
        moved = _at(problem, misfit, cause, state.z + length[:, None] * step, size)
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
