"""Does the gap diagnosis meet its marks whatever was measured? A fast trial, richness by richness.

    python tests/benchmarks/gap_richness.py [--richness "two planes,everything"] [--cases 10]
        [--first-seed 0] [--jobs 1] [--left-out] [--answers FILE]

In process and without recordings: nothing (a quarter), one effect (a half), two (an eighth), and
one that the catalogue then lacks (an eighth), of sizes log-uniform from 1 to 64 standard
deviations, in hangers drawn anew. With `--left-out` each case is diagnosed again without its
effects. Answers are kept in the file, a JSON object a line; a later run goes on from there. Exit
code 1 where a mark is missed that 20 cases and more speak of.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from tests.benchmarks.gap.richness import PLANS, answered
from tests.benchmarks.gap.scores import Asked, Scored, kept, marks, said


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--richness", default=",".join(PLANS))
    parser.add_argument("--cases", type=int, default=10, help="of each richness")
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--left-out", action="store_true")
    parser.add_argument("--answers", type=Path, default=Path(os.devnull))
    return parser.parse_args()


def cases(given: argparse.Namespace) -> list[Asked]:
    """What is asked for."""
    return [
        Asked(richness, seed, left_out)
        for seed in range(given.first_seed, given.first_seed + given.cases)
        for richness in given.richness.split(",")
        for left_out in ((False, True) if given.left_out else (False,))
    ]


def table(found: Sequence[Scored]) -> str:
    """Every mark at every richness, for people."""
    lines = ["| richness | mark | found | met |", "| --- | --- | --- | --- |"]
    lines += [
        f"| {mark.richness} | {mark.name} | {mark.found} | {mark.verdict} |"
        for mark in marks(found)
    ]
    return "\n".join(lines)


def main() -> int:
    given = arguments()
    lines = given.answers.read_text().splitlines() if given.answers.exists() else []
    found = [kept(line) for line in lines]
    known = {each.asked for each in found}
    wanted = [case for case in cases(given) if case not in known]
    with ProcessPoolExecutor(given.jobs) as pool, given.answers.open("a") as answers:
        for each in pool.map(answered, wanted):
            if each is not None:
                found.append(each)
                print(json.dumps(asdict(each)), file=answers, flush=True)
                print(said(each), flush=True)
    print(table(found))
    return int(any(mark.verdict == "no" for mark in marks(found)))


if __name__ == "__main__":
    sys.exit(main())
