"""What an alert asks its owner to do, and how soon.

Traffic is named for lost tension and loosened ends alone.
"""

from __future__ import annotations

from collections.abc import Sequence

from shm.values import TENSION, Change, Drift, Hanger, Moved
from shm.values.messages import NEXT_TEST, TODAY, WEEK, Urgency
from shm.watch.change_words import CAUSES, ends_words, probable_groups

_WHEN: dict[Urgency, str] = {"next_test": NEXT_TEST, "week": WEEK, "today": TODAY}
_LOOK_AT = "bearings, joints, cracks, new loads and the sensors"


def urgency_of(
    hanger: Hanger,
    change: Change | None,
    beyond: Sequence[Drift],
    drifts: Sequence[Drift] = (),
) -> Urgency:
    """How soon: today for a loss beyond its threshold as surely as the owner asked to be told.

    A change came slowly and stays below its threshold, as far as `drifts` of all quantities show:
    then the next planned test is soon enough to see where it goes.
    """
    if hanger.is_modelled and _losses(hanger, beyond):
        return "today"
    slow = change is not None and change.sudden < 0.5
    near = any(each.probability > 0.5 for each in drifts)
    return "next_test" if slow and not beyond and not near else "week"


def _losses(hanger: Hanger, beyond: Sequence[Drift]) -> list[Drift]:
    """Lost tension or loosened ends that are probable, for which alone traffic is named."""
    level = hanger.thresholds.alert_probability
    return [each for each in beyond if each.shift_mean < 0 and each.probability >= level]


def action_words(
    hanger: Hanger,
    change: Change | None,
    beyond: Sequence[Drift],
    drifts: Sequence[Drift] = (),
) -> str:
    """What to do and how soon, in a sentence."""
    urgency = urgency_of(hanger, change, beyond, drifts)
    if not hanger.is_modelled:
        return f"Look at the structure {_WHEN[urgency]}: {_LOOK_AT}."
    if urgency == "today":
        look = _look(gravest(beyond), change)
        return f"{look_again(hanger)} {TODAY} and decide on traffic until then; {look}."
    groups = probable_groups(change) if change else []
    if len(groups) > 1 and not beyond:
        return _tell_apart(groups, urgency, hanger)
    lead = gravest(beyond) if beyond else groups[0][0] if groups else None
    test = _again(urgency, hanger)
    if lead is None:
        return f"{test}{'' if hanger.has_sensors else ', with more modes'}."
    if lead.quantity in CAUSES:
        check = CAUSES[lead.quantity].check
        return as_sentence(f"{_WHEN[urgency]}, {check}, then test again")
    return f"{test}; {_look(lead, change)}."


def look_again(hanger: Hanger) -> str:
    """How its owner makes sure: sensors that stay test it again by themselves."""
    return "Check the hanger and its sensors" if hanger.has_sensors else "Repeat the hammer test"


def _again(urgency: Urgency, hanger: Hanger) -> str:
    return f"{look_again(hanger)} {WEEK}" if urgency == "week" else f"Compare again {NEXT_TEST}"


def _tell_apart(groups: Sequence[Sequence[Moved]], urgency: Urgency, hanger: Hanger) -> str:
    """What shows which of several causes it was."""
    causes = [CAUSES[each[0].quantity] for each in groups if each[0].quantity in CAUSES]
    if not causes:
        again, with_what = _again(urgency, hanger), "a sensor near each end and more modes"
        if hanger.has_sensors:
            return f"{again}; a hammer test with {with_what} shows what changed."
        return f"{again} with {with_what}, to see what changed."
    check, apart_by = causes[0].check, causes[0].apart_by
    return as_sentence(f"{_WHEN[urgency]}, {check}; then test with {apart_by}, to tell them apart")


def _look(lead: Moved | Drift, change: Change | None) -> str:
    """Where to look if a change of tension or of an end stays."""
    lost = lead.shift_mean < 0
    if lead.quantity == TENSION:
        beside = "compare the hangers beside it (`shm drift bridge`)"
        look = f"inspect its anchorages and the rod, and {beside}" if lost else beside
        return f"if the {'loss' if lost else 'gain'} stays, {look}"
    moved = {each.quantity: each for each in (change.moved if change else ())}
    own = moved.get(lead.quantity)
    ends = {moved[n].end for n in (lead.quantity, *own.together) if n in moved} if own else {None}
    end = "both ends" if None in ends else ends_words(ends)
    found = "a worn pin, a cracked plate or loose bolts" if lost else "a pin seized by rust or dirt"
    return f"if the change stays, inspect {end} for {found}"


def gravest(beyond: Sequence[Drift]) -> Drift:
    """A loss before a gain, the tension before the ends."""
    return min(beyond, key=lambda each: (each.shift_mean > 0, each.quantity != TENSION))


def as_sentence(words: str) -> str:
    """With a capital and a full stop."""
    return f"{words[:1].upper()}{words[1:]}."
