"""The marks of the diagnosis at every richness of data."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from shm.gap.attribution import Attribution, Explanation
from shm.gap.problem import GapProblem

ENOUGH = 20
LIKELY = 1e-4
NAMED = {"two planes": 0.78, "shapes": 0.93, "everything": 0.95}
LOG_SCORE = {"two planes": 1.34, "shapes": 1.35, "everything": 1.10}
BINS = 8


@dataclass(frozen=True)
class Asked:
    """One case, and whether its effects are left out of the catalogue."""

    richness: str
    seed: int
    left_out: bool = False


@dataclass(frozen=True)
class Scored:
    """An answer beside its truth. `claim` is the probability of what leads and its group, `right`
    whether that is the truth; `chances` are all causes, the likeliest first, `log_bayes` and
    `groups` go with them. Tensions are over the true one.
    """

    asked: Asked
    kind: str
    effects: tuple[str, ...]
    size: float
    leader: str
    claim: float
    right: bool
    causes: tuple[str, ...]
    chances: tuple[float, ...]
    log_bayes: tuple[float, ...]
    groups: tuple[int | None, ...]
    no_gap: float
    unexplained: float
    before: tuple[float, float, float]
    after: tuple[float, float, float]
    p_value: float

    @property
    def truth(self) -> str:
        return " + ".join(self.effects)

    @property
    def group(self) -> set[str]:
        """Of the first cause."""
        number = self.groups[0]
        if number is None:
            return {same(self.causes[0])}
        alike = zip(self.causes, self.groups, strict=True)
        return {same(cause) for cause, group in alike if group == number}

    @property
    def truth_chance(self) -> float:
        """What was given to the truth."""
        if self.kind == "none":
            return self.no_gap
        if self.kind == "unknown" or self.asked.left_out:
            return self.unexplained
        wanted = same(self.truth)
        found = zip(self.causes, self.chances, strict=True)
        return sum(chance for cause, chance in found if same(cause) == wanted)


@dataclass(frozen=True)
class Mark:
    richness: str
    name: str
    found: str
    verdict: str


def same(cause: str) -> str:
    """A pair whatever the order of its effects."""
    return " + ".join(sorted(cause.split(" + ")))


def kept(line: str) -> Scored:
    """A score from a line of the answers."""
    fields: dict[str, Any] = json.loads(line)
    fields = {key: tuple(v) if isinstance(v, list) else v for key, v in fields.items()}
    return Scored(**{**fields, "asked": Asked(**fields["asked"])})


def scored(
    asked: Asked,
    kind: str,
    effects: tuple[str, ...],
    size: float,
    tension_n: float,
    problem: GapProblem,
    found: Attribution,
) -> Scored:
    """The diagnosis beside the truth."""
    causes = found.explanations
    leader, claim, names = leading(found)
    truth = {"none": "no gap", "unknown": "unexplained"}.get(kind, same(" + ".join(effects)))
    truth = "unexplained" if asked.left_out else truth
    return Scored(
        asked, kind, effects, size, leader, claim, truth in names,
        tuple(each.effect for each in causes),
        tuple(each.probability for each in causes),
        tuple(each.log_bayes_factor for each in causes),
        tuple(each.group for each in causes),
        found.no_gap_probability, found.unexplained_probability,
        tension(problem, found, [(1.0, None)], tension_n),
        tension(problem, found, weighed(found), tension_n),
        found.p_value,
    )  # fmt: skip


def leading(found: Attribution) -> tuple[str, float, set[str]]:
    """What leads, its probability, and all it stands for."""
    best = max(found.explanations, key=found.claimed, default=None)
    rest = {"no gap": found.no_gap_probability, "unexplained": found.unexplained_probability}
    other = max(rest, key=rest.__getitem__)
    if best is None or found.claimed(best) <= rest[other]:
        return other, rest[other], {other}
    group = {each.effect for each in found.explanations if each.group == best.group is not None}
    return best.effect, found.claimed(best), {same(each) for each in group | {best.effect}}


def weighed(found: Attribution) -> list[tuple[float, Explanation | None]]:
    """What leads with its group, as the diagnosis answers."""
    names = leading(found)[2]
    chosen = [each for each in found.explanations if same(each.effect) in names]
    return [(each.probability, each) for each in chosen] or [(1.0, None)]


def tension(
    problem: GapProblem,
    found: Attribution,
    answer: Sequence[tuple[float, Explanation | None]],
    tension_n: float,
) -> tuple[float, float, float]:
    """Mean and 95 % interval over the true tension."""
    draws, weights = [], []
    for chance, each in answer:
        fit = each.best.fit if each is not None else found.baseline
        if fit is not None:
            draws.append(problem.tension_n(fit.hypothesis, fit.draws) / tension_n)
            weights.append(np.full(len(draws[-1]), chance / len(draws[-1])))
    values, weight = np.concatenate(draws), np.concatenate(weights)
    order = np.argsort(values)
    reached = np.cumsum(weight[order]) / weight.sum()
    low, high = (float(values[order][np.searchsorted(reached, q)]) for q in (0.025, 0.975))
    return float(np.average(values, weights=weight)), low, high


def said(each: Scored) -> str:
    """One case in a line."""
    first = [
        f"{cause} {chance:.2f} ({log_bayes:.1f})"
        for cause, chance, log_bayes in zip(each.causes, each.chances, each.log_bayes, strict=True)
    ]
    group = "/".join(sorted(each.group)) if first else ""
    left = " LEFT OUT" if each.asked.left_out else ""
    return (
        f"{each.asked.richness} #{each.asked.seed}{left} {each.kind} {each.truth} {each.size:.1f}"
        f" -> {each.leader} {each.claim:.2f} {'right' if each.right else 'WRONG'}; no gap"
        f" {each.no_gap:.2f}, unexplained {each.unexplained:.2f}; {', '.join(first[:4])}; alike"
        f" {group}; tension {each.before[0]:.4f} -> {each.after[0]:.4f}"
        f" [{each.after[1]:.4f}, {each.after[2]:.4f}], p {each.p_value:.2f}"
    )


def marks(found: Sequence[Scored]) -> list[Mark]:
    """Of each richness, and of all together."""
    kinds = list(dict.fromkeys(each.asked.richness for each in found))
    groups = [(kind, [each for each in found if each.asked.richness == kind]) for kind in kinds]
    groups += [("all", list(found))] if len(kinds) > 1 else []
    return [mark for kind, own in groups for mark in _marks(kind, own)]


def _marks(richness: str, found: Sequence[Scored]) -> list[Mark]:
    full = [each for each in found if not each.asked.left_out]
    known = [each for each in full if each.kind == "one" and each.size >= 4]
    left = [each for each in found if each.asked.left_out and each.size >= 4]
    none = [each for each in full if each.kind == "none"]
    two = [each for each in full if each.kind == "two" and each.size >= 4]
    answers = {each.asked: each for each in full}
    large = [each for each in full if each.kind in ("one", "two") and each.size >= 4]

    def mark(
        name: str,
        of: Sequence[Scored],
        what: Callable[[Scored], float],
        low: float = -np.inf,
        high: float = np.inf,
        middle: Callable[[Sequence[float]], np.floating] = np.mean,
    ) -> Mark:
        values = [float(what(each)) for each in of]
        value = float(middle(values)) if values else float("nan")
        met = "yes" if low <= value <= high else "no"
        return Mark(
            richness, name, f"{value:.3f} of {len(of)}", met if len(of) >= ENOUGH else "few"
        )

    return [
        mark("detected, size 4 up", large, lambda e: e.leader != "no gap", low=0.95),
        mark("false alarm", none, lambda e: e.leader != "no gap", high=0.03),
        mark("named first", known, _first, low=NAMED.get(richness, 0.0)),
        mark("in its group", known, lambda e: same(e.truth) in e.group, low=0.97),
        mark("left out: falsely sure", left, lambda e: _false(e, answers), high=0.05),
        mark("left out: unexplained leads", left, lambda e: e.leader == "unexplained",
             low=0.8 if richness == "everything" else 0.0),
        mark("two: found", two, two_found, low=0.7 if richness == "everything" else 0.0),
        Mark(richness, "calibration error of the claim", f"{calibration_error(full):.3f}",
             "few" if len(full) < ENOUGH else "yes" if calibration_error(full) <= 0.06 else "no"),
        mark("log score", full, lambda e: -np.log(max(e.truth_chance, LIKELY)),
             high=LOG_SCORE.get(richness, np.inf)),
        mark("tension in its interval", full, lambda e: e.after[1] <= 1 <= e.after[2], 0.9, 0.98),
        mark("tension error after", large, lambda e: abs(e.after[0] - 1), middle=np.median),
        mark("tension error before", large, lambda e: abs(e.before[0] - 1), middle=np.median),
    ]  # fmt: skip


def _first(each: Scored) -> bool:
    return bool(each.causes) and each.causes[0] == each.truth


def _false(each: Scored, answers: dict[Asked, Scored]) -> bool:
    """More than 0.9 sure of a cause outside the group that the truth had."""
    if each.leader in ("no gap", "unexplained") or each.claim <= 0.9:
        return False
    full = answers.get(Asked(each.asked.richness, each.asked.seed))
    if full is None:
        return True
    number = dict(zip(map(same, full.causes), full.groups, strict=True)).get(same(each.truth))
    alike = zip(full.causes, full.groups, strict=True)
    allowed = {same(cause) for cause, group in alike if number is not None and group == number}
    return same(each.leader) not in allowed and not set(each.leader.split(" + ")) & allowed


def two_found(each: Scored) -> bool:
    """The pair or its group leads, or one of them does and says that there is more: the pair or
    something unexplained is among the first three of all answers.
    """
    if each.right:
        return True
    answers = [(each.no_gap, "no gap"), (each.unexplained, "unexplained")]
    answers += zip(each.chances, map(same, each.causes), strict=True)
    first = [name for _, name in sorted(answers, reverse=True)[:3]]
    more = "unexplained" in first or same(each.truth) in first
    return each.leader in each.effects and more


def calibration_error(found: Sequence[Scored]) -> float:
    """Expected calibration error of the leading claim, in bins of as many cases."""
    if not found:
        return float("nan")
    claim = np.array([each.claim for each in found])
    right = np.array([float(each.right) for each in found])
    bins = np.array_split(np.argsort(claim), BINS)
    return float(
        sum(abs(claim[b].mean() - right[b].mean()) * len(b) for b in bins if len(b)) / len(found)
    )
