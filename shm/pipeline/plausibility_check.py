"""From an identified recording to what is held of it: what the store knows meets the checks."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import datetime, timedelta

import numpy as np

from shm.errors import BadInput
from shm.pipeline.faults import contained
from shm.pipeline.lineage import read_limits
from shm.plausibility import FIRST_DAY, Candidate, doubts_about, implied_shift, notice_of
from shm.read.profiles import any_profile, profile_for
from shm.read.sandbox import layout_of
from shm.store import (
    HeldTest,
    Hold,
    IdentifiedTest,
    Judgement,
    Stage,
    Store,
    StoredRecording,
    StoredTest,
    Workspace,
)
from shm.store.disposition import time_note
from shm.store.recordings import list_holds
from shm.store.tests import (
    list_baseline_tests,
    list_decisions,
    list_known_samples,
    list_latest_tests,
    list_tests_taken_at,
)
from shm.values import Alert, Doubt, Hanger, ModalTest

log = logging.getLogger(__name__)
_LATEST = 10  # of a hanger's tests: what it does from test to test, without reading years of them
_OF_OTHERS = 2  # of every other hanger's: where its modes lie now


def judge(
    workspace: Workspace, store: Store, recording: StoredRecording, found: Sequence[IdentifiedTest]
) -> tuple[tuple[IdentifiedTest, ...], Judgement]:
    """The tests to keep, and which of them to hold.

    What a person has confirmed with this sidecar is not doubted again, and has the time that they
    gave it.
    """
    sidecar_as, fingerprint = recording.file.sidecar_as, found[0].fingerprint
    decided = list_decisions(store, recording.id, sidecar_as)
    out = tuple(n for n, hold in decided.items() if hold.is_out)
    if set(out) >= {item.position for item in found}:  # sent anew, to be asked of once more
        out = ()
    judged = Judgement(sidecar_as, fingerprint, out=out)
    confirmed = [hold for hold in decided.values() if hold.is_in]
    if confirmed:
        newest = max(confirmed, key=lambda hold: hold.id)
        holds = {item.position: decided.get(item.position, newest) for item in found}
        return tuple(_as_confirmed(item, holds[item.position]) for item in found), judged
    held, candidates = [], {}
    for item in (item for item in found if item.position not in out):
        candidate = _candidate(workspace, store, recording, item, found)
        doubts = doubts_about(candidate)
        if doubts:
            doubts = _with_profile(doubts, workspace, recording)
            shift = implied_shift(candidate.test, candidate.reference, candidate.hanger)
            held.append(HeldTest(item.position, item.test.id, doubts, shift))
            candidates[item.position] = candidate
    if not held:
        return tuple(found), judged
    hooks = [hook.name for hook in workspace.bridge.hooks]
    notice = _notice(store, recording, held, candidates)
    return tuple(found), replace(judged, held=tuple(held), notice=notice, hooks=hooks)


def _with_profile(
    doubts: tuple[Doubt, ...], workspace: Workspace, recording: StoredRecording
) -> tuple[Doubt, ...]:
    """The doubts; one about the hanger says so where its logger's profile names the hanger."""
    at = next((n for n, doubt in enumerate(doubts) if doubt.check == "right hanger"), None)
    if at is None or not any_profile(workspace.folder):
        return doubts
    try:
        with workspace.archive.opened(recording.file) as path:
            layout = layout_of(path, read_limits(workspace.settings))
        profile = profile_for(layout, workspace.folder)
    except BadInput:
        return doubts  # no logger's file
    if profile is None or layout.hanger is not None or "hanger" not in profile.described:
        return doubts
    where = profile.path.relative_to(workspace.folder)
    why = (
        f"The file names no hanger; {where} books all files of its logger to hanger "
        f"{profile.described['hanger']}: if the logger was carried, write `roams = true` there."
    )
    return (*doubts[:at], replace(doubts[at], why=f"{doubts[at].why} {why}"), *doubts[at + 1 :])


def _candidate(
    workspace: Workspace,
    store: Store,
    recording: StoredRecording,
    item: IdentifiedTest,
    found: Sequence[IdentifiedTest],
) -> Candidate:
    test = item.test
    hanger = workspace.bridge.tested(test.hanger or 0)
    earlier = list_latest_tests(store, hanger.id, recording.id, _LATEST)
    baseline = store.watch.baseline(hanger.id, time=_possible(test.time))
    reference = list_baseline_tests(store, baseline) if baseline else earlier
    at_once = list_tests_taken_at(store, hanger.id, test.time, recording.id) if test.time else ()
    print_ = item.fingerprint
    return Candidate(
        hanger=hanger,
        test=test,
        received_at=recording.received_at,
        tolerance=timedelta(seconds=workspace.settings.future_tolerance_seconds),
        modified_at=recording.file.modified_at,
        built=workspace.bridge.built,
        possible_times=item.possible_times,
        file_times=item.times,
        neighbours=[other.test.time for other in found if other is not item and other.test.time],
        same_time=[each.test for each in sorted(at_once, key=lambda t: t.stage is Stage.HELD)],
        reference=[each.test for each in reference],
        reference_at=max((each.time for each in reference), default=None) if baseline else None,
        earlier=[each.test for each in earlier],
        arrived=[
            each.test
            for each in list_latest_tests(store, hanger.id, recording.id, _LATEST, as_received=True)
        ],
        baseline=baseline.posterior if baseline else None,
        fingerprint=print_,
        copies=list_known_samples(store, recording.id, hanger.id, print_) if print_ else (),
        signals=item.signals,
        others=[
            (other, _latest_of_other(store, other, recording))
            for other in workspace.bridge.hangers
            if other.id != hanger.id
        ],
    )


def _latest_of_other(
    store: Store, other: Hanger, recording: StoredRecording
) -> Sequence[ModalTest]:
    """Return the latest tests of another hanger; none where these cannot be read."""
    found: Sequence[StoredTest] = ()
    with contained(log, "tests of hanger %d cannot be compared with", other.id):
        found = list_latest_tests(store, other.id, recording.id, _OF_OTHERS)
    return [each.test for each in found]


def _possible(time: datetime | None) -> datetime | None:
    """A time by which to look for a baseline; None where it says nothing: that in force."""
    return None if time is None or time.date() < FIRST_DAY else time


def _notice(
    store: Store,
    recording: StoredRecording,
    held: Sequence[HeldTest],
    candidates: Mapping[int, Candidate],
) -> Alert:
    """Return what to tell of a recording, once: of the test whose modes say most."""
    leading = max(held, key=lambda each: np.nan_to_num(abs(each.tension_shift)))
    candidate = candidates[leading.position]
    hanger = candidate.hanger.id
    clocks = [hold for hold in list_holds(store, hanger) if hold.is_for_its_clock]
    others = [test.tension_shift for hold in clocks for test in hold.tests]
    others += [test.tension_shift for test in held if test is not leading]
    counted = {test.id: test for test in (*candidate.earlier, *candidate.arrived)}
    for test in candidate.reference:
        counted.pop(test.id, None)
    shifts = [
        implied_shift(test, candidate.reference, candidate.hanger) for test in counted.values()
    ]
    message = notice_of(candidate, leading.doubts, recording.id, others, shifts)
    if len(held) > 1:
        message += f" {len(held)} tests of {recording.file.file_name} are held."
    return Alert(
        key="",  # its hold gives it one
        hanger=hanger,
        test=leading.name,
        time=candidate.test.time or recording.received_at,
        message=message,
        drifts=(),
        kinds=("held",),
    )


def _as_confirmed(item: IdentifiedTest, hold: Hold) -> IdentifiedTest:
    """A test done again after a person has confirmed it: with the time that they gave it."""
    doubts = {test.position: test.doubts for test in hold.tests}.get(item.position, ())
    if hold.time is None and not any(doubt.time_unknown for doubt in doubts):
        return item
    notes = (*item.notes, time_note(hold, hold.time, hold.who))
    return replace(item, test=replace(item.test, time=hold.time), notes=notes)
