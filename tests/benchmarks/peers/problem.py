"""The problems that every sampler is given, and the line in which each reports.

Beam 2 on hanger 3 of the thesis with its table 1.1 ("thesis") or with frequencies of an exact beam
that are known to 3e-5 ("sharp"): six parameters with uniform priors and the model error sigma,
uniform on [0, 1], as a seventh ("sampled") or integrated out ("integrated"). The frequencies and
the likelihood are the package's, `shm.models` and `shm.inference.sampler.likelihood`.
"""

from __future__ import annotations

import argparse
import json
import resource
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from importlib.metadata import version

import numpy as np

import shm
from shm.inference.problem.thesis_noise import ThesisLikelihood
from shm.models import THESIS, build
from shm.values import FloatArray
from tests.helpers.evidence_oracle import TABLES, modal_test
from tests.helpers.hangers import HANGER_3
from tests.helpers.sharp_oracle import LEAST_SIGMA, sharp_test

# Any point away from the walls and from the middle, where some parameters would be equal.
_FINGERPRINT_AT = 0.37


@dataclass(frozen=True)
class Outcome:
    """What a sampler says. What it does not give is None.

    `theta_f` and `theta_f_sd` are mean and standard deviation of the posterior of theta_F.
    """

    log_evidence: float | None
    log_evidence_sd: float | None
    effective_samples: float
    theta_f: float
    theta_f_sd: float


class Target:
    """Prior box and log likelihood; `evaluations` counts the parameter sets that were asked for."""

    def __init__(self, problem: str, repeat: int, sigma: str):
        test = sharp_test() if problem == "sharp" else modal_test(TABLES["1.1"])
        self.tests = [test] * repeat
        self.model = build("beam2", HANGER_3, THESIS)
        self.evaluations = 0
        self._likelihood = ThesisLikelihood(self.tests)
        self._sampled = sigma == "sampled"
        prior, sampled = self.model.prior, [0.0] * self._sampled
        self.names = [*prior.names, *["sigma"] * self._sampled]
        self.lower = np.append(prior.lower, sampled)
        self.upper = np.append(prior.upper, [1.0] * self._sampled)
        self.dimension = len(self.names)

    def parameters(self, unit: FloatArray) -> FloatArray:
        """Parameters (..., d) at points of the unit cube (..., d)."""
        return self.lower + (self.upper - self.lower) * unit

    def log_likelihood(self, theta: FloatArray) -> FloatArray:
        """Log likelihood (n,) of parameters (n, d); -inf outside the prior box."""
        theta = np.atleast_2d(np.asarray(theta, dtype=float))
        inside = ((theta >= self.lower) & (theta <= self.upper)).all(axis=1)
        values = np.full(len(theta), -np.inf)
        if inside.any():
            values[inside] = self._inside(theta[inside])
        return values

    def at(self, theta: FloatArray) -> float:
        """Log likelihood of one parameter set (d,)."""
        return float(self.log_likelihood(theta)[0])

    def fingerprint(self) -> float:
        """Log likelihood at one point of the unit cube: it tells a changed problem from this."""
        value = self.at(self.parameters(np.full(self.dimension, _FINGERPRINT_AT)))
        self.evaluations = 0
        return round(value, 6)

    def _inside(self, theta: FloatArray) -> FloatArray:
        self.evaluations += len(theta)
        predicted = self._likelihood.predict(self.model, theta[:, :6])
        if self._sampled:
            return self._likelihood.joint(predicted, theta[:, 6].clip(LEAST_SIGMA))
        return self._likelihood.marginal(predicted)


def moments(theta_f: FloatArray, weights: FloatArray | None = None) -> tuple[float, float]:
    """Mean and standard deviation of samples (n,) with `weights` (n,)."""
    mean = np.average(theta_f, weights=weights)
    return float(mean), float(np.sqrt(np.average((theta_f - mean) ** 2, weights=weights)))


def kish(weights: FloatArray) -> float:
    """Effective number of weighted samples (Kish 1965)."""
    return float(weights.sum() ** 2 / (weights**2).sum())


def distinct(points: FloatArray) -> int:
    """How many of the points (n, d) differ: resampling and refused moves leave copies."""
    return len(np.unique(points, axis=0))


def report(package: str, run: Callable[[Target, int], Outcome]) -> None:
    """Reads the case from the command line, runs the sampler, prints one line of JSON.

    The processor time is that of `run` in all its threads, compilation included, imports not.
    """
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--problem", choices=("thesis", "sharp"), default="thesis")
    parser.add_argument("--repeat", type=int, default=1)
    parser.add_argument("--sigma", choices=("sampled", "integrated"), default="sampled")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--limit", type=int, default=3600, help="processor time in s")
    arguments = parser.parse_args()
    resource.setrlimit(resource.RLIMIT_CPU, (arguments.limit, arguments.limit))
    target = Target(arguments.problem, arguments.repeat, arguments.sigma)
    fingerprint = target.fingerprint()
    started = time.process_time()
    outcome = run(target, arguments.seed)
    seconds = time.process_time() - started
    # An installation from a checkout may be older than what is run from it.
    released = shm.__version__ if package == "shm" else version(package)
    head = {"version": released, "fingerprint": fingerprint, "cpu_seconds": seconds}
    print(json.dumps(head | {"evaluations": target.evaluations} | asdict(outcome)), flush=True)
