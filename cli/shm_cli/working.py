"""A flow of the command line's own: what `shm ingest` takes in or sends back is done at once."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager

from shm.pipeline import Flow
from shm.store import ENDED, Workspace
from shm_cli.common import counting_bar
from shm_daemon.execution import children_ended, executor_of
from shm_daemon.hooks import HookNotifier

LEFT_TO_IT = "Noted. The daemon does the rest; see `shm status`."
"""Where another process ingests already."""


@contextmanager
def working(workspace: Workspace) -> Iterator[Flow]:
    """A flow while the context lasts; raises StoreBusy where another process ingests."""
    settings = workspace.settings
    with ExitStack() as stack:
        stack.enter_context(workspace.lock())
        store = stack.enter_context(workspace.store())
        stack.enter_context(children_ended())
        executor = executor_of(settings)
        stack.callback(executor.shutdown, wait=False, cancel_futures=True)
        notifier = HookNotifier(workspace.folder, settings.hook_timeout_seconds, os.environ)
        stack.callback(notifier.close)
        flow = Flow(workspace, store, executor, notifier=notifier, lanes=settings.workers)
        stack.callback(flow.close)
        yield flow


def finish(flow: Flow, ids: Sequence[int]) -> None:
    """Works until nothing waits, and counts the recordings that are through."""
    with counting_bar() as bar:
        task = bar.add_task("ingesting", total=len(ids))

        def count() -> None:
            through = sum(
                flow.store.recordings.get(recording_id).stage in ENDED for recording_id in ids
            )
            bar.update(task, completed=through)

        flow.drain(count)
        while (wait_s := flow.suspects_due_s()) is not None:  # its process died
            time.sleep(wait_s)
            flow.drain(count)
        count()
