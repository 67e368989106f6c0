"""The watch over seasons whose truth its author did not write (`tests/worlds/*_seasons.py`).

python tests/benchmarks/watch_worlds.py --world tied_arch --hangers 20            # a look
python tests/benchmarks/watch_worlds.py --world tied_arch --scenarios quiet,step3 --seed 900

Each hanger goes through the watch as a user's would: its description, its tests, a baseline of the
first ten or of one. Two processes. Nothing was tuned on the seeds that docs/trials quote.
"""

from __future__ import annotations

import argparse
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
from scipy.stats import beta, gamma

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from shm.bridge import load_hanger  # noqa: E402
from shm.inference import UpdateOptions, update  # noqa: E402
from shm.models import build  # noqa: E402
from shm.modes_document import parse_modes  # noqa: E402
from shm.values import TENSION, Hanger, ModalTest, Posterior  # noqa: E402
from shm.watch import WatchOptions, watch_hanger  # noqa: E402
from shm.watch.baseline_check import check_baseline  # noqa: E402
from shm.watch.watching import alerts_of  # noqa: E402
from tests.benchmarks.drift.rivals import cusum, sound, without_swing  # noqa: E402

WORLDS = ("tied_arch", "network")
DAYS_A_YEAR = 365.25
BEGINS = 540.0
"""The day of every event: a baseline and a year before it, a year and a half after."""

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
        "nominal_tension_n", "elastic_modulus_pa", "density_kg_m3",
    )  # fmt: skip
    for key, value in known.items():
        key = names.get(key, key)
        if key in taken and not (key == "density_kg_m3" and "diameter_m" not in known):
            lines.append(f"{key} = {value!r}")
    if known.get("kind") == "strand":
        lines.append('kind = "strand"')
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
        hanger = hanger_of(described.description, number)
        first = tests[:baseline_tests]
        check = check_baseline(first, build("beam2", hanger))
        posterior = baseline_of(check.kept_of(first), hanger)
        posterior = replace(posterior, baseline_check=check)
        dated = [(test, test.time) for test in tests]
        started = time.process_time()
        watched = watch_hanger(
            posterior, dated[:baseline_tests], dated[baseline_tests:], hanger,
            WatchOptions(baseline_tests=baseline_tests),
        )  # fmt: skip
        seconds = time.process_time() - started
        start = tests[0].time
        days = [(t.time - start).total_seconds() / 86400 for t in tests]
        zero = described_day(season, number, tests)
        alerts = alerts_of(watched.watch.tests, hanger)
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
            "rivals": rivals(tests, np.array(days), baseline_tests),
            "mistaken_in_baseline": [str(each) for each in (*check.modes, *check.tests)],
            "misfit": check.misfit,
            "left_out": len(check.tests),
            "seconds": seconds / max(len(tests), 1),
        })  # fmt: skip
    return found


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


FIRST = ("transverse", 1)


def rivals(
    tests: Sequence[ModalTest], days: np.ndarray, baseline_tests: int
) -> dict[str, list[float]]:
    """CUSUM and EWMA on the first frequency, cleared of its line in the temperature, clipped."""
    first = np.array([
        next((np.log(m.frequency_hz) for m in t.modes if (m.plane, m.order) == FIRST), np.nan)
        for t in tests
    ])  # fmt: skip
    warmth = np.array([t.temperature_c for t in tests])
    year = (days < DAYS_A_YEAR) | (np.arange(len(days)) < 6)
    used = year & np.isfinite(first) & np.isfinite(warmth)
    rest = without_swing(first, warmth, used)
    # A test without a temperature is taken at the mean.
    plain = first - np.nanmedian(first[used])
    rest = np.where(np.isfinite(rest), rest, plain)
    own = rest[year & np.isfinite(rest)]
    own = own[sound(own)]
    scaled = np.where(year, np.nan, (rest - own.mean()) / max(own.std(ddof=1), 1e-9))
    clipped = np.clip(scaled, -3.0, 3.0)
    smooth, level = [], 0.0
    for value in clipped:
        level = level if np.isnan(value) else 0.8 * level + 0.2 * value
        smooth.append(abs(level))
    return {
        "cusum": [round(float(v), 3) for v in cusum(clipped)],
        "ewma": [round(v, 3) for v in smooth],
    }


def share(hits: int, count: int) -> str:
    """A share with its 90 % interval (Clopper and Pearson)."""
    low = beta.ppf(0.05, hits, count - hits + 1) if hits else 0.0
    high = beta.ppf(0.95, hits + 1, count - hits) if hits < count else 1.0
    return f"{hits} of {count}: {hits / max(count, 1):.2f} ({low:.2f} to {high:.2f})"


def rate(hits: int, years: float) -> str:
    """Events a year with a 90 % interval (Garwood)."""
    low = gamma.ppf(0.05, hits) / years if hits else 0.0
    high = gamma.ppf(0.95, hits + 1) / years
    return f"{hits} in {years:.0f}: {hits / years:.3f} ({low:.3f} to {high:.3f})"


def is_alert(alert: dict[str, Any]) -> bool:
    return not set(alert["kinds"]) <= {
        "repeat the test", "check the modes", "check the baseline"
    }  # fmt: skip


def report(rows: Sequence[dict[str, Any]]) -> str:
    lines = []
    for world in WORLDS:
        for count in sorted({r["baseline"] for r in rows}):
            mine = [r for r in rows if r["world"] == world and r["baseline"] == count]
            if not mine:
                continue
            lines.append(f"## {world}, baseline of {count}")
            for scenario in SCENARIOS:
                chosen = [r for r in mine if r["scenario"] == scenario]
                if chosen:
                    lines.append(told(scenario, chosen))
    lines.append(f"seconds a test: {np.median([r['seconds'] for r in rows]):.4f}")
    return "\n".join(lines)


def told(scenario: str, rows: Sequence[dict[str, Any]]) -> str:
    watched_from = [r["baseline"] for r in rows]
    if scenario in ("quiet", "creep"):
        years, false, notices = 0.0, 0, 0
        for r, b in zip(rows, watched_from, strict=True):
            firsts = [a["at"] for a in r["alerts"] if is_alert(a)]
            end = r["days"][firsts[0]] if firsts else r["days"][-1]
            years += (end - r["days"][b - 1]) / DAYS_A_YEAR
            false += bool(firsts)
            notices += sum(not is_alert(a) for a in r["alerts"])
        often = f"notices {notices / years:.2f} a year"
        return f"{scenario}: first false alarms {rate(false, years)}; {often}"
    delays, early, named, today = [], 0, {}, 0
    for r in rows:
        begun = next((n for n, d in enumerate(r["days"]) if d >= BEGINS), None)
        if begun is None:
            continue
        firsts = [a for a in r["alerts"] if is_alert(a)]
        if firsts and firsts[0]["at"] < begun:
            early += 1
            continue
        if not firsts:
            delays.append(np.inf)
            continue
        delays.append(firsts[0]["at"] - begun + 1)
        moved = firsts[0]["moved"]
        first = moved[0][0] if moved else "beyond"
        named[first] = named.get(first, 0) + 1
        today += "today" in firsts[0]["message"]
    delays = np.array(delays)
    q = np.quantile(delays, [0.5, 0.9, 0.95], method="higher") if len(delays) else [np.nan] * 3
    cover = [abs(r["true_shift"] - r["shift"][0]) <= 1.645 * r["shift"][1] for r in rows]
    return (
        f"{scenario}: n {len(delays)}, early {early}, tests {q[0]} / {q[1]} / {q[2]} (50/90/95 %), "
        f"never {int(np.isinf(delays).sum())}; named {named}; today {today}; "
        f"covers {np.mean(cover):.2f}"
    )


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--world", default=",".join(WORLDS))
    parser.add_argument("--scenarios", default=",".join(SCENARIOS))
    parser.add_argument("--bridges", type=int, default=4)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--years", type=float, default=3.0)
    parser.add_argument("--baselines", default="10,1")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--answers", type=Path)
    given = parser.parse_args()
    tasks = [
        (world, scenario, seed, int(count), given.years)
        for count in given.baselines.split(",")
        for scenario in given.scenarios.split(",")
        for world in given.world.split(",")
        for seed in range(given.seed, given.seed + given.bridges)
    ]
    rows: list[dict[str, Any]] = []
    with ProcessPoolExecutor(given.jobs) as pool:
        for number, found in enumerate(pool.map(solved, tasks), 1):
            rows += found
            print(f"{number} of {len(tasks)}", file=sys.stderr, end="\r", flush=True)
            if given.answers:
                with given.answers.open("a") as file:
                    file.writelines(json.dumps(row) + "\n" for row in found)
    print(report(rows))
    return 0


if __name__ == "__main__":
    sys.exit(main())
