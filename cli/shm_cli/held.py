"""`shm ingest --held`, `--confirm ID`, `--discard ID`: what waits for a person, and the answer.

What counts is discarded, and what was discarded is taken back, by the same two.
"""

from __future__ import annotations

import getpass
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any

import rich_click as click

from shm.errors import UsageError
from shm.pipeline import utc_now
from shm.store import Decision, Exclusion, Hold, Stage, Store, StoredAlert, Workspace
from shm.store.disposition import discarded_reason, taking_back
from shm.store.journal import list_former_tests
from shm.store.recordings import find_latest_hold, find_recording, list_holds
from shm_cli import flags
from shm_cli.common import can_ask, paragraph, readable_store, show


def show_held(workspace: Workspace) -> int:
    """List the recordings that wait for a decision."""
    with readable_store(workspace) as store:
        found = list_holds(store)
    if flags.wants_json():
        show({"held": [hold_document(hold) for hold in found]}, "held")
        return 0
    if not found:
        click.echo("Nothing is held.")
    for hold in found:
        click.echo(hold_line(hold) + "\n")
    return 0


@dataclass(frozen=True)
class Decided:
    """A decision, the alerts that it raised, and what it took out where that counted."""

    hold: Hold
    alerts: Sequence[StoredAlert] = ()
    exclusion: Exclusion | None = None


def decide(
    workspace: Workspace,
    which: str,
    decision: Decision,
    record: tuple[str | None, str | None],
    time: datetime | None,
) -> Decided:
    """Record a decision and do what follows, or leave that to the active daemon.

    `record` is who decided and why. Raises NothingThere, UsageError; then nothing is changed.
    """
    # It brings the hooks' libraries; `shm status` and `shm ingest --held` only tell.
    from shm.pipeline.intake import learn_from_answer
    from shm.plausibility import refuse_impossible
    from shm_cli.working import finish_now

    refuse_impossible(time, workspace.bridge.built)
    who = record[0] or getpass.getuser()
    with workspace.store() as store:
        known = {stored.id for stored in store.alerts.list_all()}
        recording_id, test = find_recording(store, which)
        held = _is_held(store, recording_id, test)
        if held and test is not None:
            _refuse_part(find_latest_hold(store, recording_id), test, decision)
        why = record[1] or _ask_reason(decision)
        if not held:
            _refuse_without_reason(store, recording_id, decision, why)
        exclusion = None
        if decision is Decision.DISCARDED:
            exclusion = store.recordings.exclude(recording_id, who, why, utc_now(), test)
            hold = exclusion.hold
        else:
            if held:
                _refuse_copy_without_reason(find_latest_hold(store, recording_id), why)
            hold = store.recordings.accept(recording_id, who, why, utc_now(), time, test)
            if held:
                learn_from_answer(workspace, store, hold)
        if hold.decision is not Decision.DISCARDED:  # else nothing is done again
            finish_now(workspace, recording_id)
        raised = [stored for stored in store.alerts.list_all() if stored.id not in known]
        return Decided(hold, raised, exclusion)


def _ask_reason(decision: Decision) -> str:
    """Ask at a terminal why something is discarded; return an empty text elsewhere."""
    if decision is not Decision.DISCARDED or not can_ask():
        return ""
    return str(click.prompt("Why is it discarded? For the record", type=flags.Words()))


def _is_held(store: Store, recording_id: int, test: str | None) -> bool:
    """Return True if the recording, or that test of it, waits for a decision."""
    hold = find_latest_hold(store, recording_id)
    if hold is None or hold.decision is not None:
        return False
    present = [
        each for each in list_former_tests(store, recording_id) if each.superseded_at is None
    ]
    return test is None or any(t.name == test and t.stage is Stage.HELD for t in present)


def _refuse_part(hold: Hold | None, test: str, decision: Decision) -> None:
    """Raise UsageError where one test is named of several that are held together."""
    others = [each.name for each in (hold.tests if hold else ()) if each.name != test]
    if hold is None or not others:
        return
    verb = "confirm" if decision is Decision.CONFIRMED else "discard"
    other = "discard" if decision is Decision.CONFIRMED else "confirm"
    raise UsageError(
        f"recording {hold.recording_id} ({hold.file_name}) holds {test} together with "
        f"{', '.join(others)}.",
        remedy=f"Decide on all with `shm ingest --{verb} {hold.recording_id}`, then turn single "
        f"ones round with `shm ingest --{other} {others[0]} --why TEXT`.",
    )


def _refuse_without_reason(store: Store, recording_id: int, decision: Decision, why: str) -> None:
    """Require a reason to reverse a decision or to exclude a used recording."""
    recording, hold = store.recordings.get(recording_id), find_latest_hold(store, recording_id)
    confirms = decision is Decision.CONFIRMED
    is_out = hold is not None and hold.is_out
    if why or (not is_out if confirms else recording.stage is Stage.REFUSED):
        return  # or there is nothing to turn round, which the store says
    now = f"is {recording.stage}" if hold is None else f"was {hold.decision} by {hold.who}"
    verb = "confirm" if confirms else "discard"
    raise UsageError(
        f"recording {recording_id} is not held: it {now}.",
        remedy=f"Say why that is changed: `shm ingest --{verb} {recording_id} --why TEXT`.",
    )


def _refuse_copy_without_reason(hold: Hold | None, why: str) -> None:
    """Refuse to accept a copy without a reason: an impact that counts twice confirms itself."""
    copies = [d for test in (hold.tests if hold else ()) for d in test.doubts if d.check == "copy"]
    if copies and not why and hold is not None and hold.decision is None:
        raise UsageError(
            f"recording {hold.recording_id} is held because {copies[0].state}.",
            remedy='Say why it counts all the same: --why "the other was filed wrongly".',
        )


def decided_words(decided: Decided, stage: Stage) -> str:
    """Return a sentence on the decision and its consequence."""
    hold, exclusion = decided.hold, decided.exclusion
    what = f"Recording {hold.recording_id} ({hold.file_name})"
    if exclusion is not None and hold.decision is Decision.WITHDRAWN:
        return f"{_excluded_words(what, exclusion)} {taking_back(hold)}"
    if hold.decision is Decision.DISCARDED and stage is Stage.REFUSED:
        return f"{what} is discarded and counts in nothing. {taking_back(hold)}"
    if hold.decision is Decision.DISCARDED:
        names = ", ".join(test.name for test in hold.tests)
        sentence = f"{names} is discarded and counts in nothing; its other tests go on counting."
        return f"{what}: {sentence} {taking_back(hold)}"
    verb = "counts again" if hold.decision is Decision.REINSTATED else "is confirmed and counts"
    time = ""
    if hold.time is not None:
        time = f" Its time is {hold.time:%Y-%m-%d %H:%M}."
    elif hold.time_unknown:
        time = " Its time is not known: that of its receipt counts."
    return f"{what} {verb} from now on; it is {stage}.{time}"


def _excluded_words(what: str, exclusion: Exclusion) -> str:
    names = ", ".join(test.name for test in exclusion.hold.tests)
    sentences = [f"{what}: {names} is discarded and counts in nothing from now on."]
    if exclusion.watched_again:
        sentences.append(
            f"Later tests that are watched again: {exclusion.watched_again}; alerts that others "
            "raised stay raised."
        )
    if exclusion.of_baseline and exclusion.since is not None:
        sentences.append(
            f"The baseline was made from {', '.join(exclusion.of_baseline)} and stays until you "
            f"set another: `shm drift rebaseline --hanger {exclusion.hold.hanger} --since "
            f"{exclusion.since:%Y-%m-%d} --why TEXT`."
        )
    return " ".join(sentences)


def discarded_words(hold: Hold) -> str:
    """Return the line for a discarded file that arrives again."""
    words = discarded_reason(hold).replace("discarded", "discarded before,", 1)
    return f"{words} {taking_back(hold)}"


def hold_line(hold: Hold) -> str:
    """Return a hold as text: when, what and why, with the commands that end it."""
    since = f"recording {hold.recording_id}, {hold.file_name}, held since"
    return paragraph(f"{since} {hold.held_at:%Y-%m-%d %H:%M}. {hold.message}")


def hold_document(hold: Hold) -> dict[str, Any]:
    """Return the same for programs; `decision` is null while nobody has decided."""
    return {
        "recording": hold.recording_id,
        "file": hold.file_name,
        "hanger": hold.hanger,
        "held_at": hold.held_at,
        "message": hold.message,
        "tests": [
            {
                "test": test.name,
                "tension_shift": test.tension_shift,
                "doubts": [vars(doubt) for doubt in test.doubts],
            }
            for test in hold.tests
        ],
        "decision": hold.decision,
        "who": hold.who or None,
        "why": hold.why or None,
        "decided_at": hold.decided_at,
        "time": hold.time,
    }
