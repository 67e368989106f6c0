"""A model error of its own for each group of modes: thesis (4.7) to (4.12)."""

from __future__ import annotations

import time
from collections.abc import Sequence

import numpy as np

from shm.errors import UsageError
from shm.inference import Progress, UpdateOptions
from shm.inference.answer.outcome import posterior_of
from shm.inference.answer.updating import infer
from shm.inference.options import silent
from shm.inference.problem.hanger_problem import Problem
from shm.inference.problem.thesis_noise import ThesisLikelihood
from shm.models import THESIS, Model
from shm.values import FloatArray, ModalTest, Posterior, Summary
from tests.benchmarks.thesis.modal_groups import groups


class GroupedLikelihood(ThesisLikelihood):
    """A model error of its own for each group of modes: thesis (4.7) to (4.12).

    Each is uniform on [0, 1] and integrated out by itself, so that the marginal likelihood is a
    product over the groups. What the rest of the sampler calls sigma is their root mean square
    over the modes; `joint` stands for the parameters alone.
    """

    def __init__(self, tests: Sequence[ModalTest], sigma: str):
        super().__init__(tests)
        self.by_name = groups(self.modes, sigma)
        self._parts = [
            ThesisLikelihood([ModalTest("part", tuple(self.modes[place] for place in own))])
            for own in self.by_name.values()
        ]

    def marginal(self, predicted: FloatArray) -> FloatArray:
        parts = zip(self._parts, self.by_name.values(), strict=True)
        terms = [part.marginal(predicted[:, own]) for part, own in parts]
        return np.asarray(np.sum(terms, axis=0))

    def joint(self, predicted: FloatArray, sigma: FloatArray) -> FloatArray:
        return self.marginal(predicted)

    def draw_sigma(self, predicted: FloatArray, rng: np.random.Generator) -> FloatArray:
        return self._mean([*self.draw_each(predicted, rng).values()])

    def draw_each(self, predicted: FloatArray, rng: np.random.Generator) -> dict[str, FloatArray]:
        """sigma (n,) of each group, by its name, given each prediction (n, measurements)."""
        parts = zip(self._parts, self.by_name.items(), strict=True)
        return {name: part.draw_sigma(predicted[:, own], rng) for part, (name, own) in parts}

    def most_likely_sigma(self, predicted: FloatArray) -> FloatArray:
        parts = zip(self._parts, self.by_name.values(), strict=True)
        return self._mean([part.most_likely_sigma(predicted[:, own]) for part, own in parts])

    def _mean(self, sigmas: Sequence[FloatArray]) -> FloatArray:
        weights = [len(own) for own in self.by_name.values()]
        return np.asarray(np.sqrt(np.average(np.square(sigmas), axis=0, weights=weights)))


def update_grouped(
    tests: Sequence[ModalTest],
    model: Model,
    sigma: str,
    options: UpdateOptions | None = None,
    progress: Progress = silent,
) -> tuple[Posterior, dict[str, Summary]]:
    """Return the posterior of `model`, and the model error of each group of modes by its name.

    `sigma` names the groups as `modal_groups` does. Raises UsageError for other priors than the
    thesis's.
    """
    if model.priors != THESIS:
        raise UsageError(
            f"a model error of each {sigma} is the thesis's: the noise of the field has its own.",
            remedy="Take the priors of the thesis.",
        )
    options = options or UpdateOptions()
    started = time.perf_counter()
    likelihood = GroupedLikelihood(tests, sigma)
    model.prepare(likelihood.highest_order, lambda done: progress(model.name, done))
    problem, rng = Problem(model, likelihood), np.random.default_rng(options.seed)
    inferred = infer(problem, options, rng, progress)
    posterior = posterior_of(problem, inferred, tests, options, rng, started)
    theta = np.column_stack([posterior.parameter(name) for name in model.parameter_names])
    drawn = likelihood.draw_each(
        likelihood.predict(model, theta), np.random.default_rng(options.seed)
    )
    return posterior, {name: Summary.of(values) for name, values in drawn.items()}
