"""Writes `data/schema_NNNN.db`, the database that a later schema must be able to upgrade.

Run it once when a schema is released: `python tests/store/make_released_database.py`.
"""

from __future__ import annotations

import sqlite3
import sys
from dataclasses import replace
from datetime import timedelta
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import numpy as np

from shm.store import Adoption, HeldTest, IdentifiedTest, Judgement, Stage, Store
from shm.store.rows import Role
from shm.store.tables import SCHEMA
from shm.values import Doubt, Fingerprint, Selection
from shm.values.notes import NoteKind
from tests.helpers.diagnoses import a_diagnosis
from tests.helpers.entering import LINEAGE
from tests.helpers.nouns import (
    NOW,
    a_change,
    a_check,
    a_file,
    a_foreign_mode,
    a_posterior,
    a_response,
    a_test,
    a_watched_test,
    an_alert,
)
from tests.helpers.streams import fill_streams

ADOPTED = "beam1+point_mass@everywhere"


def fill(store: Store) -> None:
    """Two tests with results, one refused file, one twice, an alert that was acknowledged, a
    dropped adoption, a baseline set anew, what is held."""
    for number in (1, 2, 3):
        store.recordings.receive(a_file(number), NOW)
    store.recordings.receive(a_file(1, arrival="again"), NOW)
    for number in (1, 2):
        found = IdentifiedTest(
            a_test(f"t{number}", number),
            frequency_response=a_response(),
            notes=("2 poles: damped",),
            quality=(a_check(),),
            set_aside=(a_foreign_mode(),),
        )
        store.tests.save(number, [found], LINEAGE, NOW)
    store.recordings.refuse(3, {"message": "no sampling rate.", "sha256": "3"}, NOW)
    first, second = store.tests.list_all(3)
    posteriors = (a_posterior("beam1"), a_posterior("beam2"))
    store.posteriors.save_selection(3, [first], Selection(posteriors, (0.9, 0.1)), LINEAGE, NOW)
    store.posteriors.save(second, a_posterior("beam1", ("t2",), seed=8), LINEAGE, NOW)
    baseline = store.watch.baseline(3)
    assert baseline is not None
    alert = replace(an_alert(), kinds=("beyond threshold",), change=a_change())
    store.watch.save(second, baseline, a_watched_test(), alert, ["mail"], NOW)
    store.alerts.acknowledge(1, "engineer", "looked at the pin", NOW)
    store.posteriors.save_diagnosis(3, a_diagnosis(), LINEAGE, NOW)
    before = store.posteriors.selection(3)
    assert before is not None
    adoption = Adoption(3, ADOPTED, "beam1", "point_mass", "everywhere", "a lamp", "engineer")
    probabilities = {"beam1": 0.5, "beam2": 0.1, ADOPTED: 0.4}
    posterior = a_posterior(ADOPTED)
    made = store.posteriors.adopt(
        adoption, posterior, probabilities, (before, [first]), LINEAGE, NOW
    )
    store.posteriors.drop_adoption(made.id, "the lamp is gone", "engineer", NOW)
    record = ("engineer", "new pin", second.time)
    joint = a_posterior("beam1", ("t2",), seed=9)
    store.watch.rebaseline(baseline, joint, [second], record, LINEAGE, NOW)
    _update_again(store)
    _hold(store)
    fill_streams(store)
    store.people.add("engineer", Role.ENGINEER, "correct horse battery", NOW)
    store.settings.change("hanger.3.thresholds.alert_probability", 0.9, "engineer", NOW)
    store.notes.add(3, NOW, NoteKind.INSPECTION, "rust at the pin", "engineer", NOW)


def _hold(store: Store) -> None:
    """A test with a wrong clock that a person has confirmed, and a copy of it that waits."""
    for number, check in ((5, "clock before the bridge"), (6, "copy")):
        recording = store.recordings.receive(a_file(number, modified_at=NOW), NOW).recording
        doubt = Doubt(check, "its time cannot be that", "Confirm it", "No clock was there.", True)
        held = HeldTest(0, f"t{number}", (doubt,), -0.1)
        notice = replace(an_alert("", f"t{number}"), hanger=5, drifts=(), kinds=("held",))
        print_ = Fingerprint(f"{number:064x}", np.ones((1, 256)) / 16)
        judged = Judgement(None, print_, (held,), notice, ["mail"])
        found = [IdentifiedTest(a_test(f"t{number}", number, hanger=5))]
        store.tests.save(recording.id, found, LINEAGE, NOW, judged)
    later = NOW + timedelta(days=9)
    store.recordings.accept(5, "engineer", "battery was flat", later, later)


def _update_again(store: Store) -> None:
    """A test of its own file is updated and watched twice: what it had first is superseded."""
    number = store.recordings.receive(a_file(4), NOW).recording.id
    store.tests.save(number, [IdentifiedTest(a_test("t4", 4))], LINEAGE, NOW)
    baseline = store.watch.baseline(3)
    assert baseline is not None
    for seed in (10, 11):
        third = store.tests.list_all(3)[-1]
        store.posteriors.save(third, a_posterior("beam1", ("t4",), seed=seed), LINEAGE, NOW)
        store.watch.save(third, baseline, a_watched_test("t4"), None, [], NOW)
        if seed == 10:
            store.recordings.rerun(number, Stage.UPDATED, NOW)


def main() -> None:
    path = Path(__file__).parent / "data" / f"schema_{SCHEMA}.db"
    path.unlink(missing_ok=True)
    with Store.create(path) as store:
        fill(store)
    connection = sqlite3.connect(path)
    connection.execute("PRAGMA journal_mode = DELETE")
    connection.execute("VACUUM")
    connection.close()


if __name__ == "__main__":
    main()
