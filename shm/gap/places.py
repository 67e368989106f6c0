"""Where along the hanger a local cause would have to sit, from the pattern over modes and shapes.

One local change is tried at many places; its size and the baseline's parameters follow by least
squares, to first order and then once more at the size found (Cawley and Adams 1979 compare patterns
in the same way).
"""

from __future__ import annotations

import numpy as np

from shm.gap.contract import Fit
from shm.gap.local_cause import LocalCause, flexible_ends, local_causes
from shm.gap.misfit import Misfit
from shm.gap.problem import GapProblem
from shm.gap.tried import tried
from shm.values import FloatArray, GapPlace

_PLACES_A_HALF_WAVE = 5
_FEWEST_PLACES = 31
_PASSES = 2
_PASSES_OF_AN_END = 16
_FINE = 1440
_BINS = 180
_LEAST_GAIN = 6.0
_OUTSIDE = 0.05


def places(problem: GapProblem, before: Fit) -> tuple[GapPlace, ...]:
    """For each kind of local cause where it would have to sit; that which explains most first.

    Kinds are `point mass`, `lateral spring`, `section loss` and `flexible end`, whose profile
    holds the two ends with their probabilities. Kinds that explain no more than noise would are
    absent. A profile is the likelihood of the likeliest size at each place, scaled to a density
    (means over 180 stretches).
    What a kind leaves unexplained counts as noise, so that a kind that does not fit does not claim
    to know its place. Where two places explain the data alike, as x and L - x do of a hanger with
    like ends whose shapes were not measured, the profile has both and the interval spans both.
    """
    misfit = Misfit.of(problem, before)
    found = [_place(problem, before, misfit, cause) for cause in local_causes(problem)]
    found.append(_end(problem, before, misfit))
    return tuple(sorted((each for each in found if each), key=lambda place: -place.share))


def _place(problem: GapProblem, before: Fit, misfit: Misfit, cause: LocalCause) -> GapPlace | None:
    length_m = problem.hanger.length_m
    half_waves = int(problem.observations.design.frequency_order.max())
    x_m = np.linspace(0, length_m, max(_PLACES_A_HALF_WAVE * half_waves + 1, _FEWEST_PLACES))
    fine_m = (np.arange(_FINE) + 0.5) * length_m / _FINE
    change = tried(problem, before, misfit, cause.at(x_m), _PASSES).between(x_m, fine_m)
    found = _judged(misfit, change.left(misfit))
    if found is None:
        return None
    probability, share = found
    low_m, high_m = np.interp([_OUTSIDE, 1 - _OUTSIDE], probability.cumsum(), fine_m)
    density = probability.reshape(_BINS, -1).sum(axis=1) * _BINS / length_m
    middles_m = fine_m.reshape(_BINS, -1).mean(axis=1)
    profile = tuple(zip(middles_m.tolist(), density.tolist(), strict=True))
    likeliest_m = float(fine_m[probability.argmax()])
    return GapPlace(cause.kind, likeliest_m, float(low_m), float(high_m), share, profile)


def _end(problem: GapProblem, before: Fit, misfit: Misfit) -> GapPlace | None:
    """The end that would have to turn."""
    ends = flexible_ends(problem)
    if not ends:
        return None
    changes = [tried(problem, before, misfit, end, _PASSES_OF_AN_END) for end in ends]
    found = _judged(misfit, np.concatenate([change.left(misfit) for change in changes]))
    if found is None:
        return None
    probability, share = found
    x_m = np.concatenate([end.places_m for end in ends])
    possible = x_m[probability >= 2 * _OUTSIDE]
    profile = tuple(zip(x_m.tolist(), probability.tolist(), strict=True))
    likeliest_m = float(x_m[probability.argmax()])
    low_m, high_m = float(possible.min()), float(possible.max())
    return GapPlace(ends[0].kind, likeliest_m, low_m, high_m, share, profile)


def _judged(misfit: Misfit, left: FloatArray) -> tuple[FloatArray, float] | None:
    """Probabilities (n,) of places that leave a chi-square `left` (n,), and the share that the
    best of them explains; None where noise alone would explain as much."""
    log_likelihood = misfit.log_likelihood(left)
    if 2 * log_likelihood.max() < _LEAST_GAIN:
        return None
    probability = np.exp(log_likelihood - log_likelihood.max())
    return probability / probability.sum(), 1 - float(left.min()) / misfit.total
