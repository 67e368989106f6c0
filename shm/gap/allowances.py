"""How far the laws of a hypothesis' effects may be off, and how likely that is."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from shm.gap.contract import Design, Fit, Hypothesis
from shm.gap.flexible import alike_in_planes, smooth_over_orders
from shm.gap.noise import same_mode
from shm.gap.problem import GapProblem
from shm.models.effects import EFFECTS
from shm.values import FloatArray, IntArray


class Share(NamedTuple):
    """Prior probabilities: that an effect's own law is off by so much, and that something unknown
    is that passes for it."""

    own: float
    unknown: float


EXACT = Share(0.45, 0.17)
FRACTIONS = {
    0.003: Share(0.2, 0.18),
    0.03: Share(0.1, 0.11),
    0.1: Share(0.05, 0.05),
    0.2: Share(0.015, 0.06),
    0.4: Share(0.005, 0.16),
}
"""How often an effect's law is off by such a fraction of what it does to a mode; as likely from
mode to mode as smooth over the orders. What is not in the catalogue but passes for an effect is off
by more. Shares as found in blind trials: of effects that were planted, and of effects that took the
blame for others, which had been left out."""
FRACTIONS_ON_THE_WHOLE = {
    0.01: Share(0.12, 0.13),
    0.03: Share(0.045, 0.08),
    0.1: Share(0.015, 0.06),
}
"""The same of what the effect does to the modes of a test and plane on the whole."""
ROUGH = 0.5
"""How often the law of an effect that goes with the level is only roughly known: a level is one
number of a test, while every mode rings at its own and dies away at its own pace. So it is for what
passes for such an effect."""
FRACTIONS_WHERE_ROUGH = {0.1: 0.3, 0.2: 0.35, 0.4: 0.35}
"""How often it then is off by such a fraction of what the effect does to a mode."""


class Allowance(NamedTuple):
    """By how much data are off (data,), how frequencies go together (F, F), how likely that is."""

    off: FloatArray
    alike: FloatArray
    share: Share


def allowances(problem: GapProblem, baseline: Fit, fit: Fit) -> list[Allowance]:
    """For the laws of a fit's effects; with `exactly`, their shares add to 1."""
    design, shift = problem.design, fit.predicted - baseline.predicted
    whole = _on_the_whole(design, shift)
    off = [(fraction * shift, share) for fraction, share in FRACTIONS.items()]
    off += [(fraction * whole, share) for fraction, share in FRACTIONS_ON_THE_WHOLE.items()]
    in_a_plane = same_mode(design), smooth_over_orders(design)
    if not _with_level(fit.hypothesis):
        return list(_each(off, in_a_plane))
    raised = _by_levels(problem, fit)
    by_level = [(f * raised, Share(ROUGH * s, ROUGH * s)) for f, s in FRACTIONS_WHERE_ROUGH.items()]
    off = [(error, _unless_rough(share)) for error, share in off]
    return [*_each(off, in_a_plane), *_each(by_level, (*in_a_plane, alike_in_planes(design)))]


def exactly(hypothesis: Hypothesis) -> Share:
    """How likely it is that the laws of a hypothesis' effects are exact."""
    return _unless_rough(EXACT) if _with_level(hypothesis) else EXACT


def _unless_rough(share: Share) -> Share:
    return Share(*((1 - ROUGH) * each for each in share))


def _each(
    off: Sequence[tuple[FloatArray, Share]], orders: Sequence[FloatArray]
) -> Iterator[Allowance]:
    """By how much data may be off with every way to go together, all ways as likely."""
    for error, share in off:
        for alike in orders:
            yield Allowance(error, alike, Share(*(each / len(orders) for each in share)))


def _with_level(hypothesis: Hypothesis) -> bool:
    return any(_goes_with_level(name) for name, _ in hypothesis.effects)


def _goes_with_level(name: str) -> bool:
    return "amplitude" in EFFECTS[name].follows


def _by_levels(problem: GapProblem, fit: Fit) -> FloatArray:
    """What a fit's effects that go with the level do to its prediction (data,)."""
    names = [name for name, _ in fit.hypothesis.effects]
    others = [index for index, name in enumerate(names) if not _goes_with_level(name)]
    return np.asarray(fit.predicted - problem.predicted_with(fit, others))


def _on_the_whole(design: Design, shift: FloatArray) -> FloatArray:
    """Root mean squares of a shift (data,) over each test and plane, and over each shape."""
    count = design.frequencies
    planes = 1 + int(design.frequency_plane.max())
    return np.concatenate(
        [
            _root_mean_square(
                design.frequency_test * planes + design.frequency_plane, shift[:count]
            ),
            _root_mean_square(design.shape_mode, shift[count:]),
        ]
    )


def _root_mean_square(group: IntArray, values: FloatArray) -> FloatArray:
    """Of the values (n,) of each group, given to each of its members."""
    mean = np.bincount(group, values**2) / np.maximum(np.bincount(group), 1)
    return np.asarray(np.sqrt(mean)[group])
