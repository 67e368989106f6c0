"""Try the gap diagnosis blind: three worlds, both baselines, from everything to three modes.

python tests/benchmarks/blind_trial.py make DIR --cases 96 --seed 20261126
python tests/benchmarks/blind_trial.py solve DIR --until 16:10
python tests/benchmarks/blind_trial.py solve DIR --left-out --until 16:25
python tests/benchmarks/blind_trial.py score DIR --write-docs

Layout, sealing, guarded solving and scores of single cases stand in `tests/benchmarks/blind`;
`make -C tests/benchmarks blind-trial` does all four. `solve` takes cases in the order of their
names, which says nothing, and goes on where it stopped; `score` takes those that were solved.
Sound hangers, one effect each, and what the catalogue lacks:

- `tests/worlds/simulated`: every effect that it can plant;
- `tests/worlds/finite_elements.py`: frequencies, with its nuisances of the field;
- `tests/worlds/struck_bar.py`: hammer records in time of two levels and three places, identified.

A family is a bridge of hangers of the finite elements that share a cause.
"""

from __future__ import annotations

import argparse
import json
import math
import os
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, cast

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
import numpy as np
from scipy.stats import beta

from docs.filling import fill_in, write_csv
from shm.documents import dump
from shm.errors import NotIdentifiable
from shm.identify import IdentifyOptions
from shm.identify.identification import identify
from shm.modes_document import modes_document
from shm.values import Hanger, ModalTest
from tests.benchmarks import gap_dynamics, gap_family
from tests.benchmarks.blind.case import Draft, make_case
from tests.benchmarks.blind.layout import (
    CASE_FILE,
    CASE_SCHEMA,
    HANGER_FILE,
    MODES_FILE,
    Round,
    Trial,
    answered,
    key_beside,
    read_answers,
    read_trial,
    verified_sha256,
)
from tests.benchmarks.blind.making import seal
from tests.benchmarks.blind.scores import (
    FEWEST,
    LARGE,
    NO_GAP,
    SURE,
    bins_of,
    case_scores,
    corrected_calibration_error,
    leading,
    left_out_scores,
)
from tests.benchmarks.blind.sealing import key_of
from tests.benchmarks.blind.solving import solve_left_out, solve_trial
from tests.benchmarks.blind.truth import CaseScore, Richness, TrueCase, TrueEffect
from tests.helpers.struck import STRUCK, recordings
from tests.worlds import finite_elements, struck_bar
from tests.worlds.simulated.effects.registry import PLANTED, UNLISTED

SIMULATOR, ELEMENTS, BAR = "simulator", "finite elements", "struck bar"
TRIALS = Path(__file__).resolve().parents[2] / "docs" / "trials"
THREE: Richness = "three modes"
RICHNESSES: dict[str, tuple[Richness, ...]] = {
    SIMULATOR: ("everything", "two planes", "one plane", THREE),
    ELEMENTS: ("two planes", "one plane", THREE),
    BAR: ("shapes",),
}
# Of twelve cases: the bar's take minutes to identify, and the simulator alone has "everything".
TWELVE = (
    *[(SIMULATOR, "none")] * 2, *[(SIMULATOR, "one")] * 4, (SIMULATOR, "unknown"),
    (ELEMENTS, "none"), *[(ELEMENTS, "one")] * 3, (BAR, ""),
)  # fmt: skip
BASELINES = "beam1", "beam2"
IN_BEAM2 = "rotational_end_flexibility"  # no gap of a baseline that has end springs
SIZES = 1.0, 1000.0  # of the first trial, even in the logarithm
BAR_EFFECTS = {"joint": "joint_softening", "crack": "breathing_crack", "guide": "loose_guide"}
REPEAT = 7e-5  # the middle, in its logarithm, of the error that the world's modes repeat
STIFFNESS_SD = 0.025  # of EI, by the world's modulus (1.5 %) and section (1 %, so 2 % of I)


@dataclass(frozen=True)
class Plan:
    """A case before anything is drawn for it; `effects` in the order in which they are tried."""

    case: str
    world: str
    kind: str
    richness: Richness
    baseline: str
    effects: tuple[str, ...]


def plans(cases: int, seed: int) -> list[Plan]:
    """In twelves that hold every kind of every world; each effect and richness takes its turn."""
    rng = np.random.default_rng([seed, 2])
    turns: dict[str, Iterator[Any]] = {}

    def turn(name: str, of: Sequence[Any]) -> Any:
        """The next of these, in an order drawn anew whenever all had their turn."""
        if name not in turns:
            turns[name] = (of[i] for _ in iter(int, 1) for i in rng.permutation(len(of)))
        return next(turns[name])

    found = []
    for number in range(cases):
        if number % len(TWELVE) == 0:
            order = rng.permutation(len(TWELVE))
        world, kind = TWELVE[order[number % len(TWELVE)]]
        richness = turn(f"{world} {kind}", RICHNESSES[world])
        baseline = turn(f"{world} {kind} {richness}", BASELINES)
        known = {
            SIMULATOR: tuple(UNLISTED if kind == "unknown" else PLANTED),
            ELEMENTS: tuple(gap_family.SIZES),
            BAR: gap_dynamics.KINDS,
        }[world]
        first = "" if kind == "none" else turn(f"{world} {kind} effect", known)
        rest = (str(each) for each in rng.permutation(list(known)) if each != first)
        effects = tuple(
            each for each in (first, *rest) if each and (baseline, each) != ("beam2", IN_BEAM2)
        )
        found.append(Plan(f"c{number + 1:04d}", world, kind, richness, baseline, effects))
    return found


def make(directory: Path, cases: int, seed: int) -> None:
    """The cases and, beside them, the key."""
    seeds = np.random.SeedSequence([seed, 3]).spawn(cases)
    truths = []
    for plan, own in zip(plans(cases, seed), seeds, strict=True):
        truths.append(MAKERS[plan.world](directory / "cases" / plan.case, plan, own))
        print(f"made {plan.case} of {cases}", flush=True)
    sha256 = seal(directory, key_beside(directory), truths, seed)
    print(f"SHA-256 of the key {sha256}")


def by_simulator(directory: Path, plan: Plan, seed: np.random.SeedSequence) -> TrueCase:
    share = float(np.random.default_rng(seed.spawn(1)[0]).uniform())
    draft = Draft(plan.case, cast(Any, plan.kind), plan.richness, share, plan.effects)
    truth = make_case(directory, draft, seed)
    told = json.loads((directory / CASE_FILE).read_text(encoding="utf-8"))
    _write_told(directory, plan, told["seed"])
    left_out = truth.left_out if plan.kind == "one" else ()
    return replace(truth, left_out=left_out)


def by_elements(directory: Path, plan: Plan, seed: np.random.SeedSequence) -> TrueCase:
    rng = np.random.default_rng(seed)
    cause = plan.effects[0] if plan.kind == "one" else ""
    diameter_m, slenderness = rng.uniform(0.05, 0.10), rng.uniform(80, 170)
    length_m, nominal_n = diameter_m * slenderness, 1e6 * rng.uniform(80, 200)
    size = float(np.exp(rng.uniform(*np.log(gap_family.SIZES[cause])))) if cause else 0.0
    place_m, sd = rng.uniform(0.2, 0.8) * length_m, float(np.exp(rng.uniform(-10.8, -8.1)))
    modes = rng.integers(5, 9, 2)
    made = gap_family.member(
        rng, 1, diameter_m, length_m, length_m, nominal_n * np.pi * diameter_m**2 / 4,
        cause, size, place_m, sd, modes,
    )  # fmt: skip
    planes = 2 if plan.richness == "two planes" else 1
    most = 3 if plan.richness == THREE else 99
    tests = [
        replace(t, modes=tuple(
            m for m in t.modes if m.order <= most and (planes == 2 or m.plane == "transverse")
        ))
        for t in made.tests
    ]  # fmt: skip
    write_case(directory, plan, made.hanger, tests, int(rng.integers(2**31)))
    orders = [min(most, int(each)) for each in modes[:planes]]
    seen = size_of(made, cause, size, place_m, sd, orders, plan.baseline) if cause else 0.0
    return true_case(plan, cause, seen, made.tension_n)


def size_of(
    made: gap_family.Member, cause: str, size: float, place_m: float, sd: float,
    orders: Sequence[int], baseline: str,
) -> float:  # fmt: skip
    """What the cause does to the frequencies in standard deviations, beyond what the baseline can.

    To first order: less what a tension, a stiffness and, of beam2, end springs do.
    """
    hanger, most = made.hanger, max(orders)
    bending = hanger.elastic_modulus_pa * hanger.second_moment_m4
    clamp = gap_family.CLAMP * bending / hanger.length_m
    bar = finite_elements.Bar(
        hanger.length_m, made.tension_n, bending, hanger.mass_per_length_kg_m,
        spring_deck_n_m_rad=clamp, spring_arch_n_m_rad=clamp,
    )  # fmt: skip
    free = [replace(bar, tension_n=1.01 * bar.tension_n),
            replace(bar, bending_stiffness_n_m2=1.01 * bending)]  # fmt: skip
    if baseline == "beam2":
        free += [replace(bar, spring_deck_n_m_rad=100 * bending / hanger.length_m)]
    caused = gap_family.with_cause(bar, cause, size, place_m, hanger.length_m, hanger.area_m2)

    def logs(each: finite_elements.Bar) -> np.ndarray:
        hz = np.log(finite_elements.natural_frequencies_hz(each, most))
        return np.concatenate([hz[:order] for order in orders])

    clock = math.log1p(size) if cause == gap_family.CLOCK else 0.0
    change = logs(caused) + clock - logs(bar)
    one = np.hypot(sd / np.sqrt(len(made.tests)), REPEAT)
    columns = np.transpose([logs(each) - logs(bar) for each in free]) / one
    known = np.zeros((1, len(free)))
    known[0, 1] = 0.01 / STIFFNESS_SD
    columns, change = np.vstack([columns, known]), np.append(change / one, 0.0)
    left = change - columns @ np.linalg.lstsq(columns, change, rcond=None)[0]
    return float(np.linalg.norm(left))


def by_bar(directory: Path, plan: Plan, seed: np.random.SeedSequence) -> TrueCase:
    rng = np.random.default_rng(seed)
    kind = plan.effects[0]
    usual = struck_bar.Bar()
    off = 1 + 0.01 * rng.standard_normal(2)
    bar = replace(
        usual, tension_n=float(usual.tension_n * rng.uniform(0.8, 1.25)),
        bending_nm2=float(usual.bending_nm2 * off[0]), mass_kg_m=float(usual.mass_kg_m * off[1]),
    )  # fmt: skip
    hanger = struck_bar.Hanger(bar, gap_dynamics.drawn(kind, rng))
    crew, tests = struck_bar.Crew(hits=4), []
    options = IdentifyOptions(reference_force_n=crew.peak_n, frequency_allowance=1e-4)
    for number, level in enumerate(gap_dynamics.LEVELS, 1):
        records = recordings(struck_bar.tested(hanger, crew, level, rng), crew)
        try:
            found = identify(records, options, test_id=f"t{number}", hanger=STRUCK)
        except NotIdentifiable as error:
            print(f"{plan.case}, level {level}: {error}", flush=True)
            continue
        tests.append(found.test)
    write_case(directory, plan, STRUCK, tests, int(rng.integers(2**31)))
    return true_case(plan, BAR_EFFECTS.get(kind, ""), math.nan, bar.tension_n)


MAKERS: dict[str, Callable[[Path, Plan, np.random.SeedSequence], TrueCase]] = {
    SIMULATOR: by_simulator,
    ELEMENTS: by_elements,
    BAR: by_bar,
}


def true_case(plan: Plan, effect: str, size: float, tension_n: float) -> TrueCase:
    """A line of the key; where it acts and how much is not scored."""
    kind = "none" if not effect else "one" if effect in PLANTED else "unknown"
    effects = (TrueEffect(effect, "", {}, size),) if effect else ()
    left_out = (effect,) if kind == "one" else ()
    return TrueCase(
        plan.case, cast(Any, kind), plan.richness, effects, size if effect else 0.0,
        float(tension_n), left_out,
    )  # fmt: skip


def write_case(
    directory: Path, plan: Plan, hanger: Hanger, tests: Sequence[ModalTest], seed: int
) -> None:
    directory.mkdir(parents=True)
    described = {
        "diameter_m": hanger.diameter_m, "length_m": hanger.length_m,
        "elastic_modulus_pa": hanger.elastic_modulus_pa,
        "density_kg_m3": hanger.mass_per_length_kg_m / hanger.area_m2,
        "nominal_tension_n": hanger.nominal_tension_n,
    }  # fmt: skip
    lines = [f"{name} = {float(value)!r}" for name, value in described.items() if value]
    text = "\n".join(["[[hanger]]", "id = 1", *lines, ""])
    (directory / HANGER_FILE).write_text(text, encoding="utf-8")
    ours = [replace(test, hanger=1) for test in tests]
    text = dump(modes_document(ours)) + "\n"
    (directory / MODES_FILE).write_text(text, encoding="utf-8")
    _write_told(directory, plan, seed)


def _write_told(directory: Path, plan: Plan, seed: int) -> None:
    told = {"schema": CASE_SCHEMA, "baseline": plan.baseline, "seed": seed}
    (directory / CASE_FILE).write_text(dump(told) + "\n", encoding="utf-8")


def moment(until: str | None) -> datetime:
    if until is None:
        return datetime.max.replace(tzinfo=UTC)
    hour, minute = map(int, until.split(":"))
    return datetime.now(UTC).replace(hour=hour, minute=minute, second=0)


def solve(directory: Path, left_out: bool, until: datetime, at_once: int) -> None:
    """Few cases at a time, sealed each time, until the clock says."""
    trial = read_trial(directory)
    which: Round = "left_out" if left_out else "answers"
    wanted: dict[str, tuple[str, ...]] = dict.fromkeys(trial.cases, ())
    if left_out:
        done = answered(trial.answers("answers"))
        truths, _ = key_of(trial, key_beside(directory))
        wanted = {t.case: t.left_out for t in truths if t.left_out and t.case in done}
    while datetime.now(UTC) < until:
        have = answered(trial.answers(which))
        missing = [case for case in wanted if case not in have][:at_once]
        if not missing:
            break
        some = {case: wanted[case] for case in wanted if case in have or case in missing}
        if left_out:
            sha256 = solve_left_out(trial, some)
        else:
            sha256 = solve_trial(Trial(directory, tuple(some), trial.key_sha256))
        now = datetime.now(UTC)
        print(f"{now:%H:%M:%S} {which}: {len(some)} of {len(wanted)} {sha256}", flush=True)


@dataclass(frozen=True)
class Scored:
    """A case beside what was said of it in either round."""

    plan: Plan
    first: CaseScore
    second: CaseScore | None

    @property
    def large(self) -> bool:
        """Sound, larger than 4, or of the bar, whose sizes nobody knows."""
        return self.first.kind == "none" or not self.first.size <= LARGE

    @property
    def sure(self) -> bool:
        """A claim of more than 0.9; that there is no gap is none where it is too small to see."""
        claims = self.first.leader != NO_GAP or self.large
        return self.first.leading_probability > SURE and claims


def scored(directory: Path) -> list[Scored]:
    """The cases that were solved; sensors that err in direction are no false alarm: they do."""
    trial = read_trial(directory)
    truths, seed = key_of(trial, key_beside(directory))
    verified_sha256(trial, "answers")
    answers = read_answers(trial.answers("answers"))
    told = {each.case for each in answers}
    firsts = case_scores([each for each in truths if each.case in told], answers)
    seconds: dict[str, CaseScore] = {}
    if trial.seal("left_out").exists():
        verified_sha256(trial, "left_out")
        again = read_answers(trial.answers("left_out"))
        cases = {each.case for each in again}
        known = [each for each in truths if each.case in cases]
        own = [each for each in answers if each.case in cases]
        seconds = {each.case: each for each in left_out_scores(known, own, again)}
    of = {plan.case: plan for plan in plans(len(trial.cases), seed)}
    return [
        Scored(
            of[each.case], replace(each, right=each.right or turned(each)), seconds.get(each.case)
        )
        for each in firsts
    ]


def turned(case: CaseScore) -> bool:
    return case.kind == "none" and case.leader == "sensor_misalignment"


def share(flags: Sequence[bool | None], low: float, high: float) -> tuple[str, str]:
    """The share with its 95 % interval, and whether its better end keeps the bounds."""
    hits, of = sum(map(bool, flags)), len(flags)
    if not of:
        return "no case", "too few to judge"
    ends = (
        float(beta.ppf(0.025, hits, of - hits + 1)) if hits else 0.0,
        float(beta.ppf(0.975, hits + 1, of - hits)) if hits < of else 1.0,
    )
    value = hits / of
    verdict = "met" if low <= value <= high else "missed"
    if of < FEWEST:
        verdict = "too few to judge"
    elif verdict == "missed" and ends[0] <= high and ends[1] >= low:
        verdict = "met by the better end"
    return f"{hits} of {of}: {value:.2f} ({ends[0]:.2f} to {ends[1]:.2f})", verdict


Row = tuple[str, ...]


def marks(cases: Sequence[Scored]) -> list[Row]:
    """What was asked, what came out with 95 % intervals, and whether it is met."""
    sound = [c.first for c in cases if c.first.kind == "none"]
    one = [c for c in cases if c.first.kind == "one" and c.large]
    known = [c for c in one if c.first.size > 2 * LARGE or math.isnan(c.first.size)]
    sure = [c.first.right for c in cases if c.sure]
    blamed = [c.second.misattributed for c in one if c.second]
    covered = [c.first.tension_covered for c in cases]
    few = [c.first.tension_covered for c in cases if c.plan.richness == THREE]

    def named(richness: str) -> list[bool]:
        return [c.first.first for c in one if c.plan.richness == richness]

    asked: list[tuple[str, Sequence[bool | None], float, float]] = [
        ("False alarms, at most 0.03", [not each.right for each in sound], 0, 0.03),
        ("Named first, two planes, at least 0.75", named("two planes"), 0.75, 1),
        ("Named first, everything, at least 0.9", named("everything"), 0.9, 1),
        ("In the first's group above size 8, at least 0.93",
         [c.first.in_group for c in known], 0.93, 1),
        ("Sure (above 0.9) and right, at least 0.95", sure, 0.95, 1),
        ("Left out: a wrong effect blamed, at most 0.05", blamed, 0, 0.05),
        ("Tension in its 95 % interval, 0.90 to 0.98", covered, 0.9, 0.98),
        ("The same with three modes", few, 0.9, 0.98),
    ]  # fmt: skip
    rows = [(what, *share(flags, low, high)) for what, flags, low, high in asked]
    off, ends = corrected_calibration_error(
        np.array([leading(c.first) for c in cases]),
        np.array([float(c.first.right) for c in cases]),
        np.random.default_rng(0),
    )
    verdict = "met" if off <= 0.05 else "met by the better end" if ends[0] <= 0.05 else "missed"
    said = f"{off:.3f} ({ends[0]:.3f} to {ends[1]:.3f}), {len(cases)} cases"
    if bins_of(len(cases)) < 2:
        verdict = "too few to judge"
    return [*rows, ("Expected calibration error, at most 0.05", said, verdict)]


def by_part(cases: Sequence[Scored]) -> list[Row]:
    """The same by world, richness and baseline."""
    rows: list[Row] = [
        ("part", "cases", "sound: false alarms", "named first", "first or in its group",
         "sure and right", "tension covered"),
    ]  # fmt: skip
    parts = [(c.plan.world, c.plan.richness, c.plan.baseline) for c in cases]
    for index in range(3):
        for name in sorted({part[index] for part in parts}):
            own = [c for c, part in zip(cases, parts, strict=True) if part[index] == name]
            one = [c.first for c in own if c.first.kind == "one" and c.large]
            flags: list[list[bool | None]] = [
                [not c.first.right for c in own if c.first.kind == "none"],
                [each.first for each in one],
                [each.in_group for each in one],
                [c.first.right for c in own if c.sure],
                [c.first.tension_covered for c in own],
            ]
            counts = (f"{sum(map(bool, each))} of {len(each)}" for each in flags)
            rows.append((name, str(len(own)), *counts))
    return rows


def every_case(cases: Sequence[Scored]) -> list[Row]:
    rows: list[Row] = [
        ("case", "world", "richness", "baseline", "planted", "size", "said", "probability", "right",
         "tension off, %", "covered", "left out: said", "probability", "blamed"),
    ]  # fmt: skip
    for case in cases:
        plan, one, two = case.plan, case.first, case.second
        said = " / ".join((one.leader, *one.alike)) or one.failure
        again = (
            (two.leader, f"{two.leading_probability:.2f}", str(two.misattributed)) if two else ()
        )
        rows.append(
            (one.case, plan.world, plan.richness, plan.baseline, one.planted, f"{one.size:.1f}",
             said, f"{one.leading_probability:.2f}", str(one.right),
             f"{100 * one.tension_error_after:.2f}", str(one.tension_covered), *again)
        )  # fmt: skip
    return rows


def score(directories: Sequence[Path], write: bool) -> None:
    cases = [case for directory in directories for case in scored(directory)]
    told = [("asked", "found (95 % interval)", "verdict"), *marks(cases)]
    for row in told:
        print(" | ".join(row))
    if write:
        trials = [read_trial(directory) for directory in directories]
        lines = ["| " + " | ".join(row) + " |" for row in told]
        keys = ", ".join(f"`{trial.key_sha256}`" for trial in trials)
        made = sum(len(trial.cases) for trial in trials)
        head = f"{len(cases)} of {made} cases, {kinds(cases)}; SHA-256 of the keys {keys}."
        table = "\n".join([lines[0], "|---|---|---|", *lines[1:]])
        fill_in(TRIALS / "blind_trial.md", "blind trial 2", f"{head}\n\n{table}")
        write_csv(TRIALS / "blind_trial_2" / "by_part.csv", by_part(cases))
        write_csv(TRIALS / "blind_trial_2" / "every_case.csv", every_case(cases))


def kinds(cases: Sequence[Scored]) -> str:
    counts = Counter(case.first.kind for case in cases)
    return (
        f"{counts['none']} sound, {counts['one']} with one effect of the catalogue, "
        f"{counts['unknown']} with one that it lacks"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("what", choices=["make", "solve", "score"])
    parser.add_argument("directory", type=Path, nargs="+", help="to score: one or several trials")
    parser.add_argument("--cases", type=int, default=96)
    parser.add_argument("--seed", type=int, default=20261126)
    parser.add_argument("--left-out", action="store_true")
    parser.add_argument("--until", help="UTC, today; else to the end")
    parser.add_argument("--at-once", type=int, default=12)
    parser.add_argument("--write-docs", action="store_true")
    given = parser.parse_args()
    if given.what == "make":
        make(given.directory[0], given.cases, given.seed)
    elif given.what == "solve":
        solve(given.directory[0], given.left_out, moment(given.until), given.at_once)
    else:
        score(given.directory, given.write_docs)


if __name__ == "__main__":
    main()
