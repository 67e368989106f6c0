"""The unknown errors of the data, and the discrepancy that stands for what is not in the catalogue:
a few possibilities, each a covariance with a prior weight.

The frequencies err by their identification, as stated to within a factor phi, by an error of each
mode that repeats in all tests, of unknown size tau (`shm.inference.problem.noise`), and by what
repeats in any case (`shm.gap.hypotheses.repeated_errors`): cov = phi^2 diag(sd) R diag(sd) + tau^2
[together] + repeated. Identification errs independently, but for peaks of both planes that overlap
in a test: R correlates those by an unknown part, and a frequency of small amplitude with the same
one at that of the hit. Stated standard deviations of one mode in several tests are drawn together
as far as they differ by chance. That of the shapes is taken from their own scatter between tests.
Where no standard deviations are given there is instead one unknown standard deviation for all,
log-uniform, beside what rounding adds (`shm.gap.hypotheses.observations`); where some are, both.

The discrepancy is a remainder of the data that is free to take many forms. That of the frequencies
is a Gaussian process over their fractional deviations (Kennedy and O'Hagan, J. R. Stat. Soc. B 63,
2001): alike in all tests, by test, or growing with temperature or level, and over the orders
independent, smooth, or the same for all. One of the shapes is an extra variance of every component.
Sizes are log-uniform, so that a remainder pays for its freedom.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np

from shm.assumptions import DEFAULTS, Assumptions
from shm.gap.hypotheses.contract import Design, Observations
from shm.gap.hypotheses.observations import rounding_covariance
from shm.gap.hypotheses.repeated_errors import Repeated
from shm.inference.problem.noise import correlate_model_errors, grid_model_errors, grid_sd_factors
from shm.inference.sampler.likelihood import Covariance, NoiseNode
from shm.values import FloatArray, IntArray

# Numerical: a mean over finer ones is hardly another.
_STEP_IN_SD = 1.6
_CHANCE = 1 / 40  # variance of the logarithm of a standard deviation that has 20 degrees of freedom
_SDS, _SDS_OF_SOME = 32, 12  # technical: steps of a fifth and a half in the logarithm
# Judgement: three standard deviations are wild; data that scatter by less than half of what they
# state are a chance, or were smoothed.
_WILD, _LEAST_SCATTER = 3.0, 0.5
_SETTLED = 0.06  # technical: a factor so well known (126 degrees of freedom) is one number
_FEWEST = 3  # of two no scatter of a scatter is known
_HERMITE = ((-1.732, 1 / 6), (0.0, 2 / 3), (1.732, 1 / 6))


def nodes(observations: Observations, repeated: Repeated | None = None) -> tuple[NoiseNode, ...]:
    """The possibilities for `observations`; their weights add to 1."""
    repeated = repeated or Repeated.none(observations.design)
    correlations = _correlations(observations)
    observations = replace(observations, sd=drawn_together(observations))
    stated = observations.sd[observations.design.frequencies :] ** 2
    in_any_case = repeated.frequency + rounding_covariance(observations)
    return tuple(
        NoiseNode(
            Covariance(frequency + in_any_case, factor**2 * stated, repeated.sensors),
            float(np.log(weight * share)),
            error,
        )
        for frequency, weight, error in _of_frequencies(observations, correlations)
        for factor, share in _factors_of_shapes(observations)
    )


def _of_frequencies(
    observations: Observations, correlations: list[tuple[FloatArray, float]]
) -> list[tuple[FloatArray, float, float]]:
    """Covariances (F, F) of what does not repeat in any case, weights, and the errors they mean."""
    sd = observations.sd[: observations.design.frequencies]
    design, assumed = observations.design, observations.assumed
    known = np.isfinite(sd)
    same = correlate_model_errors(design.planes_and_orders, design.planes_and_orders, assumed)
    return [
        (
            errors * np.outer(frequency_sd, frequency_sd) + sigma**2 * same,
            float(of_common * of_factor * of_sigma * of_errors),
            float(sigma if known.any() else common),
        )
        for errors, of_errors in correlations
        for common, of_common in zip(*_unknown_sds(known, assumed), strict=True)
        for factor, of_factor in zip(*_factors(known, assumed), strict=True)
        for sigma, of_sigma in zip(*_model_errors(observations), strict=True)
        for frequency_sd in [np.where(known, factor * sd, common)]
    ]


def _correlations(observations: Observations) -> list[tuple[FloatArray, float]]:
    """Correlations (F, F) of the errors of identification that are possible, with their weights.

    None where a standard deviation is unknown: that outweighs it.
    """
    design, sd = observations.design, observations.sd[: observations.design.frequencies]
    assumed = observations.assumed
    names = np.array([each.test for each in design.conditions])[design.frequency_test]
    same_test = np.equal.outer(names, names)
    same_mode_of_test = same_test * same_mode(design)
    first = np.argmax(same_mode_of_test, axis=1)
    # At the amplitude of the hit a frequency has its own error and, independently, its slope's.
    shared = np.where(np.isfinite(sd), sd[first] / sd, 1.0)
    alone = np.diag(1 - shared**2) + np.outer(shared, shared) * same_mode_of_test
    log_frequency = observations.value[first]
    overlap = (
        (np.abs(np.subtract.outer(log_frequency, log_frequency)) < assumed.overlap_of_peaks.value)
        & same_test
        & np.equal.outer(design.frequency_order, design.frequency_order)
        & np.not_equal.outer(design.frequency_plane, design.frequency_plane)
    )
    if not overlap.any() or np.isnan(sd).any():
        return [(alone, 1.0)]
    both = np.outer(shared, shared) * overlap
    return [(alone + each * both, 0.5) for each in (0.0, assumed.overlap_correlation.value)]


def drawn_together(observations: Observations) -> FloatArray:
    """Standard deviations (data,), those of one mode in all tests drawn to their root mean square.

    All the way where their logarithms scatter no more than chance makes them, hardly where they
    scatter much more (James and Stein's shrinkage). Components of a shape keep their proportions.
    """
    design = observations.design
    count, mode = design.frequencies, design.mode
    frequency, shape = observations.sd[:count], observations.sd[count:]
    of = np.unique(design.shape_mode, return_inverse=True)[1]
    size = np.sqrt(np.bincount(of, shape**2) / np.maximum(np.bincount(of), 1))
    factor = _drawn(mode[np.unique(design.shape_mode)], size) / size
    return np.concatenate([_drawn(mode, frequency), shape * factor[of]])


def _drawn(group: IntArray, sd: FloatArray) -> FloatArray:
    """Positive values (n,) drawn to the root mean square of their group; NaN stays."""
    drawn = sd.copy()
    known = np.isfinite(sd)
    for each in np.unique(group[known]):
        rows = known & (group == each)
        if rows.sum() < _FEWEST:
            continue
        scatter = np.var(np.log(sd[rows]), ddof=1)
        exponent = 1 - _CHANCE / max(scatter, _CHANCE)
        centre = np.sqrt(np.mean(sd[rows] ** 2))
        drawn[rows] = centre * (sd[rows] / centre) ** exponent
    return drawn


def same_mode(one: Design, other: Design | None = None) -> FloatArray:
    """(F of one, F of the other or of itself): 1 where both are of one plane and order, else 0."""
    planes = np.equal.outer(one.frequency_plane, (other or one).frequency_plane)
    orders = np.equal.outer(one.frequency_order, (other or one).frequency_order)
    return np.asarray(planes & orders, dtype=float)


def _unknown_sds(known: FloatArray, assumed: Assumptions) -> tuple[FloatArray, FloatArray]:
    """Values of the common unknown standard deviation and their weights."""
    if known.all():
        return np.zeros(1), np.ones(1)
    values = np.geomspace(
        *assumed.unstated_frequency_sd.bounds, _SDS_OF_SOME if known.any() else _SDS
    )
    return values, _trapezoidal(np.ones(len(values)))


def _factors(known: FloatArray, assumed: Assumptions) -> tuple[FloatArray, FloatArray]:
    """Values of true over stated standard deviations of frequencies, and their weights."""
    if not known.any():
        return np.ones(1), np.ones(1)
    values, log_share = grid_sd_factors(assumed)
    return values, np.exp(log_share)


def _factors_of_shapes(observations: Observations) -> list[tuple[float, float]]:
    """Return the same for shapes, with weights: from their scatter between tests of one added mass.

    One value where they leave little doubt, else three (Gauss and Hermite's). Scatter beyond three
    standard deviations counts as three, lest a shape that changes from test to test pass for it.
    """
    scatter, freedom = _between_tests(observations)
    # As little is known of the standard deviations of shapes as of those of frequencies.
    precision = observations.assumed.stated_sd_log_sd.value**-2 + 2 * freedom
    centre = 2 * freedom * np.log(scatter) / precision if freedom else 0.0
    spread = precision**-0.5
    if len(observations.design.shape_mode) == 0 or spread < _SETTLED:
        return [(float(np.exp(centre)), 1.0)]
    return [(float(np.exp(centre + spread * away)), share) for away, share in _HERMITE]


def _between_tests(observations: Observations) -> tuple[float, float]:
    """Return the scatter of shapes about their means over tests, in stated sds, and its freedom."""
    design = observations.design
    mode = design.shape_mode
    # What is turned at will scatters by more than its own standard deviations say.
    turned = np.where(observations.is_turned, np.arange(len(mode)), -1)
    keys = np.vstack([design.kinds[:, design.frequencies :], turned])
    kind = np.unique(keys, axis=1, return_inverse=True)[1].ravel()
    value, sd = observations.value[design.frequencies :], observations.sd[design.frequencies :]
    count = np.bincount(kind)
    mean = np.bincount(kind, value) / np.maximum(count, 1)
    several = count[kind] > 1
    if not several.any():
        return 1.0, 0.0
    away = ((value - mean[kind]) / sd)[several] / np.sqrt(1 - 1 / count[kind][several])
    # Scaling to unit length takes one degree of freedom from each shape.
    free_share = 1 - len(np.unique(mode)) / len(mode)
    freedom = free_share * float(np.sum(1 - 1 / count[kind][several]))
    scatter = float(np.sqrt(np.mean(np.minimum(away**2, _WILD**2)) / free_share))
    return max(scatter, _LEAST_SCATTER), freedom


def _model_errors(observations: Observations) -> tuple[FloatArray, FloatArray]:
    """Values of tau and their weights; no tau where all standard deviations are unknown."""
    sd = observations.sd[: observations.design.frequencies]
    if not np.isfinite(sd).any():
        return np.zeros(1), np.ones(1)
    step = _STEP_IN_SD / float(np.sqrt(2 * len(np.unique(observations.design.mode))))
    least_sd = float(np.nanmin(sd))
    values, log_share = grid_model_errors(least_sd, step, observations.assumed, beyond_usual=False)
    return values, np.exp(log_share)


def _trapezoidal(density: FloatArray) -> FloatArray:
    """Weights of values evenly spaced in the logarithm, of a density by the logarithm."""
    weights = density.copy()
    weights[[0, -1]] /= 2
    return np.asarray(weights / weights.sum())


# Judgement: no cause of the catalogue moves frequencies by more than a tenth without being seen by
# eye, nor unit shapes by more than a third. Twice as large, over log-uniform sizes from 1e-4, costs
# a remainder ln(7.6 / 6.9) = 0.1 of log evidence.
LARGEST_FREQUENCY, LARGEST_SHAPE = 0.1, 0.3
SMALLEST_SDS = 1.0  # a smaller one drowns in the errors
# Judgement: a factor of 4 between sizes, and of the plain possibilities one of each third; time
# goes with their product, and a mean over finer ones is hardly another.
FREQUENCY_SIZES, SHAPE_SIZES, PLAIN_NODES = 6, 4, 3
# Judgement: causes act on neighbouring modes alike (a spring, a mass near an end), not on far ones.
SMOOTH_ORDERS = 2.0


def flexible_nodes(
    observations: Observations, repeated: Repeated | None = None
) -> tuple[NoiseNode, ...]:
    """The unknown errors together with a remainder, in place of the unknown errors alone.

    Their weights add to 1. A remainder of the frequencies, of the shapes and of both are as likely.
    """
    plain = _thinned(nodes(observations, repeated))
    kinds = _kinds(observations)
    log_share = -np.log(len(kinds))
    return tuple(
        NoiseNode(
            replace(
                node.covariance,
                frequency=node.covariance.frequency + frequency,
                shape=node.covariance.shape + shape,
            ),
            float(node.log_weight + (log_share - np.log(len(kind)))),
            node.model_error,
        )
        for node in plain
        for kind in kinds
        for frequency, shape in kind
    )


def _kinds(observations: Observations) -> list[list[tuple[FloatArray, FloatArray]]]:
    """For each kind of remainder the variances that it may add to frequencies and shapes."""
    design = observations.design
    frequency_sd, assumed = observations.sd[: design.frequencies], observations.assumed
    sizes = sizes_of(frequency_sd, LARGEST_FREQUENCY, FREQUENCY_SIZES, assumed)
    shapes = _shape_remainders(observations)
    none = np.zeros((design.frequencies, design.frequencies)), np.zeros(len(design.shape_mode))
    in_frequencies, in_both = [], []
    for pattern in _patterns(design):
        in_frequencies += [(size**2 * pattern, none[1]) for size in sizes]
    for pattern, size, shape in product(_over_orders(design), sizes, shapes):
        in_both.append((size**2 * pattern, shape))
    kinds = [in_frequencies, [(none[0], shape) for shape in shapes], in_both]
    return [kind for kind in kinds if kind]


def _thinned(plain: tuple[NoiseNode, ...]) -> tuple[NoiseNode, ...]:
    """A few of the unknown errors, since the remainder itself covers what lies between them."""
    if len(plain) <= PLAIN_NODES:
        return plain
    weight = np.exp([node.log_weight for node in plain])
    reached = np.cumsum(weight) / weight.sum()
    middles = (np.arange(PLAIN_NODES) + 0.5) / PLAIN_NODES
    chosen, counts = np.unique(np.searchsorted(reached, middles), return_counts=True)
    return tuple(
        NoiseNode(plain[i].covariance, float(np.log(count / PLAIN_NODES)), plain[i].model_error)
        for i, count in zip(chosen, counts, strict=True)
    )


def _shape_remainders(observations: Observations) -> list[FloatArray]:
    sd = observations.sd[observations.design.frequencies :]
    if sd.size == 0:
        return []
    return [
        np.asarray(size**2 * np.ones_like(sd)) for size in sizes_of(sd, LARGEST_SHAPE, SHAPE_SIZES)
    ]


def sizes_of(
    sd: FloatArray, largest: float, count: int, assumed: Assumptions = DEFAULTS
) -> FloatArray:
    """Sizes that a remainder may have, from what drowns in the errors."""
    known = sd[np.isfinite(sd)]
    typical = float(np.median(known)) if known.size else assumed.unstated_frequency_sd.value
    return np.geomspace(min(SMALLEST_SDS * typical, largest / 2), largest, count)


def _patterns(design: Design) -> list[FloatArray]:
    """Correlations (F, F): alike in all tests, by test, and growing with what the tests vary."""
    test = design.frequency_test
    orders = _over_orders(design)
    patterns = list(orders)
    if len(np.unique(test)) > 1:
        same_test = (test[:, None] == test).astype(float)
        patterns += [same_test * orders[0], same_test * orders[-1]]
    for condition in (
        np.array([each.temperature_shift_k for each in design.conditions]),
        np.array([each.amplitude for each in design.conditions]) ** 2,
    ):
        spread = condition - condition.mean()
        if np.ptp(condition[np.unique(test)]) > 0:
            grown = (spread / np.abs(spread).max())[test]
            patterns.append(np.outer(grown, grown) * orders[-1])
    return patterns


def _over_orders(design: Design) -> list[FloatArray]:
    """Correlations (F, F) between modes: none, smooth over the order in one plane or in both."""
    patterns = [same_mode(design), smooth_over_orders(design)]
    several = np.ptp(design.frequency_plane) > 0
    return [*patterns, correlate_orders(design)] if several else patterns


def smooth_over_orders(one: Design, other: Design | None = None) -> FloatArray:
    """Correlations (F, F) that fall with the difference of the orders, in each plane."""
    planes = np.equal.outer(one.frequency_plane, (other or one).frequency_plane)
    return np.asarray(planes * correlate_orders(one, other))


def correlate_orders(one: Design, other: Design | None = None) -> FloatArray:
    """Correlations (F, F) that fall with the difference of the orders, whatever the planes."""
    orders = np.subtract.outer(one.frequency_order, (other or one).frequency_order)
    apart = orders / SMOOTH_ORDERS
    return np.asarray(np.exp(-(apart**2) / 2))
