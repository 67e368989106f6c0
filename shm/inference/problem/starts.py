"""Points from which to climb to the peaks of an update's posterior."""

from __future__ import annotations

import numpy as np

from shm.inference.problem.hanger_problem import Problem
from shm.values import FloatArray, Posterior

# Numerical: of so many draws of the prior, and as many of springs that are felt, the most probable
# ones that lie apart (in standard deviations of the prior) are starts. A missed peak shows as two
# seeds with unlike evidences (tests/benchmarks/sharp_evidence.py).
_DRAWS, _STARTS, _APART = 100, 12, 0.5
_KNOWN = 64  # numerical: half of them from a known posterior, half from the prior


def find_starts(
    problem: Problem, rng: np.random.Generator, known: FloatArray | None = None
) -> FloatArray:
    """Return starts (m, d); `known` (n, d) are further candidates."""
    of = problem.coordinates
    drawn = [of.draw_prior(_DRAWS, rng), of.draw_felt(_DRAWS, rng)]
    z = np.vstack(drawn if known is None else [*drawn, known])
    chosen: list[int] = []
    for row in np.argsort(-problem.log(z), kind="stable").tolist():
        if all(np.abs(z[row] - z[other]).max() > _APART for other in chosen):
            chosen.append(row)
        if len(chosen) == _STARTS:
            break
    return np.asarray(z[chosen])


def known_places(problem: Problem, known: Posterior, rng: np.random.Generator) -> FloatArray | None:
    """Return draws of a `known` posterior as points (n, d); None where it shares no parameter.

    What the known class does not have is drawn from the prior.
    """
    names = set(known.names) & set(problem.prior.names)
    if not names or known.priors != problem.model.priors:
        return None
    z = problem.coordinates.draw_prior(_KNOWN // 2, rng)
    theta = problem.coordinates.theta(z)
    rows = rng.choice(len(known.samples), _KNOWN // 2)
    for name in names:
        theta[:, problem.prior.names.index(name)] = known.parameter(name)[rows]
    return np.vstack(
        [problem.coordinates.places(theta), problem.coordinates.draw_prior(_KNOWN // 2, rng)]
    )
