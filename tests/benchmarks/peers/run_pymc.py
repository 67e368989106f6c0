"""PyMC's `sample_smc`, default settings (2000 draws, independent Metropolis steps, 2 chains).

The likelihood is a black box to it, evaluated point by point. Its log evidence is the log of the
mean of the chains' evidences; their scatter is no standard error with two chains, so none is
claimed.
"""

from __future__ import annotations

import logging

import numpy as np
import pymc
import pytensor.tensor as pt
import xarray
from problem import Outcome, Target, distinct, moments, report
from pytensor.graph.op import Op
from scipy.special import logsumexp

_CHAINS = 2


class LogLikelihood(Op):
    """The target's log likelihood as an operation of pytensor."""

    itypes = (pt.dvector,)
    otypes = (pt.dscalar,)

    def __init__(self, target: Target):
        self._target = target

    def perform(self, node: object, inputs: list, outputs: list) -> None:
        """Evaluates one parameter set (d,)."""
        outputs[0][0] = np.asarray(self._target.at(inputs[0]))


def run(target: Target, seed: int) -> Outcome:
    """One run."""
    logging.getLogger("pymc").setLevel(logging.ERROR)
    with pymc.Model():
        theta = [
            pymc.Uniform(name, low, high)
            for name, low, high in zip(target.names, target.lower, target.upper, strict=True)
        ]
        pymc.Potential("likelihood", LogLikelihood(target)(pt.stack(theta)))
        trace = pymc.sample_smc(
            chains=_CHAINS,
            cores=1,
            random_seed=seed,
            progressbar=False,
            compute_convergence_checks=False,
        )
    evidences = np.array([last(chain) for chain in trace.sample_stats["log_marginal_likelihood"]])
    draws = trace.posterior[target.names].to_array().values.reshape(target.dimension, -1).T
    evidence = float(logsumexp(evidences) - np.log(_CHAINS))
    return Outcome(evidence, None, distinct(draws), *moments(draws[:, 0]))


def last(chain: xarray.DataArray) -> float:
    """The log evidence of a chain: PyMC keeps one figure a stage, in a ragged array of objects."""
    stages = np.ravel(chain.values[()] if chain.ndim == 0 else chain.values)
    return float(np.ravel(stages[-1])[-1])


if __name__ == "__main__":
    report("pymc", run)
