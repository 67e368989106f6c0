"""The pattern over the bridge in plain English, for its owner."""

from __future__ import annotations

from collections.abc import Sequence

from shm.values.force_units import force_unit
from shm.values.rounding import NINETY_PERCENT, listed
from shm.watch.neighbours.pattern_types import (
    BridgePattern,
    ExplanationName,
    HangerRow,
    NeighbourOptions,
    Suspect,
)

_REACH = 2  # as in pattern: those that take up a load
_SURE_WHICH = 0.8  # judgement: four to one


def sentence_of(pattern: BridgePattern, alike_remedy: str, options: NeighbourOptions) -> str:
    """What most probably moved, by how much, and what to do about it."""
    best = pattern.explanations[0]
    if best.probability < options.named_from:
        return _undecided(pattern)
    if best.name == "nothing moved":
        return _nothing(pattern)
    if best.name == "all alike":
        return _alike(pattern, alike_remedy)
    if best.name == "each by itself":
        return _each(pattern)
    return _moved(pattern, best.name)


def leading_suspect(pattern: BridgePattern, name: ExplanationName) -> Suspect | None:
    """The likeliest hangers of one explanation."""
    return next((each for each in pattern.suspects if each.name == name), None)


def _undecided(pattern: BridgePattern) -> str:
    likely = [each for each in pattern.explanations if each.probability > 0.05]
    told = []
    for each in likely:
        suspect = leading_suspect(pattern, each.name)
        which = f", most likely {_hangers(suspect.hangers).lower()}" if suspect else ""
        told.append(f"{each.name} (probability {each.probability:.2f}{which})")
    largest = max(pattern.rows, key=lambda row: abs(row.shift_fraction))
    return (
        f"It cannot be told yet what moved: {listed(told)}; the largest shift is "
        f"{_percent(largest)} of hanger {largest.hanger}: test it and its neighbours again."
    )


def _nothing(pattern: BridgePattern) -> str:
    largest = max(pattern.rows, key=lambda row: abs(row.shift_fraction))
    return (
        f"No hanger has moved: of the {len(pattern.rows)} compared the largest shift is "
        f"{_percent(largest)} of hanger {largest.hanger}, no more than chance makes it."
    )


def _alike(pattern: BridgePattern, remedy: str) -> str:
    half = NINETY_PERCENT * pattern.alike_sd
    mean, low, high = (100 * (pattern.alike_fraction + s * half) for s in (0, -1, 1))
    who = "The hangers of one logger" if pattern.alike_cause.startswith("logger") else (
        f"All {len(pattern.rows)} hangers"
    )  # fmt: skip
    return (
        f"{who} moved by about {mean:+.1f} % (90 % interval {low:+.1f} to {high:+.1f} %): "
        f"{pattern.alike_cause} rather than a hanger; {remedy}."
    )


def _each(pattern: BridgePattern) -> str:
    moved = [row for row in pattern.rows if row.way != "unchanged"]
    if len(moved) == 1:
        return (
            f"Hanger {moved[0].hanger} has {_way(moved[0], pattern)}, and its neighbours did "
            "not take it up: check its sensor, its clamps and its description first, then itself."
        )
    if not moved:
        return "Some hangers moved a little, each by itself: test again to see which."
    told = [f"{row.hanger}: {_force(row.shift_n, pattern, '+')}" for row in moved]
    return (
        f"{len(moved)} hangers moved, and their neighbours did not take it up ({listed(told)}): "
        "check their tests, sensors and descriptions first, then the hangers themselves."
    )


def _moved(pattern: BridgePattern, name: ExplanationName) -> str:
    suspect = leading_suspect(pattern, name)
    if suspect is None:
        return _undecided(pattern)
    rows = {row.hanger: row for row in pattern.rows}
    movers = [rows[hanger] for hanger in suspect.hangers]
    told = " and ".join(f"hanger {row.hanger} has {_way(row, pattern)}" for row in movers)
    doubt = _others(pattern, suspect)
    remedy = (
        "look at its ends, its clamps and its anchorage"
        if name == "shed load"
        else "ask whether it was tightened or worked on"
    )
    return f"{told[0].upper()}{told[1:]} and {_answer(pattern, movers, name)}{doubt}: {remedy}."


def _answer(pattern: BridgePattern, movers: Sequence[HangerRow], name: ExplanationName) -> str:
    """How much of it the neighbours took up or gave."""
    lost = name == "shed load"
    own = {row.hanger for row in movers}
    near = [
        row
        for row in pattern.rows
        if row.hanger not in own and min(abs(row.place - m.place) for m in movers) <= _REACH
    ]
    answering = [
        row for row in near if (row.gained_probability if lost else row.lost_probability) > 0.5
    ] or near
    whose = "its" if len(movers) == 1 else "their"
    if not answering:
        return f"{whose} neighbours have no test to compare"
    taken = sum(row.shift_n for row in answering)
    half = sum((row.high_n - row.shift_n) ** 2 for row in answering) ** 0.5
    low_n, high_n = sorted(abs(taken + s * half) for s in (-1, 1))
    verb = "taken up" if lost else "given up"
    names = listed([str(row.hanger) for row in answering])
    many = len(answering) > 1
    return (
        f"{whose} neighbour{'s' if many else ''} {names} {'have' if many else 'has'} {verb} "
        f"{_force(abs(taken), pattern)} of it {_within(low_n, high_n, pattern)}"
    )


def _others(pattern: BridgePattern, leading: Suspect) -> str:
    """Who else it may have been, where that is in doubt."""
    alike = [each for each in pattern.suspects if each.name == leading.name]
    whole = pattern.probability(leading.name)
    if len(alike) < 2 or leading.probability > _SURE_WHICH * whole:
        return ""
    return (
        f" (or rather {_hangers(alike[1].hangers).lower()}: probabilities "
        f"{leading.probability:.2f} and {alike[1].probability:.2f})"
    )


def remarks_of(pattern: BridgePattern) -> tuple[str, ...]:
    """What qualifies the sentence: the sum, and who was not compared."""
    remarks = [_sum(pattern)]
    if pattern.not_compared:
        names = _hangers([each.hanger for each in pattern.not_compared])
        remarks.append(f"Not compared: {names.lower()}, whose tests are too old or missing.")
    return tuple(remarks)


def _sum(pattern: BridgePattern) -> str:
    kept = pattern.sum_kept
    moved = (
        f"The sum over {_group(pattern)} has moved by {_force(kept.sum_n, pattern, '+')} "
        f"(sd {_force(kept.sum_sd_n, pattern)})"
    )
    if kept.complete:
        return f"{moved}; the probability that it is kept is {kept.probability:.2f}."
    return (
        f"{moved}; a hanger without a test, or the bridge's end, may carry a part of it, and with "
        f"that part the probability that the sum is kept is {kept.probability:.2f}."
    )


def _group(pattern: BridgePattern) -> str:
    """`all 20 hangers`, `hangers 5 to 9`, or their numbers."""
    hangers = pattern.sum_kept.hangers
    if len(hangers) == len(pattern.rows):
        return f"all {len(hangers)} hangers compared"
    places = [row.place for row in pattern.rows if row.hanger in hangers]
    if len(hangers) > 2 and places == list(range(places[0], places[0] + len(places))):
        return f"hangers {hangers[0]} to {hangers[-1]}"
    return _hangers(hangers).lower()


def _way(row: HangerRow, pattern: BridgePattern) -> str:
    """`lost 34 kN (90 % interval 28 to 40 kN)`."""
    low_n, high_n = sorted(abs(value) for value in (row.low_n, row.high_n))
    verb = "lost" if row.shift_n < 0 else "gained"
    return f"{verb} {_force(abs(row.shift_n), pattern)} {_within(low_n, high_n, pattern)}"


def _within(low_n: float, high_n: float, pattern: BridgePattern) -> str:
    """`(90 % interval 28 to 40 kN)`."""
    low, _, _ = _force(low_n, pattern).partition(" ")
    return f"(90 % interval {low} to {_force(high_n, pattern)})"


def _force(force_n: float, pattern: BridgePattern, sign: str = "") -> str:
    """`34 kN`: in the unit of the tensions that shift, so that all of a sentence compare."""
    largest_n = max(row.baseline_n for row in pattern.rows)
    unit = force_unit(largest_n)
    return f"{unit.of(force_n):{sign}.{unit.decimals(largest_n) - 1}f} {unit.name}"


def _percent(row: HangerRow) -> str:
    mean, low, high = (
        100 * each for each in (row.shift_fraction, row.low_fraction, row.high_fraction)
    )
    return f"{mean:+.1f} % (90 % interval {low:+.1f} to {high:+.1f} %)"


def _hangers(hangers: Sequence[int]) -> str:
    names = listed([str(each) for each in hangers])
    return f"Hanger {names}" if len(hangers) == 1 else f"Hangers {names}"
