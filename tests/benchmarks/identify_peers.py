"""The same simulated tests through other packages: found, false, error, seconds.

    python tests/benchmarks/identify_peers.py --tests 10 --write-docs

pyOMA2 runs in our environment; sdypy-EMA in one that this command makes from its pinned file in
`peers/requirements`. Only tests without a planted fault; everybody gets the same file. Answers are
kept in the folder and a later run goes on from there (`--anew` forgets them).
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import begin
from comparing import COLUMNS, TITLES, give, rows, sound_case
from peers import environment
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from docs.filling import fill_in
from shm_cli.common import markdown

RUNS = begin.HERE / "identification" / "runs"
ENVIRONMENTS = {
    "shm": "",
    "pyoma2": "",
    "h1_peaks": "",
    "sdypy_told": "sdypy_ema",
    "sdypy_peaks": "sdypy_ema",
}
"""Environment of each; an empty one is ours."""


def run(peer: str, python: Path, given: Path, limit: int) -> dict[str, Any]:
    """The line that a run prints, or why there is none."""
    command = [str(python), str(RUNS / f"run_{peer}.py"), str(given), "--limit", str(limit)]
    single = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
    done = subprocess.run(
        command,
        env=os.environ | single | {"PYTHONPATH": str(begin.ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )
    lines = [line for line in done.stdout.splitlines() if line.startswith("{")]
    if done.returncode == 0 and lines:
        answer: dict[str, Any] = json.loads(lines[-1])
        return answer
    if done.returncode in (-signal.SIGXCPU, -signal.SIGKILL):
        return {"failure": f"over {limit} s of processor time", "seconds": float(limit)}
    said = [line.strip() for line in done.stderr.splitlines() if line.strip()]
    return {"failure": said[-1][:200] if said else f"exit code {done.returncode}"}


def answers_of(
    peers: list[str], tests: int, seed: int, limit: int, folder: Path
) -> dict[str, dict[int, dict[str, Any]]]:
    """Every peer's line for every test, those of earlier runs included."""
    kept = begin.ROOT / "build" / "peers"
    pythons = {peer: environment(ENVIRONMENTS[peer], kept) for peer in peers}
    found: dict[str, dict[int, dict[str, Any]]] = {peer: {} for peer in peers}
    with Progress(console=Console(stderr=True)) as progress:
        task = progress.add_task("runs", total=tests * len(peers))
        for place in range(tests):
            given = folder / f"given-{seed}-{place}.npz"
            for peer in peers:
                kept = folder / f"{peer}-{seed}-{place}.json"
                if not kept.is_file():
                    if not given.is_file():
                        give(sound_case(seed, place), given)
                    kept.write_text(json.dumps(run(peer, pythons[peer], given, limit)))
                found[peer][place] = json.loads(kept.read_text())
                progress.update(task, advance=1, description=f"{peer}, test {place}")
            given.unlink(missing_ok=True)
    return found


def fragment(lines: list[tuple[str, ...]], failures: list[str]) -> str:
    """The table as markdown, and why there was no answer."""
    grid = markdown(COLUMNS, lines)
    return "\n\n".join([grid, *(["\n".join(f"- {line}" for line in failures)] if failures else [])])


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tests", type=int, default=10)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--peers", default=",".join(ENVIRONMENTS))
    parser.add_argument("--limit", type=int, default=60, help="processor time of a run in s")
    parser.add_argument("--folder", type=Path, default=begin.ROOT / "build" / "identification")
    parser.add_argument("--anew", action="store_true", help="forget what is kept")
    parser.add_argument("--write-docs", action="store_true")
    arguments = parser.parse_args()
    if arguments.anew:
        shutil.rmtree(arguments.folder, ignore_errors=True)
    arguments.folder.mkdir(parents=True, exist_ok=True)
    peers = arguments.peers.split(",")
    answers = answers_of(peers, arguments.tests, arguments.seed, arguments.limit, arguments.folder)
    lines = rows(answers, arguments.seed)
    failures = [
        f"{TITLES[peer]}, test {place}: {line['failure']}"
        for peer, own in answers.items()
        for place, line in own.items()
        if "failure" in line
    ]
    grid = Table(*COLUMNS)
    for line in lines:
        grid.add_row(*line)
    console = Console(width=160, highlight=False)
    console.print(grid)
    console.print("\n".join(failures), markup=False)
    if arguments.write_docs:
        fill_in(begin.TRIALS / "identification_benchmarks.md", "peers", fragment(lines, failures))
    return 0


if __name__ == "__main__":
    sys.exit(main())
