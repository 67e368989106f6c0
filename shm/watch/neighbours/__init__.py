"""The pattern over the bridge: which hangers gained and lost tension, and what explains it best."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import timedelta
from typing import NamedTuple

import numpy as np
import scipy

from shm.errors import NothingThere
from shm.values import NAN, TENSION, Drift, FloatArray
from shm.values.rounding import NINETY_PERCENT
from shm.watch.neighbours.hypotheses import AlikeCause, Bridge, Part, alike_causes, hypotheses
from shm.watch.neighbours.pattern_types import (
    BridgePattern,
    Explanation,
    ExplanationName,
    HangerRow,
    HangerShift,
    NeighbourOptions,
    NotCompared,
    SumKept,
    Suspect,
    Way,
    remarks_of,
    sentence_of,
)

__all__ = [
    "BridgePattern", "Explanation", "HangerRow", "HangerShift", "NeighbourOptions", "NotCompared",
    "SumKept", "Suspect", "bridge_pattern", "shifts_of",
]  # fmt: skip

FEWEST = 3  # of two, either may be the one that moved
_REACH = 2  # places: what hangers further off take up is below 5 % of a loss
_SUSPECTS = 3  # technical: pairs are tried of so many


def shifts_of(
    drifts_by_hanger: Mapping[int, Sequence[Drift]],
    order: Sequence[int],
    *,
    temperature_changes_k: Mapping[int, float] | None = None,
) -> tuple[HangerShift, ...]:
    """The latest known tension shift of each hanger that has one, in their `order` on the bridge.

    `order` names all hangers, those without a test too: a place is an index into it. A drift whose
    numbers are unknown is passed over for the one before it.
    """
    changes = temperature_changes_k or {}
    return tuple(
        HangerShift(
            hanger=hanger,
            place=place,
            time=latest.time,
            baseline_n=latest.baseline,
            shift_n=latest.shift_mean * latest.baseline,
            shift_sd_n=latest.shift_sd * latest.baseline,
            temperature_change_k=changes.get(hanger, NAN),
        )
        for place, hanger in enumerate(order)
        if (latest := _latest(drifts_by_hanger.get(hanger, ()))) is not None
    )


def _latest(drifts: Sequence[Drift]) -> Drift | None:
    known = [each for each in drifts if each.quantity == TENSION and _is_known(each)]
    # Of two at one time the later in the list is of the newer baseline.
    return max(reversed(known), key=lambda each: each.time, default=None)


def _is_known(drift: Drift) -> bool:
    numbers = (drift.baseline, drift.shift_mean, drift.shift_sd)
    return all(math.isfinite(each) for each in numbers) and drift.baseline > 0 < drift.shift_sd


def bridge_pattern(
    shifts: Sequence[HangerShift],
    order: Sequence[int] = (),
    options: NeighbourOptions | None = None,
) -> BridgePattern:
    """What moved over the bridge; shifts whose tests are older than the window are left out.

    `order` names all hangers along the bridge (index: place), so that those without a shift are
    listed. Raises NothingThere where fewer than three hangers can be compared.
    """
    options = options or NeighbourOptions()
    compared, left_out = _sorted_out(shifts, order, options)
    causes = alike_causes(compared)
    parts = hypotheses(compared, causes, options)
    rows, explanations = _rows(compared, parts), _explanations(parts)
    suspects = _suspects(compared, parts)
    fraction, sd, cause = _alike(compared, parts, causes)
    pattern = BridgePattern(
        newest=max(each.time for each in compared),
        explanations=explanations,
        suspects=suspects,
        rows=rows,
        sum_kept=_sum_kept(Bridge.of(compared, options), rows, explanations, suspects),
        alike_fraction=fraction,
        alike_sd=sd,
        alike_cause=cause.name,
        not_compared=left_out,
        sentence="",
    )
    return replace(
        pattern, sentence=sentence_of(pattern, cause.remedy, options), remarks=remarks_of(pattern)
    )


def _sorted_out(
    shifts: Sequence[HangerShift], order: Sequence[int], options: NeighbourOptions
) -> tuple[list[HangerShift], tuple[NotCompared, ...]]:
    if len(shifts) < FEWEST:
        raise _too_few(f"{len(shifts)} of the hangers have a shift from a baseline")
    oldest = max(each.time for each in shifts) - timedelta(days=options.window_days)
    placed = sorted(shifts, key=lambda each: each.place)
    compared = [each for each in placed if each.time >= oldest]
    why = f"its latest test is more than {options.window_days:g} days older than the newest"
    old = [NotCompared(s.hanger, s.place, s.time, why) for s in placed if s.time < oldest]
    have = {each.hanger for each in shifts}
    none = [
        NotCompared(hanger, place, None, "no test of it has been compared with a baseline")
        for place, hanger in enumerate(order)
        if hanger not in have
    ]
    if len(compared) < FEWEST:
        raise _too_few(
            f"{len(compared)} of the hangers have a test of the last {options.window_days:g} days"
        )
    return compared, tuple(sorted([*old, *none], key=lambda each: each.place))


def _too_few(what: str) -> NothingThere:
    return NothingThere(
        f"only {what}; a pattern over the bridge needs {FEWEST}.",
        remedy="Test more hangers, in one campaign: the first tests of each form its baseline.",
    )


def _explanations(parts: Sequence[Part]) -> tuple[Explanation, ...]:
    sums: dict[ExplanationName, float] = {}
    for part in parts:
        sums[part.name] = sums.get(part.name, 0.0) + float(np.exp(part.log_weight).sum())
    found = [Explanation(name, probability) for name, probability in sums.items()]
    return tuple(sorted(found, key=lambda each: -each.probability))


def _rows(shifts: Sequence[HangerShift], parts: Sequence[Part]) -> tuple[HangerRow, ...]:
    weights = np.exp(np.concatenate([part.log_weight for part in parts]))
    gained = weights @ np.concatenate([part.gained for part in parts])
    lost = weights @ np.concatenate([part.lost for part in parts])
    return tuple(
        _row(shift, float(up), float(down))
        for shift, up, down in zip(shifts, gained, lost, strict=True)
    )


def _row(shift: HangerShift, gained: float, lost: float) -> HangerRow:
    ways: dict[Way, float] = {"unchanged": 1 - gained - lost, "gained": gained, "lost": lost}
    way = max(ways, key=lambda each: ways[each])
    half = NINETY_PERCENT * shift.shift_sd_n
    values = (shift.shift_n, shift.shift_n - half, shift.shift_n + half)
    mean, low, high = (value / shift.baseline_n for value in values)
    return HangerRow(
        shift.hanger, shift.place, shift.position_m, shift.time, shift.baseline_n, *values,
        shift_fraction=mean, low_fraction=low, high_fraction=high,
        way=way, probability=max(0.0, ways[way]), gained_probability=gained, lost_probability=lost,
    )  # fmt: skip


def _suspects(shifts: Sequence[HangerShift], parts: Sequence[Part]) -> tuple[Suspect, ...]:
    """The likeliest few of those who shed or gained load."""
    moving: dict[_Who, float] = {}
    for part in parts:
        weights = np.exp(part.log_weight).tolist()
        for members, weight in zip(part.members.tolist(), weights, strict=False):
            who = _Who(part.name, tuple(members))
            moving[who] = moving.get(who, 0.0) + weight
    likeliest = sorted(moving, key=lambda who: -moving[who])[:_SUSPECTS]
    return tuple(_suspect(shifts, parts, who, moving[who]) for who in likeliest)


class _Who(NamedTuple):
    name: ExplanationName
    members: tuple[int, ...]


def _suspect(
    shifts: Sequence[HangerShift], parts: Sequence[Part], who: _Who, probability: float
) -> Suspect:
    logs, means, sds, members = [], [], [], list(who.members)
    for part in parts:
        if part.name == who.name and part.members.shape[1] == len(members):
            rows = (part.members == members).all(axis=1)
            logs.append(part.log_weight[rows])
            means.append(part.mean_n[rows][:, members])
            sds.append(part.sd_n[rows][:, members])
    mean, sd = _mixed(np.concatenate(logs), np.concatenate(means), np.concatenate(sds))
    hangers = tuple(shifts[index].hanger for index in members)
    return Suspect(who.name, hangers, probability, tuple(mean.tolist()), tuple(sd.tolist()))


def _mixed(
    log_weights: FloatArray, means: FloatArray, sds: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Mean and standard deviation (m,) of a mixture of h normal distributions (h, m)."""
    weights = np.exp(log_weights - scipy.special.logsumexp(log_weights))
    mean = weights @ means
    return mean, np.sqrt(np.maximum(weights @ (sds**2 + means**2) - mean**2, 0))


def _alike(
    shifts: Sequence[HangerShift], parts: Sequence[Part], causes: Sequence[AlikeCause]
) -> tuple[float, float, AlikeCause]:
    """The likeliest common cause, with the mean fraction of the hangers that it moves."""
    alike = [part for part in parts if part.name == "common shift"]
    logs = np.array([part.log_weight for part in alike]).reshape(-1, len(causes))
    best = int(scipy.special.logsumexp(logs, axis=0).argmax())
    touched = causes[best].fractions != 0
    baseline = np.array([each.baseline_n for each in shifts])
    means, sds = (
        np.concatenate([each[best :: len(causes)] for each in found]) / baseline
        for found in ([part.mean_n for part in alike], [part.sd_n for part in alike])
    )
    mean, sd = _mixed(
        logs[:, best],
        means[:, touched].mean(axis=1, keepdims=True),
        sds[:, touched].mean(axis=1, keepdims=True),
    )
    return float(mean[0]), float(sd[0]), causes[best]


def _sum_kept(
    bridge: Bridge,
    rows: Sequence[HangerRow],
    explanations: Sequence[Explanation],
    suspects: Sequence[Suspect],
) -> SumKept:
    """The sum over those who moved with their neighbours; over all where nobody stands out."""
    best = explanations[0].name
    if best in ("load redistribution", "load gain"):
        movers = next((s.hangers for s in suspects if s.name == best), ())
        centres = [row.place for row in rows if row.hanger in movers]
    elif best == "independent shifts":
        centres = [row.place for row in rows if row.way != "unchanged"]
    else:
        centres = []
    near = [not centres or min(abs(row.place - c) for c in centres) <= _REACH for row in rows]
    group = [index for index, close in enumerate(near) if close]
    wanted = {c + step for c in centres for step in range(-_REACH, _REACH + 1)}
    wanted = wanted or set(range(min(bridge.places), max(bridge.places) + 1))
    keeping = ("no change", "load redistribution", "load gain")
    return SumKept(
        hangers=tuple(rows[index].hanger for index in group),
        sum_n=float(bridge.shift_n[group].sum()),
        sum_sd_n=float(np.sqrt(bridge.noise[np.ix_(group, group)].sum())),
        probability=min(1.0, sum(e.probability for e in explanations if e.name in keeping)),
        complete=wanted <= set(bridge.places[group].tolist()),
    )
