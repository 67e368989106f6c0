"""Runs a flow in this process, with a clock that stands where it is put."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import contextmanager
from datetime import datetime, timedelta

from shm.bridge import Hook
from shm.pipeline import Flow, Notifier
from shm.settings import Settings
from shm.store import Store, Workspace
from shm.store.posteriors import list_history
from shm.values import Alert
from tests.helpers.workspaces import START


class Clock:
    """Stands still until it is moved."""

    def __init__(self, now: datetime = START + timedelta(days=100)):
        self.now = now

    def __call__(self) -> datetime:
        return self.now

    def pass_by(self, seconds: float) -> None:
        self.now += timedelta(seconds=seconds)


class Postman:
    """Notes what it was told to deliver; fails as often as it is told to."""

    def __init__(self, failures: int = 0):
        self.told: list[tuple[str, str]] = []
        self.failures = failures

    def __call__(self, hook: Hook, alert: Alert) -> None:
        self.told.append((hook.name, alert.key))
        if self.failures:
            self.failures -= 1
            raise RuntimeError("no answer")


@contextmanager
def a_flow(
    workspace: Workspace,
    *,
    clock: Clock | None = None,
    notifier: Notifier | None = None,
    executor: Executor | None = None,
    lanes: int = 1,
) -> Iterator[Flow]:
    with workspace.store() as store, ThreadPoolExecutor(lanes) as threads:
        flow = Flow(
            workspace,
            store,
            executor or threads,
            notifier=notifier,
            clock=clock or Clock(),
            lanes=lanes,
        )
        try:
            yield flow
        finally:
            flow.close()


def threads(settings: Settings) -> ThreadPoolExecutor:
    """Where a daemon's steps run without a process of their own."""
    return ThreadPoolExecutor(settings.workers)


def receive_all(flow: Flow) -> None:
    for path in sorted(flow.workspace.spool.iterdir()):
        if not path.name.startswith(".") and path.suffix != ".toml":
            flow.receive(path)


def ingest(workspace: Workspace, **options: object) -> None:
    """Takes in all that lies in the spool and works until nothing waits."""
    with a_flow(workspace, **options) as flow:  # type: ignore[arg-type]
        receive_all(flow)
        flow.drain()


def tension_kn(store: Store, hanger: int = 3) -> dict[str, float]:
    """The mean tension of each test, rounded to 1 N."""
    return {
        test.test.id: round(float(posterior.tension_n.mean()) / 1e3, 3)
        for test, posterior in list_history(store, hanger)
    }
