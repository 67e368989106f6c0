"""The whole diagnosis of one hanger: where, which effect, how far, what to measure next."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from shm.gap.causes.baseline import choose_baseline, find_richer
from shm.gap.causes.damping import remark_on_damping
from shm.gap.causes.misfit import doubt_orders, refuse_misfit
from shm.gap.causes.outliers import (
    Cleared,
    describe_doubtful,
    describe_excluded,
    describe_outliers,
    exclude_gross_errors,
    residuals_with_outliers,
)
from shm.gap.causes.places import AS_LIKELY, list_other_places, places, split_place
from shm.gap.causes.residuals import check_hold_out, held_out, residuals, shrinkage, trends
from shm.gap.causes.search import Attribution, Explanation, answered, check_effects, possible
from shm.gap.hypotheses.contract import Fit, GapOptions, Hypothesis
from shm.gap.hypotheses.coordinates import is_place
from shm.gap.hypotheses.data_checks import usable
from shm.gap.hypotheses.observations import observed
from shm.gap.hypotheses.problem import GapProblem
from shm.gap.next_measurement.measurement_plan import ranked
from shm.inference.options import Progress, silent
from shm.inference.problem.data_checks import CheckedData
from shm.inference.sampler.mixture import systematic
from shm.models.effects import check_effect_priors
from shm.plausibility.bars import Known, doubt_of
from shm.values import (
    ENOUGH_EFFECTIVE,
    NAN,
    Cause,
    Diagnosis,
    EffectEstimate,
    FloatArray,
    Hanger,
    ModalTest,
    NextMeasurement,
    TensionEstimate,
)
from shm.values.diagnosis import joined
from shm.values.verdict import DOUBTFUL, MIN_FIT_P_VALUE, SHAPES_OFF

_ATTRIBUTION = 0.85
"""The part of a diagnosis's time that goes into finding the cause."""

_OF_NOTE = 0.2  # of the leading probability: what is less moves the answer little
_TENSION_DRAWS = 4000  # numerical: a 95 % interval to 2 % of its width


def diagnose(
    tests: Sequence[ModalTest],
    hanger: Hanger,
    options: GapOptions | None = None,
    progress: Progress = silent,
) -> Diagnosis:
    """Return where baseline and tests of a hanger differ, which effect causes it, what it changes.

    The same tests, options and seed give the same answer. Raises BadInput where the tests cannot
    be used (what can be used in spite of a fault is used, and `Diagnosis.remarks` says so) or where
    even the best explanation misses their frequencies by more than 10 %, UsageError for a model
    class, effect, test or order that is not there.

    Example:
        >>> diagnosis = shm.diagnose(tests, hanger, baseline="beam1")
        >>> diagnosis.leading.effect
        'point_mass'
    """
    return examined(tests, hanger, options or GapOptions(), progress)[0]


def examined(
    tests: Sequence[ModalTest], hanger: Hanger, options: GapOptions, progress: Progress = silent
) -> tuple[Diagnosis, Attribution]:
    """Return the diagnosis with the evidence that it rests on."""
    started, rng = time.perf_counter(), np.random.default_rng(options.seed)
    found, doubts, clear = _search(tests, hanger, options, rng, progress)
    problem, attribution = clear.problem, clear.attribution
    progress("shrinkage", _ATTRIBUTION)
    answer, before = answered(attribution), attribution.baseline
    after = attribution.leading.best.fit if attribution.leading else None
    best = answer[0][1]
    excluded, doubted = (describe_outliers(clear, e, best) for e in (clear.excluded, clear.doubted))
    held = held_out(problem, before, after, options.hold_out)
    after_n = _tension(problem, possible(attribution), rng)
    before_n = _tension(problem, [(1.0, before)], rng)
    where = residuals(problem, before, after, held)
    return Diagnosis(
        hanger=hanger.id,
        baseline=problem.model.name,
        tests=tuple(test.id for test in found.tests),
        where=residuals_with_outliers(clear, where, before, after),
        trends=trends(problem, before),
        places=places(problem, attribution),
        no_gap_probability=attribution.no_gap_probability,
        unexplained_probability=attribution.unexplained_probability,
        causes=_causes(problem, attribution.explanations),
        groups=attribution.groups,
        invisible=attribution.invisible,
        left_out=options.without,
        fit_p_value=min(attribution.p_values),
        model_error_percent=100 * best.model_error,
        shrinkage=shrinkage(problem, before, after, held),
        tension_before_n=before_n,
        tension_after_n=after_n,
        next_measurements=_following(problem, attribution, progress),
        remarks=(
            *doubts,
            *_states(problem, before, after, (before_n, after_n)),
            *remark_on_damping(clear.whole.observations),
            *found.remarks,
            *_shapes_off(attribution.p_values),
            *describe_excluded(clear, excluded),
            *describe_doubtful(doubted),
        ),
        seed=options.seed,
        seconds=time.perf_counter() - started,
        outliers=excluded,
        widest_swing_m=_widest_motion_m(found.tests),
        effective_draws=_effective_draws(answer),
        slenderness=hanger.slenderness(before_n.mean),
    ), attribution


def _search(
    tests: Sequence[ModalTest],
    hanger: Hanger,
    options: GapOptions,
    rng: np.random.Generator,
    progress: Progress,
) -> tuple[CheckedData, tuple[str, ...], Cleared]:
    """Return the data as they count, doubts that they are of this hanger, and the causes."""
    check_effects(options.without)
    check_effect_priors(hanger)
    found = usable(tests, hanger)
    check_hold_out(observed(found.tests, hanger).design, options.hold_out)
    whole = choose_baseline(found.tests, hanger, options, rng, progress)
    doubts = _of_another(found.tests, hanger)

    def report(label: str, done: float) -> None:
        progress(label, _ATTRIBUTION * done)

    clear = exclude_gross_errors(whole, options, rng, report)
    leading = clear.attribution.leading
    if leading is not None and not options.baseline:
        richer = find_richer(whole, leading.best.hypothesis)
        if richer is not None:
            clear = exclude_gross_errors(richer, options, rng, report)
    orders = doubt_orders(clear.problem, clear.attribution)
    refuse_misfit(clear.problem, clear.attribution, (*orders, *found.other_unit, *doubts))
    return replace(found, remarks=(*found.remarks, *orders)), doubts, clear


def _effective_draws(answer: Sequence[tuple[float, Fit]]) -> float:
    """Return the fewest effective draws of what the answer rests on; NaN where none was sampled."""
    leading = max(weight for weight, _ in answer)
    counts = [fit.effective for weight, fit in answer if weight > _OF_NOTE * leading]
    known = [each for each in counts if math.isfinite(each)]
    return min(known) if known else NAN


def _widest_motion_m(tests: Sequence[ModalTest]) -> float:
    swings = [test.widest_swing_m for test in tests]
    return max((each for each in swings if each > 0), default=NAN)


def _following(
    problem: GapProblem, attribution: Attribution, progress: Progress
) -> tuple[NextMeasurement, ...]:
    progress("next measurement", (1 + _ATTRIBUTION) / 2)
    found = ranked(problem, _contenders(attribution))
    progress("next measurement", 1.0)
    return found


def _of_another(tests: Sequence[ModalTest], hanger: Hanger) -> tuple[str, ...]:
    """Return remarks on tests that are not of the hanger as described."""
    doubts = {test.id: doubt_of(test, Known(hanger), []) for test in tests}
    return tuple(f"{DOUBTFUL}: test {id_}. {each.text}" for id_, each in doubts.items() if each)


def _states(
    problem: GapProblem, before: Fit, after: Fit | None, tensions_n: Sequence[TensionEstimate]
) -> tuple[str, ...]:
    """Return remarks on what makes the answer uncertain, to be read first."""
    found = []
    for fit in (before, *((after,) if after else ())):
        if fit.effective < ENOUGH_EFFECTIVE:
            what = fit.hypothesis.name.replace("_", " ") or f"baseline {problem.model.name}"
            found.append(
                f"The sampler failed for {what}: {fit.effective:.0f} effective draws, "
                f"{ENOUGH_EFFECTIVE} are needed. Its probability and its tension are uncertain."
            )
    nominal_n = problem.hanger.nominal_tension_n
    least, most = problem.hanger.assumptions.tension_ratio.bounds
    if nominal_n and any(
        each.q95 > 0.98 * most * nominal_n or each.q05 < 1.02 * least * nominal_n
        for each in tensions_n
    ):
        found.append(
            f"The tension lies at the bound of its prior ({least:g} to "
            f"{most:g} times nominal): check nominal_tension_n and the description."
        )
    return tuple(found)


def _shapes_off(p_values: tuple[float, float]) -> tuple[str, ...]:
    """Return a remark where the frequencies fit and the shapes do not."""
    of_frequencies, of_shapes = p_values
    if not of_shapes < MIN_FIT_P_VALUE <= of_frequencies:
        return ()
    return (
        f"{SHAPES_OFF}: by the most probable explanation the frequencies fit within their errors, "
        "the shapes do not. Check the places and directions of the sensors and the standard "
        "deviations of the shapes.",
    )


def _causes(problem: GapProblem, explanations: Sequence[Explanation]) -> tuple[Cause, ...]:
    """Return the causes.

    A pair is fitted where its parts are likeliest, and may be where these are about as likely.
    """
    near = {each.effect: _near_best(each) for each in explanations}
    found = []
    for each in explanations:
        cause = _cause(problem, each, near[each.effect][1:])
        parts = list(zip(cause.effects, cause.places, strict=True))
        also = [
            joined(at if part == effect else place for part, place in parts)
            for effect in cause.effects
            for at in near.get(effect, ())
            if len(parts) > 1
        ]
        every = dict.fromkeys(at for at in (*cause.also_at, *also) if at != cause.at)
        found.append(replace(cause, also_at=tuple(every)))
    return tuple(found)


def _near_best(explanation: Explanation) -> tuple[str, ...]:
    """Return the place of an effect, then others whose evidence is about that of the best."""
    best = explanation.best
    others = [
        each.hypothesis.at
        for each in explanation.variants
        if each is not best and each.log_evidence > best.log_evidence - AS_LIKELY
    ]
    return best.hypothesis.at, *others


def _cause(problem: GapProblem, explanation: Explanation, near: tuple[str, ...]) -> Cause:
    """Return a cause with its sizes; without evidence where a scan has left it far behind."""
    best = explanation.best
    is_known = best.fit is not None
    return Cause(
        effect=explanation.effect,
        at=best.hypothesis.at,
        probability=explanation.probability,
        log_bayes_factor=explanation.log_bayes_factor if is_known else NAN,
        log_fit=explanation.log_fit if is_known else NAN,
        log_occam=explanation.log_occam if is_known else NAN,
        parameters=_estimates(problem, best.posterior) if best.posterior else (),
        method=best.method,
        group=explanation.group,
        also_at=(
            *(list_other_places(problem, best.posterior) if best.posterior else ()),
            *near,
        ),
    )


def _estimates(problem: GapProblem, fit: Fit) -> tuple[EffectEstimate, ...]:
    coordinates = problem.coordinates(fit.hypothesis)
    values = coordinates.effect_values(fit.draws)
    length_m = problem.hanger.length_m
    return tuple(
        EffectEstimate(
            each.name,
            each.unit,
            *summarise(split_place(column, length_m)[0] if is_place(each) else column),
        )
        for each, column in zip(coordinates.effects, values.T, strict=True)
    )


def _contenders(attribution: Attribution) -> list[Fit]:
    """Return the fits that further measurements should tell apart, the likeliest first."""
    weighed = [(attribution.no_gap_probability, attribution.baseline)]
    weighed += [
        (each.probability, each.best.fit) for each in attribution.explanations if each.best.fit
    ]
    return [fit for _, fit in sorted(weighed, key=lambda pair: -pair[0])]


def _tension(
    problem: GapProblem, fits: Sequence[tuple[float, Fit]], rng: np.random.Generator
) -> TensionEstimate:
    """Return the tension over some fits, each with its weight; NaN of a bar without any."""
    if not problem.hanger.nominal_tension_n:
        return TensionEstimate(NAN, NAN, NAN, NAN)
    return tension_estimate(tension_draws_n(problem, fits, rng))


def tension_draws_n(
    problem: GapProblem, fits: Sequence[tuple[float, Fit]], rng: np.random.Generator
) -> FloatArray:
    """Return equal draws (n,) of the tension over some fits, each with its weight.

    That of the hanger alone is averaged over the model classes.
    """
    alone = [(odds, rival, rival.alone) for odds, rival in problem.rivals if rival.alone]
    parts = []
    for weight, fit in fits:
        if fit.hypothesis == Hypothesis() and alone:
            parts += [(weight * odds, rival, rival_fit) for odds, rival, rival_fit in alone]
        else:
            parts.append((weight, problem, fit))
    share = np.concatenate([np.full(len(f.draws), w / len(f.draws)) for w, _, f in parts])
    draws = [each.tension_n(f.hypothesis, f.draws, rng) for _, each, f in parts]
    rows = systematic(share / share.sum(), _TENSION_DRAWS, rng)
    return np.asarray(np.concatenate(draws)[rows])


def tension_estimate(samples: FloatArray) -> TensionEstimate:
    """Of equal draws (n,) of a tension; NaN of a bar without any."""
    if not np.isfinite(samples).all():
        return TensionEstimate(NAN, NAN, NAN, NAN)
    low, high = (float(each) for each in np.quantile(samples, [0.025, 0.975]))
    return TensionEstimate(*summarise(samples), low, high)


def summarise(samples: FloatArray) -> tuple[float, float, float, float]:
    """Return mean, standard deviation, 5 and 95 % quantiles."""
    low, high = np.quantile(samples, [0.05, 0.95])
    return float(samples.mean()), float(samples.std(ddof=1)), float(low), float(high)
