"""The watch without a model over daily frequencies of a deck that its author did not make.

python tests/benchmarks/watch_ambient.py --scenarios quiet --structures 34 --seed 1000
python tests/benchmarks/watch_ambient.py --scenarios one2,all2 --structures 20 --seed 1000

Each structure goes through `watch_frequencies` as a user's would, its first 30 tests the baseline.
The world is `ambient` of `tests/worlds/network_seasons.py`: temperature with a knee at 0 C,
traffic, moisture, modes exchanged, weeks without data, three years. Losses begin on a day of the
second year that the seed draws. Nothing was tuned on seeds from 1000 on.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from datetime import timedelta
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from shm.modes_document import parse_modes  # noqa: E402
from shm.watch import watch_frequencies  # noqa: E402
from tests.benchmarks.watch_trial.outcomes import is_alert, rate, share  # noqa: E402
from tests.worlds.network_seasons import START, StiffnessLoss, ambient  # noqa: E402

SCENARIOS = {"quiet": (0.0, 0.0)} | {
    f"{name}{percent}": (percent / 100, others)
    for percent in (1, 2, 3)
    for name, others in (("one", 0.0), ("part", 0.3), ("all", 1.0))
}
"""Size of the loss in one mode, and the share of it in the others."""

DAYS_A_YEAR = 365.25
AFTER_DAYS = 150.0  # a loss is followed for so long


def solved(task: tuple[str, int, float, int]) -> dict[str, Any]:
    scenario, seed, years, baseline = task
    size, others = SCENARIOS[scenario]
    draw = np.random.default_rng([seed, 77])
    begins, mode = float(draw.uniform(365, 730)), int(draw.integers(0, 6))
    loss = StiffnessLoss(mode, begins, size, others) if size else None
    visits, _ = ambient(seed, years, loss)
    named = [{"id": f"t{n}", **each} for n, each in enumerate(visits)]
    tests = parse_modes({"schema": "shm.modes/1", "hanger": 1, "tests": named})
    ends = START + timedelta(days=begins + AFTER_DAYS)
    if size:
        tests = tuple(each for each in tests if each.time and each.time < ends)
    started = time.process_time()
    found = watch_frequencies(tests, baseline_tests=baseline, name="Deck")
    days = {each.id: (each.time - START).total_seconds() / 86400 for each in tests if each.time}
    return {
        "scenario": scenario, "seed": seed, "begins": begins, "tests": len(tests),
        "from": days[tests[baseline - 1].id], "to": days[tests[-1].id],
        "first_after": min((d for d in days.values() if d >= begins), default=None),
        "alerts": [
            {"day": days[a.test], "kinds": list(a.kinds), "message": a.message}
            for a in found.alerts
        ],
        "largest": max(each.change.evidence_years for each in found.tests),
        "seconds": (time.process_time() - started) / len(tests),
    }  # fmt: skip


def alarms(row: dict[str, Any]) -> list[dict[str, Any]]:
    return [a for a in row["alerts"] if is_alert(a)]


def told(scenario: str, rows: Sequence[dict[str, Any]]) -> str:
    notices = sum(len(r["alerts"]) - len(alarms(r)) for r in rows)
    if scenario == "quiet":
        ends = [alarms(r)[0]["day"] if alarms(r) else r["to"] for r in rows]
        years = sum(end - r["from"] for end, r in zip(ends, rows, strict=True)) / DAYS_A_YEAR
        largest = max(r["largest"] for r in rows)
        false = rate(sum(bool(alarms(r)) for r in rows), years)
        return (
            f"quiet: first false alarms a structure-year {false}; notices {notices / years:.2f} a "
            f"year; the largest evidence {largest:.2g} years"
        )
    early = [r for r in rows if alarms(r) and alarms(r)[0]["day"] < r["begins"]]
    kept = [r for r in rows if r not in early]
    delays = np.array([alarms(r)[0]["day"] - r["begins"] if alarms(r) else np.inf for r in kept])
    q = np.quantile(delays, [0.5, 0.9], method="higher") if len(delays) else [np.nan] * 2
    within = int((delays <= 21).sum())
    return (
        f"{scenario}: n {len(rows)}, early {len(early)}, days {q[0]:.0f} / {q[1]:.0f} (50/90 %), "
        f"within 21 days {share(within, len(delays))}, not in {AFTER_DAYS:.0f} days "
        f"{int(np.isinf(delays).sum())}"
    )


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenarios", default=",".join(SCENARIOS))
    parser.add_argument("--structures", type=int, default=4)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--years", type=float, default=3.0)
    parser.add_argument("--baseline", type=int, default=30)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--answers", type=Path)
    given = parser.parse_args()
    tasks = [
        (scenario, seed, given.years, given.baseline)
        for scenario in given.scenarios.split(",")
        for seed in range(given.seed, given.seed + given.structures)
    ]
    rows: list[dict[str, Any]] = []
    with ProcessPoolExecutor(given.jobs) as pool:
        for number, row in enumerate(pool.map(solved, tasks), 1):
            rows.append(row)
            print(f"{number} of {len(tasks)}", file=sys.stderr, end="\r", flush=True)
            if given.answers:
                with given.answers.open("a") as file:
                    file.write(json.dumps(row) + "\n")
    for scenario in given.scenarios.split(","):
        print(told(scenario, [r for r in rows if r["scenario"] == scenario]))
    print(f"seconds a test: {np.median([r['seconds'] for r in rows]):.4f}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
