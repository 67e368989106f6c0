"""What a bridge full of permanent sensors costs: processor time, memory, how far behind it gets.

    python tests/benchmarks/stream_load.py --hangers 100 --hours 3

Chunks of four channels at 200 Hz are sent into the ring while a real daemon with two workers
serves: ten minutes of all hangers at once, and the next ten as soon as these are read. Printed are,
each half hour of the bridge, the longest time that ten minutes took, which is how far behind a
bridge gets, the memory of all processes of the daemon, and the sum of their processor time, which
is the share of two cores that 100 hangers need.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from itertools import islice
from pathlib import Path

from shm.store.streams import find_progress
from tests.benchmarks import begin

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from shm.read.chunk_document import chunk_document
from shm.simulate.ambient import MonitoringPlan, streamed
from shm.store import Store, Workspace
from shm.store.ring import ring_of
from shm.values.stream import PERIOD
from tests.helpers.daemons import real_daemon
from tests.helpers.footprint import descendants, resident_mb
from tests.helpers.live_streams import with_live_streams
from tests.helpers.workspaces import make_workspace

CORES = 2
TICKS_A_S = os.sysconf("SC_CLK_TCK")


def ten_minutes(workspace: Workspace, first: datetime, hours: float) -> Iterator[list[bytes]]:
    """The chunks of all streams, those of each one after the other."""
    pairs = zip(workspace.bridge.hangers, workspace.bridge.streams, strict=True)
    each = [streamed(h, s, MonitoringPlan(), first, hours * 3600, 1) for h, s in pairs]
    for _ in range(round(6 * hours)):
        yield [chunk_document(chunk) for own in each for chunk in islice(own, 10)]


def processor_s(pid: int, seen: dict[int, float]) -> float:
    """Of a process and all that it has begun; `seen` keeps what workers took that were replaced."""
    for each in descendants(pid):
        try:
            fields = Path(f"/proc/{each}/stat").read_text().rpartition(")")[2].split()
        except FileNotFoundError:
            continue
        seen[each] = (int(fields[11]) + int(fields[12])) / TICKS_A_S
    return sum(seen.values())


def is_read(store: Store, workspace: Workspace, until: datetime) -> bool:
    done = [find_progress(store, each.name) for each in workspace.bridge.streams]
    return all(each is not None and each >= until for each in done)


def main() -> None:
    asked = begin.options(
        __doc__, hangers=20, hours=2.0, wall_s=begin.Told(7200.0, "ends after so many")
    )
    first = datetime.now(UTC).replace(minute=0, second=0, microsecond=0)
    first -= timedelta(hours=1 + int(asked.hours))
    begun, memory_mb, took_s = time.monotonic(), 0.0, 0.0
    seen: dict[int, float] = {}
    with tempfile.TemporaryDirectory() as folder:
        hangers, settings = range(1, asked.hangers + 1), {"workers": CORES}
        made = make_workspace(Path(folder) / "bridge", hangers=hangers, settings=settings)
        workspace = with_live_streams(made, 200.0)
        ring = ring_of(workspace)
        with real_daemon(workspace.folder) as daemon, workspace.store() as store:
            for step, chunks in enumerate(ten_minutes(workspace, first, asked.hours), 1):
                ring.append_all(chunks)
                sent_at = time.monotonic()
                while not is_read(store, workspace, first + step * PERIOD):
                    time.sleep(2.0)
                    processor_s(daemon.pid, seen)
                    memory_mb = max(memory_mb, sum(map(resident_mb, descendants(daemon.pid))))
                    if time.monotonic() - begun > asked.wall_s:
                        return
                took_s = max(took_s, time.monotonic() - sent_at)
                if step % 3 == 0:
                    used_s = processor_s(daemon.pid, seen)
                    each_s = used_s / asked.hangers / (step / 6)
                    print(
                        f"{step / 6:g} h of {asked.hangers} hangers: memory {memory_mb:.0f} MB, ten"
                        f" minutes read in {took_s:.0f} s at most, processor {used_s:.0f} s: "
                        f"{each_s:.2f} s a hanger and hour, begin included",
                        flush=True,
                    )
                    memory_mb = took_s = 0.0


if __name__ == "__main__":
    main()
