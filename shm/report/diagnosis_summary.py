"""The answer of a gap diagnosis in words that an engineer would sign, the claim first."""

from __future__ import annotations

import math
import statistics

from shm.report import formatting
from shm.report.contents import DiagnosisSheet
from shm.report.diagnosis_remainder import compatible, law, like_tension, told_of_few
from shm.report.diagnosis_wording import (
    AFTER,
    Answer,
    Claim,
    answer,
    claimed,
    claims,
    label,
    phrase,
    tension_unit,
    tension_words,
)
from shm.report.formatting import Interval
from shm.report.paper import Fact
from shm.values import MOST_MISFIT_PERCENT, Diagnosis, NextMeasurement, Trend

_SURE = 0.9
_POOR_FIT = 0.01
_FAIR_FIT = 0.05
_WORTH_MEASURING = 1.0
_CERTAIN = 20.0
# Judgement: to rule a rival of less out, however surely, raises no gap by a ninth at most.
_LEAST_RIVAL = 0.1
_CERTAIN_ODDS = 1000
_SHRUNK = 0.8
"""The largest share of a held-out gap that may remain where it is said to have shrunk."""
# Judgement: two sds, as for any trend; a fifth of the gap is worth a word; three names fit.
_SURE_TREND_SD = 2.0
_TREND_SHARE = 0.2
_MOST_NAMED = 3
_STRING_FROM = 100.0  # judgement: of L sqrt(T/EI); bending moves its low modes by 2 % at most
_CONDITIONS = {
    "amplitude": "the level of the hits",
    "order": "the order of the mode",
    "plane": "the plane",
    "temperature": "the temperature",
    "added mass": "the known mass",
}


def name(sheet: DiagnosisSheet) -> str:
    """`Gap diagnosis, Hanger 3`."""
    return f"Gap diagnosis, {formatting.hanger_name(sheet.hanger.id, sheet.hanger.name)}"


def summary(sheet: DiagnosisSheet) -> str:
    """One paragraph: which cause, what it cannot be told from, how far, tension, what next."""
    return f"{verdict(sheet.diagnosis)} {consequences(sheet.diagnosis)}".rstrip()


def consequences(diagnosis: Diagnosis) -> str:
    """What follows the claim: how far the gap shrinks, how it goes, the tension, what next."""
    sentences = (
        _runner_up(diagnosis),
        _shrinkage(diagnosis),
        _misfit(diagnosis),
        _pattern(diagnosis),
        law(diagnosis.remainder),
        _tension(diagnosis),
        like_tension(diagnosis.remainder),
        compatible(diagnosis),
        _set_aside(diagnosis),
        next_step(diagnosis),
    )
    return " ".join(sentence for sentence in sentences if sentence)


def verdict(diagnosis: Diagnosis) -> str:
    """The claim with its probability, and what few data keep to themselves."""
    claim = claimed(diagnosis)
    if few := told_of_few(diagnosis):
        return few if answer(diagnosis) is Answer.NO_GAP else f"{_verdict(diagnosis, claim)} {few}"
    return f"{_verdict(diagnosis, claim)}{_beyond_the_swing(diagnosis)}"


def _beyond_the_swing(diagnosis: Diagnosis) -> str:
    """What no hit reached, said where nothing was found."""
    if answer(diagnosis) is not Answer.NO_GAP:
        return ""
    swing = "of these hits"
    if math.isfinite(diagnosis.widest_swing_m):
        swing = f"of {formatting.plain(1e3 * diagnosis.widest_swing_m, 2)} mm at the sensors"
    return (
        f" What acts only beyond swings {swing}, such as a guide with more play or a crack that "
        "traffic opens, is not visible; what touches only right after a hit hardly is."
    )


def _verdict(diagnosis: Diagnosis, claim: Claim | None) -> str:
    match answer(diagnosis):
        case Answer.NO_GAP:
            sure = diagnosis.no_gap_probability >= _SURE
            chance = formatting.told_probability(diagnosis.no_gap_probability)
            if diagnosis.shrinkage.rms_before_percent > MOST_MISFIT_PERCENT:
                return (
                    f"No gap can be shown, though the baseline {diagnosis.baseline} misses the "
                    f"frequencies by more than a sound model does: {_possible_misfit(diagnosis)} "
                    f"(no gap, probability {chance})."
                )
            return (
                f"{'No gap' if sure else 'Most likely no gap'}: the baseline {diagnosis.baseline} "
                f"explains the measurements, probability {chance}."
            )
        case Answer.UNEXPLAINED:
            return (
                f"{_none_explains(diagnosis)}: the probability of something else is "
                f"{formatting.told_probability(diagnosis.unexplained_probability)}."
            )
        case Answer.UNDECIDED:
            return _undecided(diagnosis)
        case Answer.EXPLAINED | Answer.ALIKE:
            assert claim is not None
            return _explained(claim)


def _possible_misfit(diagnosis: Diagnosis) -> str:
    """Return what may move the frequencies of a bar, or of a string, as far as the misfit."""
    if diagnosis.slenderness <= _STRING_FROM:
        return "on so stiff a bar what supports and sensors give may be as large"
    percent = [each.residual_percent for each in diagnosis.where]
    middle = statistics.median(percent)
    worst = max(diagnosis.where, key=lambda each: abs(each.residual_percent - middle))
    off = worst.residual_percent - middle
    side = "below" if off < 0 else "above"
    return (
        "what sensors weigh on a light string may do as much; "
        f"{worst.plane} {worst.order} lies {abs(off):.1f} % {side} the other modes"
    )


def _none_explains(diagnosis: Diagnosis) -> str:
    start = "None" if diagnosis.unexplained_probability >= _SURE else "Most likely none"
    if not diagnosis.left_out:
        return f"{start} of the effects in the catalogue explains it"
    left_out = formatting.listed([formatting.quantity(effect) for effect in diagnosis.left_out])
    return f"{start} of the effects that were tried ({left_out} left out) explains it"


def _explained(claim: Claim) -> str:
    sure = "is explained by" if claim.probability >= _SURE else "is most likely due to"
    if claim.of_the_measurement:
        likely = "is" if claim.probability >= _SURE else "is most likely"
        return f"What differs {likely} the measurement's, not the hanger's: {_told(claim)}."
    return f"The gap {sure} {_told(claim)}."


def _told(claim: Claim) -> str:
    """The leading cause in full, those that cannot be told from it, and the probability."""
    others = [label(cause) for cause in claim.causes[1:]]
    if not others:
        return f"{phrase(claim.leading)}, {_odds(claim)}"
    if len(others) > _MOST_NAMED:
        others = [*others[:_MOST_NAMED], f"{len(others) - _MOST_NAMED} more"]
    alike = formatting.listed(others)
    return (
        f"{phrase(claim.leading)}, or what these data cannot tell from it: {alike}; together "
        f"{_odds(claim)}"
    )


def _odds(claim: Claim) -> str:
    return f"probability {formatting.told_probability(claim.probability)}"


def _undecided(diagnosis: Diagnosis) -> str:
    """The likeliest possibilities, where none is likelier than all others together."""
    possible = [
        (diagnosis.no_gap_probability, "no gap"),
        (diagnosis.unexplained_probability, "something that is not in the catalogue"),
        *((each.probability, label(each.leading)) for each in claims(diagnosis)),
    ]
    known = sorted((each for each in possible if math.isfinite(each[0])), reverse=True)
    if not known:
        return "Undecided: these data give no probability to any explanation."
    told = [f"{what} ({formatting.told_probability(share)})" for share, what in known[:_MOST_NAMED]]
    return f"Undecided: these data leave open {formatting.listed(told)}."


def _set_aside(diagnosis: Diagnosis) -> str:
    """The frequencies that are gross errors, and what should have been measured."""
    told = [
        f"{each.plane} {each.order} of test {each.test} "
        f"({formatting.number(each.measured_hz, '.2f')} Hz, "
        f"{formatting.number(each.expected_hz, '.2f')} Hz expected)"
        for each in diagnosis.outliers
    ]
    if not told:
        return ""
    gross = "as a gross error" if len(told) == 1 else "as gross errors"
    return f"Set aside {gross}: {formatting.listed(told)}."


def _runner_up(diagnosis: Diagnosis) -> str:
    """The likeliest cause where none is claimed but one is not to be forgotten."""
    best = next(iter(claims(diagnosis)), None)
    told = answer(diagnosis) not in (Answer.NO_GAP, Answer.UNEXPLAINED)
    if told or best is None or not best.probability >= 1 - _SURE:
        return ""
    return f"The likeliest effect is {_told(best)}.{_why_not(diagnosis, best)}"


def _why_not(diagnosis: Diagnosis, best: Claim) -> str:
    """Why a pair that fits is not claimed where something unknown is."""
    fits = diagnosis.fit_p_value >= _FAIR_FIT and answer(diagnosis) is Answer.UNEXPLAINED
    if not fits or len(best.leading.effects) < 2:
        return ""
    return " These two fit, but together they would also fit much that has another cause."


def _pattern(diagnosis: Diagnosis) -> str:
    """Which conditions the gap surely goes with."""
    if answer(diagnosis) is Answer.NO_GAP:
        return ""
    sure = [trend for trend in diagnosis.trends if sure_trend(trend)]
    if not sure:
        return ""
    told = [f"{_CONDITIONS.get(t.condition, t.condition)} ({_slope(t)})" for t in sure]
    return f"The gap changes with {formatting.listed(told)}."


def sure_trend(trend: Trend) -> bool:
    """Whether the gap surely and noticeably goes with the condition."""
    clear = abs(trend.slope_percent) > _SURE_TREND_SD * trend.slope_sd_percent
    return clear and trend.share >= _TREND_SHARE


def _slope(trend: Trend) -> str:
    over = "from transverse to longitudinal" if trend.condition == "plane" else "over its range"
    interval = formatting.span(slope(trend), signed=True)
    return f"{formatting.mean(slope(trend), signed=True)} % {over}, 90 % interval {interval} %"


def slope(trend: Trend) -> Interval:
    return Interval.normal(trend.slope_percent, trend.slope_sd_percent)


def _shrinkage(diagnosis: Diagnosis) -> str:
    """How far the residuals shrink in and out of the fit; nothing where nothing is claimed."""
    found = diagnosis.shrinkage
    if answer(diagnosis) is Answer.NO_GAP:
        if math.isnan(found.rms_before_percent):
            return ""
        return f"The frequencies differ from it by {_percent(found.rms_before_percent)} (rms)."
    claim = claimed(diagnosis)
    if math.isnan(found.rms_after_percent) or claim is None:
        return ""
    undecided = answer(diagnosis) is Answer.UNDECIDED
    what = label(claim.leading) if undecided else "it"
    both = _percent(found.rms_before_percent), _percent(found.rms_after_percent)
    goes = "shrinks" if found.rms_after_percent < found.rms_before_percent else "grows"
    inside = f"With {what} the frequencies' error {goes} from {both[0]} to {both[1]} (rms)"
    return f"{inside}{_held_out(diagnosis)}"


def _held_out(diagnosis: Diagnosis) -> str:
    before = diagnosis.shrinkage.held_out_before_percent
    after = diagnosis.shrinkage.held_out_after_percent
    if math.isnan(before) or math.isnan(after):
        return "; nothing was held out of the fit to check that."
    if after <= _SHRUNK * before:
        return (
            f" and, where they were held out of the fit, from {_percent(before)} to "
            f"{_percent(after)}."
        )
    return (
        f", but not where they were held out of the fit ({_percent(before)} before, "
        f"{_percent(after)} after): do not rely on it yet."
    )


def _percent(value: float) -> str:
    return f"{formatting.plain(value, 2)} %"


def _misfit(diagnosis: Diagnosis) -> str:
    if not diagnosis.fit_p_value < _POOR_FIT or answer(diagnosis) is Answer.UNEXPLAINED:
        return ""
    chance = formatting.told_probability(diagnosis.fit_p_value)
    return (
        "Even so the fit is poor: were this all, measurements as far off would come with "
        f"probability {chance} only. Something is left."
    )


def _tension(diagnosis: Diagnosis) -> str:
    plain, better = diagnosis.tension_before_n, diagnosis.tension_after_n
    if math.isnan(plain.mean):
        return ""
    unit = tension_unit(diagnosis)
    alone = f"the baseline {diagnosis.baseline} alone gives {tension_words(plain, unit)}"
    if math.isnan(better.mean):
        return f"For the tension {alone}{_with_care(diagnosis)}."
    off = 100 * (plain.mean / better.mean - 1)
    told = f"{AFTER.capitalize()}, the tension is {tension_words(better, unit)}"
    return f"{told}; {alone}, {formatting.change(off)}{_with_care(diagnosis)}."


def _with_care(diagnosis: Diagnosis) -> str:
    unsure = answer(diagnosis) in (Answer.UNEXPLAINED, Answer.UNDECIDED)
    return ", not to be relied on while the gap is open" if unsure else ""


def ranked_measurements(diagnosis: Diagnosis) -> list[NextMeasurement]:
    """The measurements that were considered, those that tell most first."""
    known = [e for e in diagnosis.next_measurements if math.isfinite(e.expected_log_bayes_factor)]
    return sorted(known, key=lambda each: -each.expected_log_bayes_factor)


def next_step(diagnosis: Diagnosis) -> str:
    """The measurement that tells most between the contenders; beside no gap, those that count."""
    found = ranked_measurements(diagnosis)
    if answer(diagnosis) is Answer.NO_GAP:
        found = [each for each in found if _rival(diagnosis, each) >= _LEAST_RIVAL]
    best = next(iter(found), None)
    if best is None:
        return ""
    one, other = (formatting.quantity(each) for each in best.separates)
    if best.expected_log_bayes_factor < _WORTH_MEASURING:
        return f"No measurement that was considered would tell {one} from {other} for sure."
    return (
        f"To tell {one} from {other}, measure next: {best.what} (expected odds of "
        f"{_odds_to_expect(best)} to 1)."
    )


def _rival(diagnosis: Diagnosis, measurement: NextMeasurement) -> float:
    """The probability of the likeliest cause that a measurement tells from another answer."""
    told = (e.probability for e in diagnosis.causes if e.effect in measurement.separates)
    return max(told, default=0.0)


def promise(measurement: NextMeasurement) -> str:
    """The expected log Bayes factor; beyond certainty nobody counts."""
    factor = measurement.expected_log_bayes_factor
    return f"{factor:.1f}" if factor < _CERTAIN else f"{_CERTAIN:.0f} or more"


def _odds_to_expect(measurement: NextMeasurement) -> str:
    """The same in words for a sentence: `400`, `more than 1000`."""
    odds = math.exp(min(measurement.expected_log_bayes_factor, _CERTAIN))
    return f"{float(f'{odds:.1g}'):.0f}" if odds < _CERTAIN_ODDS else f"more than {_CERTAIN_ODDS}"


def facts(sheet: DiagnosisSheet) -> tuple[Fact, ...]:
    """The figures on top: what, value, what stands beside it."""
    facts = (_claim(sheet), _misses(sheet), _tension_fact(sheet), _fit(sheet))
    return tuple(fact for fact in facts if fact is not None)


def _claim(sheet: DiagnosisSheet) -> Fact:
    diagnosis, claim = sheet.diagnosis, claimed(sheet.diagnosis)
    if claim is not None:
        more = len(claim.causes) - 1
        alike = f" or {formatting.counted(more, 'cause')} like it" if more else ""
        told = formatting.probability(claim.probability)
        return ("Probability of the cause", told, f"{label(claim.leading)}{alike}")
    no_gap, unknown = diagnosis.no_gap_probability, diagnosis.unexplained_probability
    if diagnosis.leads == "no gap":
        return ("Probability of no gap", formatting.probability(no_gap), f"by {diagnosis.baseline}")
    return ("Something else", formatting.probability(unknown), "probability, not in the catalogue")


def _misses(sheet: DiagnosisSheet) -> Fact | None:
    found = sheet.diagnosis.shrinkage
    if math.isnan(found.rms_before_percent):
        return None
    both = (found.rms_before_percent, found.rms_after_percent)
    before, with_it = (formatting.plain(value, 2) for value in both)
    if math.isnan(found.rms_after_percent) or claimed(sheet.diagnosis) is None:
        return ("Error of the frequencies", f"{before} %", "rms, by the baseline")
    held = found.held_out_after_percent
    told = f"rms; held out {formatting.plain(held, 2)} %" if math.isfinite(held) else "rms"
    return ("Error of the frequencies", f"{before} → {with_it} %", told)


def _tension_fact(sheet: DiagnosisSheet) -> Fact | None:
    plain, better = sheet.diagnosis.tension_before_n, sheet.diagnosis.tension_after_n
    if math.isnan(plain.mean):
        return None
    unit = tension_unit(sheet.diagnosis)
    if math.isnan(better.mean):
        told = f"baseline: {tension_words(plain, unit)}"
        return ("Tension", formatting.rounded_tension(plain.mean, unit), told)
    told = f"{tension_words(better, unit)}; baseline alone {tension_words(plain, unit)}"
    return ("Tension", formatting.rounded_tension(better.mean, unit), told)


def _fit(sheet: DiagnosisSheet) -> Fact | None:
    p_value = sheet.diagnosis.fit_p_value
    if math.isnan(p_value):
        return None
    told = "good" if p_value >= 0.05 else "doubtful" if p_value >= 0.01 else "poor"
    return (
        "Fit of the answer",
        told,
        f"posterior predictive p-value {formatting.probability(p_value)}",
    )
