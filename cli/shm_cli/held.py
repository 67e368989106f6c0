"""`shm ingest --held`, `--confirm ID`, `--discard ID`: what waits for a person, and the answer."""

from __future__ import annotations

import getpass
from collections.abc import Sequence
from datetime import date, datetime
from typing import Any

import rich_click as click

from shm.documents import parse_time
from shm.errors import BadInput, StoreBusy, UsageError
from shm.pipeline import utc_now
from shm.plausibility import FIRST_DAY
from shm.store import Decision, Hold, Stage, StoredAlert, Workspace
from shm_cli.common import paragraph, show
from shm_cli.working import LEFT_TO_IT, finish, working


def show_held(workspace: Workspace, as_json: bool) -> int:
    """What nobody has decided on yet."""
    with workspace.store() as store:
        found = store.holds()
    if as_json:
        show({"held": [hold_document(hold) for hold in found]})
        return 0
    if not found:
        click.echo("Nothing is held.")
    for hold in found:
        click.echo(told(hold) + "\n")
    return 0


def decide(
    workspace: Workspace,
    which: str,
    decision: Decision,
    record: tuple[str | None, str | None],
    time: datetime | None,
) -> tuple[Hold, Sequence[StoredAlert]]:
    """Notes a decision and does what follows from it, or leaves that to the daemon at work.

    `record` is who decided and why. Raises NothingThere, UsageError; then nothing is changed.
    """
    _refuse_impossible(time, workspace.bridge.built)
    who, why = record[0] or getpass.getuser(), record[1] or ""
    with workspace.store() as store:
        known = {stored.id for stored in store.alerts()}
        recording_id = int(which) if which.isdecimal() else store.recording_named(which)[0]
        if decision is Decision.DISCARDED:
            return store.discard(recording_id, who, why, utc_now()), ()
        _refuse_copy_without_reason(store.latest_hold(recording_id), why)
        hold = store.confirm(recording_id, who, why, utc_now(), time)
        try:
            with working(workspace) as flow:
                finish(flow, [recording_id])
        except StoreBusy:
            click.echo(LEFT_TO_IT, err=True)
        return hold, [stored for stored in store.alerts() if stored.id not in known]


def _refuse_impossible(time: datetime | None, built: date | None) -> None:
    """The day of no recording, whatever a person says."""
    first = max(FIRST_DAY, built or FIRST_DAY)
    if time is not None and time.date() < first:
        why = "the bridge was built" if first == built else "any recording"
        raise UsageError(
            f"that time is before {why} ({first:%Y-%m-%d}).",
            remedy="Give the true time, or leave --time out: then that of its receipt counts.",
        )


def _refuse_copy_without_reason(hold: Hold | None, why: str) -> None:
    """One impact that counts twice confirms itself: that is not done by one word."""
    copies = [d for test in (hold.tests if hold else ()) for d in test.doubts if d.check == "copy"]
    if copies and not why and hold is not None and hold.decision is None:
        raise UsageError(
            f"recording {hold.recording_id} is held because {copies[0].state}.",
            remedy='Say why it counts all the same: --why "the other was filed wrongly".',
        )


def decided_words(hold: Hold, stage: Stage) -> str:
    """What became of a hold."""
    what = f"Recording {hold.recording_id} ({hold.file_name}) is {hold.decision}"
    if hold.decision is Decision.DISCARDED:
        return f"{what} and counts in nothing. Its raw file stays in the archive."
    time = ""
    if hold.time is not None:
        time = f" Its time is {hold.time:%Y-%m-%d %H:%M}."
    elif hold.time_unknown:
        time = " Its time is not known: that of its receipt counts."
    return f"{what} and counts from now on; it is {stage}.{time}"


def told(hold: Hold) -> str:
    """A hold as text: when, what and why, with the commands that end it."""
    since = f"recording {hold.recording_id}, {hold.file_name}, held since"
    return paragraph(f"{since} {hold.held_at:%Y-%m-%d %H:%M}. {hold.message}")


def hold_document(hold: Hold) -> dict[str, Any]:
    """The same for programs; `decision` is null while nobody has decided."""
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


class Time(click.ParamType[datetime]):
    """An ISO 8601 time; one without zone is taken as UTC."""

    name = "time"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> datetime:
        try:
            return parse_time(str(value))
        except (ValueError, OverflowError):
            raise BadInput(
                f"--time {value} is not an ISO 8601 time.", remedy="Write 2026-05-01T10:00:00Z."
            ) from None
