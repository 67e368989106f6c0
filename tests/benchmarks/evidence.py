"""Log evidences of hanger 3 against quadrature over seeds: bias, spread, honesty, processor time.

Both printings of the measurement, N_D 1 and 10, beam1 and beam2, default options; then the textbook
path on the same, for its bias. Bounds: |bias| <= 0.05, spread <= 0.1, at most 10 % of all errors
beyond twice their claim, the right class chosen by every seed, each class under 0.5 s of processor
time in the median. Run:

    python tests/benchmarks/evidence.py --seeds 20
    python tests/benchmarks/evidence.py --oracle        computes the quadrature anew
"""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass

import begin
import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

from shm.inference import UpdateOptions, update
from shm.models import THESIS, build
from shm.values import Posterior
from tests.benchmarks.thesis.textbook_tmcmc import update_textbook
from tests.helpers import evidence_oracle
from tests.helpers.evidence_oracle import ORACLE, TABLES, modal_test
from tests.helpers.hangers import HANGER_3

MODELS = ("beam1", "beam2")
OURS, TEXTBOOK = "shm.update", "textbook"
WAYS = {OURS: update, TEXTBOOK: update_textbook}
MOST_SECONDS = {"beam1": 0.5, "beam2": 0.5}
MOST_BIAS, MOST_SPREAD, MOST_BEYOND = 0.05, 0.1, 0.1


@dataclass(frozen=True)
class Runs:
    """All seeds of one class on one data set by one method."""

    table: str
    repeat: int
    model: str
    method: str
    posteriors: list[Posterior]
    seconds: list[float]

    @property
    def errors(self) -> np.ndarray:
        oracle = ORACLE[self.table, self.model, self.repeat]
        return np.array([p.log_evidence for p in self.posteriors]) - oracle

    @property
    def beyond(self) -> np.ndarray:
        """Which seeds err by more than twice what they claim."""
        claimed = np.array([p.log_evidence_sd for p in self.posteriors])
        return np.abs(self.errors) > 2 * claimed

    def faults(self) -> list[str]:
        """The bounds that fail."""
        label = f"{self.model} on {self.table}, N_D {self.repeat}"
        found = []
        if abs(self.errors.mean()) > MOST_BIAS:
            found.append(f"{label}: bias {self.errors.mean():+.3f}")
        if self.errors.std(ddof=1) > MOST_SPREAD:
            found.append(f"{label}: spread {self.errors.std(ddof=1):.3f}")
        if np.median(self.seconds) > MOST_SECONDS[self.model]:
            found.append(f"{label}: {np.median(self.seconds):.2f} s of processor time")
        return found

    def row(self) -> list[str]:
        def mean(name: str) -> float:
            return float(np.mean([getattr(p, name) for p in self.posteriors]))

        return [
            self.method,
            self.table,
            str(self.repeat),
            self.model,
            f"{ORACLE[self.table, self.model, self.repeat]:.3f}",
            f"{self.errors.mean():+.3f}",
            f"{self.errors.std(ddof=1):.3f}",
            f"{mean('log_evidence_sd'):.3f}",
            f"{self.beyond.mean():.0%}",
            f"{np.median(self.seconds):.2f}",
            f"{mean('evaluations'):.0f}",
            f"{min(p.effective_sample_size for p in self.posteriors):.0f}",
        ]


def runs(table: str, repeat: int, model: str, method: str, seeds: int) -> Runs:
    """Updates with each seed."""
    posteriors, seconds = [], []
    for seed in track(range(seeds), f"{method} {table} N_D {repeat} {model}", transient=True):
        started = time.process_time()
        tests, built = [modal_test(TABLES[table])] * repeat, build(model, HANGER_3, THESIS)
        posteriors.append(WAYS[method](tests, built, UpdateOptions(1000, seed)))
        seconds.append(time.process_time() - started)
    return Runs(table, repeat, model, method, posteriors, seconds)


def right_choices(one: Runs, other: Runs) -> int:
    """How many seeds prefer the class that quadrature prefers."""
    key = one.table, one.repeat
    prefers_one = ORACLE[key[0], one.model, key[1]] > ORACLE[key[0], other.model, key[1]]
    pairs = zip(one.posteriors, other.posteriors, strict=True)
    return sum((a.log_evidence > b.log_evidence) == prefers_one for a, b in pairs)


def compare(method: str, seeds: int, shown: Table) -> tuple[list[Runs], list[str]]:
    """All data sets and classes by one method: the runs, and the choices that went wrong."""
    made, wrong = [], []
    for table in TABLES:
        for repeat in (1, 10):
            pair = [runs(table, repeat, model, method, seeds) for model in MODELS]
            right = right_choices(*pair)
            for run in pair:
                shown.add_row(*run.row(), f"{right} of {seeds}")
            if right < seeds:
                wrong.append(f"{table}, N_D {repeat}: right class in {right} of {seeds}")
            made += pair
    return made, wrong


def main() -> None:
    """Prints the table; exits with 1 where a bound fails."""
    arguments = begin.options(__doc__, seeds=20, textbook_seeds=6, oracle=False)
    if arguments.oracle:
        evidence_oracle.main()
        return
    columns = ("method", "table", "N_D", "class", "oracle", "bias", "spread", "claimed")
    shown = Table(*columns, "beyond 2", "CPU s", "evaluations", "least ESS", "right class")
    made, faults = compare(OURS, arguments.seeds, shown)
    compare(TEXTBOOK, arguments.textbook_seeds, shown)
    Console(width=140).print(shown)
    faults += [fault for run in made for fault in run.faults()]
    beyond = np.concatenate([run.beyond for run in made]).mean()
    count = sum(len(run.seconds) for run in made)
    print(f"errors beyond twice their claim: {beyond:.1%} of {count}")
    if beyond > MOST_BEYOND:
        faults.append(f"{beyond:.0%} of the errors lie beyond twice their claim")
    print("\n".join(["Bounds failed:", *faults] if faults else ["All bounds held."]))
    sys.exit(1 if faults else 0)


if __name__ == "__main__":
    main()
