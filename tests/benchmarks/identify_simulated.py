"""How well `identify` does on simulated hammer tests of random hangers: the marks of the project.

    python tests/benchmarks/identify_simulated.py --tests 500 --processes 2 --write-docs

Two of ten tests carry a disturbance (`cases.py` says what is random). A mode counts where its
ring-down is 20 dB above the noise (rms over a hit, at its best sensor). Modes within 0.5 % of a
planted tone do not count. Exits 1 where a mark
is missed. Set OMP_NUM_THREADS=1 for the seconds of one core.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict
from functools import partial
from pathlib import Path

import begin
from marks import COLUMNS, alarms, flags, marks, table
from rich.console import Console
from rich.progress import track
from rich.table import Table
from scoring import TestScore, score_number

from docs.filling import fill_in
from shm_cli.common import markdown
from tests.worlds.simulated.disturbances.registry import DISTURBANCES


def run(numbers: range, seed: int, disturbance: str | None, processes: int) -> Iterator[TestScore]:
    """The scores of tests in the order of their numbers."""
    job = partial(score_number, seed, disturbance=disturbance)
    if processes == 1:
        yield from map(job, numbers)
        return
    with ProcessPoolExecutor(processes) as pool:
        yield from pool.map(job, numbers)


def show(scores: list[TestScore], console: Console) -> None:
    grid = Table(*COLUMNS)
    for row in table(scores):
        grid.add_row(*row)
    console.print(grid)
    for kind, told in flags(scores):
        console.print(f"{kind:16}flagged {told}")
    for name, count in alarms(scores):
        console.print(f"{name}: not good in {count} sound tests")


def fragment(scores: list[TestScore], seed: int) -> str:
    """The tables as markdown."""
    head = f"{len(scores)} tests, seed {seed}."
    calls = ", ".join(f"{name} {count}" for name, count in alarms(scores))
    told = ", ".join(f"{kind} {found}" for kind, found in flags(scores))
    return "\n\n".join(
        [
            head,
            markdown(COLUMNS, table(scores)),
            f"Planted faults flagged: {told}.",
            f"Checks that are not good in sound tests: {calls}.",
        ]
    )


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tests", type=int, default=60, help="2 s each; the page has 500")
    parser.add_argument("--first", type=int, default=0, help="number of the first test")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--processes", type=int, choices=(1, 2), default=1)
    parser.add_argument("--disturbance", choices=tuple(DISTURBANCES), help="in every test")
    parser.add_argument("--remarks", action="store_true", help="list what went wrong")
    parser.add_argument("--json", type=Path, help="write every test's score there")
    parser.add_argument("--write-docs", action="store_true")
    arguments = parser.parse_args()
    console = Console(width=150, highlight=False)
    numbers = range(arguments.first, arguments.first + arguments.tests)
    running = run(numbers, arguments.seed, arguments.disturbance, arguments.processes)
    progress = Console(stderr=True)
    scores = []
    for score in track(running, "tests", total=len(numbers), console=progress):
        scores.append(score)
        for remark in score.remarks if arguments.remarks else ():
            print(remark, flush=True)
    show(scores, console)
    if arguments.json:
        arguments.json.write_text(json.dumps([asdict(score) for score in scores], indent=1))
    if arguments.write_docs:
        fill_in(
            begin.TRIALS / "identification_benchmarks.md",
            "simulated",
            fragment(scores, arguments.seed),
        )
    return int(not all(mark.met for mark in marks(scores)))


if __name__ == "__main__":
    sys.exit(main())
