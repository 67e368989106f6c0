"""Try the gap diagnosis blind, on hangers of independent physics whose causes are sealed.

python tests/benchmarks/blind_trial.py build/blind_trial --hangers 36 --left-out 12 --seed 20261129
python tests/benchmarks/blind_trial.py build/blind_trial --score                # what is there
python tests/benchmarks/blind_trial.py build/blind_trial --score --write-docs   # the page, too

A quarter of the hangers is sound: half each of `tests/worlds/gapped_hangers.py` and
`finite_elements.py`. The others are of the first world and have one of its twenty causes in turn,
four of which the catalogue lacks; every eighth has two. Neither world shares equations, draws or
nuisances with the product.

The truth is written with a salt before the first diagnosis, and its SHA-256 into `trial.json`. A
process that diagnoses may not open it. When all answers are there, their SHA-256 is written, and
the truth is opened. Some hangers with a cause of the catalogue are then diagnosed once more without
it. A second call goes on where the first one stopped; a diagnosis takes ten to sixty seconds.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import multiprocessing
import os
import secrets
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path
from typing import Any

# Processes of one thread each: more only wait for each other.
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

import shm  # noqa: E402
from shm.diagnosis_document import diagnosis_document  # noqa: E402
from shm.documents import dump  # noqa: E402
from tests.benchmarks.blind_page import list_hanger, write_page  # noqa: E402
from tests.benchmarks.blind_scores import Row, effects_of_class, score, table  # noqa: E402
from tests.worlds import finite_elements, gapped_hangers  # noqa: E402

Truth = dict[str, Any]
SCHEMA = "shm.blind_trial/2"
GAPPED, ELEMENTS = "gapped hangers", "finite elements"
SOUND_FRACTION = 1 / 4
PAIR_EVERY = 8
COMPLETE, LEFT_OUT = "complete", "left_out"


@dataclass(frozen=True)
class Plan:
    """A hanger before it is made: its world, its place in it, and its causes."""

    name: str
    world: str
    index: int
    causes: tuple[str, ...] = ()


def plan_hangers(count: int, seed: int) -> list[Plan]:
    """Return the plans, in an order that says nothing about the causes."""
    rng = np.random.default_rng([seed, 58])
    n_sound = round(count * SOUND_FRACTION)
    worlds = (GAPPED, ELEMENTS)
    wanted: list[tuple[str, tuple[str, ...]]] = [
        (worlds[number % len(worlds)], ()) for number in range(n_sound)
    ]
    deck: list[str] = []
    for number in range(count - n_sound):
        deck = deck or [str(each) for each in rng.permutation(list(gapped_hangers.CAUSES))]
        causes: tuple[str, ...] = (deck.pop(),)
        if number % PAIR_EVERY == PAIR_EVERY - 1:
            others = [each for each in gapped_hangers.SECOND if each != causes[0]]
            causes = (*causes, str(rng.choice(others)))
        wanted.append((GAPPED, causes))
    order = rng.permutation(count)
    return [Plan(f"h{n + 1:03d}", wanted[k][0], int(k), wanted[k][1]) for n, k in enumerate(order)]


def make_hanger(plan: Plan, seed: int, folder: Path) -> Truth:
    """Write the hanger's description and its tests; return the truth."""
    if plan.world == GAPPED:
        case = gapped_hangers.make_case(seed, plan.index, plan.causes)
        case.write(folder)
        kept = ("tension_n", "kind", "causes", "inherent")
        truth = {key: case.truth[key] for key in kept}
    else:
        other = finite_elements.sound_hangers(seed, plan.index + 1)[plan.index]
        other.write(folder)
        truth = {key: other.truth[key] for key in ("tension_n", "kind")}
        truth |= {"causes": [], "inherent": {}}
    accepted = sorted({name for each in truth["causes"] for name in each["accepted"]})
    return {"hanger": plan.name, "world": plan.world, "accepted": accepted, **truth}


# ---------------------------------------------------------------- the seal


@dataclass(frozen=True)
class Trial:
    """The folder of a trial."""

    folder: Path

    @property
    def truth_file(self) -> Path:
        """Return the file that stays closed until all answers are there."""
        return self.folder / "sealed" / "truth.json"

    def read(self) -> dict[str, Any]:
        """Return what anybody may know: hangers, seed, commit, hashes."""
        document: dict[str, Any] = json.loads((self.folder / "trial.json").read_text())
        if document["schema"] != SCHEMA:
            raise SystemExit(f"{self.folder} is a trial of {document['schema']}: name another.")
        return document

    def write(self, document: dict[str, Any]) -> None:
        """Write what anybody may know."""
        _replace(self.folder / "trial.json", document)

    def hanger(self, name: str) -> Path:
        """Return the folder of a hanger."""
        return self.folder / "hangers" / name

    def answer(self, which: str, name: str) -> Path:
        """Return the file of an answer."""
        return self.folder / which / f"{name}.json"

    def answers(self, which: str) -> dict[str, dict[str, Any]]:
        """Return the answers of a round by the names of the hangers."""
        files = sorted((self.folder / which).glob("*.json"))
        return {file.stem: json.loads(file.read_text(encoding="utf-8")) for file in files}

    def hash_answers(self, which: str) -> str:
        """Return the SHA-256 of all answers of a round."""
        files = sorted((self.folder / which).glob("*.json"))
        return hashlib.sha256(b"".join(file.read_bytes() for file in files)).hexdigest()

    def open_truth(self) -> dict[str, Truth]:
        """Return the truth by the names of the hangers; it must be that which was sealed."""
        told, content = self.read(), self.truth_file.read_bytes()
        if hashlib.sha256(content).hexdigest() != told["truth_sha256"]:
            raise SystemExit(f"{self.truth_file} was changed since it was sealed.")
        if self.hash_answers(COMPLETE) != told.get("answers_sha256"):
            raise SystemExit(f"Answers of {self.folder} are lacking or were changed since.")
        return {each["hanger"]: each for each in json.loads(content)["hangers"]}


def _replace(path: Path, document: dict[str, Any]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_suffix(".part")
    part.write_text(dump(document) + "\n", encoding="utf-8")
    part.replace(path)


def make_trial(trial: Trial, count: int, left_out: int, seed: int) -> None:
    """Make the hangers and seal the truth."""
    plans = plan_hangers(count, seed)
    truths = [make_hanger(plan, seed, trial.hanger(plan.name)) for plan in plans]
    _replace(trial.truth_file, {"salt": secrets.token_hex(32), "hangers": truths})
    sha256 = hashlib.sha256(trial.truth_file.read_bytes()).hexdigest()
    commit = subprocess.run(
        ["git", "rev-parse", "HEAD"], cwd=ROOT, check=True, capture_output=True, text=True
    ).stdout.strip()
    document = {"schema": SCHEMA, "seed": seed, "commit": commit, "truth_sha256": sha256}
    trial.write(document | {"left_out": left_out, "hangers": [plan.name for plan in plans]})
    print(f"{count} hangers; SHA-256 of the truth {sha256}", flush=True)


# ---------------------------------------------------------------- the diagnoses


def guard(sealed: str) -> None:
    """Refuse to open anything in a folder in this process from now on."""

    def refuse(event: str, arguments: tuple[Any, ...]) -> None:
        if event == "open" and isinstance(arguments[0], str | bytes | os.PathLike):
            path = os.path.realpath(os.fsdecode(arguments[0]))
            if path == sealed or path.startswith(sealed + os.sep):
                raise PermissionError(f"a diagnosis of a blind trial may not open {path}")

    sys.addaudithook(refuse)


def diagnose_hanger(folder: Path, without: Sequence[str], seed: int = 1) -> dict[str, Any]:
    """Diagnose a hanger as its owner would: its two files, all options left alone."""
    hanger = shm.load_hanger(folder / "hanger.toml")
    tests = shm.load_modes(folder / "case.modes.json")
    started = time.process_time()
    answer: dict[str, Any] = {"without": list(without)}
    try:
        found = shm.diagnose(tests, hanger, without=without, seed=seed)
        answer["diagnosis"] = diagnosis_document(found)
    except shm.ShmError as error:
        answer["refused"] = str(error)
    return answer | {"processor_s": time.process_time() - started}


def solve(trial: Trial, which: str, wanted: dict[str, Sequence[str]], jobs: int) -> None:
    """Diagnose what has no answer yet, each hanger without some effects."""
    lacking = [name for name in wanted if not trial.answer(which, name).exists()]
    sealed = os.path.realpath(trial.truth_file.parent)
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(jobs, context, guard, (sealed,)) as pool:
        running = {
            pool.submit(diagnose_hanger, trial.hanger(name), wanted[name]): name for name in lacking
        }
        for number, future in enumerate(as_completed(running), len(wanted) - len(lacking) + 1):
            name, answer = running[future], future.result()
            _replace(trial.answer(which, name), answer)
            said = answer.get("diagnosis", {}).get("verdict", {}).get("outcome", "refused")
            seconds = f"{answer['processor_s']:.0f} s"
            print(f"{which} {number} of {len(wanted)}: {name} {said}, {seconds}", flush=True)


def run(trial: Trial, jobs: int, first: int | None = None) -> None:
    """Diagnose the hangers, close the answers, open the truth, diagnose without the causes.

    With `first` only so many are diagnosed, by their names.
    """
    told = trial.read()
    if "answers_sha256" not in told:
        solve(trial, COMPLETE, dict.fromkeys(told["hangers"][:first], ()), jobs)
        trial.write(told | {"answers_sha256": trial.hash_answers(COMPLETE)})
    truths, answers = trial.open_truth(), trial.answers(COMPLETE)
    chosen = list(hangers_to_repeat(truths, answers))[: told["left_out"]]
    solve(trial, LEFT_OUT, {name: truths[name]["accepted"] for name in chosen}, jobs)


def hangers_to_repeat(
    truths: dict[str, Truth], answers: dict[str, dict[str, Any]]
) -> Iterator[str]:
    """Yield the hangers with causes that the catalogue has and their model class has not itself."""
    for name, answer in answers.items():
        known = [set(each["accepted"]) for each in truths[name]["causes"]]
        itself = effects_of_class(answer)
        if known and all(each and not each & itself for each in known):
            yield name


def read_rows(trial: Trial) -> list[Row]:
    """Return every answer beside the truth, the round without the causes last."""
    truths = trial.open_truth()
    rounds = (trial.answers(COMPLETE), trial.answers(LEFT_OUT))
    return [Row(truths[name], answer) for each in rounds for name, answer in each.items()]


def main() -> int:
    """Make, solve and score a trial; return 1 where a mark is missed."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("--hangers", type=int, default=36)
    parser.add_argument("--left-out", type=int, default=12)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--first", type=int, help="diagnose only so many, by their names")
    parser.add_argument("--score", action="store_true", help="diagnose no more")
    parser.add_argument("--write-docs", action="store_true")
    given = parser.parse_args()
    trial = Trial(given.folder.resolve())
    if not given.score:
        if not (trial.folder / "trial.json").exists():
            make_trial(trial, given.hangers, given.left_out, given.seed)
        run(trial, given.jobs, given.first)
    rows = read_rows(trial)
    for row in rows:
        print(" | ".join(list_hanger(row)))
    marks = score(rows)
    print(table(marks))
    if given.write_docs:
        write_page(rows, trial.read(), trial.truth_file)
    return int(any(mark.is_met is False for mark in marks))


if __name__ == "__main__":
    sys.exit(main())
