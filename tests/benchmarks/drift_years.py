"""How soon does the watch find a change, and how often without cause? Simulated years of hangers.

    python tests/benchmarks/drift_years.py [--hangers 200] [--years 5] [--jobs 2] [--seed 0]
        [--quick] [--scenarios quiet,step5] [--answers FILE] [--write-docs]

Every rule sees the same tests: the watch, three standard deviations of the tension, and CUSUM with
and without a correction for the temperature, whose limits are set to the watch's own rate of false
alarms. Answers are kept in the file and a later run goes on from there. Exit code 1 where a mark is
missed: at most one false alarm in 50 hanger-years, and no rival sooner, in the median or in the
90 % quantile of any scenario.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from docs.filling import fill_in, write_csv
from shm.values import Thresholds
from shm.watch.options import WatchOptions
from tests.benchmarks.drift.comparing import limits_at
from tests.benchmarks.drift.figures import save_figures
from tests.benchmarks.drift.outcomes import Outcome, read, written
from tests.benchmarks.drift.scenarios import SCENARIOS
from tests.benchmarks.drift.solving import Task, solved
from tests.benchmarks.drift.table import fragment, marks, tables_beside
from tests.benchmarks.drift.years import SOUND_TESTS

DOCS = Path(__file__).parents[2] / "docs" / "trials"
PAGE, FIGURES = DOCS / "drift_trial.md", DOCS / "figures"
QUICK_HANGERS = 20


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--hangers", type=int, default=200)
    parser.add_argument("--years", type=float, default=5.0)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--seed", type=int, default=0, help="of the first hanger")
    parser.add_argument("--quick", action="store_true", help=f"{QUICK_HANGERS} hangers")
    parser.add_argument("--scenarios", default=",".join(SCENARIOS))
    parser.add_argument(
        "--limit", type=float, default=WatchOptions().limit_years, help="of the evidence, in years"
    )
    parser.add_argument(
        "--baseline-tests", type=int, default=SOUND_TESTS, help="that the watch's baseline rests on"
    )
    parser.add_argument("--answers", type=Path, default=Path(os.devnull))
    parser.add_argument("--write-docs", action="store_true")
    return parser.parse_args()


def tasks(given: argparse.Namespace, known: set[tuple[int, str]]) -> list[Task]:
    """What is asked for and not yet known, a hanger each."""
    hangers = QUICK_HANGERS if given.quick else given.hangers
    found = []
    for seed in range(given.seed, given.seed + hangers):
        names = [name for name in given.scenarios.split(",") if (seed, name) not in known]
        if names:
            chosen = tuple(SCENARIOS[name] for name in names)
            found.append(Task(seed, chosen, given.years, given.baseline_tests))
    return found


def all_outcomes(given: argparse.Namespace) -> list[Outcome]:
    """Those of the file, and those still to be made."""
    lines = given.answers.read_text().splitlines() if given.answers.is_file() else []
    outcomes = [read(line) for line in lines]
    wanted = tasks(given, {(each.seed, each.scenario) for each in outcomes})
    started = time.perf_counter()
    with ProcessPoolExecutor(given.jobs) as pool, given.answers.open("a") as answers:
        for number, found in enumerate(pool.map(solved, wanted), 1):
            outcomes += found
            for outcome in found:
                print(written(outcome), file=answers, flush=True)
            spent = time.perf_counter() - started
            print(f"{number} of {len(wanted)} hangers, {spent:.0f} s", file=sys.stderr, flush=True)
    return outcomes


def main() -> int:
    given = arguments()
    outcomes = all_outcomes(given)
    limits = limits_at(outcomes, given.limit)
    text = fragment(outcomes, given.limit, given.years)
    beside = tables_beside(outcomes, given.limit, Thresholds().alert_probability)
    print(text)
    for name, rows in beside.items():
        print("", name, *map(" | ".join, rows), sep="\n")
    if given.write_docs:
        fill_in(PAGE, "trial", text)
        for name, rows in beside.items():
            write_csv(DOCS / name, rows)
        save_figures(outcomes, limits, FIGURES)
    return int(not all(met for _, _, met in marks(outcomes, given.limit, limits)))


if __name__ == "__main__":
    sys.exit(main())
