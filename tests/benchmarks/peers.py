"""The same likelihood through the field's samplers: cost, evidence, effective samples.

Beam 2 on hanger 3 with the thesis's frequencies and with sharp ones, each counted once and ten
times (N_D). Every sampler runs in an environment of its own, which this command makes from the
pinned files beside the scripts in `peers/`, and calls the frequencies and the likelihood of this
package. One run after the other: side by side they would lengthen each other's processor time. Run:

    python tests/benchmarks/peers.py --resume --write-docs

Each run is a line of `docs/trials/peers/runs.jsonl`, from which the tables are made. Exits 1 where
a bound fails: our evidence right, and every peer with a right evidence at least 30 times as
expensive.
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
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import track

ROOT = Path(__file__).resolve().parents[2]
SCRIPTS = Path(__file__).resolve().parent / "peers"
sys.path[:0] = [str(SCRIPTS), str(ROOT)]

from table import Case, failed_bounds, show, write_docs  # noqa: E402

DOCS = ROOT / "docs" / "trials" / "peers.md"
RUNS = DOCS.with_suffix("") / "runs.jsonl"
OURS = "shm"
OUR_SEEDS = 20
ENVIRONMENTS = {
    OURS: "",
    "dynesty": "nested",
    "dynesty_dynamic": "nested",
    "dynesty_walks": "nested",
    "ultranest": "nested",
    "nautilus": "nested",
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
    def head(self) -> dict[str, Any]:
        """The keys by which its line is found."""
        return {"peer": self.peer, **asdict(self.case), "seed": self.seed}

    def done(self, rows: Iterable[dict[str, Any]], limit: int) -> bool:
        """Whether these hold it: finished, or failed with as much time as now."""
        own = [row for row in rows if row.items() >= self.head.items()]
        return any("failure" not in row or row["limit"] >= limit for row in own)

    def hopeless(self, rows: Iterable[dict[str, Any]], limit: int) -> bool:
        """Whether another seed has failed with as much time."""
        of_any_seed = {"peer": self.peer, **asdict(self.case)}.items()
        return any(row.items() >= of_any_seed and row.get("limit", 0) >= limit for row in rows)


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
    command = [str(python), str(SCRIPTS / f"run_{job.peer}.py"), "--problem", job.case.problem]
    command += ["--repeat", str(job.case.repeat), "--sigma", job.case.sigma]
    command += ["--seed", str(job.seed), "--limit", str(limit)]
    single = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
    path = {"PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        command, env=os.environ | single | path, capture_output=True, text=True, check=False
    )
    lines = [line for line in done.stdout.splitlines() if line.startswith("{")]
    head = job.head | {"date": datetime.now(UTC).date().isoformat()}
    if done.returncode == 0 and lines:
        return head | json.loads(lines[-1])
    return head | {"failure": _why(done, limit), "limit": limit}


def _why(done: subprocess.CompletedProcess[str], limit: int) -> str:
    if done.returncode in (-signal.SIGXCPU, -signal.SIGKILL):
        return f"over {limit} s of processor time"
    said = [line.strip() for line in done.stderr.splitlines() if line.strip()]
    return said[-1][:200] if said else f"exit code {done.returncode}"


def planned(peers: Sequence[str], cases: Iterable[Case], seeds: int) -> list[Job]:
    """All runs, the first seed of all first; ours has more seeds and integrates sigma out."""
    jobs = [
        Job(peer, replace(case, sigma="integrated") if peer == OURS else case, seed)
        for seed in range(1, max(seeds, OUR_SEEDS) + 1)
        for case in cases
        for peer in peers
        if seed <= (OUR_SEEDS if peer == OURS else seeds)
    ]
    return list(dict.fromkeys(jobs)) if seeds else []


def prepared(peers: Iterable[str], folder: Path, console: Console) -> dict[str, Path]:
    """The interpreters of the samplers whose environment can be made; says which cannot."""
    made: dict[str, Path] = {}
    for peer in peers:
        with console.status(f"environment of {peer}"):
            try:
                made[peer] = environment(ENVIRONMENTS[peer], folder)
            except subprocess.CalledProcessError as error:
                console.print(f"{peer} does not install: exit code {error.returncode}")
    return made


def kept(runs: Path) -> list[dict[str, Any]]:
    """The lines of the file, none where there is no file."""
    lines = runs.read_text(encoding="utf-8").splitlines() if runs.is_file() else []
    return [json.loads(line) for line in lines]


def keep(rows: Iterable[dict[str, Any]], runs: Path) -> None:
    """Writes the file anew."""
    runs.write_text("".join(f"{json.dumps(row)}\n" for row in rows), encoding="utf-8")


def run_all(jobs: Sequence[Job], pythons: dict[str, Path], runs: Path, limit: int) -> None:
    """Runs the jobs, one after the other; each one's line replaces what the file held of it."""
    for job in track(jobs, "runs"):
        if job.hopeless(kept(runs), limit):
            print(f"{job.head}: left out, an earlier seed failed", flush=True)
            continue
        row = run(job, pythons[job.peer], limit)
        others = [other for other in kept(runs) if not other.items() >= job.head.items()]
        keep([*others, row], runs)
        print(f"{job.head}: {row.get('failure') or row['cpu_seconds']}", flush=True)


def main() -> int:
    """Runs what is asked for and shows all that is kept."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=5, help="0: only the tables, anew")
    parser.add_argument("--peers", default=",".join(ENVIRONMENTS))
    parser.add_argument("--problem", default="thesis,sharp")
    parser.add_argument("--repeats", default="1,10", help="how often the data set counts")
    parser.add_argument("--sigma", default="sampled", help="of the others; ours integrates it out")
    parser.add_argument("--limit", type=int, default=1800, help="processor time of a run in s")
    parser.add_argument("--environments", type=Path, default=ROOT / "build" / "peers")
    parser.add_argument("--runs", type=Path, default=RUNS, help="a line for each run")
    parser.add_argument("--resume", action="store_true", help="only the runs that are not kept yet")
    parser.add_argument("--write-docs", action="store_true")
    arguments = parser.parse_args()
    console = Console(width=190)
    cases = [
        Case(problem, int(repeat), sigma)
        for problem in arguments.problem.split(",")
        for repeat in arguments.repeats.split(",")
        for sigma in arguments.sigma.split(",")
    ]
    jobs = planned(arguments.peers.split(","), cases, arguments.seeds)
    if arguments.resume:
        rows = kept(arguments.runs)
        jobs = [job for job in jobs if not job.done(rows, arguments.limit)]
    pythons = prepared(dict.fromkeys(job.peer for job in jobs), arguments.environments, console)
    jobs = [job for job in jobs if job.peer in pythons]
    run_all(jobs, pythons, arguments.runs, arguments.limit)
    rows = kept(arguments.runs)
    show(rows, console)
    if arguments.write_docs:
        write_docs(rows, DOCS)
    failed = failed_bounds(rows)
    for bound in failed:
        console.print(f"FAILED: {bound}")
    return int(bool(failed))


if __name__ == "__main__":
    sys.exit(main())
