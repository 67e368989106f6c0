"""A stand-in for the sampler where the flow, not the posterior, is tested: quick, seeded alike.

Tension is looked up from the mean measured frequency; the scatter is one percent. All other
parameters stay in the middle of their priors.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache

import numpy as np

from shm import plausibility
from shm.inference import UpdateOptions
from shm.models import Model
from shm.pipeline import steps
from shm.plausibility.bars import of_another_bar
from shm.values import Hanger, ModalTest, Posterior, Selection
from tests.helpers.workspaces import modes_of

_TENSIONS = (0.5, 0.8, 1.0, 1.2, 1.5)


def stand_in(put: Callable[[object, str, object], None], *, any_bar: bool = True) -> None:
    """Takes the sampler's place; `put` is `setattr`, or a monkeypatch's, which undoes it.

    Of `any_bar`, nothing doubts which hanger modes are of: that fits each candidate to each test.
    """
    for verb in (update, refresh, select):
        put(steps, verb.__name__, verb)
    if any_bar:
        others = tuple(check for check in plausibility.CHECKS if check is not of_another_bar)
        put(plausibility, "CHECKS", others)


def update(tests: Sequence[ModalTest], model: Model, options: UpdateOptions) -> Posterior:
    rng = np.random.default_rng(options.seed)
    measured = np.mean([mode.frequency_hz for test in tests for mode in test.modes])
    centre = np.interp(measured, [_mean_hz(model.hanger, t) for t in _TENSIONS], _TENSIONS)
    middle = (model.prior.lower + model.prior.upper) / 2
    samples = np.tile(np.append(middle, 0.0), (options.samples, 1))
    samples[:, 0] = rng.normal(centre, 0.01, options.samples)
    samples[:, -1] = rng.uniform(0, 0.01, options.samples)
    return Posterior(
        model=model.name,
        hanger=tests[0].hanger,
        names=(*model.parameter_names, "sigma"),
        units=(*(model.units[name] for name in model.parameter_names), "1"),
        samples=samples,
        log_likelihood=rng.normal(size=options.samples),
        most_probable=np.concatenate([[centre], middle[1:], [0.005]]),
        nominal_tension_n=model.hanger.nominal_tension_n,
        log_evidence=0.0,
        log_evidence_sd=0.1,
        effective_sample_size=float(options.samples),
        r_hat=1.0,
        evaluations=options.samples,
        predicted=(),
        tests=tuple(test.id for test in tests),
        seed=options.seed,
        seconds=0.0,
    )


def refresh(
    tests: Sequence[ModalTest], model: Model, known: Posterior, options: UpdateOptions
) -> Posterior:
    assert known.model == model.name
    return update(tests, model, options)


@cache
def _mean_hz(hanger: Hanger, tension: float) -> float:
    return float(np.mean([mode.frequency_hz for mode in modes_of(hanger, tension)]))


def select(
    tests: Sequence[ModalTest], models: Sequence[Model], options: UpdateOptions
) -> Selection:
    posteriors = tuple(update(tests, model, options) for model in models)
    return Selection(posteriors, (1 / len(models),) * len(models))
