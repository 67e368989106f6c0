"""The diagnosis of a hanger's latest stored tests, which the store keeps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from datetime import datetime
from typing import TYPE_CHECKING

from shm.errors import NothingThere
from shm.pipeline.lineage import diagnosis_lineage
from shm.report.diagnosis_summary import write_line
from shm.report.hanger_status import still_detected
from shm.store import BaselineGlance, Store, StoredAlert, StoredTest
from shm.store.posteriors import list_baselines_in_force
from shm.store.tests import list_test_rows
from shm.store.watch import (
    find_latest_diagnosis,
    find_latest_watches,
    list_detected_changes,
)
from shm.values import Change, Diagnosis, Hanger, ModalTest, WatchedTest

if TYPE_CHECKING:
    from shm.gap import GapOptions
    from shm.inference.options import Progress

LATEST_TESTS = 20
"""So many of the latest tests are diagnosed together."""


@dataclass(frozen=True, eq=False)
class ChosenTests:
    """Stored tests to diagnose together; `remark` says which were left out, empty for none."""

    stored: tuple[StoredTest, ...]
    remark: str = ""

    @property
    def tests(self) -> list[ModalTest]:
        """Return the tests themselves."""
        return [each.test for each in self.stored]


def latest_tests(store: Store, hanger: Hanger, count: int) -> tuple[StoredTest, ...]:
    """Return so many at most, the latest last; raise NothingThere where there is none."""
    if not (stored := store.tests.list_all(hanger.id)[-count:]):
        raise NothingThere(
            f"no test of hanger {hanger.id} is stored.", remedy="Take one in with `shm ingest`."
        )
    return stored


def choose_tests(
    store: Store, hanger: Hanger, count: int = LATEST_TESTS, *, every: bool = False
) -> ChosenTests:
    """Return so many of the latest tests since the last change that the watch reports.

    No steady cause explains tests from before and after a change. With `every` those from before
    it are among them. Raises NothingThere where there is no test.
    """
    stored = latest_tests(store, hanger, count)
    began_by = None if every else find_last_change(store, hanger)
    if began_by is None:
        return ChosenTests(stored)
    since = tuple(each for each in stored if each.time >= began_by) or stored[-1:]
    if len(since) == len(stored):
        return ChosenTests(stored)
    tests, are = ("test", "is") if len(since) == 1 else (f"{len(since)} tests", "are")
    remark = (
        f"Only the {tests} since {began_by:%Y-%m-%d} {are} diagnosed: the watch reports a change "
        f"before. Earlier ones left out: {len(stored) - len(since)}. To diagnose all together: "
        f"`shm gap diagnose --hanger {hanger.id} --all-tests`."
    )
    return ChosenTests(since, remark)


def find_last_change(store: Store, hanger: Hanger) -> datetime | None:
    """Return by when the last change in force of a hanger began; see `last_change`."""
    latest = find_latest_watches(store, [hanger]).get(hanger.id)
    return last_change(
        store,
        hanger,
        list_baselines_in_force(store, [hanger]).get(hanger.id),
        latest.watched if latest else None,
        list_detected_changes(store, [hanger]).get(hanger.id, ()),
        store.alerts.list_all(hanger.id, standing=True),
    )


def last_change(
    store: Store,
    hanger: Hanger,
    baseline: BaselineGlance | None,
    latest: WatchedTest | None,
    detected: Sequence[Change],
    standing: Sequence[StoredAlert],
) -> datetime | None:
    """Return by when the last change that is in force began, or the baseline was set anew.

    None where neither is known. A change is in force while the watch detects it, or while an alert
    of it has not ended; what two tests agree on began with the first of them.
    """
    times = [change.began_by for change in still_detected(detected, latest, hanger)]
    for each in standing:
        if each.alert.change is not None:
            times.append(each.alert.change.began_by)
        elif "beyond threshold" in each.alert.kinds:
            rows = list_test_rows(store, hanger.id)
            times += [row.time for row in rows if row.time < each.alert.time][:1]
    if baseline is not None and baseline.since is not None:
        times.append(baseline.since)
    return max(times, default=None)


def latest_diagnosis(store: Store, hanger: Hanger) -> Diagnosis | None:
    """Return the latest diagnosis of a hanger; it says first if its tests are from before a change.

    None where there is none.
    """
    stored = find_latest_diagnosis(store, hanger.id)
    if stored is None:
        return None
    found = stored.diagnosis
    began_by = find_last_change(store, hanger)
    if began_by is None or not _is_outdated(store, hanger, found, began_by):
        return found
    remark = (
        f"These tests are from before {began_by:%Y-%m-%d}, when the watch reports a change. "
        f"Diagnose again: `shm gap diagnose --hanger {hanger.id}`."
    )
    return replace(found, remarks=(remark, *found.remarks))


def _is_outdated(store: Store, hanger: Hanger, diagnosis: Diagnosis, began_by: datetime) -> bool:
    """Return True if all tests of a diagnosis are from before a change."""
    rows = list_test_rows(store, hanger.id)
    times = [row.time for row in rows if row.name in diagnosis.tests]
    return bool(times) and max(times) < began_by


def describe_diagnosis(store: Store, hanger: Hanger, began_by: datetime | None) -> str:
    """Return verdict, tension and date of the latest diagnosis.

    Empty if it is from before the last change, which began by a time.
    """
    stored = find_latest_diagnosis(store, hanger.id)
    if stored is None:
        return ""
    if began_by is not None and _is_outdated(store, hanger, stored.diagnosis, began_by):
        return ""
    return write_line(stored.diagnosis, stored.diagnosed_at)


def diagnose_stored(
    store: Store,
    chosen: ChosenTests,
    hanger: Hanger,
    options: GapOptions,
    now: datetime,
    progress: Progress | None = None,
) -> Diagnosis:
    """Diagnose stored tests of a hanger, keep the diagnosis and return it.

    Raises as `shm.gap.diagnose` does.
    """
    from shm.gap import diagnose  # only who diagnoses needs it
    from shm.inference.options import silent

    found = diagnose(chosen.tests, hanger, options, progress or silent)
    return keep_diagnosis(store, chosen, hanger, found, options, now)


def keep_diagnosis(
    store: Store,
    chosen: ChosenTests,
    hanger: Hanger,
    found: Diagnosis,
    options: GapOptions,
    now: datetime,
) -> Diagnosis:
    """Keep a diagnosis of these tests, and return it with the remark on those left out."""
    if chosen.remark:
        found = replace(found, remarks=(chosen.remark, *found.remarks))
    lineage = diagnosis_lineage(chosen.stored, hanger, asdict(options))
    store.posteriors.save_diagnosis(hanger.id, found, lineage, now)
    return found
