"""Absolute intervals on truth that the product's authors did not write (`tests/worlds`).

python tests/benchmarks/worlds.py                           # 20 hangers of each world: a look
python tests/benchmarks/worlds.py --worlds finite_elements --hangers 250 --seed 21
python tests/benchmarks/worlds.py --worlds eight_kinds --hangers 40  # five hangers of each kind
python tests/benchmarks/worlds.py --worlds eight_kinds --hangers 40 --new-keys  # ends, inclination

The worlds solve other equations by other code, with the nuisances of the field on. Every hanger
goes through `shm select` as a user's would: its TOML, its modes, all beam classes, no other word.
Nothing was tuned on the seeds that docs/trials/validation.md quotes. Two processes; half a minute
of one core for ten hangers.
"""

from __future__ import annotations

import argparse
import importlib
import json
import os
import sys
import tempfile
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

# Two processes, each one thread: more only wait for each other.
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

import shm  # noqa: E402
from docs.filling import fill_in  # noqa: E402
from shm.inference import UpdateOptions, select  # noqa: E402
from shm.models import applicable, build  # noqa: E402
from tests.benchmarks.shares import share  # noqa: E402

WORLDS = {
    "finite_elements": "finite elements",
    "eight_kinds": "eight kinds",
}
GROUPS = (
    *("rods", "strands", "slack", "slim", "one plane", "soft ends"),
    *("fork bars", "bars with soft ends", "slack bars", "bars with turnbuckles"),
    *("network hangers", "tubes", "locked coil strands", "spiral strands"),
)
BEAMS = ("beam1", "beam2", "beam3")


def hanger_and_tests(case: Any, new_keys: bool = False) -> tuple[Any, list[Any]]:
    """A case as a user gets it: through its files."""
    known = {"with_new_keys": True} if new_keys and hasattr(case, "extra") else {}
    with tempfile.TemporaryDirectory() as folder:
        hanger_file, modes_file = case.write(Path(folder), **known)
        found = shm.load_modes(modes_file)
        tests = list(found) if isinstance(found, list | tuple) else [found]
        return shm.load_hanger(hanger_file), tests


def selected(task: tuple[str, int, int, int, bool]) -> dict[str, Any]:
    """One hanger: interval over truth, groups, processor time, the classes' probabilities."""
    world, seed, count, index, new_keys = task
    case = importlib.import_module(f"tests.worlds.{world}").sound_hangers(seed, count)[index]
    hanger, tests = hanger_and_tests(case, new_keys)
    started = time.process_time()
    names, _ = applicable(hanger, BEAMS)
    found = select(tests, [build(name, hanger) for name in names], UpdateOptions())
    seconds, tension_n = time.process_time() - started, found.averaged.tension_n
    truth = float(case.truth["tension_n"])
    return {
        "world": world,
        "index": index,
        "groups": list(case.groups),
        "mean": tension_n.mean / truth,
        "low": tension_n.q05 / truth,
        "high": tension_n.q95 / truth,
        "seconds": seconds,
        "fewest_effective": min(p.effective_sample_size for p in found.posteriors),
        "largest_occam": max(p.log_occam for p in found.posteriors),
        "caveats": list(found.averaged.caveats),
        "faults": list(found.averaged.faults),
    }


def table(rows: Sequence[dict[str, Any]]) -> str:
    """Coverage by world and by group, as Markdown."""
    lines = [
        "| hangers | cases | 90 % interval covers | median error | median half width | worst |",
        "|---|---|---|---|---|---|",
    ]
    kinds = [("all", rows)]
    kinds += [(title, [r for r in rows if r["world"] == w]) for w, title in WORLDS.items()]
    kinds += [(group, [r for r in rows if group in r["groups"]]) for group in GROUPS]
    for name, chosen in kinds:
        if not chosen:
            continue
        hits = sum(r["low"] <= 1 <= r["high"] for r in chosen)
        error = np.array([abs(r["mean"] - 1) for r in chosen])
        half = np.array([(r["high"] - r["low"]) / 2 for r in chosen])
        lines.append(
            f"| {name} | {len(chosen)} | {share(hits, len(chosen))} | {np.median(error):.1%} "
            f"| {np.median(half):.1%} | {error.max():.0%} |"
        )
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--hangers", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--worlds", nargs="+", choices=WORLDS, default=list(WORLDS))
    parser.add_argument("--new-keys", action="store_true", help="describe ends and inclination")
    parser.add_argument("--keep", type=Path)
    parser.add_argument("--write-docs", action="store_true")
    asked = parser.parse_args()
    with ProcessPoolExecutor(2) as pool:
        chosen = [
            (w, asked.seed, asked.hangers, index, asked.new_keys)
            for w in asked.worlds
            for index in range(asked.hangers)
        ]
        rows = list(pool.map(selected, chosen))
    text = table(rows)
    seconds = [r["seconds"] for r in rows]
    text += (
        f"\n\nSeed {asked.seed}. Processor time of `shm select` with the three beams: "
        f"{np.median(seconds):.1f} s in the median, {max(seconds):.0f} s at most. Fewest effective "
        f"draws {min(r['fewest_effective'] for r in rows):.0f}; log Occam factors at most "
        f"{max(r['largest_occam'] for r in rows):.1f}."
    )
    print(text)
    if asked.keep:
        asked.keep.write_text(json.dumps(rows))
    if asked.write_docs:
        fill_in(ROOT / "docs" / "trials" / "validation.md", "worlds", text)


if __name__ == "__main__":
    main()
