"""The watch over seasons whose truth its author did not write (`tests/worlds/*_seasons.py`).

python tests/benchmarks/watch_worlds.py --world tied_arch --bridges 2             # a look
python tests/benchmarks/watch_worlds.py --scenarios quiet --bridges 9 --seed 2000 --answers a.jsonl
python tests/benchmarks/watch_worlds.py --of a.jsonl b.jsonl --write-docs

Each hanger goes through the watch as a user's would: its description, its tests, a baseline of the
first ten or of one. Two processes. Nothing was tuned on the seeds that docs/trials quote.
"""

from __future__ import annotations

import argparse
import csv
import hashlib
import importlib
import json
import os
import pickle
import sys
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

# Two processes, each one thread: more only wait for each other.
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from docs.filling import fill_in, write_csv  # noqa: E402
from shm.bridge import load_hanger  # noqa: E402
from shm.inference import UpdateOptions, update  # noqa: E402
from shm.models import build  # noqa: E402
from shm.modes_document import parse_modes  # noqa: E402
from shm.values import TENSION, Alert, Beside, Hanger, ModalTest, Posterior  # noqa: E402
from shm.watch import DatedTest, Watched, WatchOptions, watch_hanger  # noqa: E402
from shm.watch.agreement import agreement  # noqa: E402
from shm.watch.baseline_check import check_baseline  # noqa: E402
from shm.watch.watching import replay  # noqa: E402
from shm.watch.words.notices import alert_of_agreement  # noqa: E402
from tests.benchmarks.watch_trial.outcomes import BEGINS  # noqa: E402
from tests.benchmarks.watch_trial.report import HEADS, events, save_figure, tables  # noqa: E402
from tests.benchmarks.watch_trial.rivals import rivals  # noqa: E402

WORLDS = ("tied_arch", "network", "road_bridge")
ON_A_BRIDGE = 6
"""Hangers of one bridge; a quiet one gives as many, one with an event a single one."""

SCENARIOS: dict[str, tuple[str, dict[str, Any]]] = {
    "quiet": ("none", {}),
    "creep": ("none", {}),
    "step3": ("tension_step", {"size": -0.03}),
    "step5": ("tension_step", {"size": -0.05}),
    "step10": ("tension_step", {"size": -0.10}),
    "rise15": ("tension_step", {"size": 0.15}),
    "ramp1": ("tension_ramp", {"size": -0.01}),
    "ramp2": ("tension_ramp", {"size": -0.02}),
    "ramp5": ("tension_ramp", {"size": -0.05}),
    "springs": ("springs", {"size": 1 / 3}),
    "lamp": ("lamp", {"size": 8.0}),
    "clock": ("clock", {"size": 0.002}),
    "section": ("section_loss", {"size": 0.10}),
    "sensor": ("sensor_moved", {"size": 0.7}),
}
CREEP_PER_YEAR = 0.003
PAGE = ROOT / "docs" / "trials" / "watch_trial.md"
CACHE = Path(os.environ.get("SHM_WATCH_CACHE", ROOT / "build" / "watch_worlds"))


def seasons(world: str, scenario: str, seed: int, years: float) -> tuple[Any, list[int]]:
    """A bridge and the numbers of its hangers that are looked at."""
    module = importlib.import_module(f"tests.worlds.{world}_seasons")
    kind, told = SCENARIOS[scenario]
    creep = CREEP_PER_YEAR if scenario == "creep" else 0.0
    chosen = seed % ON_A_BRIDGE
    first = 1 if world == "tied_arch" else 0  # the number of its first hanger
    event = module.Event(kind=kind, hanger=first + chosen, day=BEGINS, **told)
    found = module.season(
        seed, hangers=ON_A_BRIDGE, years=years, event=event, relaxation_per_year=creep
    )
    quiet = kind == "none"
    return found, list(range(first, first + ON_A_BRIDGE)) if quiet else [first + chosen]


def hanger_of(description: dict[str, Any], number: int) -> Hanger:
    """As its owner describes it, through a file."""
    known = dict(description)
    lines = ["[[hanger]]", f"id = {number + 1}"]
    names = {"modulus_pa": "elastic_modulus_pa"}
    taken = (
        "diameter_m", "area_m2", "second_moment_m4", "mass_per_length_kg_m", "length_m",
        "nominal_tension_n", "elastic_modulus_pa", "density_kg_m3", "bending_stiffness_factor",
        "fittings_m", "ends", "inclination_deg",
    )  # fmt: skip
    for key, value in known.items():
        key = names.get(key, key)
        if key in taken and not (key == "density_kg_m3" and "diameter_m" not in known):
            lines.append(f"{key} = {json.dumps(value)}")
    if known.get("kind") == "strand":
        lines.append('kind = "strand"')
    for each in known.get("turnbuckle", ()):
        lines += ["[[hanger.turnbuckle]]", *(f"{key} = {value!r}" for key, value in each.items())]
    path = CACHE / f"hanger-{hashlib.sha256(repr(lines).encode()).hexdigest()[:16]}.toml"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join(lines) + "\n")
    return load_hanger(path, number + 1)


def tests_of(visits: list[dict[str, Any]]) -> list[ModalTest]:
    found = parse_modes({"schema": "shm.modes/1", "tests": visits})
    return sorted(found, key=lambda test: test.time)


def baseline_of(tests: Sequence[ModalTest], hanger: Hanger) -> Posterior:
    """The posterior of the baseline's tests jointly, kept since every scenario begins alike."""
    key = hashlib.sha256(repr((tests, hanger)).encode()).hexdigest()[:24]
    path = CACHE / f"baseline-{key}.pickle"
    if path.is_file():
        return pickle.loads(path.read_bytes())
    found = update(tests, build("beam2", hanger), UpdateOptions(samples=200))
    path.write_bytes(pickle.dumps(found))
    return found


def solved(task: tuple[str, str, int, int, float]) -> list[dict[str, Any]]:
    """What our watch and its rivals say of the hangers of one bridge."""
    world, scenario, seed, baseline_tests, years = task
    season, chosen = seasons(world, scenario, seed, years)
    found = []
    for number in chosen:
        described = season.hangers[number]
        tests = tests_of(described.visits)
        if len(tests) < baseline_tests + 6:
            continue
        start = tests[0].time
        days = [(t.time - start).total_seconds() / 86400 for t in tests]
        zero = described_day(season, number, tests)
        if SCENARIOS[scenario][0] != "none" and days[baseline_tests - 1] + zero >= BEGINS:
            continue  # the baseline would hold the event
        hanger = hanger_of(described.description, number)
        first = tests[:baseline_tests]
        check = check_baseline(first, hanger)
        posterior = baseline_of(check.accepted_tests(first), hanger)
        posterior = replace(posterior, baseline_check=check)
        dated = [(test, test.time) for test in tests]
        started = time.process_time()
        watched = watch_hanger(
            posterior, dated[:baseline_tests], dated[baseline_tests:], hanger,
            WatchOptions(baseline_tests=baseline_tests),
        )  # fmt: skip
        seconds = time.process_time() - started
        alerts = [
            *replay(watched.watch.tests, hanger)[1],
            *agreeing(watched, dated, baseline_tests, hanger),
        ]
        alerts.sort(key=lambda alert: alert.time)
        by_id = {test.id: n for n, test in enumerate(tests)}
        watched_at = [by_id[each.test] for each in watched.watch.tests]
        drift = {d.quantity: d for d in watched.latest.drifts}[TENSION]
        found.append({
            "world": world, "scenario": scenario, "seed": seed, "hanger": number,
            "baseline": baseline_tests, "days": [round(d + zero, 2) for d in days],
            "alerts": [
                {
                    "at": by_id[a.test], "kinds": list(a.kinds),
                    "moved": [] if a.change is None else [
                        [m.quantity, round(m.probability, 3), m.shift_mean, list(m.alike)]
                        for m in a.change.moved[:6]
                    ],
                    "message": a.message,
                }
                for a in alerts
            ],
            "watched_at": watched_at,
            "evidence": [float(f"{t.change.evidence_years:.3g}") for t in watched.watch.tests],
            "outlier": [round(t.change.outlier_probability, 3) for t in watched.watch.tests],
            "shift": [drift.shift_mean, drift.shift_sd],
            "true_shift": true_shift(season, number),
            "rivals": rivals(tests, np.array(days)),
            "mistaken_in_baseline": [str(each) for each in (*check.modes, *check.tests)],
            "misfit": check.misfit,
            "left_out": len(check.tests),
            "seconds": seconds / max(len(tests), 1),
        })  # fmt: skip
    return found


def agreeing(
    watched: Watched, dated: Sequence[DatedTest], first: int, hanger: Hanger
) -> list[Alert]:
    """What the daemon adds where two tests agree, next to each other and after the `first`
    ones, the baseline's: the first such alert."""
    options = WatchOptions(baseline_tests=first)
    for n in range(first + 1, len(dated)):
        before = [test for test, _ in reversed(dated[first:n])]
        beside = Beside(came=(before[:3], ()))
        found = agreement(watched.reader, dated[n], beside, hanger, options, ())
        if found is not None:
            return [alert_of_agreement(found, hanger)]
    return []


def described_day(season: Any, number: int, tests: Sequence[ModalTest]) -> float:
    """The day of the first test from the season's start."""
    truth = season.hangers[number].truth
    days = truth["day"] if "day" in truth else [each["day"] for each in truth["visits"]]
    return float(np.min(days))


def true_shift(season: Any, number: int) -> float:
    """Of the tension that lasts, from the first test to the last, a fraction."""
    truth = season.hangers[number].truth
    lasting = (
        np.asarray(truth["baseline_tension_n"], float)
        if "baseline_tension_n" in truth
        else np.array([each["reference_tension_n"] for each in truth["visits"]])
    )
    return float(lasting[-1] / lasting[0] - 1)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--world", default=",".join(WORLDS))
    parser.add_argument("--scenarios", default=",".join(SCENARIOS))
    parser.add_argument("--bridges", type=int, default=4)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--years", type=float, default=3.0)
    parser.add_argument("--baselines", default="10,1")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--answers", type=Path, help="keeps every hanger's outcome, a line each")
    parser.add_argument("--of", type=Path, nargs="*", help="these answers, nothing is run")
    parser.add_argument("--write-docs", action="store_true")
    given = parser.parse_args()
    tasks = [
        (world, scenario, seed, int(count), given.years)
        for count in given.baselines.split(",")
        for scenario in given.scenarios.split(",")
        for world in given.world.split(",")
        for seed in range(given.seed, given.seed + given.bridges)
    ]
    rows: list[dict[str, Any]] = []
    if given.of:
        rows = [json.loads(line) for path in given.of for line in path.read_text().splitlines()]
        tasks = []
    with ProcessPoolExecutor(given.jobs) as pool:
        for number, found in enumerate(pool.map(solved, tasks), 1):
            rows += found
            print(f"{number} of {len(tasks)}", file=sys.stderr, end="\r", flush=True)
            if given.answers:
                with given.answers.open("a") as file:
                    file.writelines(json.dumps(row) + "\n" for row in found)
    told, each = tables(rows), [HEADS, *events(rows)]
    print(told)
    csv.writer(sys.stdout).writerows(each)
    if given.write_docs:
        fill_in(PAGE, "trial", told)
        write_csv(PAGE.with_suffix("") / "events.csv", each)
        save_figure(rows, PAGE.parent / "figures" / "watch_delays.png")
    return 0


if __name__ == "__main__":
    sys.exit(main())
