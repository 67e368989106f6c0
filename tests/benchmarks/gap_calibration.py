"""What simulated hangers teach the gap diagnosis: writes `shm/gap/causes/calibration.toml` anew.

    python tests/benchmarks/gap_calibration.py --cases 480 --seed 131 --jobs 2 --keep lessons.jsonl
        --write

Makes the hangers of a blind trial (`blind_trial.py`) and diagnoses each that has a cause of the
catalogue twice, with the whole catalogue and without what was planted, truth in hand: this teaches,
it does not judge, so score with another seed. What a hanger taught is kept in the file, and a later
run goes on from there. A value for which fewer than ten answers speak stays as it is. Without
`--write` the file is only printed. A hanger takes some 40 s of a core.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime
from itertools import repeat
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from scipy.special import logsumexp

from shm.bridge import load_hanger
from shm.errors import ShmError
from shm.gap.causes.baseline import choose_baseline
from shm.gap.causes.outliers import Cleared, exclude_gross_errors
from shm.gap.causes.probabilities import (
    CALIBRATION,
    FILE,
    Calibration,
    Share,
    _allowances,
    _linear,
)
from shm.gap.causes.search import Attribution
from shm.gap.hypotheses.contract import Fit, GapOptions
from shm.gap.hypotheses.data_checks import usable
from shm.gap.hypotheses.problem import GapProblem
from shm.modes_document import load_modes
from tests.benchmarks.blind_trial import Truth, make_hanger, plan_hangers

FEWEST = 10
FITS = 0.05
"""A p-value from which on an explanation counts as fitting: one right one in twenty does not."""
Ways = tuple[float, ...]
"""Log evidences of an exact law, then of one that is off by each fraction of `CALIBRATION`."""


@dataclass(frozen=True)
class Lesson:
    """What one case taught; None where it taught nothing of that.

    `own` and `mimicking` are the ways of the law of what was planted, and of what led in its place.
    `mimics` is how many effects together do what the missing one does.
    """

    case: str
    own: Ways | None = None
    mimics: int | None = None
    mimicking: Ways | None = None


def lesson(folder: Path, truth: Truth) -> Lesson:
    """Diagnose a hanger with and without what was planted in it."""
    nothing = Lesson(truth["hanger"])
    if not all(each["accepted"] for each in truth["causes"]) or not truth["causes"]:
        return nothing
    try:
        whole = diagnosed(folder, ())
        planted = _fit_of(whole.attribution, tuple(e["accepted"][0] for e in truth["causes"]))
        own = ways_of(whole.problem, whole.attribution.baseline, planted) if planted else None
        without = diagnosed(folder, tuple(truth["accepted"]))
        return _without_the_planted(replace(nothing, own=own), without)
    except ShmError as error:
        print(f"{truth['hanger']}: {error}", file=sys.stderr)
        return nothing


def diagnosed(folder: Path, without: tuple[str, ...]) -> Cleared:
    hanger, tests = load_hanger(folder / "hanger.toml"), load_modes(folder / "case.modes.json")
    options = GapOptions(without=without)
    rng = np.random.default_rng(options.seed)
    problem = choose_baseline(usable(tests, hanger).tests, hanger, options, rng)
    return exclude_gross_errors(problem, options, rng)


def _without_the_planted(taught: Lesson, clear: Cleared) -> Lesson:
    found = clear.attribution
    if found.leads == "no gap" or not found.explanations:
        return taught
    names = found.explanations[0].best.hypothesis.names
    fit = _fit_of(found, names)
    return replace(
        taught,
        mimics=len(names) if min(found.p_values) >= FITS else 0,
        mimicking=ways_of(clear.problem, found.baseline, fit) if fit else None,
    )


def _fit_of(found: Attribution, effects: tuple[str, ...]) -> Fit | None:
    """Return the likeliest fit of effects."""
    fits = [each.fit for each in found.tried if not each.hypothesis.flexible and each.fit]
    own = [fit for fit in fits if sorted(fit.hypothesis.names) == sorted(effects)]
    return max(own, key=lambda fit: fit.log_evidence, default=None)


def ways_of(problem: GapProblem, baseline: Fit, fit: Fit) -> Ways:
    """Return the log evidence of each fraction, its patterns as likely."""
    residual = problem.value - fit.predicted
    log = [_linear(fit, errors, residual)[0] for _, errors in _allowances(problem, baseline, fit)]
    by_fraction = np.reshape(log, (len(CALIBRATION.off_by), -1))
    off = logsumexp(by_fraction, axis=1) - np.log(by_fraction.shape[1])
    return (_linear(fit, fit.noise, residual)[0], *map(float, off))


def shares(cases: Sequence[Ways]) -> list[float]:
    """Return how often each way is the right one, by which the cases' evidence is largest.

    Expectation and maximisation (Dempster, Laird and Rubin, J. R. Stat. Soc. B 39, 1977), half a
    case added to each way (Jeffreys).
    """
    log = np.array(cases)
    found = np.full(log.shape[1], 1 / log.shape[1])
    for _ in range(500):
        weight = log + np.log(found)
        counts = np.exp(weight - logsumexp(weight, axis=1, keepdims=True)).sum(axis=0) + 0.5
        found = counts / counts.sum()
    return [float(each) for each in found]


def calibrated(lessons: Sequence[Lesson]) -> tuple[Calibration, str]:
    """Return the values that lessons teach, others as they are, and how many answers they had."""
    mimics = [each.mimics for each in lessons if each.mimics is not None]
    own = [each.own for each in lessons if each.own]
    mimicking = [each.mimicking for each in lessons if each.mimicking]
    answers = f"{len(mimics)} without the true effect; laws of {len(own)} and {len(mimicking)}"
    new = CALIBRATION
    if len(mimics) >= FEWEST:
        one, two = (mimics.count(n) / len(mimics) for n in (1, 2))
        new = replace(new, mimics_one=one, mimics_two=two)
    if min(len(own), len(mimicking)) >= FEWEST:
        exact, *off = map(Share, shares(own), shares(mimicking))
        new = replace(new, exact=exact, off_by=dict(zip(CALIBRATION.off_by, off, strict=True)))
    return new, answers


def text(told: Calibration, about: Mapping[str, object]) -> str:
    """Return the data file: that of today with other values, and `about` their trial."""
    values = FILE.read_text(encoding="utf-8").partition("[provenance]")
    of_laws = "\n".join(
        f"    {{ fraction = {f:g}, known = {each.known:.4g}, unknown = {each.unknown:.4g} }},"
        for f, each in told.off_by.items()
    )
    return f"""{values[0]}[provenance]
trial = "{about["trial"]}"
seeds = "{about["seeds"]}"
cases = "{about["cases"]}"
answers = "{about["answers"]}"
date = {about["date"]}
command = "{about["command"]}"

# Of effects that were left out of the catalogue, this share does to the data about what another
# effect does, or two together; the rest resembles nothing in the catalogue.
[mimic]
one_effect = {told.mimics_one:.4g}
two_effects = {told.mimics_two:.4g}

# How often an effect's law is off, by which fraction of what the effect does: `known` of effects
# that were planted, `unknown` of what passed for one and was another, which had been left out.
[law]
exact = {{ known = {told.exact.known:.4g}, unknown = {told.exact.unknown:.4g} }}
off = [
{of_laws}
]
"""


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=24)
    parser.add_argument("--seed", type=int, default=131)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--keep", type=Path, default=Path(os.devnull))
    parser.add_argument("--write", action="store_true", help=f"writes {FILE.name}")
    return parser.parse_args()


def main() -> int:
    given = arguments()
    lines = given.keep.read_text().splitlines() if given.keep.exists() else []
    name = f"{given.cases} of seed {given.seed}: "
    lessons = [each for each in map(_kept, lines) if each.case.startswith(name)]
    with tempfile.TemporaryDirectory() as folder, ProcessPoolExecutor(given.jobs) as pool:
        known = {each.case for each in lessons}
        plans = plan_hangers(given.cases, given.seed)
        plans = [each for each in plans if name + each.name not in known]
        places = [Path(folder) / each.name for each in plans]
        missing = [make_hanger(*each) for each in zip(plans, repeat(given.seed), places)]
        with given.keep.open("a") as kept:
            for each in pool.map(lesson, places, missing):
                lessons.append(replace(each, case=name + each.case))
                print(json.dumps(asdict(lessons[-1])), file=kept, flush=True)
    command = (
        f"python tests/benchmarks/gap_calibration.py --cases {given.cases} --seed {given.seed} "
        "--write"
    )
    today = datetime.now(UTC).date()
    found, answers = calibrated(lessons)
    about = {
        "trial": "simulated hangers",
        "seeds": given.seed,
        "cases": given.cases,
        "answers": answers,
        "date": today,
        "command": command,
    }
    told = text(found, about)
    print(told)
    if given.write:
        FILE.write_text(told, encoding="utf-8")
    return 0


def _kept(line: str) -> Lesson:
    return Lesson(**json.loads(line))


if __name__ == "__main__":
    sys.exit(main())
