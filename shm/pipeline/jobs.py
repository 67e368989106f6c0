"""What waits, asked of the store: each job knows how to begin and who keeps its result."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from functools import partial
from typing import Any

from shm.bridge import Hook
from shm.errors import NothingThere, ShmError
from shm.models import DESCRIPTION, competing_names
from shm.pipeline import Clock
from shm.pipeline.ending import told_by_other
from shm.pipeline.judging import judge
from shm.pipeline.limits import heed_limits
from shm.pipeline.lineage import Taught, identify_lineage, update_terms
from shm.pipeline.registry import Opens, RemoteFile, WatchResult, registered, run_step
from shm.pipeline.telling import Terms, after_works, held_messages, message_of, plan, works_before
from shm.pipeline.watching import settled, tests_beside, to_watch
from shm.settings import Settings
from shm.store import (
    Delivery,
    DeliveryState,
    IdentifiedTest,
    KeptWatch,
    Stage,
    Store,
    StoredRecording,
    StoredTest,
    TestRow,
    Workspace,
)
from shm.store.archive import nothing
from shm.values import WITHOUT_MODEL, Alert, Hanger, Posterior, Selection
from shm.values.stated_tension import averaged_now

DELIVERIES = 16  # technical: threads that mostly wait for an answer
_DELIVERIES_A_HOOK = 4  # technical: a quarter, so that a hook that hangs leaves room for three
_LONGEST_S = 86400.0  # judgement: a hook mended within a day is told the day after at the latest
_DOUBLINGS = 32  # of any wait that may be set, so many are more than a day

Notifier = Callable[[Hook, Alert], object]


class DeliveryRefused(ShmError):
    """A hook has said for good that it does not take an alert: no use in trying again."""


@dataclass(frozen=True)
class Step:
    """What to run on the executor, and what keeps its result."""

    run: Callable[[], Any]
    keep: Callable[[Any], object]


@dataclass(frozen=True)
class Job:
    """A step that waits: its name, the recordings and tests it is for, how to begin it.

    `stage` is where they stand as long as it is not done. `hanger` and the `names` of the tests are
    for the log.
    """

    key: tuple[str, int]
    prepare: Callable[[], Step]
    recordings: tuple[int, ...] = ()
    tests: tuple[int, ...] = ()
    stage: Stage = Stage.RECEIVED
    delivery: Delivery | None = None
    hanger: int | None = None
    names: tuple[str, ...] = ()
    message: Alert | None = None


def wait_after(attempts: int, settings: Settings) -> timedelta:
    """How long a delivery waits that has failed so often: doubled each time, a day at most."""
    seconds = settings.hook_backoff_seconds * 2.0 ** (attempts - 1) if attempts else 0.0
    return timedelta(seconds=min(seconds, _LONGEST_S))


def _waits(settings: Settings) -> list[timedelta]:
    """Those after so many failures, up to the first that is as long as any."""
    waits = [wait_after(0, settings)]
    while waits[-1].total_seconds() < _LONGEST_S and len(waits) < _DOUBLINGS:
        waits.append(wait_after(len(waits), settings))
    return waits


@dataclass(frozen=True)
class Jobs:
    """The jobs of a workspace, made from what its store says now."""

    workspace: Workspace
    store: Store
    clock: Clock

    def waiting(self, limit: int, held: Collection[int]) -> Iterator[Job]:
        """Steps in the order in which to take them, leaving out the recordings `held`.

        A hanger's first selection waits until every received file is identified, so that the
        earliest of its tests make the baseline; a watch waits for the files that came in before its
        test, so that what it says does not depend on which step was the faster.
        """
        received = self.store.recordings.list_waiting(limit, excluding=held)
        for recording in received:
            yield Job(
                ("identify", recording.id), partial(self._identify, recording), (recording.id,)
            )
        selected = self.store.posteriors.selected_models()
        waiting = self._waiting_tests(limit, held)
        oldest = min((recording.id for recording in received), default=None)
        for hanger in self.workspace.bridge.watched:
            if hanger.id in selected:
                yield from self._later_tests(
                    hanger, selected[hanger.id], waiting[hanger.id], oldest
                )
            elif not received:
                yield from self._first_tests(hanger, waiting[hanger.id])

    def begin_messages(self, *, hurry: bool = False) -> None:
        """Decides which alerts go to which hook now, as one message or alone, and keeps that."""
        unsent = self.store.alerts.list_unsent()
        if not unsent:
            return
        window_s = self.workspace.settings.alert_grouping_seconds
        terms = Terms(window_s, hurry, self.workspace.bridge.hooks)
        now = self.clock()
        made = plan(unsent, self.store.silences.list_all(), now, terms)
        self.store.alerts.begin_messages(made.messages, made.not_needed, now)

    def owed(self, notifier: Notifier, under_way: Sequence[Delivery]) -> Iterator[Job]:
        """Messages that are due, as many as there is room for beside those `under_way`.

        A hook that hangs takes no more than its own share of the room.
        """
        taken = Counter(delivery.hook for delivery in under_way)
        if taken.total() >= DELIVERIES:
            return
        now, most, waits = self.clock(), 2 * DELIVERIES, _waits(self.workspace.settings)
        ids = [*(delivery.id for delivery in under_way), *self._held_until_later(now)]
        due = self.store.alerts.list_due_deliveries(now, most, ids, waits, begun=True)
        parts: defaultdict[int | None, list[Delivery]] = defaultdict(list)
        for part in self.store.alerts.list_of_messages([each.id for each in due]) if due else ():
            parts[part.message_id].append(part)
        for delivery in due:
            if taken[delivery.hook] < _DELIVERIES_A_HOOK and taken.total() < DELIVERIES:
                taken[delivery.hook] += 1
                message = message_of(parts[delivery.id])
                prepare = partial(self._deliver, notifier, delivery, message)
                yield Job(("deliver", delivery.id), prepare, delivery=delivery, message=message)

    def _held_until_later(self, now: datetime) -> frozenset[int]:
        """Messages that wait for the end of quiet hours, that of a failed attempt too."""
        hooks = self.workspace.bridge.hooks
        if not any(hook.quiet_hours and hook.quiet_hours.until(now) for hook in hooks):
            return frozenset()
        waiting = self.store.alerts.list_deliveries(DeliveryState.WAITING)
        return held_messages(waiting, hooks, now)

    def _waiting_tests(self, limit: int, held: Collection[int]) -> defaultdict[int, list[TestRow]]:
        waiting: defaultdict[int, list[TestRow]] = defaultdict(list)
        most = max(limit, self.workspace.settings.baseline_tests)
        for test in self.store.tests.list_waiting(most, excluding=held):
            waiting[test.hanger].append(test)
        return waiting

    def _first_tests(self, hanger: Hanger, tests: Sequence[TestRow]) -> Iterator[Job]:
        needed = self.workspace.settings.baseline_tests
        if len(tests) >= needed:
            first = tests[:needed]
            yield _job("select", hanger.id, partial(self._select, hanger, first), first)

    def _later_tests(
        self, hanger: Hanger, model: str, tests: Sequence[TestRow], oldest: int | None
    ) -> Iterator[Job]:
        to_update = [test for test in tests if test.stage is Stage.IDENTIFIED]
        for test in self._untaught(to_update):
            yield _job("update", test.id, partial(self._update, hanger, model, test), [test])
        # Watched in the order of their times, so that an alert names the first test that shows it.
        for test in tests[:1]:
            if test.stage is Stage.UPDATED and (oldest is None or test.recording_id < oldest):
                yield _job("watch", test.id, partial(self._watch, hanger, test), [test])

    def _untaught(self, tests: Sequence[TestRow]) -> Iterator[TestRow]:
        """Tests up to the first whose tension was read: later ones learn from its posterior."""
        weighed = (
            self.store.tests.weighed_among([test.id for test in tests]) if len(tests) > 1 else ()
        )
        for test in tests:
            yield test
            if test.id in weighed:
                return

    def _identify(self, recording: StoredRecording) -> Step:
        workspace, selected = self.workspace, self.store.posteriors.selected_models()
        settings = replace(workspace.settings, store="", mqtt_url="")  # both may hold a password
        archive: Opens = workspace.archive
        if settings.scheduler:  # workers elsewhere need not see our folders
            archive = RemoteFile.of(workspace.archive, recording.file, settings.max_file_bytes)
        step = registered().identify
        run = partial(run_step, step, recording, archive, workspace.bridge, settings, selected)
        return Step(run, partial(self._keep_tests, recording))

    def _keep_tests(self, recording: StoredRecording, found: Sequence[IdentifiedTest]) -> object:
        """What is implausible is held: kept with the rest, and counted in nothing."""
        lineage = identify_lineage(recording, found[0].test.hanger, self.workspace)
        found, judged = judge(self.workspace, self.store, recording, found)
        return self.store.tests.save(recording.id, found, lineage, self.clock(), judged)

    def _select(self, hanger: Hanger, first: Sequence[TestRow]) -> Step:
        tests = [self.store.tests.get(test.id) for test in first]
        names: tuple[str, ...] = (WITHOUT_MODEL,)
        if hanger.is_modelled:
            names = competing_names(hanger, self.workspace.settings.model_names)
        settings = self.workspace.settings
        taught = self.taught(hanger, min(test.time for test in tests))
        terms, lineage = update_terms(hanger, names, tests, settings, taught=taught)
        plain = [test.test for test in tests]
        run = partial(run_step, registered().select, plain, hanger, names, terms)

        def keep(found: Selection) -> None:
            self.store.posteriors.save_selection(hanger.id, tests, found, lineage, self.clock())
            self._summarise(hanger)

        return Step(run, keep)

    def _update(self, hanger: Hanger, model: str, waiting: TestRow) -> Step:
        test, baseline = (
            self.store.tests.get(waiting.id),
            self.store.watch.baseline(hanger.id, model),
        )
        # Not the latest posterior: a result must not depend on which tests were computed before.
        known = baseline.posterior if baseline else None
        settings, taught = self.workspace.settings, self.taught(hanger, test.time)
        terms, lineage = update_terms(hanger, [model], [test], settings, known, taught)
        step = registered().update
        run = partial(run_step, step, test.test, hanger, model, known, terms)
        makes_baseline = self._makes_baseline(test, model)

        def keep(found: Posterior) -> None:
            now, to_watch = self.clock(), not makes_baseline
            self.store.posteriors.save(test, found, lineage, now, to_watch=to_watch)
            self._summarise(hanger)

        return Step(run, keep)

    def _summarise(self, hanger: Hanger) -> None:
        if hanger.is_modelled:
            self.store.posteriors.save_summaries(hanger)
            heed_limits(self.workspace, self.store, [hanger], self.clock())

    def taught(self, hanger: Hanger, before: datetime) -> Taught | None:
        """The last time before then that the hanger's own tension was read, else a sibling's."""
        if self.workspace.settings.priors != DESCRIPTION:
            return None
        siblings = [
            each.id
            for each in self.workspace.bridge.hangers
            if hanger.family and each.family == hanger.family and each.id != hanger.id
        ]
        own = self.store.tests.latest_weighed([hanger.id], before)
        weighed = own or (self.store.tests.latest_weighed(siblings, before) if siblings else None)
        if weighed is None:
            return None
        try:
            posterior = self.store.posteriors.of_test(weighed)
        except NothingThere:  # not through updating yet
            return None
        return Taught(posterior, own is not None)

    def _makes_baseline(self, test: StoredTest, model: str) -> bool:
        """Whether a test, done again, would be compared with what it has made itself."""
        baseline = self.store.watch.baseline(test.hanger, model, test.time)
        return baseline is not None and test.test.id in baseline.posterior.tests

    def _watch(self, hanger: Hanger, waiting: TestRow) -> Step:
        test = self.store.tests.get(waiting.id)
        silences = self.store.silences.list_all()
        if any(each.is_maintenance and each.covers(hanger.id, test.time) for each in silences):
            return Step(nothing, lambda _: self.store.watch.pass_over(test, self.clock()))
        current = self.store.posteriors.of_test(test)
        # Of the test's own class: another may have been adopted, or dropped, since its update.
        baseline = self.store.watch.baseline(hanger.id, current.model, test.time)
        if baseline is None:
            raise NothingThere(f"hanger {hanger.id} has no baseline.", remedy="Run `shm doctor`.")
        hooks = [hook.name for hook in self.workspace.bridge.hooks]
        limit_years = self.workspace.settings.false_call_years
        needed = to_watch(self.store, baseline, test)
        tests = (needed.baseline_tests, needed.later)
        selection = self.store.posteriors.selection(hanger.id)
        compared = None if selection is None else selection.selection
        tension = averaged_now(current, compared, hanger.limits) if hanger.is_modelled else None
        beside = tests_beside(self.store, baseline, test)
        of_test = (baseline, tests, current, hanger, limit_years, needed.kept, tension, beside)
        run = partial(run_step, registered().watch, *of_test)

        def keep(found: WatchResult | None) -> object:
            if found is None:  # the test still waits, to be watched from the baseline on
                self.store.watch.forget_state(baseline)
                return None
            watched, alert, state = *found[:2], KeptWatch(needed.key, test.time, found[2])
            if alert is not None and silences:
                earlier = [each.alert for each in self.store.alerts.list_all(hanger.id)]
                works = works_before(alert, silences, earlier)
                alert = alert if works is None else after_works(alert, works)
            ended, alert = settled(self.store, hanger, baseline, test, (watched, alert, found[3]))
            first = told_by_other(alert, self.store.alerts.list_all(hanger.id), of_stream=True)
            rings, now = None if first else alert, self.clock()
            of_test = (test, baseline, watched, rings, hooks, now)
            level = hanger.thresholds.alert_probability
            return self.store.watch.save(*of_test, state, ended, first, level)

        return Step(run, keep)

    def _deliver(self, notifier: Notifier, delivery: Delivery, message: Alert) -> Step:
        hooks = {hook.name: hook for hook in self.workspace.bridge.hooks}
        run = partial(_notify, notifier, hooks.get(delivery.hook), delivery.hook, message)
        return Step(run, lambda _: self.store.alerts.save_delivery(delivery, self.clock()))


def _job(kind: str, number: int, prepare: Callable[[], Step], tests: Sequence[TestRow]) -> Job:
    recordings = tuple(dict.fromkeys(test.recording_id for test in tests))
    return Job(
        (kind, number),
        prepare,
        recordings,
        tuple(test.id for test in tests),
        tests[0].stage,
        hanger=tests[0].hanger,
        names=tuple(test.name for test in tests),
    )


def _notify(notifier: Notifier, hook: Hook | None, name: str, message: Alert) -> None:
    if hook is None:
        raise ShmError(f"no hook {name} in bridge.toml.", remedy="Describe it again.")
    notifier(hook, message)
