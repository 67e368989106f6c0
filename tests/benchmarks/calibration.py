"""Simulation-based calibration of `update` (Talts et al. 2018): are the ranks of the truth uniform?

Parameters and model error are drawn from the prior, data are simulated with them, and the rank of
each true value among the posterior's draws is noted. If, and only if, the posteriors are right on
average, every rank is uniform. Run:

    python tests/benchmarks/calibration.py beam1 beam2 --draws 300 --workers 2

Which joint distribution is simulated
-------------------------------------
The likelihood L = prod N(f_hat; f, (s f_hat)^2), s^2 = sigma^2 + e^2 (e the fractional error of the
identification), has the datum in its own standard deviation. As a density of f_hat it is not
normalised. With u = f / f_hat its integral over f_hat is

    Z(s) = int exp(-(u - 1)^2 / 2 s^2) / (sqrt(2 pi) s u) du,

which does not hold f: it is a function of s alone. It diverges at u = 0, where f_hat is infinite,
as exp(-1 / 2 s^2): no proper model of the data belongs to sigma near 1, but below sigma = 0.1 what
lies beyond u = 1/2 to 2 weighs less than exp(-12), and is left out here. There Z = 1 + s^2 + ....
Hence with N data

    prior(theta) prior(sigma) L = prior(theta) [prior(sigma) Z(s)^N] [L / Z(s)^N],

and the code's posterior is, exactly, that of the normalised data density L / Z^N with the prior of
sigma multiplied by Z^N. So sigma is drawn from the uniform prior times Z^N, and u from the density
proportional to exp(-(u - 1)^2 / 2 s^2) / u.

The prior of sigma reaches to 1, where the data density above is improper. Calibration also holds
with the prior restricted to any set A of sigma: the truth is drawn from the prior within A, and the
restricted posterior is the posterior given that sigma lies in A. Its draws are those draws of
`update` whose sigma lies in A; the others are left out, and nothing in the product changes. Then
the number of draws left differs from case to case, so that a rank r among n is noted as
(r + U) / (n + 1) with U uniform on (0, 1): uniform itself, whatever n.

Beside the parameters, the rank of the log likelihood and, where ends can be swapped, of the lower
and the higher of the two springs are noted; the springs themselves have symmetric ranks for any
sampler that swaps by chance. theta_F is the tension.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import nullcontext
from dataclasses import dataclass
from functools import partial

import numpy as np
from rich.progress import track
from scipy.stats import chisquare, cramervonmises

from shm.inference import UpdateOptions, update
from shm.inference.problem.thesis_noise import ThesisLikelihood
from shm.models import THESIS, Model, build
from shm.values import NAN, PLANES, FloatArray, ModalTest, Mode
from tests.helpers.hangers import HANGER_3

MODES = 6
BINS = 20
LEAST_IN_BIN = 10
THRESHOLD = 0.005
RANGE_OF_U = (0.5, 2.0)


@dataclass(frozen=True)
class Terms:
    """What is simulated: sigma within `low` to `high`, the identification's fractional error.

    Of `samples` draws of `update` every `thinning`-th counts, so that they are independent.
    """

    model: str
    low: float
    high: float
    identification_error: float
    samples: int
    thinning: int
    seed: int


@dataclass(frozen=True, eq=False)
class Case:
    """The ranks of one draw from the prior, as fractions (quantities,), of the draws counted."""

    ranks: FloatArray
    counted: int


def scatter_density(u: FloatArray, s: FloatArray) -> FloatArray:
    """Density of u = f / f_hat before normalisation, for s (n,): shape (n, nodes)."""
    s = s[:, None]
    return np.asarray(np.exp(-0.5 * ((u - 1) / s) ** 2) / (np.sqrt(2 * np.pi) * s * u))


def nodes_of_u(s: float) -> FloatArray:
    """Nodes of a grid of u that resolves s."""
    low, high = RANGE_OF_U
    return np.linspace(max(low, 1 - 9 * s), min(high, 1 + 9 * s), 4001)


def normaliser(s: float) -> float:
    """Z(s)."""
    u = nodes_of_u(s)
    return float(np.trapezoid(scatter_density(u, np.array([s]))[0], u))


def draw_sigma(terms: Terms, rng: np.random.Generator) -> float:
    """sigma from the uniform prior times Z^N within the limits, by rejection."""
    count = MODES * len(PLANES)

    def weight(sigma: float) -> float:
        return normaliser(float(np.hypot(sigma, terms.identification_error))) ** count

    while True:
        sigma = float(rng.uniform(terms.low, terms.high))
        if rng.random() * weight(terms.high) < weight(sigma):
            return sigma


def draw_u(s: float, shape: tuple[int, ...], rng: np.random.Generator) -> FloatArray:
    """u from its normalised density."""
    u = nodes_of_u(s)
    density = scatter_density(u, np.array([s]))[0]
    cumulated = np.append(0.0, np.cumsum((density[1:] + density[:-1]) / 2))
    return np.asarray(np.interp(rng.random(shape) * cumulated[-1], cumulated, u))


def simulated(model: Model, theta: FloatArray, sigma: float, error: float, rng) -> ModalTest:  # type: ignore[no-untyped-def]
    """A modal test of the truth, from the normalised density of the data."""
    s = float(np.hypot(sigma, error))
    exact = model.frequencies_hz(theta[None], MODES)[0]
    measured = exact / draw_u(s, exact.shape, rng)
    modes = tuple(
        Mode(plane, order + 1, float(f), error * float(f) if error else NAN)
        for plane, row in zip(PLANES, measured, strict=True)
        for order, f in enumerate(row)
    )
    return ModalTest("calibration", modes, hanger=HANGER_3.id)


def quantities(model: Model) -> tuple[str, ...]:
    """What is ranked."""
    folded = [f"{side}({one}, {other})" for one, other in model.swaps for side in ("min", "max")]
    return (*model.parameter_names, "sigma", *folded, "log likelihood")


def values(model: Model, samples: FloatArray, log_likelihood: FloatArray) -> FloatArray:
    """All quantities (n, quantities) of draws with sigma (n, d + 1)."""
    names = model.parameter_names
    folded = [
        pick(samples[:, names.index(one)], samples[:, names.index(other)])
        for one, other in model.swaps
        for pick in (np.minimum, np.maximum)
    ]
    return np.column_stack([samples, *folded, log_likelihood])


def case_of(terms: Terms, number: int) -> Case:
    """One draw from the prior, its data, its posterior and its ranks."""
    rng = np.random.default_rng([terms.seed, number])
    model = build(terms.model, HANGER_3, THESIS)
    prior = model.prior
    theta = rng.uniform(prior.lower, prior.upper)
    sigma = draw_sigma(terms, rng)
    test = simulated(model, theta, sigma, terms.identification_error, rng)
    posterior = update([test], model, UpdateOptions(terms.samples, seed=number))
    drawn = values(model, posterior.samples, posterior.log_likelihood)[:: terms.thinning]
    column = len(prior.names)
    drawn = drawn[(terms.low <= drawn[:, column]) & (drawn[:, column] <= terms.high)]
    likelihood = ThesisLikelihood([test])
    predicted = likelihood.predict(model, theta[None])
    true_likelihood = likelihood.joint(predicted, np.array([sigma]))
    truth = values(model, np.append(theta, sigma)[None], true_likelihood)[0]
    below = (drawn < truth).sum(axis=0)
    ranks = (below + rng.random(len(truth))) / (len(drawn) + 1)
    return Case(ranks, len(drawn))


def p_values(ranks: FloatArray) -> tuple[float, float]:
    """Of uniform ranks (cases,): by their histogram (chi-square), by their distribution."""
    counts = np.histogram(ranks, max(2, min(BINS, len(ranks) // LEAST_IN_BIN)), (0, 1))[0]
    return float(chisquare(counts).pvalue), float(cramervonmises(ranks, "uniform").pvalue)


def histogram(ranks: FloatArray) -> str:
    """Counts of ranks in bins, as a line of bars; a middle bar is what is expected."""
    bars = " ▁▂▃▄▅▆▇█"
    counts = np.histogram(ranks, BINS, (0, 1))[0]
    heights = (4 * counts / (len(ranks) / BINS)).round().astype(int).clip(0, len(bars) - 1)
    return "".join(bars[height] for height in heights)


def report(name: str, labels: Sequence[str], cases: Sequence[Case]) -> bool:
    """Prints the table of a model class; whether all ranks are uniform."""
    ranks = np.array([case.ranks for case in cases])
    tests = 2 * len(labels)
    counted = int(np.median([case.counted for case in cases]))
    print(f"\n{name}: {len(cases)} draws from the prior, median of {counted} samples counted")
    print(f"{'quantity':24} {'ranks 0 to 1':{BINS}}  chi-square  ECDF   90 % covers")
    worst = 1.0
    for label, column in zip(labels, ranks.T, strict=True):
        by_bins, by_ecdf = p_values(column)
        worst = min(worst, by_bins, by_ecdf)
        covered = np.mean((column > 0.05) & (column < 0.95))
        print(f"{label:24} {histogram(column)}  {by_bins:10.3f}  {by_ecdf:.3f}  {covered:.1%}")
    adjusted = min(1.0, worst * tests)
    print(f"smallest p of {tests}: {worst:.5f}, by Bonferroni {adjusted:.4f} (bound {THRESHOLD})")
    return adjusted > THRESHOLD


def main() -> None:
    """Runs the trial; exit code 1 where ranks are not uniform."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("models", nargs="*", default=["beam1", "beam2"])
    parser.add_argument("--draws", type=int, default=300)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--samples", type=int, default=1000)
    parser.add_argument("--thinning", type=int, default=4)
    parser.add_argument("--sigma", type=float, nargs=2, default=(0.001, 0.03))
    parser.add_argument("--identification-error", type=float, default=0.0)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    passed = True
    pool = ProcessPoolExecutor(arguments.workers) if arguments.workers > 1 else nullcontext()
    with pool as executor:
        for name in arguments.models:
            passed &= run(name, arguments, executor)
    if not passed:
        raise SystemExit("ranks are not uniform")


def run(name: str, arguments: argparse.Namespace, executor: Executor | None) -> bool:
    """All draws of one model class; whether its ranks are uniform."""
    low, high = arguments.sigma
    error, samples = arguments.identification_error, arguments.samples
    terms = Terms(name, low, high, error, samples, arguments.thinning, arguments.seed)
    mapped = (executor.map if executor else map)(partial(case_of, terms), range(arguments.draws))
    cases = list(track(mapped, name, total=arguments.draws))
    labels = quantities(build(name, HANGER_3, THESIS))
    return report(name, labels, cases)


if __name__ == "__main__":
    main()
