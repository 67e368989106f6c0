"""Local fits: the optima of a problem by least squares, and points along the valleys through them.

Frequencies good to 1e-4 confine the parameters to a valley whose part of the prior is so small
that no draw of the prior meets it. Damped least squares (Levenberg 1944, Marquardt 1963) from
dispersed starts does. Draws of the prior that go to the valley by least squares, each to its own
draw of the noise, lie along it nearly as the posterior does (randomised maximum likelihood: Oliver,
He and Reynolds 1996).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shm.inference.mixture import normalised
from shm.inference.problem import Problem
from shm.values import FloatArray, IntArray, Posterior


@dataclass(frozen=True)
class Numerics:
    """Numerical settings of local fits; weights correct for all of them.

    As many `starts` come from the prior, with a misfit of `first_sigma`, as from where springs are
    felt, with one of `felt_sigma`. After `steps` those `followed` take `next_steps`, and those
    `kept` `last_steps`. Optima nearer than `apart` (of the prior's standard deviation) are one.
    A missed optimum shows as two seeds with unlike evidences (tests/benchmarks/sharp_evidence.py).
    `damping` is the first of Levenberg and Marquardt, no coordinate moves by more than
    `longest_step`, and a descent has `arrived` when no log density gains more.

    `along` points go from an optimum in `along_steps` each, in a valley `wider` than the posterior
    and then nearly as narrow, so that they follow its bends. Optima are chosen by their density to
    the power of `tempered`, halfway from all alike to the most probable one alone. Points
    `farthest` below the highest log density weigh nothing, but a `fewest` are kept.
    """

    starts: int = 40
    followed: int = 24
    kept: int = 12
    steps: int = 8
    next_steps: int = 10
    last_steps: int = 40
    first_sigma: float = 0.02
    felt_sigma: float = 0.001
    apart: float = 0.1
    damping: float = 1e-2
    longest_step: float = 0.5
    arrived: float = 1e-3
    along: int = 160
    along_steps: int = 6
    wider: tuple[float, float] = (10.0, 1.5)
    tempered: float = 0.5
    farthest: float = 15.0
    fewest: int = 30


_SET = Numerics()


@dataclass(frozen=True, eq=False)
class LocalFits:
    """Optima `z` (m, d), the best first, and their model errors `sigma` (m,)."""

    z: FloatArray
    sigma: FloatArray


def search(
    problem: Problem, rng: np.random.Generator, known: FloatArray | None = None
) -> LocalFits:
    """Return the best distinct optima; `known` (n, d) are further starts."""
    starts = [problem.coordinates.draw_prior(_SET.starts, rng)]
    starts += [problem.coordinates.draw_felt(_SET.starts, rng)]
    sigma = np.repeat([_SET.first_sigma, _SET.felt_sigma], _SET.starts)
    if known is not None:
        starts.append(known)
        sigma = np.append(sigma, np.full(len(known), _SET.felt_sigma))
    z, sigma = descend(problem, np.vstack(starts), sigma, _SET.steps)
    z = problem.coordinates.fold(z)
    best = _distinct(problem, z, _SET.followed)
    z, sigma = descend(problem, z[best], sigma[best], _SET.next_steps)
    problem.settle(z[_distinct(problem, z)[0]])
    kept = _distinct(problem, z)
    z, sigma = descend(problem, z[kept], sigma[kept], _SET.last_steps)
    z = problem.coordinates.fold(z)
    kept = _distinct(problem, z)
    return LocalFits(z[kept], sigma[kept])


def draw_along(
    problem: Problem, fits: LocalFits, rng: np.random.Generator, centres: FloatArray | None = None
) -> tuple[FloatArray, IntArray]:
    """Return points (n, d) along the valleys through the optima, most of them through the best, and
    the optimum (n,) that each came from.

    They are draws of the prior, or the `centres` (n, d) instead, carried to the data.
    """
    if centres is None:
        centres = problem.coordinates.draw_prior(_SET.along, rng)
    density = problem.log_posterior(problem.evaluate(fits.z))
    chances = normalised(_SET.tempered * density)
    chosen = rng.choice(len(chances), len(centres), p=chances)
    z = fits.z[chosen]
    for wider in _SET.wider:
        z = carried(problem, centres, wider * fits.sigma[chosen], rng, _SET.along_steps, z)
    density = problem.log_posterior(problem.evaluate(z))
    least = min(density.max() - _SET.farthest, np.sort(density)[-min(_SET.fewest, len(density))])
    kept = density >= least
    z = problem.coordinates.fold(z[kept])
    return problem.coordinates.connect(z, rng), chosen[kept]


def carried(
    problem: Problem,
    centres: FloatArray,
    sigma: FloatArray | float,
    rng: np.random.Generator,
    steps: int,
    start: FloatArray,
) -> FloatArray:
    """Return draws `centres` (m, d) of another distribution brought to this problem's data.

    Each goes to the least-squares optimum for its own draw of the noise, of model error `sigma`
    (m,), with its old place as the centre of the prior: the data's part is made new, the rest is
    kept. The way begins at `start` (m, d).
    """
    errors = rng.standard_normal((len(centres), len(problem.likelihood.fit_error)))
    sigmas = np.broadcast_to(sigma, len(centres))
    return descend(problem, start, sigmas, steps, centres, errors)[0]


def known_places(problem: Problem, known: Posterior, rng: np.random.Generator) -> FloatArray | None:
    """Return draws of a `known` posterior as points (n, d); None where it shares no parameter.

    What the known class does not have is drawn from the prior.
    """
    names = set(known.names) & set(problem.prior.names)
    if not names or known.priors != problem.model.priors:
        return None
    z = problem.coordinates.draw_prior(_SET.along // 2, rng)
    theta = problem.coordinates.theta(z)
    rows = rng.choice(len(known.samples), _SET.along // 2)
    for name in names:
        theta[:, problem.prior.names.index(name)] = known.parameter(name)[rows]
    return np.vstack(
        [problem.coordinates.places(theta), problem.coordinates.draw_prior(_SET.along // 2, rng)]
    )


def model_error(problem: Problem, z: FloatArray) -> FloatArray:
    """Return the model errors (m,) at `z` (m, d)."""
    return problem.likelihood.model_error(problem.predict(z))


def _distinct(problem: Problem, z: FloatArray, most: int = _SET.kept) -> IntArray:
    """Return indices of the most probable points that lie apart from each other, the best first.

    Of one optimum that most starts reach, one point counts: the others leave a place for a less
    probable optimum.
    """
    kept: list[int] = []
    for index in np.argsort(-problem.log_posterior(problem.evaluate(z))):
        if all(np.abs(z[index] - z[other]).max() > _SET.apart for other in kept):
            kept.append(int(index))
    return np.array(kept[:most])


def descend(
    problem: Problem,
    z: FloatArray,
    sigma: FloatArray,
    steps: int,
    centre: FloatArray | float = 0.0,
    errors: FloatArray | float = 0.0,
) -> tuple[FloatArray, FloatArray]:
    """Move points `z` (m, d) downhill together; return them and their model errors (m,).

    The prior is centred at `centre`; `errors` (m, measurements) are the misfits to reach, in
    standard deviations of independent noise of model error `sigma` (m,).
    """

    def fit(z: FloatArray) -> tuple[FloatArray, FloatArray]:
        residual = np.einsum("mnk,mk->mn", whitening, problem.misfit(z)) - errors
        return residual, (residual**2).sum(axis=1) + ((z - centre) ** 2).sum(axis=1)

    whitening = np.array([problem.likelihood.whitening(float(each)) for each in sigma])
    damping = np.full(len(z), _SET.damping)
    residual, cost = fit(z)
    for _ in range(steps):
        step = _step(whitening @ problem.slopes(z), residual, z - centre, damping)
        trial_residual, trial_cost = fit(z + step)
        better = trial_cost < cost
        gained = float(np.max(np.where(better, cost - trial_cost, 0.0)))
        z = np.where(better[:, None], z + step, z)
        residual = np.where(better[:, None], trial_residual, residual)
        cost = np.where(better, trial_cost, cost)
        damping = np.where(better, damping * 0.2, damping * 8).clip(1e-9, 1e8)
        if gained < _SET.arrived and damping.min() > _SET.damping:
            break
    return z, model_error(problem, z)


def _step(
    slopes: FloatArray, residual: FloatArray, away: FloatArray, damping: FloatArray
) -> FloatArray:
    """Return the damped Gauss-Newton step (m, d) of points `away` (m, d) from the prior's centre.

    At most 1 in any direction.
    """
    normal = np.einsum("mnd,mne->mde", slopes, slopes) + np.eye(away.shape[1])
    gradient = np.einsum("mnd,mn->md", slopes, residual) + away
    diagonal = np.einsum("mdd->md", normal) * damping[:, None]
    damped = normal + diagonal[..., None] * np.eye(away.shape[1])
    step = -np.linalg.solve(damped, gradient[..., None])[..., 0]
    longest = np.abs(step).max(axis=1, keepdims=True)
    return np.asarray(step / np.maximum(longest / _SET.longest_step, 1.0))
