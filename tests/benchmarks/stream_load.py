"""What a bridge full of permanent sensors costs: processor time, memory, how far behind it gets.

    python tests/benchmarks/stream_load.py --hangers 20 --hours 6
    python tests/benchmarks/stream_load.py --hangers 100 --hours 4 --live 8

Chunks of four channels at 200 Hz are sent into the ring while a real daemon with two workers
serves; without `--live` as fast as it takes them, so that processor time is what counts: its sum
over all processes of the daemon, a hanger and hour, and so for 100 hangers the share of two cores.
With `--live N` so many seconds of the bridge pass in one of ours, at least 7: chunks of a past time
are sealed once none came for ten seconds. Each half hour sent tells memory and how far the stream
that is worst off is behind, in seconds of the bridge; ten minutes are what a window takes.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import threading
import time
from datetime import UTC, datetime, timedelta
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from shm.read.chunk_document import chunk_document
from shm.simulate.monitored import MonitoringPlan, streamed
from shm.store import Store, Workspace
from shm.store.ring import ring_of
from tests.helpers.daemons import real_daemon
from tests.helpers.footprint import descendants, resident_mb
from tests.helpers.live_streams import with_live_streams
from tests.helpers.workspaces import make_workspace

CORES = 2
TICKS_A_S = os.sysconf("SC_CLK_TCK")


def send(
    workspace: Workspace, first: datetime, hours: float, live: float, sent: list[datetime]
) -> None:
    """All streams minute by minute; `sent` grows by when each ends."""
    ring, plan = ring_of(workspace), MonitoringPlan()
    pairs = list(zip(workspace.bridge.hangers, workspace.bridge.streams, strict=True))
    each = [streamed(h, s, plan, first, hours * 3600, 1) for h, s in pairs]
    begun = time.monotonic()
    for minute, chunks in enumerate(zip(*each, strict=True), 1):
        if live:
            time.sleep(max(0.0, begun + 60 * minute / live - time.monotonic()))
        ring.append_all([chunk_document(chunk) for chunk in chunks])
        sent.append(chunks[0].end)


def behind(store: Store, workspace: Workspace, sent: list[datetime]) -> float:
    """Seconds of the bridge from what was sent to what is read of the stream that is worst off."""
    done = [store.streams.progress(each.name) for each in workspace.bridge.streams]
    known = [each for each in done if each]
    return (sent[-1] - min(known)).total_seconds() if len(known) == len(done) else float("nan")


def processor_s(pid: int) -> float:
    """Of a process and all that it has begun, as long as they live."""
    total = 0.0
    for each in descendants(pid):
        try:
            fields = Path(f"/proc/{each}/stat").read_text().rpartition(")")[2].split()
        except FileNotFoundError:
            continue
        total += (int(fields[11]) + int(fields[12])) / TICKS_A_S
    return total


def wait_until_done(store: Store, workspace: Workspace, until: datetime, patience_s: float) -> None:
    """Raises TimeoutError where a stream is not read up to a time."""
    give_up = time.monotonic() + patience_s
    while True:
        done = [store.streams.progress(each.name) for each in workspace.bridge.streams]
        if all(each is not None and each >= until for each in done):
            return
        if time.monotonic() > give_up:
            raise TimeoutError(f"read up to {min(each for each in done if each)}")
        time.sleep(1.0)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--hangers", type=int, default=20)
    parser.add_argument("--hours", type=float, default=2.0)
    parser.add_argument("--live", type=float, default=0.0)
    parser.add_argument("--patience-s", type=float, default=3600.0)
    asked = parser.parse_args()
    first = datetime.now(UTC).replace(minute=0, second=0, microsecond=0)
    first -= timedelta(hours=1 + int(asked.hours))
    ends = first + timedelta(hours=asked.hours)
    sent: list[datetime] = []
    told, begun = 0, time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        hangers, settings = range(1, asked.hangers + 1), {"workers": CORES}
        made = make_workspace(Path(folder) / "bridge", hangers=hangers, settings=settings)
        workspace = with_live_streams(made, 200.0)
        with real_daemon(workspace.folder) as daemon, workspace.store() as store:
            sender = threading.Thread(
                target=send, args=(workspace, first, asked.hours, asked.live, sent), daemon=True
            )
            sender.start()
            memory_mb: list[float] = []
            while sender.is_alive():
                sender.join(5.0)
                memory_mb.append(sum(map(resident_mb, descendants(daemon.pid))))
                if sent and len(sent) // 30 > told:
                    told = len(sent) // 30
                    late_s, used_s = behind(store, workspace, sent), processor_s(daemon.pid)
                    print(
                        f"{told / 2:g} h: memory {memory_mb[-1]:.0f} MB, behind {late_s:.0f} s,"
                        f" processor {used_s:.0f} s in {time.monotonic() - begun:.0f} s",
                        flush=True,
                    )
            wait_until_done(store, workspace, ends, asked.patience_s)
            used_s = processor_s(daemon.pid)
            windows = sum(
                len(store.streams.list_windows(each.id, first, ends))
                for each in workspace.bridge.hangers
            )
    each_s = used_s / asked.hangers / asked.hours
    print(f"{asked.hangers} hangers, {asked.hours:g} h: {windows} windows")
    print(f"processor time {used_s:.0f} s, {each_s:.2f} s a hanger and hour, begin included")
    print(f"100 hangers: {100 * each_s / 3600 / CORES:.0%} of {CORES} cores")
    half = len(memory_mb) // 2
    if half:
        early, late = max(memory_mb[:half]), max(memory_mb[half:])
        print(f"memory of all processes: up to {early:.0f} MB, in the second half {late:.0f} MB")


if __name__ == "__main__":
    main()
