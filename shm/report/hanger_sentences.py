"""The paragraph that an engineer reads first: tension, what changed, which model, what next."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from shm.report import formatting, open_warnings
from shm.report.contents import HangerReport
from shm.report.diagnosis_summary import next_step
from shm.report.hanger_status import UNDETERMINED
from shm.report.hanger_summary import (
    BASELINE_ALONE,
    BASELINE_AND_CHANGE,
    BASELINE_TESTS,
    LATEST_TEST,
)
from shm.values import PredictedFrequency
from shm.values.modes import FIRST_ORDERS
from shm.values.posterior import MOST_R_HAT

# Judgement: half the limit of a misfit, 1 %, is worth a diagnosis;
# three names are what a sentence bears.
_WORTH_DIAGNOSING_PERCENT = 0.5
_MOST_NAMED = 3
_LEAST_PERCENT = 0.01  # below what any test tells of a frequency
_BASIS = {
    LATEST_TEST: "Its tension is {tension} by test {test}{day}.",
    BASELINE_TESTS: "Its tension is {tension} by its baseline, test {test}{day}.",
    BASELINE_AND_CHANGE: "Its tension is now {tension}.",
    BASELINE_ALONE: "Its tension was {tension} at the baseline; the tests since do not show "
    "whether it changed.",
}
"""The sentence on the tension, by what it rests on."""


def summary(data: HangerReport) -> str:
    """Return state, action and tension, then the details."""
    return f"{data.now.message.words} {_tension(data)} {details(data)}"


def why(data: HangerReport) -> str:
    """Return every doubt; the numbers stand below, among the facts."""
    return _joined(*_doubts(data), open_warnings.dated_by_receipt(data.now.undated))


def _doubts(data: HangerReport) -> tuple[str, ...]:
    """Return what must not wait until the details: warnings, an outdated baseline, caveats."""
    return data.now.message.reasons


def details(data: HangerReport) -> str:
    """Return why, and how sure: everything after state, action and tension."""
    neighbours = data.neighbours.sentence if data.neighbours else ""
    undated = open_warnings.dated_by_receipt(data.now.undated)
    # A doubt that says by how much the model misses is not said twice, nor what to do about it.
    is_stated = data.averaged.states_misfit
    model = f"{_chosen(data)}." if is_stated else _model(data)
    further = _further_advice(data, is_misfit_stated=is_stated)
    return _joined(
        *_doubts(data), over_time(data), neighbours, model, _outside(data), *further, undated
    )


def over_time(data: HangerReport) -> str:
    """Return what follows from the change, how the tension creeps, what the period holds."""
    return _joined(
        "Once the change is explained, set a new baseline (`shm drift rebaseline`)."
        if data.now.called
        else "",
        data.creep.words if data.creep else "",
        in_period(data),
    )


def fit(data: HangerReport) -> str:
    """Return how the model class fits the latest test, and what to do to know more."""
    return _joined(_model(data), _outside(data), *_further_advice(data))


def _joined(*sentences: str) -> str:
    return " ".join(each for each in sentences if each)


def advice(data: HangerReport) -> tuple[str, ...]:
    """Return what to do next, most urgent first; never empty."""
    first, further = data.now.message.lead, _further_advice(data)
    return further if further and first.urgency == "none" else (first.action, *further)


def _further_advice(data: HangerReport, *, is_misfit_stated: bool = False) -> tuple[str, ...]:
    diagnose = "" if is_misfit_stated and data.diagnosis is None else _diagnose(data)
    made = (_quality(data), _sampling(data), _width(data), diagnose, _thermometer(data))
    return tuple(each for each in made if each)


def _tension(data: HangerReport) -> str:
    now = data.now
    if not now.is_determined:
        span = formatting.span(data.tension_n.in_unit(data.tension_unit))
        return f"{UNDETERMINED} (90 % interval {span} {data.tension_unit.name})."
    tension = formatting.with_half(data.tension_n, data.tension_unit)
    day = f" of {data.latest.time:%Y-%m-%d}" if data.latest.time else ""
    return _BASIS[now.basis].format(tension=tension, test=data.latest.id, day=day)


def in_period(data: HangerReport) -> str:
    """Return what the period of the report holds, and what changed in it against its start."""
    if data.period is None:
        return ""
    tests = formatting.counted(len(data.trend), "test")
    raised = formatting.counted(len(data.alerts), "alert")
    called = formatting.listed(
        [each.words for each in data.states.within(data.period).changes]
        or ["no change was detected"]
    )
    return f"In the period {data.period}: {tests}, {raised}; {called}; {_course(data)}."


def _course(data: HangerReport) -> str:
    if len(data.trend) < 2:
        return "with one test in it nothing in it can be compared"
    first, last = data.trend[0], data.trend[-1]
    change = formatting.signed_percent(last.tension_n.since(first.tension_n))
    return f"from its first test ({first.test}) to its last the tension moved by {change}"


def _model(data: HangerReport) -> str:
    misfits = data.misfits_percent
    if not misfits:
        return f"{_chosen(data)}."
    count = (
        "one measured frequency" if len(misfits) == 1 else f"{len(misfits)} measured frequencies"
    )
    if _misses(data):
        off = f"{data.posterior.misfit_percent:.1f} % (root mean square)"
        return f"{_chosen(data)}. It misses {count} by {off}."
    rms = max(_rms_percent(data), _LEAST_PERCENT)
    within = f"{'better than ' * (rms == _LEAST_PERCENT)}{formatting.plain(rms, 2)}"
    return f"{_chosen(data)}. It predicts {count} to {within} % (root mean square)."


def _rms_percent(data: HangerReport) -> float:
    """Return the root mean square of the misfits; NaN where no mode was measured."""
    residuals = [off.mean for _, off in data.misfits_percent]
    return float(np.sqrt(np.mean(np.square(residuals)))) if residuals else math.nan


def _misses(data: HangerReport) -> bool:
    """Return True if the class is so far off that its posterior doubts the description.

    Its predictions fit the modes all the same, with the model error learnt from them.
    """
    return not data.posterior.fits


def _outside(data: HangerReport) -> str:
    """Name the modes that the model class misses by more than both uncertainties."""
    misfits = [] if _misses(data) or data.diagnosis else data.misfits_percent
    outside = [mode for mode, off in misfits if not off.low <= 0 <= off.high]
    if not misfits:
        return ""
    # So many may well lie outside by chance: two standard deviations.
    by_chance = 0.1 * len(misfits) + 2 * math.sqrt(0.09 * len(misfits))
    if len(outside) > by_chance:
        return f"{_outliers(outside)}: the model does not explain these, and no diagnosis was made."
    chance = f"{_outliers(outside)}, no more than by chance" if outside else ""
    start = chance or "Each lies within its 90 % interval"
    if _rms_percent(data) >= _WORTH_DIAGNOSING_PERCENT:
        return f"{start}, but the intervals are so wide that they may hide a misfit."
    return f"{start}: the model explains what was measured."


def _outliers(modes: Sequence[PredictedFrequency]) -> str:
    """Return `Transverse 2 and longitudinal 4 lie outside the 90 % interval`, `5 modes lie ...`."""
    wording = formatting.listed([f"{each.plane} {each.order}" for each in modes])
    named = f"{wording[0].upper()}{wording[1:]}"
    who = named if len(modes) <= _MOST_NAMED else formatting.counted(len(modes), "mode")
    return f"{who} {'lies' if len(modes) == 1 else 'lie'} outside the 90 % interval"


def _chosen(data: HangerReport) -> str:
    model = formatting.model_class(data.posterior.model)
    if data.selection is None or len(data.selection.posteriors) < 2:
        return f"The model class is {model}"
    names = [formatting.model_class(posterior.model) for posterior in data.selection.posteriors]
    if model not in names:
        return f"The model class is {model}"
    rivals = formatting.listed([each for each in names if each != model])
    if names[0] != model:
        return f"The model class is {model}, less probable than {names[0]}"
    return f"The model class is {model}, the most probable (compared with {rivals})"


def _quality(data: HangerReport) -> str:
    doubted = [check for check in data.quality if check.verdict in ("warning", "refused")]
    others = [check.name for check in doubted if check.name != FIRST_ORDERS]
    requests = [
        f"try to capture {check.found.removesuffix(' not found')}"
        for check in doubted
        if check.name == FIRST_ORDERS
    ]
    requests += [f"improve {formatting.listed(others)}"] if others else []
    return f"At the next test, {formatting.listed(requests)}." if requests else ""


def _sampling(data: HangerReport) -> str:
    if not data.posterior.r_hat > MOST_R_HAT:
        return ""
    return (
        f"The sampling has not converged (R-hat {data.posterior.r_hat:.2f}): raise the number of "
        f"samples before relying on the interval."
    )


def _width(data: HangerReport) -> str:
    half = data.tension_n.width / 2 / data.tension_n.mean
    threshold_fraction = data.hanger.thresholds.tension_shift_fraction
    if half <= threshold_fraction:
        return ""
    if not data.now.is_determined:
        return "Identify more modes, or state the ends and the length more exactly."
    return (
        f"The tension is known to ± {100 * half:.1f} %, no better than the threshold of "
        f"{100 * threshold_fraction:.3g} %. Identify more modes, or repeat the test, "
        f"to see smaller shifts."
    )


def _diagnose(data: HangerReport) -> str:
    """Return the next step against the gap between model and measurement."""
    if data.diagnosis is not None:
        return next_step(data.diagnosis)
    if not (_misses(data) or _rms_percent(data) >= _WORTH_DIAGNOSING_PERCENT):
        return ""
    return (
        "Learn what the model does not explain, and what that does to the tension "
        f"(shm gap diagnose --hanger {data.hanger.id})."
    )


def _thermometer(data: HangerReport) -> str:
    if math.isfinite(data.latest.temperature_c):
        return ""
    return "Record the temperature with the next test: it moves the tension."
