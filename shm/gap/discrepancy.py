"""What is not in the catalogue: a remainder of the data that is free to take many forms.

A remainder of the frequencies is a Gaussian process over their fractional deviations (Kennedy and
O'Hagan, J. R. Stat. Soc. B 63, 2001): alike in all tests, by test, or growing with temperature or
level, and over the orders independent, smooth, or the same for all. One of the shapes is an
extra variance of every component. Sizes are log-uniform, so that a remainder pays for its freedom.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np

from shm.gap.contract import Design, NoiseNode, Observations
from shm.gap.noise import nodes, same_mode
from shm.gap.repeated_errors import Repeated
from shm.values import FloatArray

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
SD_UNKNOWN = 1e-3  # judgement, of what states none: a hammer test of fair quality


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
        _with_remainder(node, frequency, shape, log_share - np.log(len(kind)))
        for node in plain
        for kind in kinds
        for frequency, shape in kind
    )


def _kinds(observations: Observations) -> list[list[tuple[FloatArray, FloatArray]]]:
    """For each kind of remainder the variances that it may add to frequencies and shapes."""
    design = observations.design
    sizes = sizes_of(observations.sd[: design.frequencies], LARGEST_FREQUENCY, FREQUENCY_SIZES)
    shapes = _shape_remainders(observations)
    none = np.zeros((design.frequencies, design.frequencies)), np.zeros(len(design.shape_mode))
    in_frequencies, in_both = [], []
    for pattern in _patterns(design):
        in_frequencies += [(size**2 * pattern, none[1]) for size in sizes]
    for pattern, size, shape in product(_over_orders(design), sizes, shapes):
        in_both.append((size**2 * pattern, shape))
    kinds = [in_frequencies, [(none[0], shape) for shape in shapes], in_both]
    return [kind for kind in kinds if kind]


def _with_remainder(
    node: NoiseNode, frequency: FloatArray, shape: FloatArray, log_share: np.float64
) -> NoiseNode:
    own = node.covariance
    covariance = replace(own, frequency=own.frequency + frequency, shape=own.shape + shape)
    return NoiseNode(covariance, float(node.log_weight + log_share), node.model_error)


def _thinned(plain: tuple[NoiseNode, ...]) -> tuple[NoiseNode, ...]:
    """A few of the unknown errors, since the remainder itself covers what lies between them."""
    if len(plain) <= PLAIN_NODES:
        return plain
    weight = np.exp([node.log_weight for node in plain])
    reached = np.cumsum(weight) / weight.sum()
    middles = (np.arange(PLAIN_NODES) + 0.5) / PLAIN_NODES
    kept, counts = np.unique(np.searchsorted(reached, middles), return_counts=True)
    return tuple(
        NoiseNode(plain[i].covariance, float(np.log(count / PLAIN_NODES)), plain[i].model_error)
        for i, count in zip(kept, counts, strict=True)
    )


def _shape_remainders(observations: Observations) -> list[FloatArray]:
    sd = observations.sd[observations.design.frequencies :]
    if sd.size == 0:
        return []
    return [
        np.asarray(size**2 * np.ones_like(sd)) for size in sizes_of(sd, LARGEST_SHAPE, SHAPE_SIZES)
    ]


def sizes_of(sd: FloatArray, largest: float, count: int) -> FloatArray:
    """Sizes that a remainder may have, from what drowns in the errors."""
    known = sd[np.isfinite(sd)]
    typical = float(np.median(known)) if known.size else SD_UNKNOWN
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
    return [*patterns, alike_in_planes(design)] if several else patterns


def smooth_over_orders(design: Design) -> FloatArray:
    """Correlations (F, F) that fall with the difference of the orders, in each plane."""
    plane = design.frequency_plane
    return np.asarray((plane[:, None] == plane) * alike_in_planes(design))


def alike_in_planes(design: Design) -> FloatArray:
    """Correlations (F, F) that fall with the difference of the orders, whatever the planes."""
    order = design.frequency_order
    apart = (order[:, None] - order) / SMOOTH_ORDERS
    return np.asarray(np.exp(-(apart**2) / 2))
