"""The work that waits: what is computed for a recording or a test, and where its result is stored.

Each kind of work is one generator: it reads the store, yields what is to be computed elsewhere, is
sent the result and stores it. Only the thread that runs the flow uses the store. What computes is
imported by the first work that needs it, so that the daemon itself begins quickly.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Collection, Generator, Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from functools import partial
from typing import Any, TypeAlias

from shm.errors import NothingThere
from shm.models import DESCRIPTION, competing_names
from shm.pipeline import Clock
from shm.pipeline.controls import campaign_warnings, control_charts
from shm.pipeline.courier import after_works, with_tension, works_before
from shm.pipeline.limits import evaluate_limit_alerts
from shm.pipeline.lineage import Taught, identify_lineage, update_terms
from shm.pipeline.plausibility_check import judge
from shm.pipeline.remote_file import Opens, RemoteFile, WatchResult, run_step
from shm.pipeline.watching import find_neighbouring_tests, reconciled, to_watch
from shm.report.hanger_summary import HangerSummary, LatestTest
from shm.store import (
    Stage,
    Store,
    StoredAlert,
    StoredRecording,
    TestRow,
    WatchCheckpoint,
    Workspace,
)
from shm.store.archive import do_nothing
from shm.store.recordings import list_waiting_recordings
from shm.store.tests import find_latest_weighed, list_waiting_tests, list_weighed
from shm.store.watch import list_detected_changes, list_selected_models
from shm.values import NAN, WITHOUT_MODEL, Alert, Hanger, ModalTest
from shm.values.stated_tension import averaged_now

Work: TypeAlias = "Generator[Callable[[], Any], Any, Sequence[StoredAlert] | None]"


@dataclass(frozen=True)
class Task:
    """Work that waits: its kind and number, the recordings and tests that it is for.

    `stage` is the stage of these until it is done. `hanger` and `names` of the tests are for the
    log.
    """

    kind: str
    id: int
    work: Callable[[], Work]
    recordings: tuple[int, ...]
    tests: tuple[int, ...] = ()
    stage: Stage = Stage.RECEIVED
    hanger: int | None = None
    names: tuple[str, ...] = ()

    @property
    def key(self) -> tuple[str, int]:
        """Return what no two tasks share."""
        return self.kind, self.id

    @property
    def log_fields(self) -> dict[str, object]:
        """Return the fields by which the log is searched, those with one value."""
        named = {"recording": self.recordings, "hanger": (self.hanger,), "test": self.names}
        single = {key: ids[0] for key, ids in named.items() if len(ids) == 1 and ids[0] is not None}
        return {**single, "stage": self.kind}


@dataclass(frozen=True)
class Queue:
    """The tasks of a workspace, asked of its store each time."""

    workspace: Workspace
    store: Store
    clock: Clock

    def list_waiting(self, limit: int, excluding: Collection[int]) -> Iterator[Task]:
        """Yield tasks in the order in which to take them, without the recordings `excluding`.

        A hanger's first selection waits until every received file is identified, so that its
        earliest tests make the baseline; a watch waits for the files received before its test, so
        that its result does not depend on which task was the faster.
        """
        received = list_waiting_recordings(self.store, limit, excluding=excluding)
        for each in received:
            yield Task("identify", each.id, partial(self._identify, each), (each.id,))
        needed = self.workspace.settings.baseline_tests
        waiting: defaultdict[int, list[TestRow]] = defaultdict(list)
        for test in list_waiting_tests(self.store, max(limit, needed), excluding=excluding):
            waiting[test.hanger].append(test)
        selected = list_selected_models(self.store)
        oldest = min((each.id for each in received), default=None)
        # Control hangers first: what they say of a campaign goes into its alerts. Then those with
        # few tests, which years of others that are judged again must not hold up.
        for hanger in sorted(
            self.workspace.bridge.watched,
            key=lambda each: (not each.is_control, len(waiting[each.id])),
        ):
            tests = waiting[hanger.id]
            if hanger.id in selected:
                yield from self._list_later(hanger, selected[hanger.id], tests, oldest)
            elif not received and len(tests) >= (count := 1 if hanger.is_control else needed):
                first = tests[:count]
                yield _make_task("select", hanger.id, partial(self._select, hanger, first), first)

    def _list_later(
        self, hanger: Hanger, model: str, tests: Sequence[TestRow], oldest: int | None
    ) -> Iterator[Task]:
        to_update = [test for test in tests if test.stage is Stage.IDENTIFIED]
        ids = [test.id for test in to_update]
        weighed = list_weighed(self.store, ids) if len(ids) > 1 else ()
        for test in to_update:
            yield _make_task("update", test.id, partial(self._update, hanger, model, test), [test])
            if test.id in weighed:  # later tests learn from its posterior
                break
        # In the order of their times, so that an alert names the first test that shows it.
        for test in tests[:1]:
            if test.stage is Stage.UPDATED and (oldest is None or test.recording_id < oldest):
                yield _make_task("watch", test.id, partial(self._watch, hanger, test), [test])

    def _identify(self, recording: StoredRecording) -> Work:
        from shm.pipeline import steps

        workspace, store = self.workspace, self.store
        settings = replace(workspace.settings, store="", mqtt_url="")  # both may hold a password
        archive: Opens = workspace.archive
        if settings.scheduler:  # workers elsewhere need not see our folders
            archive = RemoteFile.of(workspace.archive, recording.file, settings.max_file_bytes)
        of_file = recording, archive, workspace.bridge, settings, list_selected_models(store)
        found = yield partial(run_step, steps.identify_file, *of_file)
        lineage = identify_lineage(recording, found[0].test.hanger, workspace)
        found, judged = judge(workspace, store, recording, found)
        notice = store.tests.save(recording.id, found, lineage, self.clock(), judged)
        return None if notice is None else (notice,)

    def _select(self, hanger: Hanger, first: Sequence[TestRow]) -> Work:
        from shm.pipeline import steps

        tests, settings = [self.store.tests.get(test.id) for test in first], self.workspace.settings
        names: tuple[str, ...] = (WITHOUT_MODEL,)
        if hanger.is_modelled:
            names = competing_names(hanger, settings.model_names)
        taught = self._find_taught(hanger, min(test.time for test in tests))
        terms, lineage = update_terms(hanger, names, tests, settings, taught=taught)
        plain = [_to_infer(test.test, hanger) for test in tests]
        found = yield partial(run_step, steps.select_model, plain, hanger, names, terms)
        self.store.posteriors.save_selection(hanger.id, tests, found, lineage, self.clock())
        self._summarise(hanger)
        return None

    def _update(self, hanger: Hanger, model: str, row: TestRow) -> Work:
        from shm.pipeline import steps

        store, settings = self.store, self.workspace.settings
        test, baseline = store.tests.get(row.id), store.watch.baseline(hanger.id, model)
        # Not the latest posterior: a result must not depend on which tests were computed before.
        known = baseline.posterior if baseline else None
        taught = self._find_taught(hanger, test.time)
        terms, lineage = update_terms(hanger, [model], [test], settings, known, taught)
        # A test of the baseline, done again, would be compared with what it has made itself.
        current = store.watch.baseline(hanger.id, model, test.time)
        of_baseline = current is not None and test.test.id in current.posterior.tests
        to_watch = not (of_baseline or hanger.is_control)
        plain = _to_infer(test.test, hanger)
        found = yield partial(run_step, steps.update_test, plain, hanger, model, known, terms)
        store.posteriors.save(test, found, lineage, self.clock(), to_watch=to_watch)
        self._summarise(hanger)
        return None

    def _watch(self, hanger: Hanger, row: TestRow) -> Work:
        from shm.pipeline import steps

        store, settings = self.store, self.workspace.settings
        test, silences = store.tests.get(row.id), store.silences.list_all()
        if any(each.is_maintenance and each.covers(hanger.id, test.time) for each in silences):
            yield do_nothing
            store.watch.pass_over(test, self.clock())
            return None
        current = store.posteriors.get(test.hanger, test.test.id)
        # Of the test's own class: another may have been adopted, or dropped, since its update.
        baseline = store.watch.baseline(hanger.id, current.model, test.time)
        if baseline is None:
            raise NothingThere(f"hanger {hanger.id} has no baseline.", remedy="Run `shm doctor`.")
        hooks = [hook.name for hook in self.workspace.bridge.hooks]
        needed = to_watch(store, baseline, test)
        tests = (needed.baseline_tests, needed.later)
        selection = store.posteriors.selection(hanger.id)
        compared = None if selection is None else selection.selection
        tension = averaged_now(current, compared, hanger.limits) if hanger.is_modelled else None
        neighbours = find_neighbouring_tests(store, baseline, test)
        years = settings.false_call_years
        of_test = (baseline, tests, current, hanger, years, needed.state, neighbours)
        found: WatchResult | None = yield partial(run_step, steps.watch_test, *of_test)
        if found is None:  # the test still waits, to be watched from the baseline on
            store.watch.forget_state(baseline)
            return None
        watched, alert, state_bytes = found
        if alert is not None and tension is not None:
            called = list_detected_changes(store, [hanger]).get(hanger.id, ())
            now = HangerSummary(
                hanger,
                LatestTest(test.test.id, test.time, tension, current.model),
                averaged_now(baseline.posterior, compared, hanger.limits),
                drifts=watched.published_drifts,
                called=(*called, *([watched.change] if watched.change.called else ())),
                standing=(alert,),
            )
            alert = with_tension(alert, now)
        if alert is not None and silences:
            earlier = [each.alert for each in store.alerts.list_all(hanger.id)]
            works = works_before(alert, silences, earlier)
            alert = alert if works is None else after_works(alert, works)
        if alert is not None and self.workspace.bridge.controls:
            alert = self._add_doubts(alert, hanger, test.time)
        changes = reconciled(store, hanger, baseline, test, (watched, alert))
        stored = (test, baseline, watched, alert, hooks, self.clock())
        state = WatchCheckpoint(needed.key, test.time, state_bytes)
        level = hanger.thresholds.alert_probability
        return store.watch.save(*stored, state, changes, level)

    def _add_doubts(self, alert: Alert, hanger: Hanger, time: datetime) -> Alert:
        """Return an alert that names what the control hangers put in doubt."""
        charts = control_charts(self.workspace, self.store)
        doubts = campaign_warnings(charts, hanger, time, self.workspace.settings.campaign_days)
        text, mark, details = alert.message.partition(" Details: ")
        return replace(alert, message=f"{' '.join((text, *doubts))}{mark}{details}")

    def _summarise(self, hanger: Hanger) -> None:
        if hanger.is_modelled:
            self.store.posteriors.save_summaries(hanger)
        if hanger.is_modelled and not hanger.is_control:
            evaluate_limit_alerts(self.workspace, self.store, [hanger], self.clock())

    def _find_taught(self, hanger: Hanger, before: datetime) -> Taught | None:
        """Return the last time before then that its tension was read, else a sibling's."""
        if self.workspace.settings.priors != DESCRIPTION or hanger.is_control:
            return None
        siblings = [
            each.id
            for each in self.workspace.bridge.hangers
            if hanger.family and each.family == hanger.family and each.id != hanger.id
        ]
        latest = find_latest_weighed(self.store, [hanger.id], before)
        weighed = latest or (
            find_latest_weighed(self.store, siblings, before) if siblings else None
        )
        if weighed is None:
            return None
        try:
            posterior = self.store.posteriors.get(weighed.hanger, weighed.test.id)
        except NothingThere:  # not through updating yet
            return None
        return Taught(posterior, latest is not None)


def _to_infer(test: ModalTest, hanger: Hanger) -> ModalTest:
    """Return a test to infer a tension from: of a control hanger without what was read."""
    unread = replace(test, tension_read_n=NAN, tension_read_sd_n=NAN)
    return unread if hanger.is_control else test


def _make_task(kind: str, id_: int, work: Callable[[], Work], tests: Sequence[TestRow]) -> Task:
    recordings = tuple(dict.fromkeys(test.recording_id for test in tests))
    ids, names = tuple(test.id for test in tests), tuple(test.name for test in tests)
    return Task(kind, id_, work, recordings, ids, tests[0].stage, tests[0].hanger, names)
