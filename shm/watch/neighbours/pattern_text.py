"""The pattern over the bridge in plain English, for its owner."""

from __future__ import annotations

from collections.abc import Sequence

from shm.values.rounding import NINETY_PERCENT, force_unit, listed, rounded, rounded_percent
from shm.watch.neighbours.pattern_types import (
    REDISTRIBUTION,
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
    if best.name == "no change":
        return _nothing(pattern)
    if best.name == "common shift":
        return _alike(pattern, alike_remedy)
    if best.name == "independent shifts":
        return _each(pattern)
    return _moved(pattern, best.name)


def leading_suspect(pattern: BridgePattern, name: ExplanationName) -> Suspect | None:
    """The likeliest hangers of one explanation."""
    return next((each for each in pattern.suspects if each.name == name), None)


def _undecided(pattern: BridgePattern) -> str:
    best = pattern.explanations[0]
    suspect = leading_suspect(pattern, best.name)
    way = "from" if best.name == REDISTRIBUTION else "of"
    of = f" {way} {_hangers(suspect.hangers).lower()}" if suspect else ""
    largest = max(pattern.rows, key=lambda row: abs(row.shift_fraction))
    return (
        "It is not clear yet whether load moved between hangers. Most probable is "
        f"{best.name}{of} (probability {best.probability:.2f}). The largest shift is "
        f"{_percent(largest)}, of hanger {largest.hanger}."
    )


def _nothing(pattern: BridgePattern) -> str:
    largest = max(pattern.rows, key=lambda row: abs(row.shift_fraction))
    return (
        f"No load has moved between hangers: the largest shift, {_percent(largest)} of hanger "
        f"{largest.hanger}, is within the scatter."
    )


def _alike(pattern: BridgePattern, remedy: str) -> str:
    size = rounded_percent(pattern.alike_fraction, NINETY_PERCENT * pattern.alike_sd, "+")
    is_of_logger = pattern.alike_cause.startswith("logger")
    who = "The hangers of one logger" if is_of_logger else "All hangers"
    return (
        f"{who} shifted alike, by {size}. The probable cause is {pattern.alike_cause}, not the "
        f"hangers. {remedy[0].upper()}{remedy[1:]}."
    )


def _each(pattern: BridgePattern) -> str:
    moved = [row for row in pattern.rows if row.way != "unchanged"]
    if not moved:
        return (
            "Some hangers changed a little, without load moving between them; the tests do not "
            "show which."
        )
    alone = "A wrong sensor, clamp or description would look the same."
    if len(moved) == 1:
        row = moved[0]
        return f"Hanger {row.hanger} {_way(row)}, and its neighbours did not take it up. {alone}"
    names = _hangers([row.hanger for row in moved])
    return f"{names} changed, and their neighbours did not take it up. {alone}"


def _moved(pattern: BridgePattern, name: ExplanationName) -> str:
    suspect = leading_suspect(pattern, name)
    if suspect is None:
        return _undecided(pattern)
    rows = {row.hanger: row for row in pattern.rows}
    movers = [rows[hanger] for hanger in suspect.hangers]
    lost = name == REDISTRIBUTION
    first = " ".join(f"Hanger {row.hanger} {_way(row)}." for row in movers)
    whose = f"{_hangers(suspect.hangers).lower()} to {'its' if len(movers) == 1 else 'their'}"
    lead = f"Load has moved from {whose} neighbours." if lost else ""
    parts = (lead, first, _answer(pattern, movers, lost=lost), _others(pattern, suspect))
    return " ".join(part for part in parts if part)


def _answer(pattern: BridgePattern, movers: Sequence[HangerRow], *, lost: bool) -> str:
    """How much of it the neighbours took up or gave."""
    own = {row.hanger for row in movers}
    near = [
        row
        for row in pattern.rows
        if row.hanger not in own and min(abs(row.place - m.place) for m in movers) <= _REACH
    ]
    answering = [
        row for row in near if (row.gained_probability if lost else row.lost_probability) > 0.5
    ] or near
    its, it = ("Its", "it") if len(movers) == 1 else ("Their", "them")
    if not answering:
        return f"{its} neighbours have no test to compare."
    taken = sum(row.shift_n for row in answering)
    half = sum((row.high_n - row.shift_n) ** 2 for row in answering) ** 0.5
    names, did = _hangers([row.hanger for row in answering]), "took up" if lost else "gave up"
    return f"{names} beside {it} {did} {_force(abs(taken), half)} of it."


def _others(pattern: BridgePattern, leading: Suspect) -> str:
    """Who else it may have been, where that is in doubt."""
    alike = [each for each in pattern.suspects if each.name == leading.name]
    whole = pattern.probability(leading.name)
    if len(alike) < 2 or leading.probability > _SURE_WHICH * whole:
        return ""
    return (
        f"It may also be {_hangers(alike[1].hangers).lower()} (probability "
        f"{alike[1].probability:.2f})."
    )


def remarks_of(pattern: BridgePattern) -> tuple[str, ...]:
    """What qualifies the sentence: the sum, and who was not compared."""
    kept = pattern.sum_kept
    half = NINETY_PERCENT * kept.sum_sd_n
    remarks = [
        f"The sum of the tensions of {_group(pattern)} changed by {_force(kept.sum_n, half, '+')}."
    ]
    if not kept.complete:
        remarks.append("A hanger without a test, or the bridge's end, may carry a part of it.")
    if pattern.not_compared:
        names = _hangers([each.hanger for each in pattern.not_compared])
        remarks.append(f"Not compared: {names.lower()}, whose tests are too old or missing.")
    return tuple(remarks)


def _group(pattern: BridgePattern) -> str:
    """`all hangers compared`, `hangers 5 to 9`, or their numbers."""
    hangers = pattern.sum_kept.hangers
    if len(hangers) == len(pattern.rows):
        return "all hangers compared"
    places = [row.place for row in pattern.rows if row.hanger in hangers]
    if len(hangers) > 2 and places == list(range(places[0], places[0] + len(places))):
        return f"hangers {hangers[0]} to {hangers[-1]}"
    return _hangers(hangers).lower()


def _way(row: HangerRow) -> str:
    """`lost 34.1 ± 5.8 kN`."""
    verb = "lost" if row.shift_n < 0 else "gained"
    return f"{verb} {_force(abs(row.shift_n), (row.high_n - row.low_n) / 2)}"


def _force(force_n: float, half_n: float, sign: str = "") -> str:
    """`34.1 ± 5.8 kN`, rounded by its interval."""
    unit = force_unit(force_n, half_n)
    return f"{rounded(unit.of(force_n), unit.of(half_n), sign)} {unit.name}"


def _percent(row: HangerRow) -> str:
    return rounded_percent(row.shift_fraction, (row.high_fraction - row.low_fraction) / 2, "+")


def _hangers(hangers: Sequence[int]) -> str:
    names = listed([str(each) for each in hangers])
    return f"Hanger {names}" if len(hangers) == 1 else f"Hangers {names}"
