"""A week of a busy bridge in fast motion: does the daemon grow in memory or in open files?

    python tests/benchmarks/week.py --tests 10000 --hangers 20 --write-docs

The daemon runs in this process with the clock of the simulated week, its steps in a pool of
processes with the real sampler and the real watch. Each hanger's modal tests come in turn, with
noise; on each day one hanger loses a tenth of its tension, which must be told.
"""

from __future__ import annotations

import os
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from datetime import timedelta
from pathlib import Path

import begin
import numpy as np

from docs.filling import fill_in
from shm.bridge import Hook
from shm.documents import dump
from shm.modes_document import modes_document
from shm.resources import one_thread_a_process
from shm.store import ENDED, Stage, Store, Workspace
from shm.store.recordings import count_stages
from shm.values import Alert, ModalTest, Mode
from shm_daemon.loop import run
from shm_daemon.wakeup import Wakeup
from tests.helpers.flows import Clock
from tests.helpers.footprint import Trend, descendants, open_files, resident_mb, trend
from tests.helpers.workspaces import START, make_workspace, modelled_test, put

PAGE = begin.TRIALS / "load.md"
WEEK_S = 7 * 86400.0
BATCH = 100
FREQUENCY_SD = 3e-4
LOST = 0.9
NEGLIGIBLE = 0.02


@dataclass
class Sample:
    """What the daemon takes after a number of tests."""

    tests: int
    files: int
    daemon_mb: float
    workers_mb: float
    tests_a_minute: float


@dataclass
class Week:
    """A workspace, the clock of its daemon, and what its hook was told."""

    workspace: Workspace
    tests: int
    seed: int
    clock: Clock = field(default_factory=lambda: Clock(START))
    told: list[tuple[int, str]] = field(default_factory=list)

    def notify(self, hook: Hook, alert: Alert) -> None:
        self.told.append((alert.hanger, alert.test))

    @property
    def losses(self) -> dict[int, int]:
        """The first test after each hanger's loss: one hanger a day, at noon."""
        hangers = self.workspace.bridge.hangers[:7]
        return {h.id: round(self.tests * (day + 0.5) / 7) for day, h in enumerate(hangers)}

    def drop(self, first: int, last: int) -> None:
        """Drops tests `first` to before `last`, and moves the clock to the last of them."""
        self.clock.now = START + timedelta(seconds=WEEK_S * last / self.tests)
        rng, hangers = np.random.default_rng([self.seed, first]), self.workspace.bridge.hangers
        for number in range(first, last):
            hanger = hangers[number % len(hangers)]
            tension = LOST if number >= self.losses.get(hanger.id, self.tests) else 1.0
            day = 7 * number / self.tests
            test = noisy(modelled_test(f"{number:06}", hanger, day, tension), rng)
            put(self.workspace.spool / f"{test.id}.modes.json", dump(modes_document([test])))


def noisy(test: ModalTest, rng: np.random.Generator) -> ModalTest:
    """The test as it may be measured."""

    def measured(mode: Mode) -> Mode:
        sd_hz = FREQUENCY_SD * mode.frequency_hz
        frequency_hz = float(mode.frequency_hz + sd_hz * rng.standard_normal())
        return replace(mode, frequency_hz=frequency_hz, frequency_sd_hz=sd_hz)

    return replace(test, modes=tuple(map(measured, test.modes)))


@contextmanager
def served(week: Week) -> Iterator[None]:
    """The daemon's loop in a thread of this process."""
    wakeup, options = Wakeup(), {"clock": week.clock, "notifier": week.notify}
    thread = threading.Thread(
        target=run, args=(week.workspace,), kwargs={"wakeup": wakeup, **options}, daemon=True
    )
    thread.start()
    try:
        yield
    finally:
        wakeup.stop()
        thread.join(60)
    if thread.is_alive():
        raise SystemExit("the daemon does not end")


def through(store: Store) -> int:
    """Tests that are done, or held as another hanger's: a loss of a tenth may look so."""
    counts = count_stages(store)
    return sum(counts[stage] for stage in ENDED)


def lived(week: Week, every: int) -> list[Sample]:
    """Brings all tests of the week through the daemon; what it takes after each `every` tests."""
    samples = []
    with served(week), week.workspace.store() as store:
        for last in range(every, week.tests + 1, every):
            began = time.monotonic()
            for first in range(last - every, last, BATCH):
                until = min(first + BATCH, last)
                week.drop(first, until)
                while through(store) < until:
                    time.sleep(0.1)
            samples.append(sampled(last, every, time.monotonic() - began))
            print(samples[-1], file=sys.stderr, flush=True)
    return samples


def sampled(tests: int, every: int, seconds: float) -> Sample:
    own = os.getpid()
    workers_mb = sum(map(resident_mb, descendants(own)))
    return Sample(tests, open_files(own), resident_mb(own), workers_mb, 60 * every / seconds)


def rows(week: Week, samples: list[Sample], seconds: float) -> list[tuple[str, object]]:
    """What the page tells; the first quarter, in which caches fill, is left out of the trends."""
    stored_bytes = week.workspace.database.stat().st_size
    later, every = samples[len(samples) // 4 :], len(week.workspace.bridge.hangers)
    waits = [(int(test) - week.losses[h]) / every for h, test in week.told if h in week.losses]
    return [
        ("tests, hangers", f"{week.tests:,}, {every}"),
        ("time it took", f"{seconds / 60:.0f} min"),
        ("tests a minute at first, at last",
         f"{samples[0].tests_a_minute:.0f}, {samples[-1].tests_a_minute:.0f}"),
        ("memory of the daemon, MB", trend([each.daemon_mb for each in later])),
        ("memory of its workers, MB", trend([each.workers_mb for each in later])),
        ("open files", trend([float(each.files) for each in later])),
        ("the store, kB a test", f"{stored_bytes / 1000 / week.tests:.0f}"),
        ("alerts where tension was lost, after at most so many tests of the hanger",
         f"{len(waits)}, {max(waits, default=0):.0f}"),
        ("alerts where nothing was", len(week.told) - len(waits)),
    ]  # fmt: skip


def faults(week: Week, told: list[tuple[str, object]]) -> list[str]:
    """What must not be: growth, or a test that is lost or doubled."""
    found = [name for name, value in told if isinstance(value, Trend) and value.grows(NEGLIGIBLE)]
    with week.workspace.store() as store:
        hangers = [hanger.id for hanger in week.workspace.bridge.hangers]
        watched = sum(len(store.watch.list_all(hanger)) for hanger in hangers)
        done = count_stages(store)[Stage.DONE]
        if through(store) != week.tests or watched != done - len(hangers):
            found.append("tests are lost or doubled")
    return found


def main() -> None:
    options = begin.options(
        __doc__,
        tests=10_000,
        hangers=20,
        every=begin.Told(500, "tests between two looks"),
        samples=begin.Told(1000, "kept of a posterior"),
        model="beam1",
        workers=2,
        seed=1,
        write_docs=False,
    )
    one_thread_a_process()
    settings = {"models": options.model, "samples": options.samples, "workers": options.workers}
    with tempfile.TemporaryDirectory() as folder:
        hangers = range(1, options.hangers + 1)
        workspace = make_workspace(
            Path(folder) / "bridge", hangers=hangers, settings=settings, hooks={"ops": ["true"]}
        )
        week, began = Week(workspace, options.tests, options.seed), time.monotonic()
        samples = lived(week, options.every)
        told = rows(week, samples, time.monotonic() - began)
        table = "\n".join(
            ["| | |", "|---|---|", *(f"| {name} | {value} |" for name, value in told)]
        )
        print(table)
        if options.write_docs:
            fill_in(PAGE, "week", table)
        if found := faults(week, told):
            raise SystemExit(f"grows: {', '.join(found)}")


if __name__ == "__main__":
    main()
