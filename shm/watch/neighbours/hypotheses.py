"""Everything that may have moved, with its probability: all explanations at all noise scales, a
fraction common to all hangers or to all of one logger among them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from shm.values import FloatArray, IntArray
from shm.watch.neighbours.evidence import (
    Bridge,
    Weighed,
    beyond,
    independent,
    nothing,
    shed_factors,
    weighed,
    with_sign,
)
from shm.watch.neighbours.pattern_types import ExplanationName, HangerShift, NeighbourOptions

# Both of two equal losses stand among the likeliest single ones.
_FIRST_OF_TWO = 3
_NOBODY: IntArray = np.empty((0, 0), np.int64)
_SWING_K = 5.0
_SPREAD = 0.2
_FEWEST = 3


@dataclass(frozen=True, eq=False)
class Part:
    """Hypotheses of one explanation at one noise scale.

    Log probabilities (h,); `members` (h, m) are the hangers that shed or gained, empty for the
    other explanations; probabilities (h, n) that each hanger gained or lost more than is
    negligible; means and standard deviations (h, n) of its shift in N.
    """

    name: ExplanationName
    log_weight: FloatArray
    members: IntArray
    gained: FloatArray
    lost: FloatArray
    mean_n: FloatArray
    sd_n: FloatArray


def hypotheses(
    shifts: Sequence[HangerShift], causes: Sequence[AlikeCause], options: NeighbourOptions
) -> tuple[Part, ...]:
    """All hypotheses with their posterior probabilities, which add to 1."""
    parts: list[Part] = []
    for scale, prior in zip(options.noise_scales, options.noise_prior, strict=True):
        bridge = Bridge.of(shifts, options, scale)
        for part in _at_one_scale(bridge, causes, options):
            parts.append(replace(part, log_weight=part.log_weight + math.log(prior)))
    total = float(scipy.special.logsumexp(np.concatenate([part.log_weight for part in parts])))
    return tuple(replace(part, log_weight=part.log_weight - total) for part in parts)


def _at_one_scale(
    bridge: Bridge, causes: Sequence[AlikeCause], options: NeighbourOptions
) -> tuple[Part, ...]:
    found = nothing(bridge)
    weight = found.log_evidence + math.log(options.prior["no change"])
    still = _part("no change", weight, _NOBODY, found, bridge, options)
    return (
        still,
        _alike(bridge, causes, options),
        *_moves(bridge, options),
        _by_itself(bridge, options),
    )


def _part(
    name: ExplanationName,
    log_weight: FloatArray,
    members: IntArray,
    found: Weighed,
    bridge: Bridge,
    options: NeighbourOptions,
) -> Part:
    least = options.negligible_fraction * bridge.baseline_n
    gained, lost = beyond(found.mean_n, found.sd_n, least)
    return Part(name, log_weight, members, gained, lost, found.mean_n, found.sd_n)


def _by_itself(bridge: Bridge, options: NeighbourOptions) -> Part:
    found = independent(bridge, options)
    weight = found.log_evidence + math.log(options.prior["independent shifts"])
    unknown = np.full((1, len(bridge.shift_n)), np.nan)
    return Part(
        "independent shifts", np.array([weight]), _NOBODY, found.gained[None], found.lost[None],
        unknown, unknown,
    )  # fmt: skip


def _alike(bridge: Bridge, causes: Sequence[AlikeCause], options: NeighbourOptions) -> Part:
    patterns = np.array([each.fractions * bridge.baseline_n for each in causes])
    found = weighed(bridge, _sized(patterns[:, :, None], options))
    prior = math.log(options.prior["common shift"] / len(found.log_evidence))
    return _part("common shift", found.log_evidence + prior, _NOBODY, found, bridge, options)


def _sized(factors: FloatArray, options: NeighbourOptions) -> FloatArray:
    """Each factor at each size, sizes running slowest."""
    sizes = np.array(options.sizes_fraction)[:, None, None, None]
    return np.asarray((sizes * factors).reshape(-1, *factors.shape[1:]), np.float64)


def _moves(bridge: Bridge, options: NeighbourOptions) -> tuple[Part, Part, Part]:
    """One hanger sheds, one gains, two shed."""
    factors, count = shed_factors(bridge, options), len(bridge.shift_n)
    sizes = len(options.sizes_fraction)
    one, found = (
        np.tile(np.arange(count)[:, None], (sizes, 1)),
        weighed(bridge, _sized(factors, options)),
    )
    two = _pairs(with_sign(found, one, -1), count)
    both = np.concatenate([factors[two[:, 0]], factors[two[:, 1]]], axis=2)
    found_of_two = weighed(bridge, _sized(both, options))
    shed, gained = options.prior["load redistribution"], options.prior["load gain"]
    one_shed = shed * (1 - options.two_hangers) / (count * sizes)
    two_shed = shed * options.two_hangers / (count * (count - 1) / 2 * sizes)
    two = np.tile(two, (sizes, 1))

    def part(
        name: ExplanationName, members: IntArray, of: Weighed, sign: int, prior: float
    ) -> Part:
        weight = with_sign(of, members, sign) + math.log(prior)
        return _part(name, weight, members, of, bridge, options)

    return (
        part("load redistribution", one, found, -1, one_shed),
        part("load gain", one, found, 1, gained / (count * sizes)),
        part("load redistribution", two, found_of_two, -1, two_shed),
    )


def _pairs(logs_of_one: FloatArray, count: int) -> IntArray:
    """Pairs (p, 2) of hangers of which one is among the likeliest to have shed load by itself."""
    of_each = scipy.special.logsumexp(logs_of_one.reshape(-1, count), axis=0)
    first = of_each.argsort()[-_FIRST_OF_TWO:].tolist()
    return np.array([(i, j) for i in first for j in range(count) if i < j or j not in first])


@dataclass(frozen=True, eq=False)
class AlikeCause:
    """A common cause: the fractions (n,) that it moves hangers by, largest about 1; what to do."""

    fractions: FloatArray
    name: str
    remedy: str


def alike_causes(shifts: Sequence[HangerShift]) -> tuple[AlikeCause, ...]:
    """Every common cause that the data could tell from another.

    All by one fraction; each as its temperature went, where those differ; each logger's hangers,
    where there are several loggers. A rate that is off by e moves frequencies by e, tensions by 2e.
    """
    return (_common(shifts), *_by_temperature(shifts), *_by_logger(shifts))


def _common(shifts: Sequence[HangerShift]) -> AlikeCause:
    changes = _changes(shifts)
    everywhere = np.ones(len(shifts))
    clocks = "compare the loggers' clocks and sampling rates"
    if _swing(changes) < _SWING_K:
        return AlikeCause(
            everywhere,
            "a clock or a load on the whole deck",
            f"the temperatures hardly changed; {clocks}, and ask for new surfacing or works",
        )
    if np.isfinite(changes).all() and changes.std() <= _SPREAD * _swing(changes):
        return AlikeCause(
            everywhere,
            "a temperature or a clock",
            f"all tests lie about {changes.mean():+.0f} K from their baselines; "
            f"check the temperature readings, and {clocks}",
        )
    return AlikeCause(
        everywhere,
        "a temperature or a clock",
        f"{clocks}, and the temperatures of the tests",
    )


def _by_temperature(shifts: Sequence[HangerShift]) -> tuple[AlikeCause, ...]:
    changes = _changes(shifts)
    swing = _swing(changes)
    if not (swing >= _SWING_K and changes.std() > _SPREAD * swing):
        return ()
    remedy = "the shifts go with the temperatures of the tests; check those readings"
    return (AlikeCause(changes / np.abs(changes).max(), "the temperature", remedy),)


def _by_logger(shifts: Sequence[HangerShift]) -> tuple[AlikeCause, ...]:
    names = np.array([each.logger for each in shifts])
    known = sorted({name for name in names.tolist() if name})
    if len(set(names.tolist())) < 2:
        return ()
    return tuple(
        AlikeCause(
            (names == name).astype(float),
            f"logger {name}",
            f"only hangers of logger {name} moved; check its clock, sampling rate and sensors",
        )
        for name in known
        if np.count_nonzero(names == name) >= _FEWEST
    )


def _changes(shifts: Sequence[HangerShift]) -> FloatArray:
    return np.array([each.temperature_change_k for each in shifts])


def _swing(changes: FloatArray) -> float:
    """Root mean square of the changes in K; NaN where one is unknown."""
    return float(np.sqrt(np.mean(changes**2)))
