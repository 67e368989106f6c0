"""How many files a minute the daemon brings through all stages; how soon it tells an alert.

    python tests/benchmarks/load.py --queue 2000 --alerts 100 --write-docs

The daemon is a process with a pool of two workers, on a bridge of 20 hangers like the thesis's.
A queue lies in the spool when it begins: simulated hammer tests as the logger writes them (three
hits, 25 s, four accelerations, CSV), or tests whose modes are known already (`*.modes.json`).

Then, with settings as they come, one file at a time is dropped of a hanger that has lost a fifth of
its tension, until one calls the alert: the second since as a rule. The time is taken from the
renaming of that file, which is whole, until a program has the alert.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from functools import cache
from pathlib import Path

import begin
import numpy as np

from docs.filling import fill_in
from shm.documents import dump, format_time
from shm.modes_document import modes_document
from shm.read import write
from shm.simulate import HammerPlan, HangerState, hammer_test
from shm.store import ENDED, Stage, Store, Workspace
from shm.store.recordings import count_stages
from shm.values import PLANES, FloatArray, Hanger, ModalTest, Mode
from tests.helpers.daemons import real_daemon
from tests.helpers.footprint import descendants, resident_mb, trend
from tests.helpers.workspaces import START, make_workspace, put
from tests.worlds.simulated.elements import natural_frequencies

PAGE = begin.TRIALS / "load.md"
PLATE = """nominal_tension_n = 711e3
[hanger.plate]
length_m = 1.0915
thickness_m = 0.040
end_width_m = 1.0644
neck_width_m = 0.241
slot_m = 0.562
edge_node_spacing_m = 0.0425
"""
PLAN = HammerPlan(hits=3, seconds_per_hit=8.0, acceleration_noise_m_s2=0.05)
ORDERS, FREQUENCY_SD = 6, 3e-4
LOST = 0.8
RECORDINGS_OF_A_HANGER = 2
LONGEST_DELIVERY_S, MOST_FILES = 10.0, 5
Content = tuple[str, str]
"""The end of a file's name and what is in the file."""


def state_of(hanger: Hanger, seed: int, lost: float = 1.0) -> HangerState:
    rng = np.random.default_rng([seed, hanger.id])
    tension_n = hanger.nominal_tension_n * rng.uniform(0.9, 1.1) * lost
    k1, k2, k3, k4 = 10 ** rng.uniform(6.8, 8.0, 4)
    return HangerState(tension_n, k1, k2, k3, k4, damping_ratio=0.0015)


@cache
def struck(hanger: Hanger, seed: int, number: int, lost: float) -> str:
    """A recording as CSV, without its time: 0.8 MB, which are simulated in 0.3 s."""
    rng = np.random.default_rng([seed, hanger.id, number])
    made = hammer_test(hanger, state_of(hanger, seed, lost), PLAN, rng, temperature_c=11.5)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "test.csv"
        write(made, path)
        return path.read_text()


def recording(hanger: Hanger, seed: int, number: int, when: datetime, lost: float) -> Content:
    text = struck(hanger, seed, number % RECORDINGS_OF_A_HANGER, lost)
    return ".csv", f"# time: {format_time(when)}\n{text}"


@cache
def true_hz(hanger: Hanger, seed: int, lost: float) -> FloatArray:
    return natural_frequencies(hanger, state_of(hanger, seed, lost), ORDERS)


def modes(hanger: Hanger, seed: int, number: int, when: datetime, lost: float) -> Content:
    rng = np.random.default_rng([seed, hanger.id, number])
    exact_hz = true_hz(hanger, seed, lost)
    noisy_hz = exact_hz * np.exp(FREQUENCY_SD * rng.standard_normal(exact_hz.shape))
    found = [
        Mode(plane, order + 1, float(hz), float(FREQUENCY_SD * hz))
        for plane, row in zip(PLANES, noisy_hz, strict=True)
        for order, hz in enumerate(row)
    ]
    test = ModalTest(f"t{number}", tuple(found), hanger.id, when, 11.5)
    return ".modes.json", dump(modes_document([test]))


Kind = Callable[[Hanger, int, int, datetime, float], Content]
KINDS: dict[str, Kind] = {"recordings": recording, "modes": modes}


@dataclass
class Load:
    """What a queue took."""

    done: list[tuple[float, int]] = field(default_factory=list)
    daemon_mb: list[float] = field(default_factory=list)
    workers_mb: list[float] = field(default_factory=list)

    @property
    def seconds(self) -> float:
        return self.done[-1][0]


def bridge(folder: Path, model: str, hangers: int, **options: object) -> Workspace:
    """A workspace of hangers with end plates, its settings as they come but for the pool of two."""
    settings = {"models": model, "samples": 1000, "workers": 2}
    settings |= {"spool_scan_seconds": 2.0, "spool_stable_seconds": 2.0}
    made = make_workspace(folder, hangers=range(1, hangers + 1), settings=settings, **options)  # type: ignore[arg-type]
    path = Path(made.bridge.source)
    path.write_text(path.read_text().replace("nominal_tension_n = 711e3", PLATE))
    return made.reopened()


def drop(workspace: Workspace, kind: Kind, seed: int, numbers: Sequence[int], lost: float) -> None:
    """Drops a test of each hanger for each of the numbers, an hour after the other."""
    for number in numbers:
        for hanger in workspace.bridge.hangers:
            when = START + timedelta(hours=number, seconds=hanger.id)
            ending, content = kind(hanger, seed, number, when, lost)
            put(workspace.spool / f"h{hanger.id:03}-{number:05}{ending}", content)


def until_done(workspace: Workspace, files: int, pid: int) -> Load:
    """Waits until so many files are done; what the processes hold meanwhile."""
    load, began = Load(), time.monotonic()
    with workspace.store() as store:
        while not load.done or load.done[-1][1] < files:
            time.sleep(2.0)
            counts = count_stages(store)
            if counts[Stage.REFUSED]:
                raise SystemExit(f"{counts[Stage.REFUSED]} files are refused")
            # What is held as another hanger's has been through all stages but the last.
            ended = sum(counts[stage] for stage in ENDED)
            load.done.append((time.monotonic() - began, ended))
            load.daemon_mb.append(resident_mb(pid))
            load.workers_mb.append(sum(map(resident_mb, descendants(pid))))
    return load


def queue(folder: Path, model: str, kind: str, options: argparse.Namespace) -> str:
    """Brings a queue through all stages; a row of the table."""
    workspace = bridge(folder / f"{model}-{kind}", model, options.hangers)
    tests = options.queue // options.hangers
    drop(workspace, KINDS[kind], options.seed, range(tests), 1.0)
    with real_daemon(workspace.folder) as daemon:
        load = until_done(workspace, tests * options.hangers, daemon.pid)
    quarter = len(load.done) // 4
    daemon_mb, workers_mb = (trend(mb[quarter:]) for mb in (load.daemon_mb, load.workers_mb))
    a_minute = 60 * tests * options.hangers / load.seconds
    name = f"{tests * options.hangers:,} {kind}, {model}"
    return f"| {name} | {load.seconds / 60:.1f} | {a_minute:.0f} | {daemon_mb} | {workers_mb} |"


def latency(folder: Path, model: str, kind: str, options: argparse.Namespace) -> str:
    """Drops the files that call an alert, one after the other; a row of the table."""
    heard = folder / f"told-{model}-{kind}"
    heard.mkdir()
    hook = ["sh", "-c", f"cat > {heard}/.$$ && mv {heard}/.$$ {heard}/$$"]
    workspace = bridge(
        folder / f"alerts-{model}-{kind}", model, options.alerts, hooks={"ops": hook}
    )
    rng, waits = np.random.default_rng(options.seed), []
    drop(workspace, modes, options.seed, [0], 1.0)
    drop(workspace, modes, options.seed, [1], LOST)
    with real_daemon(workspace.folder) as daemon:
        until_done(workspace, 2 * options.alerts, daemon.pid)
        with workspace.store() as store:
            for hanger in workspace.bridge.hangers:
                time.sleep(rng.uniform(1.0, 5.0))
                drops = drops_of(workspace, hanger, KINDS[kind], options.seed)
                waits.append(called(store, hanger, drops, heard))
    middle, late = np.percentile(waits, [50, 99])
    return f"| {len(waits)} alerts by {kind}, {model} | {middle:.1f} | {late:.1f} |"


def drops_of(workspace: Workspace, hanger: Hanger, kind: Kind, seed: int) -> Iterator[float]:
    """Drops one file of a hanger after the other; when each was complete."""
    for number in range(2, 2 + MOST_FILES):
        ending, content = kind(hanger, seed, number, START + timedelta(hours=number), LOST)
        complete = time.time()
        put(workspace.spool / f"h{hanger.id}-{number}{ending}", content)
        yield complete


def called(store: Store, hanger: Hanger, drops: Iterator[float], folder: Path) -> float:
    """How long after the file that calls it the hook has the alert of a hanger."""
    for complete in drops:
        heard = heard_of(store, hanger.id, folder)
        if heard is not None:
            return heard - complete
    raise SystemExit(f"{MOST_FILES} files of hanger {hanger.id} call no alert")


def heard_of(store: Store, hanger: int, folder: Path) -> float | None:
    """When the hook had the alert of a hanger; None where its file is done and called none."""
    before, end = count_stages(store)[Stage.DONE], math.inf
    while time.monotonic() < end:
        for path in (each for each in folder.iterdir() if not each.name.startswith(".")):
            heard, at = json.loads(path.read_text())["hanger"], path.stat().st_mtime
            path.unlink()
            if heard == hanger:
                return at
        time.sleep(0.05)
        if end == math.inf and count_stages(store)[Stage.DONE] > before:
            end = time.monotonic() + LONGEST_DELIVERY_S
    return None


def told(row: str) -> str:
    """The row, told at once: all of them take hours."""
    print(row, file=sys.stderr, flush=True)
    return row


def main() -> None:
    options = begin.options(
        __doc__,
        queue=2000,
        hangers=20,
        alerts=begin.Told(100, "0: only the queues"),
        models="beam2,solid2",
        kinds=",".join(KINDS),
        seed=1,
        write_docs=False,
    )
    cases = [(m, kind) for m in options.models.split(",") for kind in options.kinds.split(",")]
    lines = [
        "| queue | minutes | files a minute | memory of the daemon, MB | of its workers, MB |",
        "|---|---|---|---|---|",
    ]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        lines += [told(queue(folder, *case, options)) for case in cases if options.queue]
        lines += ["", "| | median, s | 99 %, s |", "|---|---|---|"]
        lines += [told(latency(folder, *case, options)) for case in cases if options.alerts]
    text = "\n".join(lines)
    print(text)
    if options.write_docs:
        fill_in(PAGE, "load", text)


if __name__ == "__main__":
    main()
