"""Locate the place of a local cause along the hanger from the pattern over modes and shapes.

One local change is tried at many places; its size and the baseline's parameters follow by least
squares, to first order and then once more at the size found (Cawley and Adams 1979 compare patterns
in the same way).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy

from shm.gap.contract import Fit, Hypothesis
from shm.gap.problem import GapProblem
from shm.gap.residuals import identification_sd
from shm.inference.mixture import Rows
from shm.models.effects import EFFECTS, Effect, Parameter, parameters_of
from shm.values import FloatArray, GapPlace

# Judgement: where no standard deviation is stated, the one that is estimated may be four times too
# large (1 / 4.5^2 = 0.05), and data may rightly fit so well.
_LEAST_SCALE = 0.05


@dataclass(frozen=True, eq=False)
class Misfit:
    """The baseline's misfit, with its free parameters and errors together as one covariance.

    `value` (data,) are the data with errors `sd`, `deviation` (data,) is theirs from the middle of
    the prior, to first order; `slopes` (data, p) are those of the baseline's own `n_parameters` and
    then, as further parameters z, of the errors that repeat; `weighted` is the same over `sd`,
    `inner` (p, p) the covariance of all p. `least_scale` is the least chi-square of a datum that is
    taken for noise.
    """

    value: FloatArray
    sd: FloatArray
    deviation: FloatArray
    slopes: FloatArray
    weighted: FloatArray
    inner: FloatArray
    n_parameters: int
    least_scale: float

    @classmethod
    def of(cls, problem: GapProblem, before: Fit) -> Misfit:
        observations, sd = problem.observations, identification_sd(problem, before)
        slopes = np.column_stack([before.slopes, problem.repeated.loads])
        weighted = slopes / sd[:, None]
        return cls(
            value=observations.value,
            sd=sd,
            deviation=observations.value - before.predicted + before.slopes @ before.z,
            slopes=slopes,
            weighted=weighted,
            inner=np.asarray(np.linalg.inv(np.eye(slopes.shape[1]) + weighted.T @ weighted)),
            n_parameters=len(before.z),
            least_scale=1.0 if np.isfinite(observations.sd).any() else _LEAST_SCALE,
        )

    def products(self, one: FloatArray, other: FloatArray) -> FloatArray:
        """Products (n,) of rows (n, data) by the inverse covariance (Woodbury's identity)."""
        one, other = one / self.sd, other / self.sd
        left, right = one @ self.weighted, other @ self.weighted
        products = np.einsum("ij,ij->i", one, other)
        return np.asarray(products - np.einsum("ij,ij->i", left @ self.inner, right))

    def parameters(self, deviation: FloatArray) -> FloatArray:
        """Return the likeliest parameters z (n, p) for deviations (n, data)."""
        return np.asarray((deviation / self.sd) @ self.weighted @ self.inner)

    @property
    def total(self) -> float:
        """The chi-square of the baseline."""
        return float(self.products(self.deviation[None], self.deviation[None])[0])

    def repeated(self, z: FloatArray) -> FloatArray:
        """Return what repeated errors add to predictions (n, data) at parameters z (n, p)."""
        return np.asarray(z[:, self.n_parameters :] @ self.slopes[:, self.n_parameters :].T)

    def at(self, predicted: FloatArray, z: FloatArray) -> FloatArray:
        """Return the chi-square (n,) of predictions (n, data) at parameters z (n, p)."""
        error = (self.value - predicted) / self.sd
        return np.asarray((error**2).sum(axis=1) + (z**2).sum(axis=1))

    def log_likelihood(self, chi_square: FloatArray) -> FloatArray:
        """Of causes that leave `chi_square` (n,), relative to none at all.

        What the best of them leaves counts as noise.
        """
        rest = chi_square.min() / max(len(self.value) - 2, 1)
        return np.asarray((self.total - chi_square) / (2 * max(rest, self.least_scale)))


@dataclass(frozen=True, eq=False)
class Change(Rows):
    """Changes of the data by a cause at n places.

    `per_size` (n, data) is that of a size of 1, `deviation` (n, data) that of the data, as in
    Misfit, from what is expected without the cause.
    """

    deviation: FloatArray
    per_size: FloatArray
    largest: float

    def sizes(self, misfit: Misfit) -> FloatArray:
        """Return the likeliest sizes (n,), up to the largest, the baseline's parameters free."""
        square = misfit.products(self.per_size, self.per_size)
        along = misfit.products(self.per_size, self.deviation)
        with np.errstate(over="ignore"):  # a cause that does nothing has no size
            sizes = along / np.maximum(square, np.finfo(float).tiny)
        return np.clip(sizes, 0.0, self.largest)

    def left(self, misfit: Misfit) -> FloatArray:
        """The chi-square (n,) that the likeliest sizes leave."""
        rest = self.deviation - self.sizes(misfit)[:, None] * self.per_size
        return misfit.products(rest, rest)

    def between(self, x_m: FloatArray, fine_m: FloatArray) -> Change:
        """The same at places between those tried, `x_m` (n,)."""
        deviation, per_size = scipy.interpolate.CubicSpline(
            x_m, [self.deviation, self.per_size], axis=1
        )(fine_m)
        return Change(deviation, per_size, self.largest)


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

    def predicted(self, problem: GapProblem, baseline: FloatArray, size: FloatArray) -> FloatArray:
        """The data (n, data) with sizes (n,), and the baseline's parameters at z (n, d)."""
        return problem.predict_with_effect(self.hypothesis, baseline, self._values(problem, size))

    def _values(self, problem: GapProblem, size: FloatArray) -> FloatArray:
        """The effect's parameters (n, parameters)."""
        ((name, variant),) = self.hypothesis.effects
        if name == _END:
            return np.repeat(-np.log10(size)[:, None], len(variant.planes), axis=1)
        extent_m = np.full(len(size), _EXTENT * problem.hanger.length_m)
        values = {"x_m": self.places_m, "extent_m": extent_m}
        parameters = parameters_of(name, problem.hanger, variant)
        return np.stack([size, *(values[each.name] for each in parameters[1:])], axis=1)


def local_causes(problem: GapProblem) -> tuple[LocalCause, ...]:
    """Return the causes that may sit anywhere, in all planes that were measured."""
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
class _State(Rows):
    """Sizes (n,) of a cause and the parameters z (n, p) of the misfit with them, what they leave
    (n,), and the change about them."""

    size: FloatArray
    z: FloatArray
    left: FloatArray
    change: Change


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
        better = moved.left < state.left
        state = moved.where(better, state)
        length = np.where(better, 1.0, _SHORTER * length)
    return state.change


def _without(problem: GapProblem, before: Fit, misfit: Misfit, cause: LocalCause) -> _State:
    """No cause yet, but what a small one would do."""
    count = len(cause.places_m)
    z = np.zeros((count, misfit.slopes.shape[1]))
    z[:, : misfit.n_parameters] = before.z
    small = cause.predicted(problem, z[:, : misfit.n_parameters], np.full(count, cause.small))
    per_size = (small - before.predicted) / cause.small
    change = Change(np.repeat(misfit.deviation[None], count, axis=0), per_size, cause.largest)
    left = misfit.at(before.predicted[None], z)
    return _State(np.zeros(count), z, left, change)


def _at(
    problem: GapProblem, misfit: Misfit, cause: LocalCause, z: FloatArray, size: FloatArray
) -> _State:
    here, further = (
        cause.predicted(problem, z[:, : misfit.n_parameters], each) + misfit.repeated(z)
        for each in (size, _FURTHER * size)
    )
    per_size = (further - here) / ((_FURTHER - 1) * size[:, None])
    expected = z @ misfit.slopes.T + size[:, None] * per_size
    change = Change(misfit.value - here + expected, per_size, cause.largest)
    return _State(size, z, misfit.at(here, z), change)


# By five points a half wave a spline follows its square, as local causes act, to 2 % (5/384 h^4 / 2
# with h = 2 pi / 5); 31 lie nearer together than a corroded stretch is long (`_EXTENT`).
_PLACES_A_HALF_WAVE, _FEWEST_PLACES = 5, 31
# Judgement: to first order and once more at the size found; an end goes through decades.
_PASSES, _PASSES_OF_AN_END = 2, 16
# Technical: as many stretches as a page shows, eight points in each.
_BINS = 180
_FINE = 8 * _BINS
_LEAST_GAIN = 6.0  # of chi-square, for a size and a place: 95 % of chance alone
_FEWEST = 4  # tension and stiffness take two frequencies, a size and its place two more
_OUTSIDE = 0.05  # on either side of a 90 % interval


def places(problem: GapProblem, before: Fit) -> tuple[GapPlace, ...]:
    """For each kind of local cause where it would have to sit; that which explains most first.

    Kinds are `point mass`, `lateral spring`, `section loss` and `flexible end`, whose profile
    holds the two ends with their probabilities. Kinds that explain no more than noise would are
    absent, as all are where there are fewer than `_FEWEST` frequencies. A profile is the likelihood
    of the likeliest size at each place, scaled to a density (means over 180 stretches).
    What a kind leaves unexplained counts as noise, so that a kind that does not fit does not claim
    to know its place. Where two places explain the data alike, as x and L - x do of a hanger with
    like ends whose shapes were not measured, the profile has both and the interval spans both.
    """
    if problem.design.frequencies < _FEWEST:
        return ()
    misfit = Misfit.of(problem, before)
    found = [_place(problem, before, misfit, cause) for cause in local_causes(problem)]
    found.append(_end(problem, before, misfit))
    return tuple(sorted((each for each in found if each), key=lambda place: -place.share))


def _place(problem: GapProblem, before: Fit, misfit: Misfit, cause: LocalCause) -> GapPlace | None:
    length_m = problem.hanger.length_m
    half_waves = int(problem.observations.design.frequency_order.max())
    x_m = np.linspace(0, length_m, max(_PLACES_A_HALF_WAVE * half_waves + 1, _FEWEST_PLACES))
    fine_m = (np.arange(_FINE) + 0.5) * length_m / _FINE
    change = tried(problem, before, misfit, replace(cause, places_m=x_m), _PASSES).between(
        x_m, fine_m
    )
    found = _judged(misfit, change.left(misfit))
    if found is None:
        return None
    probability, share = found
    low_m, high_m = np.interp([_OUTSIDE, 1 - _OUTSIDE], probability.cumsum(), fine_m)
    density = probability.reshape(_BINS, -1).sum(axis=1) * _BINS / length_m
    middles_m = fine_m.reshape(_BINS, -1).mean(axis=1)
    profile = tuple(zip(middles_m.tolist(), density.tolist(), strict=True))
    best_m = float(fine_m[probability.argmax()])
    return GapPlace(cause.kind, best_m, float(low_m), float(high_m), share, profile)


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
    best_m = float(x_m[probability.argmax()])
    low_m, high_m = float(possible.min()), float(possible.max())
    return GapPlace(ends[0].kind, best_m, low_m, high_m, share, profile)


def _judged(misfit: Misfit, left: FloatArray) -> tuple[FloatArray, float] | None:
    """Probabilities (n,) of places that leave a chi-square `left` (n,), and the share that the
    best of them explains; None where noise alone would explain as much."""
    log_likelihood = misfit.log_likelihood(left)
    if 2 * log_likelihood.max() < _LEAST_GAIN:
        return None
    probability = np.exp(log_likelihood - log_likelihood.max())
    return probability / probability.sum(), 1 - float(left.min()) / misfit.total
