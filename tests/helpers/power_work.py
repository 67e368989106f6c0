"""The work during which the power is cut: files land in the spool and go through all stages.

Run as a module under the recorder: `python -m tests.helpers.power_work FOLDER FILES`. It says, each
time that something was promised, what: a file that landed, one that was entered, stages reached.
"""

from __future__ import annotations

import sys
from datetime import timedelta
from pathlib import Path

import sqlalchemy as sa

from shm.pipeline import Flow
from shm.store import Workspace
from shm.store.journal import is_step
from shm.store.tables import journal
from shm_daemon.spool import incoming
from tests.helpers import quick_update
from tests.helpers.feeds import Feed
from tests.helpers.flows import Clock, a_flow
from tests.helpers.power import mark
from tests.helpers.workspaces import START


def take_in(flow: Flow, feed: Feed, describe: bool) -> None:
    """One more file: it lands, is entered, and goes through."""
    name, content = feed.made()
    with incoming(flow.workspace.spool, 10**7) as file:
        file.write(content)
        landed = file.land(name, {"hanger": 3} if describe else {})
        mark(f"landed {landed.sha256}")
    receipt = flow.receive(landed.path)
    mark(f"entered {receipt.recording.file.sha256}")
    flow.drain(lambda: mark(f"steps {_reached(flow)}"))
    mark(f"steps {_reached(flow)}")


def _reached(flow: Flow) -> int:
    with flow.store.reading() as connection:
        return int(
            connection.scalar(sa.select(sa.func.count()).select_from(journal).where(is_step)) or 0
        )


def main() -> None:
    workspace = Workspace.open(sys.argv[1])
    quick_update.stand_in(setattr)
    feed = Feed(workspace, drafts=Path(sys.argv[3]))
    clock = Clock(START + timedelta(days=100))
    with a_flow(workspace, clock=clock) as flow:
        for number in range(int(sys.argv[2])):
            take_in(flow, feed, describe=number % 2 == 1)


if __name__ == "__main__":
    main()
