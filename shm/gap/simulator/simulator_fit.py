"""A hypothesis of a user's simulator fitted, and what a fit leaves of the readings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import scipy

from shm.gap.hypotheses.contract import Fit, Hypothesis
from shm.gap.hypotheses.sampling import sample
from shm.gap.hypotheses.target import Target
from shm.gap.simulator.simulator_problem import Prior, Reading, SimulatorProblem
from shm.inference.sampler.density import climb, find_peaks
from shm.values import BoolArray, FloatArray

# Numerical: points of the priors among which climbs start, those climbs, draws that are kept.
_SCOUTS, _STARTS, _DRAWS = 150, 3, 400


def fit_hypothesis(
    problem: SimulatorProblem,
    hypothesis: Hypothesis,
    rng: np.random.Generator,
    start: FloatArray | None = None,
) -> Fit:
    """Return the posterior of a hypothesis with its evidence.

    `start` (d0,) is a fit of the simulator alone: half of the points to climb from are near it.
    """
    target = Target(problem, hypothesis)
    z = rng.standard_normal((_SCOUTS, target.dimension))
    if start is not None:
        z[::2, : len(start)] = start
    log = target.log(z)
    best = np.argsort(-np.where(np.isnan(log), -np.inf, log))[:_STARTS]
    return sample(target, find_peaks(target, z[best]), _DRAWS, rng)


def refit(problem: SimulatorProblem, fit: Fit, rows: BoolArray) -> FloatArray:
    """Return the most probable z by the readings of `rows` (data,) alone, from a fit to all."""
    z, _ = climb(Target(problem.part(rows), fit.hypothesis), fit.z[None])
    return np.asarray(z[0])


# Judgement, in a prior's standard deviations: nearer to a bound than a hundredth of the range; so
# far out that one in 150 000 lies beyond.
_AT_BOUND, _FAR_OUT = 2.33, 4.5
_FEWEST_EFFECTIVE = 20  # judgement: fewer draws tell a spread to no better than a sixth
# Judgement: what does not fit, but for one of its three worst readings, holds a slip.
_BAD, _GOOD, _SUSPECTS = 0.01, 0.05, 3


def drop_copies(readings: Sequence[Reading]) -> tuple[tuple[Reading, ...], tuple[str, ...]]:
    """Return the readings, those alike to the last digit once, and a remark on them."""
    distinct = {
        (tuple(sorted(e.condition.items())), e.observable, e.value, repr(e.sd)): e for e in readings
    }
    copies = len(readings) - len(distinct)
    if not copies:
        return tuple(readings), ()
    return tuple(distinct.values()), (
        f"{copies} of {len(readings)} readings repeat another one to the last digit and count once:"
        " a copy, or a step of the instrument that hides its scatter, adds nothing.",
    )


def errors_of(problem: SimulatorProblem, fit: Fit) -> FloatArray:
    """Return stated deviations, and for unstated ones those that the fit found."""
    found = np.sqrt(np.diag(fit.noise.frequency))
    return np.where(np.isfinite(problem.sd), problem.sd, found)


def in_sds(problem: SimulatorProblem, fit: Fit) -> FloatArray:
    """Return what a fit leaves of each reading (data,), in its standard deviations."""
    return np.asarray((problem.value - fit.predicted) / errors_of(problem, fit))


def rms(values: FloatArray) -> float:
    """Return the root mean square."""
    return float(np.sqrt(np.mean(values**2)))


def p_value(problem: SimulatorProblem, fit: Fit, residual: FloatArray | None = None) -> float:
    """Return that of the misfit at the best point, averaged over the unknown size of the errors.

    A `residual` (data,) may be another than the fit's, NaN for readings that do not count.
    """
    away = problem.value - fit.predicted if residual is None else residual
    freedom = max(1, int(np.isfinite(away).sum()) - len(fit.z))
    nodes = problem.nodes()
    weight = np.exp([each.log_weight for each in nodes])
    squares = [float(np.nansum(away**2 / np.diag(n.covariance.frequency))) for n in nodes]
    return float(weight @ scipy.special.chdtrc(freedom, squares) / weight.sum())


def moments(
    problem: SimulatorProblem, fit: Fit, names: Mapping[str, object]
) -> dict[str, tuple[float, float]]:
    """Return mean and standard deviation of parameters; NaN where draws do not show it."""
    found = {}
    for j, (name, prior) in enumerate(problem.priors(fit.hypothesis).items()):
        if name in names:
            value = prior.value(fit.draws[:, j])
            shown = fit.effective >= _FEWEST_EFFECTIVE and not _at_bound(prior, fit.draws[:, j])
            found[name] = float(value.mean()), float(value.std()) if shown else float("nan")
    return found


def _at_bound(prior: Prior, z: FloatArray) -> bool:
    return prior.spread in ("uniform", "logarithmic") and bool(abs(z.mean()) > _AT_BOUND)


def at_bounds(problem: SimulatorProblem, fit: Fit) -> tuple[str, ...]:
    """Return a remark on each parameter at the bound of its prior, or far out of it."""
    remarks = []
    for j, (name, prior) in enumerate(problem.priors(fit.hypothesis).items()):
        z = fit.draws[:, j]
        bound = _at_bound(prior, z)
        if bound or abs(z.mean()) > _FAR_OUT:
            where = "at its bound" if bound else "far out of its prior"
            remarks.append(
                f"{name} lies {where}, {float(prior.value(z).mean()):.4g}: widen its prior if it "
                "may lie there."
            )
    return tuple(remarks)


def slips(problem: SimulatorProblem, *fits: Fit) -> tuple[str, ...]:
    """Return a remark on the reading without which the last of these that misfits would fit."""
    return tuple(remark for fit in fits if (remark := _slip(problem, fit)))[-1:]


def _slip(problem: SimulatorProblem, fit: Fit) -> str:
    """Return a remark on the reading without which a bad fit is a good one; empty for none."""
    if len(problem.value) < len(fit.z) + 3 or p_value(problem, fit) > _BAD:
        return ""
    best, remark = _GOOD, ""
    for row in np.argsort(-np.abs(in_sds(problem, fit)))[:_SUSPECTS]:
        z = refit(problem, fit, np.arange(len(problem.value)) != row)
        away = problem.value - problem.predict(fit.hypothesis, z[None])[0]
        off = abs(away[row]) / errors_of(problem, fit)[row]
        away[row] = np.nan
        if (p := p_value(problem, fit, away)) > best:
            best, remark = p, _on_slip(problem.readings[row], off, fit.hypothesis.name)
    return remark


def _on_slip(reading: Reading, off: float, effect: str) -> str:
    return (
        f"{reading.observable} = {reading.value:.6g} at {dict(reading.condition)} lies "
        f"{off:.0f} sds from what all other readings say with {effect or 'the simulator alone'}: "
        "look whether it is a slip, and diagnose again without it."
    )
