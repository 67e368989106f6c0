"""A test before it counts: what its checks look at, what its modes imply, what a person is told."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import date, datetime, timedelta

from shm.documents import format_time
from shm.models.bar_fit import PARAMETERS, Bar, fit_bars, refit, seen_in
from shm.plausibility.bar_evidence import OTHER_BAR, changes_of
from shm.values import (
    NAN,
    Doubt,
    Fingerprint,
    Hanger,
    KnownSamples,
    ModalTest,
    Posterior,
)
from shm.values.messages import TODAY, WEEK


@dataclass(frozen=True, eq=False)
class Candidate:
    """An identified test before it counts, and what is known to judge it by.

    `possible_times` are several where the day of its time can be read in several orders.
    `file_times` are those of all files or records of this one test, `neighbours` those of other
    tests in the same file, `same_time` are tests of the same hanger in other recordings with the
    very same time. `modified_at` is when the file was last written, which copying resets.
    `built` is when the bridge was; `tolerance` how far ahead of the receipt a clock may be.
    `reference` are the tests of the hanger's baseline in force, the latest taken at
    `reference_at`; `earlier` its latest tests that count, by time, `arrived` those that came in
    last, whatever their time; `baseline` the posterior that later tests are compared with.
    `copies` are recordings that may hold the same samples, `others` the other hangers of the bridge
    with their latest tests that count. `signals` says which of its channels are doubtful.
    """

    hanger: Hanger
    test: ModalTest
    received_at: datetime
    tolerance: timedelta
    modified_at: datetime | None = None
    built: date | None = None
    possible_times: Sequence[datetime] = ()
    file_times: Sequence[datetime] = ()
    neighbours: Sequence[datetime] = ()
    same_time: Sequence[ModalTest] = ()
    reference: Sequence[ModalTest] = ()
    reference_at: datetime | None = None
    earlier: Sequence[ModalTest] = ()
    arrived: Sequence[ModalTest] = ()
    baseline: Posterior | None = None
    fingerprint: Fingerprint | None = None
    copies: Sequence[KnownSamples] = ()
    others: Sequence[tuple[Hanger, Sequence[ModalTest]]] = ()
    signals: Sequence[str] = ()


Check = Callable[[Candidate], Doubt | None]
"""Gives one reason to hold a test; None where there is none, or nothing to judge by."""


def implied_shift(test: ModalTest, reference: Sequence[ModalTest], hanger: Hanger) -> float:
    """Return by which fraction the tension differs from the reference's, going by the modes.

    Bending stiffness and ends may differ, too: stiffer ends lift the high modes, and a tension by
    itself would have to rise for that, though it has fallen. A rough figure is all that is wanted
    of a test that may be of another bar. NaN where they share no mode, or where the bar carries no
    tension.
    """
    before = seen_in(reference, hanger)
    shift = seen_in([test], hanger).over(before)
    if not shift.mask.any() or not hanger.nominal_tension_n > 0:
        return NAN
    (fit,) = fit_bars([Bar.described(hanger, before)])
    ((_, sd),) = changes_of(OTHER_BAR)
    return math.expm1(refit(fit, shift, sd[:PARAMETERS]).theta[0] - fit.theta[0])


_OTHER_BAR = ("right hanger", "right planes", "right time base")
"""Checks that modes fail which are not those of the hanger as it was."""


def notice_of(
    candidate: Candidate,
    doubts: Sequence[Doubt],
    recording_id: int,
    others: Sequence[float],
    counted: Sequence[float] = (),
) -> str:
    """The message of one held test; `others` are shifts of tension that other held tests imply,
    `counted` those that tests imply which count.

    Where its modes themselves are not in doubt, what they imply leads: a wrong clock must not hide
    a loss. Nor must the likeness to another hanger: there it is said of the case that it is wrong.
    """
    loss = "" if any(map(_is_of_others, doubts)) else _loss(candidate, others, counted)
    if_correct = ""
    if not loss and not any(doubt.check == "copy" for doubt in doubts):
        if_correct = _advice_if_correct(
            candidate, is_of_other=any(d.check in _OTHER_BAR for d in doubts)
        )
    states = "; ".join(doubt.state for doubt in doubts)
    end = "" if states.endswith("?") else "."
    held = f"test {candidate.test.id} (recording {recording_id}) is held: {states}{end}"
    lead = f"{loss} T{held[1:]}" if loss else f"Hanger {candidate.hanger.id}: {held}"
    why = " ".join(doubt.why for doubt in doubts)
    # Whose it is must be known as soon as it would have to be repeated.
    to_do = _what_to_do(candidate, doubts, recording_id, TODAY if TODAY in if_correct else WEEK)
    return f"{lead} {to_do} {why} {if_correct}Until then it counts in nothing."


def _what_to_do(candidate: Candidate, doubts: Sequence[Doubt], recording_id: int, soon: str) -> str:
    given = [""]
    if any(doubt.check.startswith("clock") for doubt in doubts):
        times = [str(format_time(each)) for each in candidate.possible_times]
        given = [f" --time {each}" for each in times or ["TIME"]]
    why = " --why TEXT" if any(doubt.check == "copy" for doubt in doubts) else ""
    ways = [f"--confirm {recording_id}{time}{why}" for time in given]
    ways.append(f"--discard {recording_id}")
    leading = next((doubt for doubt in doubts if _is_of_others(doubt)), doubts[0])
    action = f"{soon.capitalize()}, {leading.action[:1].lower()}{leading.action[1:]}"
    if leading.instead_of:
        discards = (f"`shm ingest --discard {each} --why TEXT`" for each in leading.instead_of)
        first = ", ".join(discards)
        return (
            f"{action}: {first}, then `shm ingest {ways[0]}`. Or keep the part: "
            f"`shm ingest {ways[-1]}`."
        )
    if _is_of_others(leading):
        ways.reverse()  # most of these are what they seem
    return f"{action}: {' or '.join(f'`shm ingest {way}`' for way in ways)}."


def _is_of_others(doubt: Doubt) -> bool:
    return doubt.check.startswith(("copy", "right"))


def _advice_if_correct(candidate: Candidate, *, is_of_other: bool) -> str:
    """Return what the modes would mean if they are the hanger's own after all.

    A damaged hanger looks like another one: who discards the test unseen may discard the damage.
    """
    hanger = candidate.hanger
    shift = implied_shift(candidate.test, candidate.reference, hanger)
    if not abs(shift) >= hanger.thresholds.tension_shift_fraction:
        return (
            f"If it is of hanger {hanger.id} after all, it has changed and may be damaged: "
            "look at it before you discard the test, and repeat the test within a week. "
            if is_of_other
            else ""
        )
    moved = "lost" if shift < 0 else "gained"
    return (
        f"If it is right as it was sent, hanger {hanger.id} has {moved} {100 * abs(shift):.0f} % "
        "of its tension: look at it before you discard the test, and repeat the test today. "
    )


def _loss(candidate: Candidate, others: Sequence[float], counted: Sequence[float]) -> str:
    """Return what the modes would mean for the tension; empty where that is below the threshold."""
    hanger, limit = candidate.hanger, candidate.hanger.thresholds.tension_shift_fraction
    shift = implied_shift(candidate.test, candidate.reference, hanger)
    if not abs(shift) >= limit:
        return ""
    moved = "lost" if shift < 0 else "gained"
    held, counting = (
        sum(each * shift > 0 and abs(each) >= limit for each in shifts)
        for shifts in ((shift, *others), counted)
    )
    say = f"{held} held tests agree" if held > 1 else "one held test says so"
    if counting:
        say = f"{held + counting} tests agree, {held} of them held"
    return (
        f"Hanger {hanger.id} may have {moved} {100 * abs(shift):.0f} % of its tension: {say}. "
        "Repeat the test today, with the logger's clock set."
    )
