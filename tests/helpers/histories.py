"""A store with something in every table, made by the flow and by the verbs of persons."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from shm.documents import dump
from shm.modes_document import modes_document
from shm.store import (
    Adoption,
    Archive,
    IdentifiedTest,
    Judged,
    Lineage,
    Stage,
    Store,
    Workspace,
)
from shm.store.checking import archived_names
from shm.store.people import Role, Scope
from shm.store.retention import copy_archive, removable, remove
from shm.values import Fingerprint
from shm.values.notes import NoteKind
from tests.helpers import quick_update
from tests.helpers.contents import quiet
from tests.helpers.diagnoses import a_diagnosis
from tests.helpers.flows import Clock, Postman, a_flow, receive_all
from tests.helpers.nouns import a_file, a_posterior, a_response
from tests.helpers.streams import fill_streams
from tests.helpers.workspaces import START, make_workspace, modelled_test, put, write_test

EPOCH = datetime(1970, 1, 1, 0, 3, tzinfo=UTC)
LINEAGE = Lineage("0" * 64, "1" * 64, "0.1.0")
_ADOPTED = "beam1+point_mass@everywhere"


def a_history(folder: Path) -> Workspace:
    """Two hangers: tests that lose tension, held ones that were confirmed, discarded, replaced or
    wait, refused ones, work done again, decisions of persons, copies."""
    hooks = {"mail": ["true"], "phone": ["true"]}
    workspace = make_workspace(folder / "bridge", hangers=(3, 4), hooks=hooks)
    with pytest.MonkeyPatch.context() as patch:
        quick_update.stand_in(patch.setattr)
        clock = Clock()
        _samples(workspace, clock)
        for hanger in (3, 4):
            for day, tension in ((0, 1.0), (30, 0.8), (60, 0.8)):
                path = workspace.spool / f"h{hanger}-{day}.modes.json"
                write_test(path, workspace, hanger=hanger, day=day, tension=tension)
                _work(workspace, clock)
        _held(workspace, clock)
        _refused(workspace, clock)
        _again(workspace, clock)
        _taken_out(workspace, clock)
    with workspace.store() as store:
        fill_streams(store)
        _decide(store, clock)
        _keep(workspace, store, clock, folder)
    return workspace


def _work(workspace: Workspace, clock: Clock) -> None:
    clock.pass_by(60)
    with a_flow(workspace, notifier=Postman(), clock=clock) as flow:
        receive_all(flow)
        flow.drain()


def _samples(workspace: Workspace, clock: Clock) -> None:
    """Recordings of which there are samples; these would take long to be identified."""
    with workspace.store() as store:
        for number in (1, 2):
            file = a_file(number, modified_at=clock())
            recording = store.recordings.receive(file, clock()).recording
            test = modelled_test(f"s{number}", workspace.bridge.hanger(3), day=number - 9)
            judged = Judged(file.sidecar_as, Fingerprint(f"{number:064x}", np.ones((1, 256)) / 16))
            found = [IdentifiedTest(test, frequency_response=a_response())]
            store.tests.save(recording.id, found, LINEAGE, clock(), judged)
    _work(workspace, clock)


def _held(workspace: Workspace, clock: Clock) -> None:
    for number in range(5):
        test = modelled_test(f"lost{number}", workspace.bridge.hanger(4), tension=0.9 - number / 99)
        document = dump(modes_document([replace(test, time=EPOCH + timedelta(days=number))]))
        put(workspace.spool / f"lost{number}.modes.json", document)
        _work(workspace, clock)
    with workspace.store() as store:
        first, second, third, *_ = (hold.recording_id for hold in store.recordings.list_holds())
        store.recordings.accept(first, "Ann", "clock was dead", clock(), START + timedelta(days=70))
        store.recordings.exclude(second, "Ann", "of another bridge", clock())
        store.recordings.reprocess(third, Stage.IDENTIFIED, clock())
    _work(workspace, clock)


def _refused(workspace: Workspace, clock: Clock) -> None:
    for _ in range(2):  # it is dropped again, and tried again
        put(workspace.spool / "bad.modes.json", "{}")
        _work(workspace, clock)
    write_test(workspace.spool / "h3-30.modes.json", workspace, hanger=3, day=30, tension=0.8)
    _work(workspace, clock)


def _again(workspace: Workspace, clock: Clock) -> None:
    for name, stage in (("h3-60", Stage.WATCHED), ("h4-60", Stage.UPDATED)):
        with workspace.store() as store:
            clock.pass_by(60)
            store.recordings.reprocess(store.recordings.find(name)[0], stage, clock())
        _work(workspace, clock)


def _taken_out(workspace: Workspace, clock: Clock) -> None:
    """Two tests that counted are discarded, one of them is taken back."""
    for number in (1, 2):
        path = workspace.spool / f"out{number}.modes.json"
        write_test(path, workspace, hanger=4, day=80 + number, tension=0.8)
        _work(workspace, clock)
    with workspace.store() as store:
        for name in ("out2", "out1"):
            clock.pass_by(60)
            store.recordings.exclude(store.recordings.find(name)[0], "Ann", "a slip", clock())
        store.recordings.accept(store.recordings.find("out2")[0], "Ann", "no slip", clock())
    _work(workspace, clock)


def _decide(store: Store, clock: Clock) -> None:
    """Acknowledges, adopts, drops that, sets a baseline anew: each a minute after the other."""
    watched = [alert.id for alert in store.alerts.list_all() if ":held-" not in alert.alert.key]
    for number in watched[:2]:
        store.alerts.acknowledge(number, "engineer", "looked", clock())
    period = (clock(), clock() + timedelta(days=1))
    store.silences.make(4, period, "engineer", "sensor is replaced", period[0])
    for hanger in (3, 4):
        store.posteriors.save_diagnosis(hanger, a_diagnosis(), LINEAGE, clock())
    before, baseline = store.posteriors.selection(3), store.watch.baseline(3)
    assert before is not None
    assert baseline is not None
    chosen = store.tests.of_baseline(baseline)
    effect = ("beam1", "point_mass", "everywhere", "a lamp", "engineer")
    clock.pass_by(60)
    adopted = store.posteriors.adopt(
        Adoption(3, _ADOPTED, *effect),
        a_posterior(_ADOPTED, tuple(test.test.id for test in chosen)),
        {"beam1": 0.4, _ADOPTED: 0.6},
        (before, chosen),
        LINEAGE,
        clock(),
    )
    clock.pass_by(60)
    store.posteriors.drop_adoption(adopted.id, "the lamp is gone", "engineer", clock())
    clock.pass_by(60)
    newest, now = store.tests.list_all(3)[-1], store.watch.baseline(3)
    assert now is not None
    joint = a_posterior("beam1", (newest.test.id,), seed=9)
    record = ("engineer", "new pin", newest.time)
    store.watch.rebaseline(now, joint, [newest], record, LINEAGE, clock())


def _keep(workspace: Workspace, store: Store, clock: Clock, folder: Path) -> None:
    for name in ("gauge", "office"):
        store.upkeep.create_token(name, Scope.READ, clock())
    password = "correct horse battery"
    for name in ("Ann", "Bo"):
        store.people.add(name, Role.READER, password, clock())
    for _ in range(2):
        assert store.people.sign_in("Ann", password, clock()) is not None
    for level in (0.9, None):
        store.settings.change("hanger.3.thresholds.alert_probability", level, "Ann", clock())
        store.notes.add(3, clock(), NoteKind.INSPECTION, "Pin looked at.", "Ann", clock())
    for hanger in workspace.bridge.hangers:
        store.posteriors.save_summaries(hanger)
    copies = Archive(folder / "copies")
    copy_archive(workspace.archive, copies, archived_names(store), quiet)
    store.upkeep.note_copies(copies, clock())
    gone = removable(store, workspace.archive, clock(), quiet).removals[:1]
    remove(store, workspace.archive, gone, clock())
    store.upkeep.note_backup(folder / "may.db", clock())
