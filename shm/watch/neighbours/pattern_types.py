"""What goes into the pattern over the bridge, what comes out, and how that reads in English."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import datetime
from types import MappingProxyType
from typing import Literal

from shm.values import NAN
from shm.values.rounding import NINETY_PERCENT, force_unit, listed, rounded, rounded_percent

ExplanationName = Literal[
    "no change", "load redistribution", "load gain", "common shift", "independent shifts"
]
REDISTRIBUTION: ExplanationName = "load redistribution"
Way = Literal["gained", "lost", "unchanged"]


@dataclass(frozen=True)
class HangerShift:
    """How far a hanger's tension lies from its baseline at its latest test, by itself.

    `place` counts the hangers along the bridge, those without a test too; two rows of hangers stand
    in one count if three places or more are left free between them. `temperature_change_k` is that
    of the latest test from the baseline's mean, NaN where unknown.
    """

    hanger: int
    place: int
    time: datetime
    baseline_n: float
    shift_n: float
    shift_sd_n: float
    position_m: float = NAN
    temperature_change_k: float = NAN


# Judgement: why, says `NeighbourOptions`.
_PRIOR: dict[ExplanationName, float] = {
    "no change": 0.70,
    "load redistribution": 0.10,
    "load gain": 0.04,
    "common shift": 0.08,
    "independent shifts": 0.08,
}


@dataclass(frozen=True)
class NeighbourOptions:
    """What is taken for granted before any data.

    - `prior`: most looks at a bridge find nothing; a hanger that slackens is what one watches for;
      one that gains was tightened, and somebody would know; faults of a whole campaign and of
      single hangers (a sensor moved, a wrong description) are about as frequent as damage.
    - `sizes_fraction`: a shift, if there is one, is normal with one of these standard deviations,
      fractions of the tension, equally likely: half a decade apart, no size preferred.
    - `nearest_share`, `next_share`: what each neighbour takes up of a lost load on average, as a
      stiff deck spreads it; the shares scatter as a Dirichlet of `share_concentration` does, which
      is a standard deviation of 0.19 and 0.15.
    - `two_hangers`: the prior share of two hangers shedding load at once.
    - `scatter_fraction`: what parked loads and the like add to each hanger's standard deviation.
    - `common_scatter_fraction`: what the temperature correction leaves in all hangers together.
    - `noise_scales`, `noise_prior`: the stated standard deviations may be too small by one of these
      factors, as those of any identification may; without it such noise would be named a move.
    - `negligible_fraction`: a shift within it counts as unchanged.
    - `named_from`: the probability from which an explanation is named.
    """

    window_days: float = 30.0
    prior: MappingProxyType[ExplanationName, float] = field(
        default_factory=lambda: MappingProxyType(_PRIOR)
    )
    sizes_fraction: tuple[float, ...] = (0.01, 0.03, 0.1, 0.3)
    nearest_share: float = 0.35
    next_share: float = 0.15
    share_concentration: float = 5.0
    two_hangers: float = 0.2
    scatter_fraction: float = 0.001
    common_scatter_fraction: float = 0.002
    noise_scales: tuple[float, ...] = (1.0, 1.5, 2.25)
    noise_prior: tuple[float, ...] = (0.7, 0.2, 0.1)
    negligible_fraction: float = 0.005
    named_from: float = 0.8


@dataclass(frozen=True)
class Explanation:
    """One explanation of all shifts together; the probabilities of a pattern's five add to 1."""

    name: ExplanationName
    probability: float


@dataclass(frozen=True)
class Suspect:
    """The hangers (one or two) that shed or gained load, if any did.

    `probability` is given all the data, all explanations admitted; `shift_n` and `shift_sd_n` hold
    the shift of each if it is they, in which their neighbours have a say.
    """

    name: ExplanationName
    hangers: tuple[int, ...]
    probability: float
    shift_n: tuple[float, ...]
    shift_sd_n: tuple[float, ...]


@dataclass(frozen=True)
class HangerRow:
    """One hanger: its shift as measured, with 90 % interval, and which way it moved.

    `probability` is that of `way`, all explanations weighed; a shift of all hangers alike counts as
    a move too. Fractions are of the baseline tension.
    """

    hanger: int
    place: int
    position_m: float
    time: datetime
    baseline_n: float
    shift_n: float
    low_n: float
    high_n: float
    shift_fraction: float
    low_fraction: float
    high_fraction: float
    way: Way
    probability: float
    gained_probability: float
    lost_probability: float


@dataclass(frozen=True)
class SumKept:
    """Whether the tensions of `hangers` add to what they did.

    `probability` is that of the explanations which keep the sum. `complete` is false where a hanger
    among them has no shift, or where the bridge's end may have taken a share.
    """

    hangers: tuple[int, ...]
    sum_n: float
    sum_sd_n: float
    probability: float
    complete: bool


@dataclass(frozen=True)
class NotCompared:
    """A hanger that the pattern leaves out, and why; `time` is None where it has no test."""

    hanger: int
    place: int
    time: datetime | None
    why: str


@dataclass(frozen=True)
class BridgePattern:
    """What moved over the bridge: five explanations, the likeliest first, and each hanger.

    `suspects` are the likeliest hangers to have shed or gained load. `alike_fraction` and its sd
    are the common shift if all moved alike, and `alike_cause` what that would be put down to.
    `sentence` says it to the owner.
    """

    newest: datetime
    explanations: tuple[Explanation, ...]
    suspects: tuple[Suspect, ...]
    rows: tuple[HangerRow, ...]
    sum_kept: SumKept
    alike_fraction: float
    alike_sd: float
    alike_cause: str
    not_compared: tuple[NotCompared, ...]
    sentence: str
    remarks: tuple[str, ...] = ()

    def probability(self, name: ExplanationName) -> float:
        """The probability of one explanation."""
        return next(each.probability for each in self.explanations if each.name == name)


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
    return (
        f"All hangers shifted alike, by {size}. The probable cause is {pattern.alike_cause}, not "
        f"the hangers. {remedy[0].upper()}{remedy[1:]}."
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
