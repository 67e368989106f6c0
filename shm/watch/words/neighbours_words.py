"""State the pattern over the bridge in English: what most probably moved, and what to do."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from shm.values.rounding import NINETY_PERCENT, force_unit, listed, rounded, rounded_percent
from shm.watch.engine.limits import LIMITS
from shm.watch.neighbours import (
    REACH,
    BridgePattern,
    HangerRow,
    HangerShift,
    NeighbourOptions,
    weigh_pattern,
)


def bridge_pattern(
    shifts: Sequence[HangerShift],
    order: Sequence[int] = (),
    options: NeighbourOptions | None = None,
) -> BridgePattern:
    """Return what moved over the bridge, as `weigh_pattern` does, with sentence and remarks."""
    options = options or NeighbourOptions()
    pattern = weigh_pattern(shifts, order, options)
    sentence = sentence_of(pattern, options.named_from)
    return replace(pattern, sentence=sentence, remarks=remarks_of(pattern))


def sentence_of(pattern: BridgePattern, named_from: float) -> str:
    """Return the most probable explanation, or that none is clear."""
    best = pattern.explanations[0]
    largest = max(pattern.rows, key=lambda row: abs(row.shift_fraction))
    size = rounded_percent(
        largest.shift_fraction, (largest.high_fraction - largest.low_fraction) / 2, "+"
    )
    if best.probability < named_from:
        suspect = next((each for each in pattern.suspects if each.name == best.name), None)
        way = "from" if best.name == "load redistribution" else "of"
        of = f" {way} {_hangers(suspect.hangers).lower()}" if suspect else ""
        explanation = f"{best.name.capitalize()}{of} is"
        if best.name == "independent shifts":
            explanation = "Independent changes are"
        return (
            f"It is not clear yet whether load moved between hangers. {explanation} the most "
            f"probable explanation ({best.probability:.2f}). The largest shift is {size}, "
            f"of hanger {largest.hanger}."
        )
    if best.name == "no change":
        return (
            f"No load has moved between hangers: the largest shift, {size} of hanger "
            f"{largest.hanger}, is within the scatter."
        )
    if best.name == "common shift":
        size = rounded_percent(pattern.alike_fraction, NINETY_PERCENT * pattern.alike_sd, "+")
        return (
            f"All hangers shifted alike, by {size}. The probable cause is {pattern.alike_cause}, "
            "not the hangers. Compare the loggers' clocks and sampling rates, check the "
            "temperatures of the tests, and ask for new surfacing or works."
        )
    return _individual(pattern) if best.name == "independent shifts" else _moved(pattern)


def _individual(pattern: BridgePattern) -> str:
    moved = [row for row in pattern.rows if row.way != "unchanged"]
    if not moved:
        return (
            "Some hangers changed a little, without load moving between them; the tests do not "
            "show which."
        )
    who = f"Hanger {moved[0].hanger} {_way(moved[0])}, and its"
    if len(moved) > 1:
        who = f"{_hangers([row.hanger for row in moved])} changed, and their"
    return (
        f"{who} neighbours did not take it up. A wrong sensor, clamp or description would look "
        "the same."
    )


def _moved(pattern: BridgePattern) -> str:
    """State who shed or gained load, how much of it the neighbours took up or gave, any doubt."""
    name = pattern.explanations[0].name
    suspects = [each for each in pattern.suspects if each.name == name]
    movers = [row for row in pattern.rows if row.hanger in suspects[0].hangers]
    lost, one = name == "load redistribution", len(movers) == 1
    whose = f"{_hangers(suspects[0].hangers).lower()} to {'its' if one else 'their'}"
    words = [f"Load has moved from {whose} neighbours."] if lost else []
    words += [f"Hanger {row.hanger} {_way(row)}." for row in movers]
    near = [
        row
        for row in pattern.rows
        if row not in movers and min(abs(row.place - each.place) for each in movers) <= REACH
    ]
    answered = [
        row for row in near if (row.gained_probability if lost else row.lost_probability) > 0.5
    ]
    near = answered or near
    if near:
        taken = sum(row.shift_n for row in near)
        half = sum((row.high_n - row.shift_n) ** 2 for row in near) ** 0.5
        names, did = _hangers([row.hanger for row in near]), "took up" if lost else "gave up"
        words.append(
            f"{names} beside {'it' if one else 'them'} {did} {_force(abs(taken), half)} of it."
        )
    else:
        words.append(f"{'Its' if one else 'Their'} neighbours have no test to compare.")
    if len(suspects) > 1 and suspects[0].probability <= LIMITS.sure_which * pattern.probability(
        name
    ):
        words.append(
            f"It may also be {_hangers(suspects[1].hangers).lower()} (probability "
            f"{suspects[1].probability:.2f})."
        )
    return " ".join(words)


def remarks_of(pattern: BridgePattern) -> tuple[str, ...]:
    """Return what qualifies the sentence: the sum, and who was not compared."""
    chosen, hangers = pattern.sum_kept, pattern.sum_kept.hangers
    places = [row.place for row in pattern.rows if row.hanger in hangers]
    group = _hangers(hangers).lower()
    if len(hangers) == len(pattern.rows):
        group = "all hangers compared"
    elif len(hangers) > 2 and places[-1] - places[0] == len(places) - 1:
        group = f"hangers {hangers[0]} to {hangers[-1]}"
    change = _force(chosen.sum_n, NINETY_PERCENT * chosen.sum_sd_n, "+")
    remarks = [f"The sum of the tensions of {group} changed by {change}."]
    if not chosen.complete:
        remarks.append("A hanger without a test, or the bridge's end, may carry a part of it.")
    if pattern.not_compared:
        names = _hangers([each.hanger for each in pattern.not_compared])
        remarks.append(f"Not compared: {names.lower()}, whose tests are too old or missing.")
    return tuple(remarks)


def _way(row: HangerRow) -> str:
    """Return `lost 34.1 ± 5.8 kN`."""
    verb = "lost" if row.shift_n < 0 else "gained"
    return f"{verb} {_force(abs(row.shift_n), (row.high_n - row.low_n) / 2)}"


def _force(force_n: float, half_n: float, sign: str = "") -> str:
    unit = force_unit(force_n, half_n)
    return f"{rounded(unit.of(force_n), unit.of(half_n), sign)} {unit.name}"


def _hangers(hangers: Sequence[int]) -> str:
    names = listed([str(each) for each in hangers])
    return f"Hanger {names}" if len(hangers) == 1 else f"Hangers {names}"
