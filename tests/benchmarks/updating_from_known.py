"""Does updating from a known posterior give what updating from scratch gives, and for how much?

Each case plants a hanger, updates Beam 2 on a test A of it, changes its tension by up to 10 % and,
in every other case, softens one end by up to a decade, and updates on a test B from scratch and
from A's posterior. The noise of the frequencies is 1 % (as hanger 3 of the thesis misfits) and
0.1 % by turns. Run:

    python tests/benchmarks/updating_from_known.py --cases 40 --workers 2

Bounds: differences of means and of log evidences in their standard errors have a median size of
0.67 where both are right and independent, and must stay below 1.35 (twice that, for the effective
sample size is itself uncertain); the median ratio of the spreads must lie within 5 % of 1 for
theta_F, so that neither way is systematically the more confident; the two ways must cover the
truth by their 90 % intervals equally often within 10 % of the cases.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from rich.progress import track
from scipy.stats import ks_2samp

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from shm.inference import UpdateOptions, refresh, update
from shm.models import THESIS, Model, build
from shm.values import PLANES, FloatArray, ModalTest, Mode, Posterior
from tests.helpers.hangers import HANGER_3

ERRORS = (0.01, 0.001)
NAMES = ("theta_F", "theta_L", "sigma")
LARGEST_SCORE = 1.35
LARGEST_BIAS_OF_SPREAD = 0.05
LARGEST_DIFFERENCE_OF_COVERAGE = 0.1


@dataclass(frozen=True, eq=False)
class Comparison:
    """One case: differences in standard errors, ratios of spreads, what each way took."""

    error: float
    method: str
    scores: FloatArray
    evidence_score: float
    spread_ratios: FloatArray
    distance: float
    covered: tuple[bool, bool]
    evaluations: tuple[int, int]
    cpu_s: tuple[float, float]


def modal_test(
    model: Model, theta: FloatArray, error: float, rng: np.random.Generator
) -> ModalTest:
    """Twelve frequencies with fractional noise."""
    exact = model.frequencies_hz(theta[None], 6)[0]
    noisy = exact * (1 + error * rng.standard_normal(exact.shape))
    modes = tuple(
        Mode(plane, order + 1, float(frequency))
        for plane, row in zip(PLANES, noisy, strict=True)
        for order, frequency in enumerate(row)
    )
    return ModalTest("planted", modes, hanger=HANGER_3.id)


def planted(case: int, rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """Parameters before and after something has changed."""
    before = np.array([rng.uniform(0.7, 1.5), rng.uniform(0.93, 1.02), *rng.uniform(6, 9, 4)])
    after = before.copy()
    after[0] *= 1 + rng.uniform(-0.1, 0.1)
    if case % 2:
        after[2 + rng.integers(4)] -= rng.uniform(0, 1)
    return before, after


def compared(samples: int, case: int) -> Comparison:
    """One case."""
    rng = np.random.default_rng([7, case])
    model, error = build("beam2", HANGER_3, THESIS), ERRORS[case // 2 % len(ERRORS)]
    before, after = planted(case, rng)
    first, second = (modal_test(model, theta, error, rng) for theta in (before, after))
    known = update([first], model, UpdateOptions(samples, seed=3 * case))
    began = time.process_time()
    scratch = update([second], model, UpdateOptions(samples, seed=3 * case + 1))
    between = time.process_time()
    found = refresh([second], model, known, UpdateOptions(samples, seed=3 * case + 2))
    cpu_s = (time.process_time() - between, between - began)
    return comparison(error, found, scratch, float(after[0]), cpu_s)


def comparison(
    error: float, found: Posterior, scratch: Posterior, truth: float, cpu_s: tuple[float, float]
) -> Comparison:
    """Both posteriors of one test, beside each other."""
    both = (found, scratch)
    draws = [np.column_stack([each.parameter(name) for name in NAMES]) for each in both]
    means = draws[0].mean(axis=0) - draws[1].mean(axis=0)
    errors = [
        x.std(axis=0) ** 2 / p.effective_sample_size for x, p in zip(draws, both, strict=True)
    ]
    low, high = np.quantile([each.parameter("theta_F") for each in both], [0.05, 0.95], axis=1)
    evidence_error = np.hypot(found.log_evidence_sd, scratch.log_evidence_sd)
    return Comparison(
        error=error,
        method=found.method,
        scores=means / np.sqrt(errors[0] + errors[1]),
        evidence_score=float((found.log_evidence - scratch.log_evidence) / evidence_error),
        spread_ratios=draws[0].std(axis=0) / draws[1].std(axis=0),
        distance=float(ks_2samp(draws[0][:, 0], draws[1][:, 0]).statistic),
        covered=(bool(low[0] < truth < high[0]), bool(low[1] < truth < high[1])),
        evaluations=(found.evaluations, scratch.evaluations),
        cpu_s=cpu_s,
    )


def report(label: str, cases: Sequence[Comparison]) -> None:
    """Prints what came out for some of the cases."""
    ways = ", ".join(f"{count} {way}" for way, count in Counter(c.method for c in cases).items())
    evaluations = np.median([c.evaluations for c in cases], axis=0)
    cpu_s = np.median([c.cpu_s for c in cases], axis=0)
    scores = np.median(np.abs([[*c.scores, c.evidence_score] for c in cases]), axis=0)
    ratios = np.array([c.spread_ratios for c in cases])
    print(f"\n{label}: {len(cases)} tests; {ways}")
    print(f"evaluations: {evaluations[0]:.0f} from known, {evaluations[1]:.0f} from scratch")
    print(f"processor time: {cpu_s[0]:.2f} s from known, {cpu_s[1]:.2f} s from scratch (medians)")
    for name, score, ratio in zip(NAMES, scores, ratios.T, strict=False):
        low, middle, high = np.quantile(ratio, [0.1, 0.5, 0.9])
        print(
            f"{name:13} |difference of means| {score:.2f} standard errors; "
            f"ratio of spreads {middle:.3f} (80 %: {low:.2f} to {high:.2f})"
        )
    print(f"log evidence  |difference| {scores[-1]:.2f} standard errors")
    print(
        f"theta_F: median Kolmogorov-Smirnov distance {np.median([c.distance for c in cases]):.3f}"
    )
    covered = np.mean([c.covered for c in cases], axis=0)
    print(f"90 % interval covers: {covered[0]:.0%} from known, {covered[1]:.0%} from scratch")


def faults(cases: Sequence[Comparison]) -> list[str]:
    """Which of the bounds fail."""
    scores = np.median(np.abs([[*c.scores, c.evidence_score] for c in cases]), axis=0)
    ratio = float(np.median([c.spread_ratios[0] for c in cases]))
    covered = np.mean([c.covered for c in cases], axis=0)
    checks = {
        "means or evidences differ": scores.max() > LARGEST_SCORE,
        "spreads differ": abs(ratio - 1) > LARGEST_BIAS_OF_SPREAD,
        "coverage differs": abs(covered[0] - covered[1]) > LARGEST_DIFFERENCE_OF_COVERAGE,
    }
    return [fault for fault, found in checks.items() if found]


def main() -> None:
    """Runs the trial; exit code 1 where a bound fails."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=40)
    parser.add_argument("--samples", type=int, default=1000)
    parser.add_argument("--workers", type=int, default=1)
    arguments = parser.parse_args()
    with ProcessPoolExecutor(arguments.workers) as executor:
        mapped = executor.map(partial(compared, arguments.samples), range(arguments.cases))
        cases = list(track(mapped, "tests", total=arguments.cases))
    for error in sorted({case.error for case in cases}, reverse=True):
        report(f"noise {error:.1%}", [case for case in cases if case.error == error])
    report("all", cases)
    failed = faults(cases)
    if failed:
        raise SystemExit("; ".join(failed))


if __name__ == "__main__":
    main()
