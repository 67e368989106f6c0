"""How often the intervals of a sampled effect hold the truth, and what a fit costs.

Effects are drawn from their priors as far as the data can show them, with deviations of the bar,
two tests (one with a known mass), two planes of six modes, no shapes. A 90 % interval must hold the
truth in 78 to 98 % of the cases (99 % range of 60 draws of 0.9, rounded outwards).
"""

from __future__ import annotations

import argparse
import sys
import time

import numpy as np

from shm.gap.contract import Hypothesis
from shm.models.effects import Variant
from tests.helpers.gap_campaigns import campaign, fit_of, problem_of, scan_of

CASES = 60
LEAST, MOST = 0.78, 0.98
EFFECTS = ("bending_stiffness", "distributed_mass", "point_mass", "effective_length")


def main() -> int:
    """Prints a line for each effect; 1 where a bound is missed."""
    argparse.ArgumentParser(description=__doc__).parse_args()
    print(f"{'effect':24} {'cases':>6} {'held':>6} {'fit s':>7} {'evidence sd':>12}")
    rates = [_line(effect) for effect in EFFECTS]
    return 0 if all(LEAST <= rate <= MOST for rate in rates) else 1


def _line(effect: str) -> float:
    variant = Variant("deck end", ends=(0,)) if effect == "effective_length" else Variant()
    hypothesis = Hypothesis(((effect, variant),))
    rows = np.array([_case(hypothesis, seed) for seed in range(CASES)])
    held, fit_s, sd = rows.mean(axis=0)
    print(f"{effect:24} {CASES:6} {held:6.2f} {fit_s:7.3f} {sd:12.3f}")
    return float(held)


def _case(hypothesis: Hypothesis, seed: int) -> tuple[float, float, float]:
    problem = problem_of(campaign(seed=seed))
    scan_of(problem, hypothesis)  # cuts the priors
    coordinates = problem.coordinates(hypothesis)
    z = np.random.default_rng(seed).standard_normal((1, coordinates.dimension))
    truth = coordinates.effect_values(z)[0]
    planted = problem_of(campaign(hypothesis.effects, truth.tolist(), seed=seed))
    planted.smallest = problem.smallest
    began = time.process_time()
    fit = fit_of(planted, hypothesis, 1000)
    seconds = time.process_time() - began
    size = planted.coordinates(hypothesis).effect_values(fit.draws)[:, 0]
    low, high = np.quantile(size, [0.05, 0.95])
    return float(low <= truth[0] <= high), seconds, fit.log_evidence_sd


if __name__ == "__main__":
    sys.exit(main())
