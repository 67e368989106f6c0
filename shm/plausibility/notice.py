"""What a person is told of a held test: state, action, why."""

from __future__ import annotations

from collections.abc import Sequence

from shm.plausibility.candidate import Candidate, frequency_change, implied_shift
from shm.values import Doubt
from shm.values.messages import TODAY, WEEK

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
    if_own = ""
    if not loss and not any(doubt.check == "copy" for doubt in doubts):
        if_own = _if_own(candidate, is_of_other=any(d.check in _OTHER_BAR for d in doubts))
    states = "; ".join(doubt.state for doubt in doubts)
    end = "" if states.endswith("?") else "."
    held = f"test {candidate.test.id} (recording {recording_id}) is held: {states}{end}"
    lead = f"{loss} T{held[1:]}" if loss else f"Hanger {candidate.hanger.id}: {held}"
    why = " ".join(doubt.why for doubt in doubts)
    # Whose it is must be known as soon as it would have to be repeated.
    to_do = _what_to_do(doubts, recording_id, TODAY if TODAY in if_own else WEEK)
    return f"{lead} {to_do} {why} {if_own}Until then it counts in nothing."


def _what_to_do(doubts: Sequence[Doubt], recording_id: int, soon: str) -> str:
    time = " --time TIME" if any(doubt.check.startswith("clock") for doubt in doubts) else ""
    why = " --why TEXT" if any(doubt.check == "copy" for doubt in doubts) else ""
    ways = [f"--confirm {recording_id}{time}{why}", f"--discard {recording_id}"]
    leading = next((doubt for doubt in doubts if _is_of_others(doubt)), doubts[0])
    action = f"{soon.capitalize()}, {leading.action[:1].lower()}{leading.action[1:]}"
    if leading.instead_of:
        discards = (f"`shm ingest --discard {each} --why TEXT`" for each in leading.instead_of)
        first = ", ".join(discards)
        return (
            f"{action}: {first}, then `shm ingest {ways[0]}`. Or keep the part: "
            f"`shm ingest {ways[1]}`."
        )
    if _is_of_others(leading):
        ways.reverse()  # most of these are what they seem
    return f"{action}: `shm ingest {ways[0]}` or `shm ingest {ways[1]}`."


def _is_of_others(doubt: Doubt) -> bool:
    return doubt.check.startswith(("copy", "right"))


def _if_own(candidate: Candidate, *, is_of_other: bool) -> str:
    """What the modes would mean if they are the hanger's own after all.

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
    """What the modes would mean for the tension; empty where that is below the threshold."""
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
    change = frequency_change(candidate.test, candidate.reference)
    side = "below" if change < 0 else "above"
    return (
        f"Hanger {hanger.id} may have {moved} {100 * abs(shift):.0f} % of its tension: {say}. "
        "Repeat the test today, with the logger's clock set. "
        f"Its lowest frequencies are {100 * abs(change):.1f} % {side} the last ones."
    )
