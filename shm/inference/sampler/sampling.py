"""Draws and evidence of a posterior from its peaks.

Points along the valleys through the peaks show where the posterior is; adaptive importance sampling
gives evidence and draws. Where too few draws are effective, emcee continues from the same points.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from shm.inference.options import EMCEE, IMPORTANCE
from shm.inference.sampler.chain import run_chain
from shm.inference.sampler.density import Density, Peak, Points, climb
from shm.inference.sampler.importance import weigh
from shm.inference.sampler.likelihood import Covariance, Likelihood
from shm.inference.sampler.mixture import Weighted, effective, normalised, systematic
from shm.inference.sampler.valley import Draws, Proposal, Valley, valleys_through
from shm.values import ENOUGH_EFFECTIVE, FloatArray, IntArray


@dataclass(frozen=True)
class Numerics:
    """Numerical settings of the sampler; weights correct for all of them.

    `along` points go from a peak in `along_steps` each, in a valley `wider` than the posterior and
    then nearly as narrow, so that they follow its bends. Peaks are chosen by their density to the
    power of `tempered`, halfway from all alike to the most probable one alone. Points `farthest`
    below the highest log density weigh nothing, but a `fewest` are kept.

    The first mixture has `clusters` parts. Where less than `poor` of the wanted draws are
    effective, it begins again from `again` points where the weight is, `attempts` times in all.
    `enough` draws are effective for each sample to keep, `fewest_effective` in all: fewer repeat
    draws, more cost in proportion. Of a chain `candidates` times as many draws as are kept are
    weighted.
    """

    along: int = 160
    along_steps: int = 6
    wider: tuple[float, float] = (10.0, 1.5)
    tempered: float = 0.5
    farthest: float = 15.0
    fewest: int = 30
    clusters: int = 8
    attempts: int = 2
    poor: float = 0.7
    again: int = 100
    enough: float = 0.35
    candidates: int = 2
    fewest_effective: float = 1.5 * ENOUGH_EFFECTIVE


_SET = Numerics()


@dataclass(frozen=True, eq=False)
class Sampled:
    """Equal draws of a posterior `points` with its evidence, and how they were made."""

    points: Points
    log_evidence: float
    log_evidence_sd: float
    effective_sample_size: float
    r_hat: float
    method: str


def sample(
    density: Density,
    peaks: Sequence[Peak],
    samples: int,
    rng: np.random.Generator,
    sampler: str = IMPORTANCE,
    centres: FloatArray | None = None,
    on_progress: Callable[[float], None] = lambda done: None,
) -> Sampled:
    """Return so many equal draws of a posterior about its `peaks`, the best first.

    Where fewer than 200 are effective, emcee continues. Points along the valley begin at draws of
    the prior, or at `centres` (n, d).
    """
    final, points = weigh_along(density, peaks, samples, rng, centres, on_progress)
    on_progress(0.8)
    enough = final.effective_sample_size >= min(ENOUGH_EFFECTIVE, samples)
    if enough and sampler != EMCEE:
        drawn: Points = final.resampled(samples, rng).take(rng.permutation(samples))
        size, r_hat, method = final.effective_sample_size, final.r_hat, IMPORTANCE
    else:
        drawn, size, r_hat = _continue(density, final, points, samples, rng)
        method = EMCEE
    return Sampled(
        drawn,
        final.log_evidence,
        final.log_evidence_sd,
        min(size, float(samples)),
        r_hat,
        method,
    )


def weigh_along(
    density: Density,
    peaks: Sequence[Peak],
    samples: int,
    rng: np.random.Generator,
    centres: FloatArray | None = None,
    on_progress: Callable[[float], None] = lambda done: None,
) -> tuple[Weighted[Draws], FloatArray]:
    """Return weighted draws, enough for so many samples where it can be, and points (n, d) along
    the valleys that led to them.
    """
    wanted = max(_SET.enough * samples, _SET.fewest_effective)
    rough = density.rough
    points, nearest = draw_along(rough, peaks, rng, centres)
    on_progress(0.4)
    for attempt in range(_SET.attempts):
        best = points[[int(rough.log(points).argmax())]]
        whitening = most_likely_error(rough, best).whitening
        valleys = [Valley(rough, points, whitening)]
        if attempt == 0:
            valleys = valleys_through(rough, points, nearest, whitening)
        first = Proposal.through(valleys, points, _SET.clusters, rng)
        final = weigh(density, first, wanted, rng)
        if final.effective_sample_size > _SET.poor * wanted:
            break
        # The posterior is elsewhere than it seemed: start again from where the weight is.
        points = final.spread(_SET.again, rng)
    return final, points


def most_likely_error(density: Density, z: FloatArray) -> Covariance:
    """Return the covariance of the data about z (1, d) at its most probable size."""
    likelihood = density.likelihood
    return likelihood.nodes[int(likelihood.by_node(density.residual(z))[0].argmax())].covariance


def draw_along(
    density: Density,
    peaks: Sequence[Peak],
    rng: np.random.Generator,
    centres: FloatArray | None = None,
) -> tuple[FloatArray, IntArray]:
    """Return points (n, d) along the valleys through the peaks, most of them through the best, and
    the peak (n,) that each came from.

    They are draws of the prior, or the `centres` (n, d) instead, carried to the data: each climbs
    to the peak for its own draw of the noise, with its old place as the centre of the prior, so
    that they lie nearly as the posterior does (randomised maximum likelihood: Oliver, He and
    Reynolds 1996).
    """
    if centres is None:
        centres = density.fold(rng.standard_normal((_SET.along, density.dimension)))
    chances = normalised(_SET.tempered * np.array([peak.log for peak in peaks]))
    chosen = rng.choice(len(chances), len(centres), p=chances)
    z = np.array([peak.z for peak in peaks])[chosen]
    error = most_likely_error(density, peaks[0].z[None])
    for wider in _SET.wider:
        wide = error.scaled(wider)
        noise = rng.standard_normal((len(z), len(density.value))) @ wide.factor.T
        z, _ = climb(density, z, Likelihood.of(wide, 0.0), centres, noise, _SET.along_steps)
    log = density.log(density.fold(z))
    least = min(log.max() - _SET.farthest, np.sort(log)[-min(_SET.fewest, len(log))])
    likely = log >= least
    return density.connect(density.fold(z[likely]), rng), chosen[likely]


def _continue(
    density: Density,
    weighted: Weighted[Draws],
    points: FloatArray,
    samples: int,
    rng: np.random.Generator,
) -> tuple[Points, float, float]:
    """Return equal draws by emcee, how many of them are effective, and R-hat.

    Half of the walkers start at weighted draws, half at points along the valley. They walk in the
    rough density; what that is off by, weights of the draws correct.
    """
    drawn = weighted.resampled(len(points), rng).z
    chain, size, r_hat = run_chain(density.rough, np.vstack([drawn, points]), rng)
    count = _SET.candidates * samples
    chosen = chain[rng.choice(len(chain), count, replace=len(chain) < count)]
    exact = density.evaluate(chosen)
    weights = normalised(density.log_posterior(exact) - density.rough.log(chosen))
    rows = rng.permutation(systematic(weights, samples, rng))
    return exact.take(rows), size * effective(weights) / count, r_hat
