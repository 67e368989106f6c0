"""Thousands of damaged and hostile files through the door of the readers, and some through a flow.

    python tests/benchmarks/fuzz_readers.py --files 20000 --flow 500 --write-docs

Each file comes of a seed: `tests/helpers/mutations.py`. What is asked: no crash of the process that
asks, none over 10 s, memory below 1 GB, and every file read or refused with message and remedy;
of the sample that goes through a flow, every refused one in quarantine with its reason.
`tests/faults/test_mutated_files.py` holds what can be tested in seconds.
"""

from __future__ import annotations

import json
import multiprocessing
import resource
import tempfile
import time
from collections import Counter
from collections.abc import Iterable
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, field
from pathlib import Path

import begin
import numpy as np

from docs.filling import fill_in
from shm.errors import BadInput
from shm.read import sandbox, sidecar_path
from shm.read.sandbox import reading_process
from shm.store import Stage
from shm.store.recordings import list_recordings
from shm_daemon.execution import process_pool
from tests.helpers.flows import a_flow
from tests.helpers.mutations import Sample, damaged, harmful_samples, light, whole_samples
from tests.helpers.workspaces import make_workspace

PAGE = begin.TRIALS / "load.md"
BOMB_BYTES = 300_000_000
SHARE = 500


@dataclass
class Tally:
    """What came of a number of files."""

    outcomes: Counter[str] = field(default_factory=Counter)
    formats: Counter[str] = field(default_factory=Counter)
    slowest_s: float = 0.0
    slowest: str = ""
    own_kb: int = 0
    children_kb: int = 0
    crashes: list[str] = field(default_factory=list)
    faults: list[str] = field(default_factory=list)

    def add(self, other: Tally) -> None:
        self.outcomes += other.outcomes
        self.formats += other.formats
        if other.slowest_s > self.slowest_s:
            self.slowest_s, self.slowest = other.slowest_s, other.slowest
        self.own_kb = max(self.own_kb, other.own_kb)
        self.children_kb = max(self.children_kb, other.children_kb)
        self.crashes += other.crashes
        self.faults += other.faults


def outcome_of(path: Path) -> tuple[str, str]:
    """What came of a file in a word, and in its own words."""
    verb = sandbox.load_modes if path.name.endswith(".modes.json") else sandbox.read_test
    try:
        return ("read", "") if verb(path) else ("fault", "an empty answer")
    except BadInput as refusal:
        if not (refusal.message and refusal.remedy and refusal.file):
            return "fault", f"a refusal without words: {refusal!r}"
        return kind_of(refusal), str(refusal)
    except Exception as error:  # noqa: BLE001 - that there is none is what is measured
        return "fault", repr(error)


def kind_of(refusal: BadInput) -> str:
    if "made the reader crash" in refusal.message:
        return "the child crashed"
    if "takes more than" in refusal.message:
        return "the child was out of time"
    if "more memory" in refusal.message:
        return "the child was out of memory"
    if "cannot be" in refusal.message and "answer" in refusal.message:
        return "the answer was not believed"
    return "refused by the reader"


def one_by_one(laid: Iterable[tuple[str, Path]]) -> Tally:
    """Reads files, each with its name, one after the other, and takes them away."""
    tally = Tally()
    for name, path in laid:
        begun = time.monotonic()
        outcome, words = outcome_of(path)
        took_s = time.monotonic() - begun
        tally.outcomes[outcome] += 1
        tally.formats["".join(path.suffixes)] += 1
        if took_s > tally.slowest_s:
            tally.slowest_s, tally.slowest = took_s, f"{name}: {words[:100]}"
        if outcome == "fault":
            tally.faults.append(f"{name}: {words}")
        elif outcome not in ("read", "refused by the reader"):
            tally.crashes.append(f"{name}: {words}")
        path.unlink()
        sidecar_path(path).unlink(missing_ok=True)
    tally.own_kb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    tally.children_kb = peak_of_children_kb()
    return tally


def peak_of_children_kb() -> int:
    """The peak of the reading process; its children's is told when it ends."""
    reading_process._forget()
    return resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss


def a_pool(folder: Path) -> list[Sample]:
    """What is damaged: whole files for the most part."""
    return light([*whole_samples(folder) * 3, *harmful_samples(folder, 1_000_000)])


def a_share(first: int, count: int, seed: int) -> Tally:
    """Damages and reads the files of the numbers from `first`."""
    with tempfile.TemporaryDirectory() as folder:
        made = a_pool(Path(folder))
        numbered = (
            (n, damaged(made, np.random.default_rng([seed, n])))
            for n in range(first, first + count)
        )
        return one_by_one((f"{n} {s.name}", s.lay(Path(folder), f"f{n}")) for n, s in numbered)


def laid_out(folder: Path) -> list[tuple[str, Path]]:
    """The files made to harm, in their full size."""
    made = harmful_samples(folder / "made", BOMB_BYTES)
    return [(sample.name, sample.lay(folder, f"h{n}")) for n, sample in enumerate(made)]


def read_all(files: int, processes: int, seed: int) -> Tally:
    tally, begun = Tally(), time.monotonic()
    context = multiprocessing.get_context("spawn")
    with (
        tempfile.TemporaryDirectory() as folder,
        # Each task in a process of its own: its memory is that of reading alone.
        ProcessPoolExecutor(processes, context, max_tasks_per_child=1) as pool,
    ):
        laid = pool.submit(laid_out, Path(folder)).result()
        shares = [
            pool.submit(a_share, first, min(SHARE, files - first), seed)
            for first in range(0, files, SHARE)
        ]
        for share in as_completed([pool.submit(one_by_one, laid), *shares]):
            tally.add(share.result())
            took_s = time.monotonic() - begun
            print(f"{tally.outcomes.total()} files, {took_s:.0f} s", flush=True)
    return tally


def through_a_flow(files: int, seed: int) -> Counter[str]:
    """What came of files that were dropped into the spool of a workspace, by outcome."""
    with tempfile.TemporaryDirectory() as folder:
        workspace = make_workspace(Path(folder, "bridge"), settings={"workers": 2})
        made = a_pool(Path(folder))
        for n in range(files):
            damaged(made, np.random.default_rng([seed, 10**6 + n])).lay(workspace.spool, f"f{n}")
        pool = process_pool(2)
        with pool, a_flow(workspace, executor=pool, lanes=2) as flow:
            dropped = [path for path in sorted(workspace.spool.iterdir()) if path.suffix != ".toml"]
            for path in dropped:
                flow.receive(path)
            flow.drain()
            refused = list_recordings(flow.store, Stage.REFUSED)
            pids = len(list(workspace.quarantine.folder.glob("*.reason.json")))
        reasons = [
            json.loads(path.read_text())
            for path in workspace.quarantine.folder.glob("*.reason.json")
        ]
        told = [
            r for r in reasons if r["message"] and r["remedy"] and "internal" not in r["message"]
        ]
        for reason in reasons:
            if reason not in told:
                print("without a proper reason:", reason)
        return Counter(
            {"dropped": len(dropped), "refused": len(refused), "in quarantine": pids,
             "with message and remedy": len(told)}
        )  # fmt: skip


def table_of(tally: Tally, flow: Counter[str]) -> str:
    lines = ["| what came of them | files |", "|---|---|"]
    lines += [f"| {outcome} | {count} |" for outcome, count in tally.outcomes.most_common()]
    lines += ["", "| measured | |", "|---|---|"]
    lines += [
        f"| files, of {len(tally.formats)} endings | {tally.outcomes.total()} |",
        f"| faults of the process that asks | {len(tally.faults)} |",
        f"| slowest | {tally.slowest_s:.1f} s ({tally.slowest.split(':')[0]}) |",
        f"| largest memory of the process that asks | {tally.own_kb >> 10} MB |",
        f"| largest memory of a reading child | {tally.children_kb >> 10} MB |",
    ]
    lines += [f"| through a flow: {what} | {count} |" for what, count in flow.items()]
    return "\n".join(lines)


def main() -> None:
    options = begin.options(__doc__, files=20_000, flow=500, processes=2, seed=1, write_docs=False)
    tally = read_all(options.files, options.processes, options.seed)
    print("\n".join([*tally.faults, *tally.crashes]))
    flow = through_a_flow(options.flow, options.seed) if options.flow else Counter()
    table = table_of(tally, flow)
    print(table)
    if options.write_docs:
        fill_in(PAGE, "fuzz", table)


if __name__ == "__main__":
    main()
