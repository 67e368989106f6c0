"""Data of the page of one hanger and its figures; each part is read when it is first used."""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any

from fastapi import Depends, Request

from shm.errors import ShmError
from shm.pipeline import utc_now
from shm.pipeline.diagnosing import latest_diagnosis
from shm.pipeline.reporting import hanger_now, hanger_states
from shm.report.contents import DiagnosisSheet, HangerReport
from shm.report.states import NOTHING_WATCHED, StatesOverTime
from shm.store import (
    Baseline,
    BaselineGlance,
    HangerEvent,
    Store,
    StoredWatch,
    TrendPoint,
    Workspace,
)
from shm.store.alerts import list_hanger_events
from shm.store.posteriors import list_baselines_in_force, list_trend
from shm.store.tests import list_watched_tests
from shm.store.watch import (
    list_detections,
)
from shm.values import Hanger
from shm.values.notes import Note
from shm_daemon.web.access import AtSite
from shm_daemon.web.background_work import BackgroundWorker, background_worker_of
from shm_daemon.web.models import HangerNumber
from shm_daemon.web.site import described

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class StatesOrder:
    """States over time to be worked out: of which hanger, against what, over which tests.

    They take a second and load what takes longer, so that no request can wait for them.
    """

    folder: Path
    hanger: Hanger
    baseline_id: int
    model: str
    tests: tuple[int, ...]
    false_call_years: float

    def make(self) -> StatesOverTime:
        """Run in a process of its own: the workspace is opened anew."""
        workspace = Workspace.open(self.folder)
        with workspace.store() as store:
            baseline = store.watch.baseline(self.hanger.id, self.model)
            return hanger_states(workspace, store, self.hanger, baseline)


class HangerView:
    """One hanger as it stands in the store; what is asked for twice is read once."""

    def __init__(
        self,
        workspace: Workspace,
        store: Store,
        hanger: Hanger,
        background_worker: BackgroundWorker[Any],
    ):
        self.workspace, self.store, self.hanger = workspace, store, hanger
        self._background_worker = background_worker

    @cached_property
    def trend(self) -> tuple[TrendPoint, ...]:
        """One point a test that has been through updating, the oldest first."""
        return list_trend(self.store, self.hanger)

    @cached_property
    def baseline(self) -> BaselineGlance | None:
        return list_baselines_in_force(self.store, [self.hanger]).get(self.hanger.id)

    @cached_property
    def events(self) -> tuple[HangerEvent, ...]:
        return list_hanger_events(self.store, self.hanger.id)

    @cached_property
    def notes(self) -> tuple[Note, ...]:
        """Return the notes on the hanger and on the bridge, the latest first."""
        return self.store.notes.list_all(self.hanger.id)

    @cached_property
    def calls(self) -> tuple[StoredWatch, ...]:
        """The tests at which a change stood as called."""
        if self.baseline is None:
            return ()
        found = list_detections(self.store, self.hanger.id, self.baseline.id)
        return tuple(each for each in found if each.watched.change.called)

    @cached_property
    def report(self) -> HangerReport | None:
        """Return the report after the latest test; None before the first is processed."""
        if not self.trend:
            return None
        report = hanger_now(self.workspace, self.store, self.hanger, self.trend, utc_now())
        rows = zip(report.trend, self.trend, strict=True)
        return replace(
            report,
            # A test without a time stands at its receipt.
            trend=tuple(replace(row, time=point.time) for row, point in rows),
            states=self.states or NOTHING_WATCHED,
        )

    @cached_property
    def sheet(self) -> DiagnosisSheet | None:
        """The latest diagnosis of the gap."""
        found = latest_diagnosis(self.store, self.hanger)
        if found is None:
            return None
        return DiagnosisSheet(found, self.hanger, self.workspace.bridge.name)

    @cached_property
    def states(self) -> StatesOverTime | None:
        """The states over time; None while they are worked out, empty where there are none."""
        if self.baseline is None:
            return NOTHING_WATCHED
        try:
            made: StatesOverTime | None = self._background_worker.get_or_start(
                self._order(self.baseline)
            )
        except ShmError as error:
            log.warning("states over time of hanger %d: %s", self.hanger.id, error)
            return NOTHING_WATCHED
        return made

    def _order(self, baseline: BaselineGlance) -> StatesOrder:
        stored = self.store.watch.baseline(self.hanger.id, baseline.model)
        assert isinstance(stored, Baseline)
        return StatesOrder(
            folder=self.workspace.folder,
            hanger=self.hanger,
            baseline_id=baseline.id,
            model=baseline.model,
            tests=tuple(each.id for each in list_watched_tests(self.store, stored)),
            false_call_years=self.workspace.settings.false_call_years,
        )


def view_of(request: Request, site: AtSite, hanger_id: HangerNumber) -> HangerView:
    """Return the hanger that is asked for; raises NothingThere."""
    hanger = described(site.workspace, hanger_id)
    return HangerView(site.workspace, site.store, hanger, background_worker_of(request))


View = Annotated[HangerView, Depends(view_of)]
