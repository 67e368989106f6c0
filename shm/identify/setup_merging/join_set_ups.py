"""The findings of several set-ups of one test as one finding over all points.

Modes that several set-ups saw are matched; one estimate is made of theirs, which differ by more
than their own scatter tells.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from shm.identify.contract import (
    FREQUENCY_FLOOR,
    LEAST_HITS,
    Dropped,
    Finding,
    FoundMode,
    Measurement,
    Place,
    Poles,
    place_of,
)
from shm.identify.estimation.poles import FAR
from shm.identify.estimation.shapes import modal_assurance
from shm.identify.estimation.spread import widening
from shm.identify.mode_ordering.planes import transverse_share
from shm.identify.options import IdentifyOptions
from shm.identify.setup_merging.modal_participation import levels, ringing, with_levels
from shm.identify.setup_merging.products import (
    hammer_roves,
    joined_shapes,
    of_hits,
    of_seen_shapes,
    of_shapes,
)
from shm.values import NAN, PLANES, FloatArray, ResponsePoint

LARGEST_SHIFT = 0.002
"""A mode's frequency differs by less than this fraction from set-up to set-up."""
LEAST_LIKENESS = 0.25  # judgement: MAC of 60 degrees; the other plane's mode is at 90
_SEEN = 0.01
"""Share of a shape's energy that points must hold to say anything of it."""


@dataclass(frozen=True, eq=False)
class JoinedFinding:
    """The modes of a test over `points`; `apart` are the same modes as each set-up has them."""

    points: tuple[ResponsePoint, ...]
    finding: Finding
    apart: tuple[tuple[FoundMode, ...], ...]
    notes: tuple[str, ...] = ()


def join_set_ups(
    measurements: Sequence[Measurement], findings: Sequence[Finding], options: IdentifyOptions
) -> JoinedFinding:
    """Join the modes of all set-ups over all points; those of a single one are unchanged.

    Frequency and damping are pooled. A mode seen by one set-up only is accepted if three hits
    or more validate it there. Without a force, modes that not all set-ups see are dropped:
    their shape is not known at all points. Raises BadInput where set-ups cannot be joined.
    """
    first = measurements[0]
    if len(measurements) == 1:
        modes = findings[0].modes
        if first.driven and modes:
            modes = with_levels(modes, [ringing(first, modes)])
        return JoinedFinding(first.points, replace(findings[0], modes=modes), (modes,))
    counts: Counter[tuple[str, str]] = Counter()
    for entry in (entry for finding in findings for entry in finding.dropped):
        counts[entry.what, entry.reason] += entry.count
    dropped = [Dropped(what, count, reason) for (what, reason), count in counts.items()]
    accepted: list[list[ModeInSetUp]] = []
    for group in matched(measurements, [finding.modes for finding in findings]):
        if reason := _doubt(group, len(measurements), bool(first.driven)):
            dropped.append(Dropped(f"mode at {group[0].mode.frequency_hz:.4g} Hz", 1, reason))
        else:
            accepted.append(group)
    parts = [finding.poles for finding in findings]
    poles = Poles(
        np.concatenate([each.order for each in parts]),
        np.concatenate([each.frequency_hz for each in parts]),
        np.concatenate([each.damping_ratio for each in parts]),
        np.concatenate([each.stable for each in parts]),
    )
    if not accepted:
        nothing = Finding((), tuple(dropped), poles)
        return JoinedFinding(first.points, nothing, ((),) * len(findings))
    pools = [_pool(group, options.frequency_allowance) for group in accepted]
    apart = tuple(_as_seen(accepted, pools, number) for number in range(len(measurements)))
    points, modes = _over_all_points(measurements, pools, apart, accepted)
    found = Finding(modes, tuple(dropped), poles)
    return JoinedFinding(points, found, apart, (_note(measurements),))


def _over_all_points(
    measurements: Sequence[Measurement],
    pools: Sequence[FoundMode],
    apart: Sequence[Sequence[FoundMode]],
    groups: Sequence[Sequence[ModeInSetUp]],
) -> tuple[tuple[ResponsePoint, ...], tuple[FoundMode, ...]]:
    """Return the pooled modes with their shapes over all points."""
    if measurements[0].driven:
        seen = [
            [any(is_seen.set_up == n for is_seen in g) for g in groups] for n in range(len(apart))
        ]
        rings = [
            ringing(m, modes, is_seen)
            for m, modes, is_seen in zip(measurements, apart, seen, strict=True)
        ]
        products = [of_hits(ring) for ring in rings]
        if _see_the_same(measurements):
            products = [of_seen_shapes(*each) for each in zip(apart, seen, strict=True)]
        level_m_s2 = levels(rings)
    else:
        products = [of_shapes(modes) for modes in apart]
        level_m_s2 = np.full(len(pools), NAN)
    shapes = joined_shapes(measurements, products)
    modes = tuple(
        replace(pool, shape=value, shape_sd=sd, acceleration_m_s2=float(level))
        for pool, value, sd, level in zip(pools, shapes.values, shapes.sds, level_m_s2, strict=True)
    )
    return shapes.points, modes


def _see_the_same(measurements: Sequence[Measurement]) -> bool:
    """Return whether all set-ups have equal sensors, so that none needs another's scale."""
    points = [[place_of(point) for point in m.points] for m in measurements]
    return all(each == points[0] for each in points) and not hammer_roves(measurements)


def _note(measurements: Sequence[Measurement]) -> str:
    count = len(measurements)
    if not measurements[0].driven:
        return f"{count} set-ups are joined by the sensors that they share"
    if hammer_roves(measurements):
        return f"{count} set-ups are joined; by reciprocity, shapes stand at the hammer's places"
    return f"{count} set-ups are joined by the force of their hits"


def _doubt(group: Sequence[ModeInSetUp], set_ups: int, hammered: bool) -> str:
    """Return the reason why a mode is not accepted; empty where it is."""
    if not hammered and len(group) < set_ups:
        return "not seen in all set-ups, so its shape is not known at all points"
    if len(group) == 1 and math.isnan(group[0].mode.damping_sd):
        return "seen in one set-up only, with fewer than three hits"
    return ""


def _pool(group: Sequence[ModeInSetUp], allowance: float) -> FoundMode:
    """Return the mode with pooled frequency and damping, still without a shape."""
    modes = [seen.mode for seen in group]
    damping_sds = np.array([mode.damping_sd for mode in modes])
    # Without a standard deviation of its damping, that of a mode's frequency is but a floor.
    sds = np.array([mode.frequency_sd_hz for mode in modes])
    frequency, frequency_sd = pool_estimates(
        np.array([mode.frequency_hz for mode in modes]), np.where(np.isnan(damping_sds), NAN, sds)
    )
    damping, damping_sd = pool_estimates(
        np.array([mode.damping_ratio for mode in modes]), damping_sds
    )
    if math.isnan(frequency_sd):
        frequency_sd = FREQUENCY_FLOOR * frequency
    sd = math.hypot(frequency_sd, allowance * frequency)
    nothing = np.empty(0)
    return FoundMode(frequency, sd, damping, damping_sd, nothing, nothing)


def _as_seen(
    groups: Sequence[list[ModeInSetUp]], pools: Sequence[FoundMode], number: int
) -> tuple[FoundMode, ...]:
    """Return each mode as this set-up has it, or as all have where it does not see it."""
    return tuple(
        next((seen.mode for seen in group if seen.set_up == number), pool)
        for group, pool in zip(groups, pools, strict=True)
    )


def pool_estimates(values: FloatArray, sds: FloatArray) -> tuple[float, float]:
    """Return mean and standard deviation of `values` (set-ups,) with `sds`, NaN where unknown.

    Random effects: what set-ups differ by (mounting of sensors, temperature) is estimated from
    their scatter and added to the variance of each (DerSimonian and Laird 1986, eq. 6 to 9);
    its share of the result is widened as Student's 95 % quantile is over the normal one. An
    unknown standard deviation counts as the largest known one, and none as smaller than the
    median: from a few hits it may be small by chance. Where none is known, three set-ups or
    more tell by their scatter alone; the result of fewer is NaN.
    """
    count = len(values)
    if count == 1:
        return float(values[0]), float(sds[0])
    if np.all(np.isnan(sds)):
        scatter = float(np.std(values, ddof=1)) / np.sqrt(count) * widening(count - 1)
        return float(np.mean(values)), scatter if count >= LEAST_HITS else NAN
    variances = np.where(np.isnan(sds), np.nanmax(sds), sds) ** 2
    variances = np.maximum(variances, max(float(np.nanmedian(sds**2)), np.finfo(float).tiny))
    between = _between(values, variances)
    weights = 1 / (variances + between)
    alone = 1 / np.sum(1 / variances)
    variance = alone + (1 / np.sum(weights) - alone) * widening(count - 1) ** 2
    return float(values @ weights / np.sum(weights)), float(np.sqrt(variance))


def _between(values: FloatArray, variances: FloatArray) -> float:
    """Return the variance between set-ups beyond their `variances` (set-ups,)."""
    weights = 1 / variances
    total = np.sum(weights)
    excess = weights @ (values - values @ weights / total) ** 2 - (len(values) - 1)
    return max(0.0, float(excess / (total - np.sum(weights**2) / total)))


@dataclass(frozen=True, eq=False)
class ModeInSetUp:
    """A mode as one set-up sees it."""

    set_up: int
    mode: FoundMode
    shape: dict[Place, float]
    transverse: float

    @staticmethod
    def of(set_up: int, mode: FoundMode, measurement: Measurement) -> ModeInSetUp:
        places = [place_of(point) for point in measurement.points]
        both = not set(PLANES) - {point.plane for point in measurement.points}
        share = transverse_share(mode.shape, measurement.points) if both else np.nan
        shape = dict(zip(places, mode.shape.tolist(), strict=True))
        return ModeInSetUp(set_up, mode, shape, share)


def matched(
    measurements: Sequence[Measurement], found: Sequence[Sequence[FoundMode]]
) -> list[list[ModeInSetUp]]:
    """Return the modes of all set-ups in groups that are one mode each, by rising frequency.

    Set-ups are taken from the one with most modes on; each of its modes joins the nearest
    group, one to one, if its frequency and its shape on common points (else its direction)
    allow.
    """
    seen = [
        [ModeInSetUp.of(index, mode, measurement) for mode in modes]
        for index, (measurement, modes) in enumerate(zip(measurements, found, strict=True))
    ]
    groups: list[list[ModeInSetUp]] = []
    for modes in sorted(seen, key=len, reverse=True):
        _take_in(groups, modes)
    return sorted(groups, key=_frequency)


def _take_in(groups: list[list[ModeInSetUp]], modes: Sequence[ModeInSetUp]) -> None:
    cost = np.array([[_cost(group, mode) for group in groups] for mode in modes])
    cost = cost.reshape(len(modes), len(groups))
    joined = {
        int(row): int(column)
        for row, column in zip(*scipy.optimize.linear_sum_assignment(cost), strict=True)
        if cost[row, column] < FAR
    }
    for row, mode in enumerate(modes):
        if row in joined:
            groups[joined[row]].append(mode)
        else:
            groups.append([mode])


def _frequency(group: Sequence[ModeInSetUp]) -> float:
    return float(np.mean([seen.mode.frequency_hz for seen in group]))


def _cost(group: Sequence[ModeInSetUp], mode: ModeInSetUp) -> float:
    shift = abs(mode.mode.frequency_hz / _frequency(group) - 1)
    likeness = float(np.mean([_likeness(member, mode) for member in group]))
    if shift > LARGEST_SHIFT or likeness < LEAST_LIKENESS:
        return FAR
    return shift / LARGEST_SHIFT + 1 - likeness


def _likeness(one: ModeInSetUp, other: ModeInSetUp) -> float:
    """Return the MAC on common points; else of the directions; 1 where nothing is common."""
    common = sorted(one.shape.keys() & other.shape.keys(), key=str)
    shapes = [np.array([seen.shape[place] for place in common]) for seen in (one, other)]
    if all(_tells(part, seen.shape) for part, seen in zip(shapes, (one, other), strict=True)):
        return modal_assurance(*shapes)
    if np.isnan(one.transverse) or np.isnan(other.transverse):
        return 1.0
    directions = [
        np.sqrt(np.array([seen.transverse, 1 - seen.transverse])) for seen in (one, other)
    ]
    return modal_assurance(*directions)


def _tells(part: FloatArray, shape: dict[Place, float]) -> bool:
    return float(part @ part) > _SEEN * sum(value**2 for value in shape.values())
