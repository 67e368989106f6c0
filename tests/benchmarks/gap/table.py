"""The marks and the table of the trial."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.stats import beta

from shm.values.leading import MIN_NO_GAP_PROBABILITY
from tests.benchmarks.gap.outcomes import ABOUT, NONE, Outcome
from tests.worlds.simulated.effects.registry import PLANTED

NAMED, COVERED, NO_GAP, UNEXPLAINED, SECONDS = 0.90, (0.80, 0.98), 0.95, 0.80, 60.0
ENOUGH = 20
HEADER = (
    "effect",
    "size",
    "n",
    "named first",
    "first or in the group",
    "size in its 90 % interval",
    "tension off before, after",
)


def share(flags: Sequence[bool]) -> float:
    return float(np.mean(flags)) if flags else float("nan")


def of(flags: Sequence[bool]) -> str:
    return f"{sum(flags)} of {len(flags)}" if flags else "-"


def with_interval(flags: Sequence[bool]) -> str:
    """The share with Jeffreys' 90 % interval."""
    hits, misses = sum(flags), len(flags) - sum(flags)
    low, high = (float(beta.ppf(each, hits + 0.5, misses + 0.5)) for each in (0.05, 0.95))
    return f"{of(flags)}: {share(flags):.2f} ({low:.2f} to {high:.2f})"


def sizes_said(wanted: float, outcomes: Sequence[Outcome]) -> str:
    """The size wanted, or from which to which they are where the effect cannot be so small."""
    sizes = [each.size for each in outcomes]
    if not sizes or max(sizes) < ABOUT * wanted:
        return f"{wanted:g}"
    return f"{min(sizes):.0f} to {max(sizes):.0f}"


def answered(outcome: Outcome) -> bool:
    """Whether the answer is right: the effect or its group; something unknown if it is left out."""
    if outcome.left_out:
        return outcome.unexplained > max(outcome.probability, outcome.no_gap)
    return outcome.first or outcome.in_group


def quiet(outcome: Outcome) -> bool:
    """Whether no gap leads."""
    return outcome.no_gap >= MIN_NO_GAP_PROBABILITY


def covers(outcomes: Sequence[Outcome]) -> list[bool]:
    return [each.covered for each in outcomes if each.covered is not None]


def row(name: str, size: str, outcomes: Sequence[Outcome]) -> tuple[str, ...]:
    """A line of the table."""
    before, after = (
        100 * float(np.median([abs(getattr(each, name)) for each in outcomes]))
        for name in ("tension_before", "tension_after")
    )
    return (
        name,
        size,
        str(len(outcomes)),
        of([each.first for each in outcomes]),
        of([answered(each) for each in outcomes]),
        of(covers(outcomes)),
        f"{before:.2f} %, {after:.2f} %",
    )


def rows(outcomes: Sequence[Outcome]) -> list[tuple[str, ...]]:
    """A line for every effect and size, in the order of the catalogue."""
    kinds = sorted({(list(PLANTED).index(o.case.effect), o.case.size) for o in outcomes})
    found = []
    for index, size in kinds:
        name = list(PLANTED)[index]
        own = [o for o in outcomes if (o.case.effect, o.case.size) == (name, size)]
        found.append(row(name, sizes_said(size, own), own))
    return found


def kinds(planted: Sequence[Outcome]) -> list[tuple[str, list[Outcome]]]:
    """What was planted, by size wanted; those that have it beside all."""
    found = []
    for size in sorted({each.case.size for each in planted}):
        own = [each for each in planted if each.case.size == size]
        exact = [each for each in own if each.size < ABOUT * size]
        found.append((f"size {size:g} or the smallest that exists", own))
        if 0 < len(exact) < len(own):
            found.append((f"of these, size {size:g}", exact))
    return found


def marks(outcomes: Sequence[Outcome]) -> list[tuple[str, str, bool]]:
    """What is asked, what was found, whether it is met."""
    empty = [each for each in outcomes if each.case.effect == NONE]
    found = []
    for kind, own in kinds([each for each in outcomes if each.planted is not None]):
        right, sizes = [answered(each) for each in own], covers(own)
        what, least = ("unexplained", UNEXPLAINED) if own[0].left_out else ("named", NAMED)
        found.append(
            (f"{kind}: {what}, at least {least}", with_interval(right), share(right) >= least)
        )
        inside = len(sizes) < ENOUGH or COVERED[0] <= share(sizes) <= COVERED[1]
        if sizes:
            mark = f"{kind}: in its 90 % interval, {COVERED[0]} to {COVERED[1]}"
            found.append((mark, with_interval(sizes), inside))
    if empty:
        calm = [quiet(each) for each in empty]
        mark = f"no gap leads where none is, at least {NO_GAP}"
        found.append((mark, with_interval(calm), share(calm) >= NO_GAP))
    seconds = [each.seconds for each in outcomes]
    said = f"median {np.median(seconds):.1f}, largest {np.max(seconds):.1f}"
    found.append((f"seconds of one core, below {SECONDS:g}", said, max(seconds) < SECONDS))
    return found


def seeds_said(outcomes: Sequence[Outcome]) -> str:
    """The seeds from which to which, without those that were not run."""
    seeds = sorted({each.case.seed for each in outcomes})
    ends = [k for k in range(len(seeds)) if k + 1 == len(seeds) or seeds[k + 1] > seeds[k] + 1]
    begins = [0, *(k + 1 for k in ends[:-1])]
    return ", ".join(f"{seeds[a]} to {seeds[b]}" for a, b in zip(begins, ends, strict=True))


def marks_table(outcomes: Sequence[Outcome]) -> str:
    """The marks for people."""
    lines = [f"{len(outcomes)} campaigns, seeds {seeds_said(outcomes)}.", ""]
    lines += ["| mark | found | met |", "|---|---|---|"]
    lines += [
        f"| {mark} | {found} | {'yes' if met else 'no'} |" for mark, found, met in marks(outcomes)
    ]
    return "\n".join(lines)


def by_effect(outcomes: Sequence[Outcome]) -> list[Sequence[str]]:
    """Every effect at both sizes, under its headings."""
    return [HEADER, *rows([each for each in outcomes if each.planted is not None])]
