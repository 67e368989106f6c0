"""What simulated hangers teach the gap diagnosis: writes `shm/gap/calibration.toml` anew.

    python tests/benchmarks/gap_calibration.py --cases 480 --seed 131 --jobs 2 --keep lessons.jsonl
        --write

Makes the cases of a blind trial and diagnoses each twice, with the whole catalogue and without what
was planted, key in hand: this teaches, it does not judge, so score with another seed. What a case
taught is kept in the file, and a later run goes on from there. Of gaps below four standard
deviations nothing is learnt. A value for which fewer than ten answers speak stays as it is. Without
`--write` the file is only printed. A case takes some 20 s of a core.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from scipy.special import logsumexp

from shm.bridge import load_hanger
from shm.errors import ShmError
from shm.gap.attribution import Attribution
from shm.gap.contract import Fit, GapOptions
from shm.gap.data_checks import usable
from shm.gap.law_error import allowances, by_its_laws, second_cause
from shm.gap.model_probabilities import CALIBRATION, FILE, Calibration, Provenance, Share, log_prior
from shm.gap.observations import observed
from shm.gap.outlier_removal import Cleared, exclude_outliers, search_further
from shm.gap.problem import GapProblem
from shm.modes_document import load_modes
from tests.benchmarks.blind.layout import (
    CASE_FILE,
    CASE_SCHEMA,
    HANGER_FILE,
    MODES_FILE,
    read_document,
)
from tests.benchmarks.blind.making import make_trial
from tests.benchmarks.blind.scores import LARGE
from tests.benchmarks.blind.truth import TrueCase

FEWEST = 10
FITS = 0.05
"""A p-value from which on an explanation counts as fitting: one right one in twenty does not."""
STEADY = 2
"""Answers added on either side of odds, so that a few do not make certain."""
Ways = dict[str, float]
"""Log evidence of each way in which a law may be off, named as in `Allowance.way`."""


@dataclass(frozen=True)
class Lesson:
    """What one case taught; None and empty where it taught nothing of that.

    `own` and `mimicking` are the ways of the law of what was planted, and of what led in its place.
    `second` is how far the second cause of the likeliest pair moves the data against the first,
    `undetected` whether a cause was there where something unknown led, `mimics` how many effects
    together do what the missing one does, `pair` those that led in its place.
    """

    case: str
    causes: int
    own: Ways | None = None
    second: float | None = None
    undetected: bool | None = None
    mimics: int | None = None
    pair: tuple[str, ...] = ()
    mimicking: Ways | None = None


def lesson(directory: Path, truth: TrueCase) -> Lesson:
    """A case diagnosed with and without what was planted in it."""
    nothing = Lesson(truth.case, len(truth.effects))
    if truth.size < LARGE:
        return nothing
    try:
        whole = diagnosed(directory, ())
        first = replace(nothing, **_with_the_whole_catalogue(whole, truth))
        if truth.kind == "unknown":
            return first
        return replace(first, **_without_the_planted(diagnosed(directory, truth.left_out)))
    except ShmError as error:
        print(f"{truth.case}: {error}", file=sys.stderr)
        return nothing


def diagnosed(directory: Path, without: tuple[str, ...]) -> Cleared:
    told = read_document(directory / CASE_FILE, CASE_SCHEMA)
    hanger, tests = load_hanger(directory / HANGER_FILE), load_modes(directory / MODES_FILE)
    options = GapOptions(str(told["baseline"]), without, seed=int(told["seed"]))
    problem = GapProblem(hanger, options.baseline, observed(usable(tests, hanger).tests, hanger))
    return search_further(exclude_outliers(problem, options, np.random.default_rng(options.seed)))


def _with_the_whole_catalogue(clear: Cleared, truth: TrueCase) -> dict[str, object]:
    found, problem = clear.attribution, clear.problem
    planted = _fit_of(found, tuple(each.name for each in truth.effects))
    alone = dict.fromkeys(found.search.variants, 1)
    pair = max(
        found.explanations,
        key=lambda each: each.log_bayes_factor + log_prior(each.best.hypothesis, alone),
        default=None,
    )
    share = second_cause(problem, found.baseline, pair.best.fit)[1] if pair else 1.0
    return {
        "own": ways_of(problem, found.baseline, planted) if planted and truth.effects else None,
        "second": share if truth.effects and pair and pair.is_pair and share < 1 else None,
        "undetected": bool(truth.effects) if found.leads == "unexplained" else None,
    }


def _without_the_planted(clear: Cleared) -> dict[str, object]:
    found = clear.attribution
    if found.leads == "no gap" or not found.explanations:
        return {}
    likeliest, leading = found.explanations[0], found.leading
    fit = _fit_of(found, tuple(name for name, _ in likeliest.best.hypothesis.effects))
    fits = found.p_value >= FITS
    return {
        "mimics": len(likeliest.best.hypothesis.effects) if fits else 0,
        "pair": leading.best.hypothesis.names if leading and leading.is_pair else (),
        "mimicking": ways_of(clear.problem, found.baseline, fit) if fit else None,
    }


def _fit_of(found: Attribution, effects: tuple[str, ...]) -> Fit | None:
    """The likeliest fit by the very laws of effects, before these may be off."""
    tried = [
        each
        for each in found.tried
        if each.fit and not each.hypothesis.flexible
        if sorted(name for name, _ in each.hypothesis.effects) == sorted(effects)
    ]
    return max(tried, key=lambda each: each.log_evidence).fit if tried else None


def ways_of(problem: GapProblem, baseline: Fit, fit: Fit) -> Ways:
    """All allowances of one way are as likely."""
    logs = by_its_laws(problem, baseline, fit, np.random.default_rng(0)).log_evidences
    ways = [("exact", 0.0), *(each.way for each in allowances(problem, baseline, fit))]
    by_way = defaultdict(list)
    for (kind, fraction), log in zip(ways, logs, strict=True):
        by_way[f"{kind} {fraction:g}"].append(log)
    return {way: float(logsumexp(each) - np.log(len(each))) for way, each in by_way.items()}


def shares(cases: Sequence[Ways]) -> Ways:
    """How often each way is the right one, by which the cases' evidence is largest.

    Those of a law that may be rough beside those that cannot: "rough" is how often such a law is,
    and what is rough and what is not add to 1 each. Expectation and maximisation (Dempster, Laird
    and Rubin, J. R. Stat. Soc. B 39, 1977), half a case added to each way (Jeffreys).
    """
    names = sorted({way for each in cases for way in each})
    log = np.array([[each.get(way, -np.inf) for way in names] for each in cases])
    rough = np.array([way.startswith("rough") for way in names])
    level = np.isfinite(log[:, rough]).any(axis=1)
    found, often = np.where(rough, 1 / max(rough.sum(), 1), 1 / (~rough).sum()), 0.5
    for _ in range(500):
        of_case = np.where(rough, often, np.where(level, 1 - often, 1.0)[:, None])
        with np.errstate(divide="ignore"):  # what cannot be rough
            weight = log + np.log(found * of_case)
        counts = np.exp(weight - logsumexp(weight, axis=1, keepdims=True)).sum(axis=0) + 0.5
        found = counts / np.where(rough, counts[rough].sum(), counts[~rough].sum())
        often = (counts[rough].sum() - rough.sum() / 2 + 0.5) / (level.sum() + 1)
    return {**dict(zip(names, map(float, found), strict=True)), "rough": float(often)}


def calibrated(lessons: Sequence[Lesson], about: Provenance) -> Calibration:
    """The values that lessons teach; others as they are."""
    mimics = [each.mimics for each in lessons if each.mimics is not None]
    pairs = [each.pair for each in lessons if each.pair]
    undetected = [each.undetected for each in lessons if each.undetected is not None]
    second = [(each.second, each.causes > 1) for each in lessons if each.second is not None]
    own = [each.own for each in lessons if each.own]
    mimicking = [each.mimicking for each in lessons if each.mimicking]
    answers = (
        f"{len(mimics)} without the true effect, {len(pairs)} of these a pair; {len(undetected)} "
        f"unexplained; {len(second)} pairs; laws of {len(own)} planted and {len(mimicking)} others"
    )
    new = replace(CALIBRATION, provenance=replace(about, answers=answers))
    if len(mimics) >= FEWEST:
        one, two = (mimics.count(n) / len(mimics) for n in (1, 2))
        new = replace(new, mimics_one=one, mimics_two=two)
    if len(pairs) >= FEWEST:
        new = replace(new, **_pairs(pairs))
    if len(undetected) >= FEWEST:
        new = replace(new, undetected_share=sum(undetected) / len(undetected))
    if len(second) >= FEWEST:
        below, odds = minor(second)
        new = replace(new, minor_below=below, minor_law_odds=odds)
    return replace(new, **_laws(own, mimicking)) if min(len(own), len(mimicking)) >= FEWEST else new


def _pairs(pairs: Iterable[tuple[str, ...]]) -> dict[str, object]:
    """Counts of effects and, beside them, of the ends that led with turned sensors."""
    turned, led = Counter[str](), Counter[str]()
    for pair in pairs:
        (turned if "sensor_misalignment" in pair else led).update(pair)
    del turned["sensor_misalignment"]
    return {"in_mimicking_pairs": dict(led.most_common()), "with_turned_sensors": dict(turned)}


def minor(second: Sequence[tuple[float, bool]]) -> tuple[float, float]:
    """Below which share a second cause is mostly the law of the first, and the odds that it is.

    Of all shares that which puts the fewest answers (share, whether there were two) on the wrong
    side.
    """
    ordered = sorted(second)
    wrong = [
        sum(two for _, two in ordered[:i]) + sum(not two for _, two in ordered[i:])
        for i in range(len(ordered) + 1)
    ]
    count = int(np.argmin(wrong))
    edges = [0.0, *(share for share, _ in ordered), 1.0]
    causes = sum(two for _, two in ordered[:count])
    odds = (count - causes + STEADY) / (causes + STEADY)
    return (edges[count] + edges[count + 1]) / 2, odds


def _laws(own: Sequence[Ways], mimicking: Sequence[Ways]) -> dict[str, object]:
    planted, others = shares(own), shares(mimicking)

    def share(way: str) -> Share:
        return Share(planted[way], others[way])

    return {
        "exact": share("exact 0"),
        "of_a_mode": {f: share(f"mode {f:g}") for f in CALIBRATION.of_a_mode},
        "on_the_whole": {f: share(f"whole {f:g}") for f in CALIBRATION.on_the_whole},
        "rough": planted["rough"],
        "where_rough": {
            f: planted.get(f"rough {f:g}", old) for f, old in CALIBRATION.where_rough.items()
        },
    }


def text(told: Calibration) -> str:
    """The data file."""
    about = told.provenance

    def table(counts: Mapping[str, int]) -> str:
        return "\n".join(f"{name} = {count}" for name, count in counts.items())

    def rows(laws: Mapping[float, Share]) -> str:
        made = (
            f"    {{ fraction = {f:g}, own = {each.own:.4g}, unknown = {each.unknown:.4g} }},"
            for f, each in laws.items()
        )
        return "\n".join(made)

    rough = "\n".join(
        f"    {{ fraction = {f:g}, share = {share:.4g} }}," for f, share in told.where_rough.items()
    )
    return f"""# What trials on simulated hangers taught the gap diagnosis; `shm/gap/model_probabilities.py` reads it.
# `python tests/benchmarks/gap_calibration.py` runs the trial and writes this file anew.

[provenance]
trial = "{about.trial}"
seeds = "{about.seeds}"
cases = "{about.cases}"
answers = "{about.answers}"
date = {about.date}
command = "{about.command}"

# Of effects that were left out of the catalogue, this share does to the data about what another
# effect does, or two together; the rest resembles nothing in the catalogue.
[mimic]
one_effect = {told.mimics_one:.4g}
two_effects = {told.mimics_two:.4g}

# In how many of the pairs that led with the true effect left out each effect was.
[mimic.in_pairs]
{table(told.in_mimicking_pairs)}

# In how many more turned sensors led with an end: together they do what skewed axes do.
[mimic.with_turned_sensors]
{table(told.with_turned_sensors)}

# Where a free remainder explains what no cause does, so likely is a cause nevertheless: its place
# was not found, or its law is farther off than allowed for.
[undetected]
share = {told.undetected_share:.4g}

# The second cause of a pair is minor where it moves the data by less than `below` of what the first
# does; `law_odds` are the odds that it then is no cause, but the error of the first one's law.
[minor]
below = {told.minor_below:.4g}
law_odds = {told.minor_law_odds:.4g}

# How often an effect's law is off, by which fraction of what the effect does: `own` of effects that
# were planted, `unknown` of what passed for an effect and was another one, which had been left out.
# `of_a_mode`: of what it does to that very mode; `on_the_whole`: to the modes of a test and plane.
[law]
exact = {{ own = {told.exact.own:.4g}, unknown = {told.exact.unknown:.4g} }}
of_a_mode = [
{rows(told.of_a_mode)}
]
on_the_whole = [
{rows(told.on_the_whole)}
]

# How often the law of an effect that goes with the level is only roughly known, and by which
# fractions of what it does to a mode it is then off.
[rough_law]
probability = {told.rough:.4g}
of_a_mode = [
{rough}
]
"""  # noqa: E501


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
        trial = Path(folder) / "trial"
        made = make_trial(trial, given.cases, given.seed, given.jobs)
        known = {each.case for each in lessons}
        missing = [each for each in made if name + each.case not in known]
        places = [trial / "cases" / each.case for each in missing]
        with given.keep.open("a") as kept:
            for each in pool.map(lesson, places, missing):
                lessons.append(replace(each, case=name + each.case))
                print(json.dumps(asdict(lessons[-1])), file=kept, flush=True)
    command = (
        f"python tests/benchmarks/gap_calibration.py --cases {given.cases} --seed {given.seed} "
        "--write"
    )
    today = datetime.now(UTC).date()
    about = Provenance("simulated hangers", str(given.seed), str(given.cases), "", today, command)
    told = text(calibrated(lessons, about))
    print(told)
    if given.write:
        FILE.write_text(told, encoding="utf-8")
    return 0


def _kept(line: str) -> Lesson:
    found = Lesson(**json.loads(line))
    return replace(found, pair=tuple(found.pair))


if __name__ == "__main__":
    sys.exit(main())
