"""Families of hangers with one shared cause, sealed and solved as the blind trial.

python tests/benchmarks/blind_families.py make DIR --families 4 --seed 20261126
python tests/benchmarks/blind_families.py solve DIR --until 16:25
python tests/benchmarks/blind_families.py score DIR --write-docs

Bridges of `gap_family.py`: finite elements of `tests/worlds`, two planes, nuisances of the field.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, cast

import numpy as np

from docs.filling import fill_in
from shm.bridge import load_hanger
from shm.diagnosis_document import bridge_diagnosis_document
from shm.documents import dump
from shm.gap import GapOptions, diagnose_bridge
from shm.modes_document import load_modes
from shm.read.atomic import replace_text
from shm.values.leading import MIN_NO_GAP_PROBABILITY
from tests.benchmarks import gap_family
from tests.benchmarks.blind.layout import (
    TRIAL_SCHEMA,
    Trial,
    answers_sha256,
    key_beside,
    read_trial,
)
from tests.benchmarks.blind.making import give_one_time
from tests.benchmarks.blind.sealing import key_of, write_key
from tests.benchmarks.blind.solving import guard
from tests.benchmarks.blind.truth import TrueCase
from tests.benchmarks.blind.workers import workers
from tests.benchmarks.blind_trial import TRIALS, Plan, moment, share, true_case, write_case

HANGERS = 3  # one more than the least that can share a cause: 20 s of a core each


def make(directory: Path, families: int, seed: int) -> None:
    """Folders f1, f2, ... with a case for each hanger; every cause takes its turn."""
    rng = np.random.default_rng([seed, 4])
    causes = [str(each) for each in rng.permutation(list(gap_family.SIZES))]
    truths: list[TrueCase] = []
    for number in range(families):
        cause = causes[number % len(causes)]
        for member in gap_family.bridge(seed, number, HANGERS, cause):
            name = f"f{number + 1}/h{member.hanger.id}"
            plan = Plan(name, "", "", "two planes", "beam1", ())
            write_case(directory / "cases" / name, plan, member.hanger, member.tests, 1)
            truths.append(true_case(plan, member.cause, float("nan"), member.tension_n))
    sha256 = write_key(key_beside(directory), truths, seed)
    names = [f"f{number + 1}" for number in range(families)]
    document = {"schema": TRIAL_SCHEMA, "cases": names, "key_sha256": sha256}
    (directory / "trial.json").write_text(dump(document) + "\n", encoding="utf-8")
    give_one_time(directory)
    print(f"SHA-256 of the key {sha256}")


def solved(directory: Path) -> str:
    """The document of a family's joint diagnosis."""
    named = [
        (load_hanger(each / "hanger.toml"), load_modes(each / "tests.modes.json"))
        for each in sorted(directory.iterdir())
    ]
    numbered = [
        (replace(hanger, id=n), [replace(test, hanger=n) for test in tests])
        for n, (hanger, tests) in enumerate(named, 1)
    ]
    return dump(bridge_diagnosis_document(diagnose_bridge(numbered, GapOptions(seed=1)))) + "\n"


def solve(trial: Trial, until: datetime) -> None:
    """One family after the other in a process that cannot open the key, until the clock says."""
    answers = trial.answers("answers")
    answers.mkdir(exist_ok=True)
    hidden = [key_beside(trial.directory)]
    with workers(1, guard, ([trial.directory / "cases"], hidden)) as pool:
        for name in trial.cases:
            path = answers / f"{name}.json"
            if path.exists() or datetime.now(UTC) > until:
                continue
            replace_text(path, pool.submit(solved, trial.case_directory(name)).result())
            print(f"{datetime.now(UTC):%H:%M:%S} {name} {answers_sha256(answers)}", flush=True)


def score(trial: Trial) -> str:
    """Whether the shared cause was named or is in the group named, its members, tensions."""
    truths, _ = key_of(trial, key_beside(trial.directory))
    named: list[bool] = []
    covered: list[bool] = []
    right = said = true = 0
    for name in trial.cases:
        path = trial.answers("answers") / f"{name}.json"
        if not path.exists():
            continue
        found = json.loads(path.read_text(encoding="utf-8"))
        own = dict(enumerate((t for t in truths if t.case.startswith(f"{name}/")), 1))
        effects = [truth.effects[0].name for truth in own.values() if truth.effects]
        cause = max(effects, key=effects.count)
        have = {n for n, t in own.items() if t.effects and t.effects[0].name == cause}
        told, had = claimed(found)
        named.append(cause in told)
        right, said, true = right + len(had & have), said + len(had), true + len(have)
        covered += [
            t["jointly_n"]["q025"] <= own[t["hanger"]].tension_n <= t["jointly_n"]["q975"]
            for t in found["tensions"]
        ]
        print(f"{name}: {cause} in {sorted(have)}; said {' / '.join(told)} in {sorted(had)}")
    return (
        f"{len(named)} families of {HANGERS} hangers that share a cause: it or its group named in "
        f"{share(named, 0, 1)[0]}; {said} hangers named as members, rightly {right}, of {true}; "
        f"the tension's 95 % interval holds in {share(covered, 0.9, 0.98)[0]}. SHA-256 of the key "
        f"`{trial.key_sha256}`."
    )


def claimed(found: dict[str, Any]) -> tuple[list[str], set[int]]:
    """The group of the shared cause that leads, and who has it; nothing where none leads."""
    by_group: dict[Any, list[dict[str, Any]]] = {}
    for number, each in enumerate(found["causes"]):
        group = f"alone {number}" if each["group"] is None else each["group"]
        by_group.setdefault(group, []).append(each)
    claims = [(sum(each["probability"] for each in group), group) for group in by_group.values()]
    claim, leading = max(claims, key=lambda pair: pair[0], default=(0.0, []))
    if found["each_for_itself_probability"] >= MIN_NO_GAP_PROBABILITY:
        return [], set()
    if claim <= found["unknown_probability"]:
        return [], set()
    best = max(leading, key=lambda each: cast(float, each["probability"]))
    members = {each["hanger"] for each in best["members"] if each["probability"] > 0.5}
    return [each["effect"] for each in leading], members


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("what", choices=["make", "solve", "score"])
    parser.add_argument("directory", type=Path)
    parser.add_argument("--families", type=int, default=4)
    parser.add_argument("--seed", type=int, default=20261126)
    parser.add_argument("--until", help="UTC, today; else to the end")
    parser.add_argument("--write-docs", action="store_true")
    given = parser.parse_args()
    if given.what == "make":
        make(given.directory, given.families, given.seed)
    elif given.what == "solve":
        solve(read_trial(given.directory), moment(given.until))
    else:
        said = score(read_trial(given.directory))
        print(said)
        if given.write_docs:
            fill_in(TRIALS / "blind_trial.md", "families", said)


if __name__ == "__main__":
    main()
