"""The whole diagnosis of one hanger: where, which effect, how far, what to measure next."""

from __future__ import annotations

import time
from collections.abc import Sequence

import numpy as np

from shm.gap.answer import answered, possible
from shm.gap.attribution import Attribution, Explanation
from shm.gap.contract import Fit, Hypothesis
from shm.gap.laws import mixed
from shm.gap.next_measurement import ranked
from shm.gap.observations import observed
from shm.gap.options import GapOptions, Progress, silent
from shm.gap.places import places
from shm.gap.problem import GapProblem
from shm.gap.remarks import doubtful, set_aside, usable
from shm.gap.setting_aside import cleared, outliers, with_outliers
from shm.gap.shrinkage import held_out, shrinkage
from shm.gap.trends import trends
from shm.gap.where import residuals
from shm.models import check_baseline
from shm.models.as_made import TENSION_RATIO
from shm.models.effects import check_effect_priors
from shm.values import (
    ENOUGH_EFFECTIVE,
    MOST_MISFIT_PERCENT,
    NAN,
    Cause,
    Diagnosis,
    EffectEstimate,
    FloatArray,
    Hanger,
    ModalTest,
    TensionEstimate,
)

_ATTRIBUTION = 0.85
"""The part of a diagnosis's time that goes into finding the cause."""

_AS_LIKELY = 1.5
"""Places of one effect whose log evidences differ by less are not told apart."""


def diagnose(
    tests: Sequence[ModalTest],
    hanger: Hanger,
    options: GapOptions | None = None,
    progress: Progress = silent,
) -> Diagnosis:
    """Where the baseline and the tests of a hanger differ, which effect causes it, what it changes.

    The same tests, options and seed give the same answer. Raises BadInput where the tests cannot
    be used (what can be used in spite of a fault is used, and `Diagnosis.remarks` says so),
    UsageError for a model class, effect, test or order that is not there.

    Example:
        >>> diagnosis = shm.diagnose(tests, hanger, baseline="beam1")
        >>> diagnosis.leading.effect
        'point_mass'
    """
    options = options or GapOptions()
    started = time.perf_counter()
    check_effect_priors(hanger)
    check_baseline(options.baseline, hanger)
    found = usable(tests, hanger)
    whole = GapProblem(hanger, options.baseline, observed(found.tests, hanger))
    rng = np.random.default_rng(options.seed)
    clear = cleared(whole, options, rng, lambda label, done: progress(label, _ATTRIBUTION * done))
    problem, attribution = clear.problem, clear.attribution
    progress("shrinkage", _ATTRIBUTION)
    answer = answered(attribution)
    before, leading = attribution.baseline, attribution.leading
    after = leading.best.fit if leading else None
    aside, doubted = (outliers(clear, e, answer[0][1]) for e in (clear.aside, clear.doubted))
    held = held_out(problem, before, after, options.hold_out, rng)
    progress("next measurement", (1 + _ATTRIBUTION) / 2)
    following = ranked(problem, _contenders(attribution))
    progress("next measurement", 1.0)
    tensions = [_tension(problem, f, rng) for f in ([(1.0, before)], possible(attribution))]
    return Diagnosis(
        hanger=hanger.id,
        baseline=options.baseline,
        tests=tuple(test.id for test in found.tests),
        where=with_outliers(clear, residuals(problem, before, after, held), before, after),
        trends=trends(problem, before),
        places=places(problem, before),
        no_gap_probability=attribution.no_gap_probability,
        unexplained_probability=attribution.unexplained_probability,
        causes=tuple(_cause(problem, each) for each in attribution.explanations),
        groups=attribution.groups,
        invisible=attribution.invisible,
        left_out=options.without,
        fit_p_value=attribution.p_value,
        model_error_percent=100 * answer[0][1].model_error,
        shrinkage=shrinkage(problem, before, after, held),
        tension_before_n=tensions[0],
        tension_after_n=tensions[1],
        next_measurements=following,
        remarks=(
            *_states(problem, before, after, tensions[1]),
            *found.remarks,
            *clear.misnumbered,
            *set_aside(aside, clear.otherwise),
            *doubtful(doubted),
        ),
        seed=options.seed,
        seconds=time.perf_counter() - started,
        outliers=aside,
    )


def _states(
    problem: GapProblem, before: Fit, after: Fit | None, tension_n: TensionEstimate
) -> tuple[str, ...]:
    """What keeps the answer from being taken at its word, to be read first."""
    found = []
    for fit in (before, *((after,) if after else ())):
        if fit.effective < ENOUGH_EFFECTIVE:
            what = fit.hypothesis.name.replace("_", " ") or f"baseline {problem.baseline}"
            found.append(
                f"The sampler failed for {what}: {fit.effective:.0f} effective draws, "
                f"{ENOUGH_EFFECTIVE} are needed. Its probability and its tension are uncertain."
            )
    nominal_n = problem.hanger.nominal_tension_n
    if nominal_n and (
        tension_n.q95 > 0.98 * TENSION_RATIO[1] * nominal_n
        or tension_n.q05 < 1.02 * TENSION_RATIO[0] * nominal_n
    ):
        found.append(
            f"The tension lies at the bound of its prior ({TENSION_RATIO[0]:g} to "
            f"{TENSION_RATIO[1]:g} times nominal): check nominal_tension_n and the description."
        )
    best = after or before
    count = problem.design.frequencies
    rest = (problem.observations.value - best.predicted)[:count]
    misfit_percent = 100 * float(np.sqrt(np.mean(rest**2)))
    if misfit_percent > MOST_MISFIT_PERCENT:
        found.append(
            f"The leading explanation misses the frequencies by {misfit_percent:.1f} % (root mean "
            "square): it does not fit this hanger."
        )
    return tuple(found)


def _cause(problem: GapProblem, explanation: Explanation) -> Cause:
    best = explanation.best
    return Cause(
        effect=explanation.effect,
        at=best.hypothesis.at,
        probability=explanation.probability,
        log_bayes_factor=explanation.log_bayes_factor,
        log_fit=explanation.log_fit,
        log_occam=explanation.log_occam,
        parameters=_estimates(problem, best.posterior) if best.posterior else (),
        method=best.method,
        group=explanation.group,
        also_at=tuple(
            each.hypothesis.at
            for each in explanation.variants
            if each is not best and each.log_evidence > best.log_evidence - _AS_LIKELY
        ),
    )


def _estimates(problem: GapProblem, fit: Fit) -> tuple[EffectEstimate, ...]:
    """The effects' own parameters, which stand behind those of the hanger."""
    own = len(problem.names(Hypothesis()))
    samples = problem.theta(fit.hypothesis, fit.draws)[:, own:]
    parameters = problem.coordinates(fit.hypothesis).parameters[own:]
    return tuple(
        EffectEstimate(each.name, each.unit, *_summary(values))
        for each, values in zip(parameters, samples.T, strict=True)
    )


def _contenders(attribution: Attribution) -> list[Fit]:
    """The fits that further measurements should tell apart, the likeliest first."""
    weighed = [(attribution.no_gap_probability, attribution.baseline)]
    weighed += [
        (each.probability, each.best.fit) for each in attribution.explanations if each.best.fit
    ]
    return [fit for _, fit in sorted(weighed, key=lambda pair: -pair[0])]


def _tension(
    problem: GapProblem, fits: Sequence[tuple[float, Fit]], rng: np.random.Generator
) -> TensionEstimate:
    """The tension over some fits, each with its weight; NaN of a bar without any."""
    if not problem.hanger.nominal_tension_n:
        return TensionEstimate(NAN, NAN, NAN, NAN)
    weight = np.array([weight for weight, _ in fits])
    draws = [problem.tension_n(fit.hypothesis, fit.draws) for _, fit in fits]
    samples = mixed(draws, weight, rng)
    low, high = (float(each) for each in np.quantile(samples, [0.025, 0.975]))
    return TensionEstimate(*_summary(samples), low, high)


def _summary(samples: FloatArray) -> tuple[float, float, float, float]:
    """Mean, standard deviation, 5 and 95 % quantiles."""
    low, high = np.quantile(samples, [0.05, 0.95])
    return float(samples.mean()), float(samples.std(ddof=1)), float(low), float(high)
