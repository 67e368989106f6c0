"""The same likelihood through the field's samplers: cost, evidence, effective samples.

Beam 2 on hanger 3, table 1.1 of the thesis counted once and ten times (N_D). Every sampler runs in
an environment of its own, which this command makes from the pinned files beside the scripts in
`peers/`, and calls the frequencies and the likelihood of this package. Run:

    python tests/benchmarks/peers.py --seeds 5 --write-docs

Runs are kept in the folder; a later run of some of the samplers replaces theirs and the tables show
all. Exits 1 where a bound fails: our evidence right, and every peer with a right evidence at least
30 times as expensive.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import shutil
import signal
import subprocess
import sys
import venv
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import Progress

ROOT = Path(__file__).resolve().parents[2]
SCRIPTS = Path(__file__).resolve().parent / "peers"
sys.path[:0] = [str(SCRIPTS), str(ROOT)]

from table import Case, failed_bounds, show, write_docs  # noqa: E402

DOCS = ROOT / "docs" / "trials" / "peers.md"
OURS = "shm"
OUR_SEEDS = 20
ENVIRONMENTS = {
    OURS: "",
    "dynesty": "nested",
    "dynesty_dynamic": "nested",
    "ultranest": "nested",
    "nautilus": "nested",
    "pymc": "pymc",
    "uqpy": "uqpy",
    "blackjax": "blackjax",
    "emcee": "nested",
}
"""Environment of each sampler; ours runs in the one that runs this command."""


@dataclass(frozen=True)
class Job:
    """One run of one sampler."""

    peer: str
    case: Case
    seed: int

    @property
    def name(self) -> str:
        return f"{self.peer}-{self.case.repeat}-{self.case.sigma}-{self.seed}"

    @property
    def siblings(self) -> str:
        """A pattern of the files of all seeds."""
        return f"{self.peer}-{self.case.repeat}-{self.case.sigma}-*.json"


def environment(name: str, folder: Path) -> Path:
    """The interpreter of an environment, made anew where its pinned file has changed."""
    if not name:
        return Path(sys.executable)
    pinned = SCRIPTS / "requirements" / f"{name}.txt"
    made, digest = folder / name, hashlib.sha256(pinned.read_bytes()).hexdigest()
    python, stamp = made / "bin" / "python", made / "made-of"
    if not (stamp.is_file() and stamp.read_text() == digest):
        shutil.rmtree(made, ignore_errors=True)
        uv = Path(sys.executable).with_name("uv")
        venv.create(made, with_pip=not uv.exists())
        installer = (
            [uv, "pip", "install", "--quiet", "--python", python]
            if uv.exists()
            else [python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
        )
        subprocess.run([*installer, "--requirement", pinned], check=True)
        stamp.write_text(digest)
    return python


def run(job: Job, python: Path, limit: int) -> dict[str, Any]:
    """The line of JSON that a run prints, or why there is none, with the job's own keys."""
    command = [str(python), str(SCRIPTS / f"run_{job.peer}.py"), "--repeat", str(job.case.repeat)]
    command += ["--sigma", job.case.sigma, "--seed", str(job.seed), "--limit", str(limit)]
    single = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
    path = {"PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        command, env=os.environ | single | path, capture_output=True, text=True, check=False
    )
    lines = [line for line in done.stdout.splitlines() if line.startswith("{")]
    head = {"peer": job.peer, "repeat": job.case.repeat, "sigma": job.case.sigma, "seed": job.seed}
    if done.returncode == 0 and lines:
        return head | json.loads(lines[-1])
    return head | {"failure": _why(done, limit)}


def _why(done: subprocess.CompletedProcess[str], limit: int) -> str:
    if done.returncode in (-signal.SIGXCPU, -signal.SIGKILL):
        return f"over {limit} s of processor time"
    said = [line.strip() for line in done.stderr.splitlines() if line.strip()]
    return said[-1][:200] if said else f"exit code {done.returncode}"


def planned(peers: Sequence[str], cases: Iterable[Case], seeds: int) -> list[Job]:
    """All runs, the first seed of all first; ours has more seeds and integrates sigma out."""
    jobs = [
        Job(peer, case, seed)
        for seed in range(1, max(seeds, OUR_SEEDS) + 1)
        for case in cases
        for peer in peers
        if (peer != OURS and seed <= seeds) or (peer == OURS and case.sigma == "integrated")
    ]
    return jobs if seeds else []


def prepared(peers: Sequence[str], folder: Path, console: Console) -> dict[str, Path]:
    """The interpreters of the samplers whose environment can be made; says which cannot."""
    made: dict[str, Path] = {}
    for peer in peers:
        with console.status(f"environment of {peer}"):
            try:
                made[peer] = environment(ENVIRONMENTS[peer], folder)
            except subprocess.CalledProcessError as error:
                console.print(f"{peer} does not install: exit code {error.returncode}")
    return made


def forget(jobs: Iterable[Job], folder: Path) -> None:
    """Takes away what is kept of the samplers and cases that are to run."""
    for pattern in {job.siblings for job in jobs}:
        for path in folder.glob(pattern):
            path.unlink()


def run_all(
    jobs: Sequence[Job], pythons: dict[str, Path], folder: Path, limit: int, workers: int
) -> None:
    """Runs the jobs and keeps each one's line as a file; a case that failed once is left there."""

    def attempt(job: Job) -> str:
        if any("failure" in json.loads(path.read_text()) for path in folder.glob(job.siblings)):
            return "left out, an earlier seed failed"
        row = run(job, pythons[job.peer], limit)
        (folder / f"{job.name}.json").write_text(json.dumps(row))
        return str(row.get("failure") or f"{row['cpu_seconds']:.1f} s")

    with Progress() as progress, ThreadPoolExecutor(workers) as pool:
        task = progress.add_task("runs", total=len(jobs))
        under_way = {pool.submit(attempt, job): job for job in jobs}
        for future in as_completed(under_way):
            progress.update(
                task, advance=1, description=f"{under_way[future].name}: {future.result()}"
            )


def main() -> int:
    """Runs what is asked for and shows all that is kept."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=5, help="0: only the tables, anew")
    parser.add_argument("--peers", default=",".join(ENVIRONMENTS))
    parser.add_argument("--repeats", default="1,10", help="how often the data set counts")
    parser.add_argument("--sigma", default="sampled,integrated")
    parser.add_argument("--limit", type=int, default=900, help="processor time of a run in s")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--folder", type=Path, default=ROOT / "build" / "peers")
    parser.add_argument("--resume", action="store_true", help="only the runs that are not kept yet")
    parser.add_argument("--write-docs", action="store_true")
    arguments = parser.parse_args()
    console, results = Console(width=190), arguments.folder / "results"
    results.mkdir(parents=True, exist_ok=True)
    sigmas, repeats = arguments.sigma.split(","), map(int, arguments.repeats.split(","))
    cases = [Case(repeat, sigma) for repeat in repeats for sigma in sigmas]
    pythons = prepared(arguments.peers.split(","), arguments.folder, console)
    jobs = planned(list(pythons), cases, arguments.seeds)
    if arguments.resume:
        jobs = [job for job in jobs if not (results / f"{job.name}.json").is_file()]
    else:
        forget(jobs, results)
    run_all(jobs, pythons, results, arguments.limit, arguments.workers)
    rows = [json.loads(path.read_text()) for path in sorted(results.glob("*.json"))]
    show(rows, console)
    if arguments.write_docs:
        write_docs(rows, DOCS)
    failed = failed_bounds(rows)
    for bound in failed:
        console.print(f"FAILED: {bound}")
    return int(bool(failed))


if __name__ == "__main__":
    sys.exit(main())
