"""Write the verdict of a gap diagnosis as sentences; the verdict itself is `Diagnosis.verdict`."""

from __future__ import annotations

import math
import statistics
from collections.abc import Mapping
from datetime import datetime
from typing import TYPE_CHECKING

from shm.report import formatting
from shm.report.diagnosis_wording import (
    AFTER,
    inspection,
    is_of_the_measurement,
    label,
    phrase,
    short_tension_words,
    tension_unit,
)
from shm.report.paper import Fact
from shm.values import (
    Diagnosis,
    GapVerdict,
    NextMeasurement,
    Outcome,
    TensionEstimate,
    effect_label,
)
from shm.values.verdict import SHAPES_OFF, Reason

if TYPE_CHECKING:
    from shm.report.contents import DiagnosisSheet

_SURE = 0.9
_WORTH_MEASURING = 1.0
_CERTAIN = 20.0
# Judgement: to rule a rival of less out, however surely, raises no gap by a ninth at most.
_LEAST_RIVAL = 0.1
_MOST_NAMED = 3
_STRING_FROM = 100.0  # judgement: of L sqrt(T/EI); bending moves its low modes by 2 % at most
_COUNTS = ("no mode", "one mode", "two modes", "three modes")

_OUTCOMES: Mapping[Outcome, str] = {
    Outcome.NO_GAP: "{reason} (no gap, probability {chance})",
    Outcome.EXPLAINED: "the gap {due} {causes}, probability {chance}; what is left is within the "
    "stated errors",
    Outcome.PARTLY: "{causes} part of the gap, but more is left than the errors allow: {reason}",
    Outcome.ALIKE: "several causes fit alike, and these data cannot tell them apart: {causes}, "
    "together probability {chance}",
    Outcome.UNEXPLAINED: "not explained: {reason}",
}
_REASONS: Mapping[Reason, str] = {
    "": "no gap is visible: the baseline {baseline} explains the measurements",
    "few modes": "nothing visible in {modes}, where little can be",
    "misses by percents": "no gap can be shown, though the baseline {baseline} misses the "
    "frequencies by more than a sound model does: {possible}",
    "misses the errors": "no gap can be shown, though the baseline {baseline} misses the "
    "frequencies by more than the stated errors",
    "less probable than not": "no cause is claimed, for it may be that there is no gap",
    "poor fit": "{what} as far off would come by chance with probability {p_value} only",
    "large misfit": "{misfit} % of the frequencies (rms)",
    "large residuals": "{rms_z} standard deviations (rms)",
    "acts alone": "something may act on {alone} alone, probability {acts_alone}",
    "unknown is more probable": "{start} of the effects {tried} explains it, and the probability "
    "of something else is {unknown}",
    "much would fit": "{nearest} fits, but so would much that has another cause, and the "
    "probability of something else is {unknown}",
    "weak evidence": "{nearest} is the most probable cause, but leaves more than the errors allow",
    "none is more probable than not": "no cause is more probable than all else",
    "sampler failed": "no cause is claimed from such draws",
    "no probabilities": "these data give no probability to any explanation",
}
_HELD_OUT: Mapping[bool | None, str] = {
    True: "",
    False: "Where they were held out of the fit the frequencies come no nearer: do not rely on the "
    "cause yet.",
    None: "Nothing that the cause moves was held out of the fit to check it.",
}
_UNCERTAIN = "the sampler failed, so the answer is uncertain; "
_DOUBTED = "make sure first that these tests are of this hanger: "
_CALLIPER = "measure section, length and weight with calliper and tape first: "
_MEASUREMENT = "what differs is the measurement's, not the hanger's: "


def name(sheet: DiagnosisSheet) -> str:
    """Return `Gap diagnosis, Hanger 3`."""
    return f"Gap diagnosis, {formatting.hanger_name(sheet.hanger.id, sheet.hanger.name)}"


def write_summary(diagnosis: Diagnosis) -> str:
    """Return the first paragraph: the verdict, and what it does to the tension."""
    return f"{write_lead(diagnosis)} {write_tension(diagnosis)}".rstrip()


def write_lead(diagnosis: Diagnosis) -> str:
    """Return the verdict in a sentence, what asks for care first."""
    verdict = diagnosis.verdict
    start = _UNCERTAIN if verdict.is_uncertain else ""
    start += _DOUBTED if verdict.is_doubted else ""
    if verdict.claim is not None and verdict.is_description_off:
        start += _CALLIPER
    elif verdict.claim is not None and is_of_the_measurement(verdict.claim):
        start += _MEASUREMENT
    wording = start + _OUTCOMES[verdict.outcome].format_map(_list_words(diagnosis, verdict))
    return f"{wording[0].upper()}{wording[1:]}."


def _list_words(diagnosis: Diagnosis, verdict: GapVerdict) -> dict[str, str]:
    """Return the words that the sentences of outcomes and reasons may hold."""
    alone, unknown = verdict.alone, diagnosis.unexplained_probability
    left_out = ", ".join(formatting.quantity(effect) for effect in diagnosis.left_out)
    are_shapes_off = any(each.startswith(SHAPES_OFF) for each in diagnosis.remarks)
    words = {
        "chance": formatting.spoken_probability(verdict.probability),
        "due": "is explained by" if verdict.probability >= _SURE else "is most likely due to",
        "causes": _list_causes(verdict, explain=verdict.outcome is Outcome.PARTLY),
        "baseline": diagnosis.baseline,
        "modes": _count_modes(diagnosis) if verdict.is_few else "",
        "possible": _explain_misfit(diagnosis) if verdict.reason == "misses by percents" else "",
        "what": "mode shapes" if are_shapes_off else "measurements",
        "p_value": formatting.spoken_probability(verdict.fit_p_value),
        "rms_z": formatting.plain(verdict.rms_z, 2),
        "misfit": formatting.plain(diagnosis.shrinkage.rms_after_percent, 2),
        "alone": f"{alone.plane} {alone.order} of test {alone.test}" if alone else "",
        "acts_alone": formatting.spoken_probability(alone.acts_alone) if alone else "",
        "start": "none" if unknown >= _SURE else "most likely none",
        "tried": f"that were tried ({left_out} left out)" if left_out else "in the catalogue",
        "unknown": formatting.spoken_probability(unknown),
        "nearest": label(verdict.runner_up.leading) if verdict.runner_up else "the best of them",
    }
    return words | {"reason": _REASONS[verdict.reason].format_map(words)}


def _list_causes(verdict: GapVerdict, *, explain: bool = False) -> str:
    """Name each effect that is claimed once, with its place where all causes agree on it.

    The first few, and that there are others; with `explain` as the subject of that verb.
    """
    causes = verdict.claim.causes if verdict.claim else ()
    if len(causes) < 2:
        found = "".join(label(cause) for cause in causes)
        return f"{found} explains" if explain else found
    places: dict[str, set[str]] = {}
    for cause in causes:
        for effect, at in zip(cause.effects, cause.places, strict=True):
            places.setdefault(effect, set()).add(at)
    names = [effect_label(e, next(iter(at)) if len(at) == 1 else "") for e, at in places.items()]
    shown = names[:_MOST_NAMED] + ["others"] * (len(names) > _MOST_NAMED)
    listed = formatting.listed(shown)
    if not explain:
        return listed
    is_placed = all(len(at) == 1 for at in list(places.values())[:_MOST_NAMED])
    where = "" if is_placed else ", at a place that these data cannot tell,"
    *first, last = shown
    if not first:
        return f"{last}{where} explains"
    return f"{', '.join(first)} or {last}{where} explain"


def _count_modes(diagnosis: Diagnosis) -> str:
    """Return `two modes of transverse vibration`."""
    modes = {(each.plane, each.order) for each in diagnosis.where}
    planes = sorted({plane for plane, _ in modes})
    return f"{_COUNTS[len(modes)]} of {formatting.listed(planes)} vibration"


def _explain_misfit(diagnosis: Diagnosis) -> str:
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


def write_tension(diagnosis: Diagnosis) -> str:
    """Return the tension, and what keeps it or the cause from being relied on."""
    verdict, after_n = diagnosis.verdict, diagnosis.tension_after_n
    sentences = []
    if verdict.is_few and (off := _off_percent(after_n)):
        sentences.append(f"So few data decide little: the tension may be off by {off} (95 %).")
    if after := _tension_after(diagnosis):
        sentences.append(f"{after[0].upper()}{after[1:]}.")
    if verdict.claim is not None:
        sentences.append(_HELD_OUT[verdict.holds_out])
    return " ".join(sentence for sentence in sentences if sentence)


def _tension_after(diagnosis: Diagnosis) -> str:
    """Return the tension and whether to rely on it; empty where it is not known."""
    verdict, after_n = diagnosis.verdict, diagnosis.tension_after_n
    if not math.isfinite(after_n.mean):
        return ""
    care = ""
    if verdict.is_open:
        care = ", not to be relied on while the gap is open"
    elif verdict.is_doubted:
        care = ", not to be relied on while it may be another hanger"
    elif verdict.is_description_off:
        care = ", not to be relied on while the description may be off"
    return f"{AFTER}, the tension is {short_tension_words(after_n, tension_unit(diagnosis))}{care}"


def write_line(diagnosis: Diagnosis, at: datetime) -> str:
    """Return the verdict, the tension after it and the date, in one line."""
    verdict = diagnosis.verdict.outcome.value
    parts = (f"{verdict[0].lower()}{verdict[1:]}", _tension_after(diagnosis))
    return f"Gap diagnosis of {at:%Y-%m-%d}: {'; '.join(part for part in parts if part)}."


def _off_percent(tension_n: TensionEstimate) -> str:
    """Return the larger half of the 95 % interval."""
    reach = max(tension_n.q975 - tension_n.mean, tension_n.mean - tension_n.q025)
    if not (math.isfinite(reach) and tension_n.mean > 0):
        return ""
    return f"{formatting.plain(100 * reach / tension_n.mean, 2)} %"


def write_details(diagnosis: Diagnosis) -> str:
    """Return the second paragraph: the cause, what to look at, what no hit reached, what next."""
    verdict = diagnosis.verdict
    named = verdict.claim or verdict.runner_up
    sentences = (
        _state_size(verdict),
        inspection(named.leading) if named else "",
        _state_reach(diagnosis) if verdict.outcome is Outcome.NO_GAP else "",
        next_step(diagnosis),
    )
    return " ".join(sentence for sentence in sentences if sentence)


def _state_size(verdict: GapVerdict) -> str:
    """Return the most probable cause with its sizes and places."""
    if verdict.claim is not None:
        most = "The most probable" if len(verdict.claim.causes) > 1 else "The cause"
        return f"{most}: {phrase(verdict.claim.leading)}."
    if verdict.runner_up is None:
        return ""
    chance = formatting.spoken_probability(verdict.runner_up.probability)
    what = f"{phrase(verdict.runner_up.leading)}, probability {chance}"
    if verdict.outcome is Outcome.NO_GAP:
        return f"If there is a gap, most likely {what}."
    return f"The most probable: {what}."


def _state_reach(diagnosis: Diagnosis) -> str:
    """Return what no hit reached."""
    variation = "of these hits"
    if math.isfinite(diagnosis.widest_swing_m):
        variation = f"of {formatting.plain(1e3 * diagnosis.widest_swing_m, 2)} mm at the sensors"
    return (
        f"What acts only beyond swings {variation}, such as a guide with more play or a crack that "
        "traffic opens, is not visible; what touches only right after a hit hardly is."
    )


def ranked_measurements(diagnosis: Diagnosis) -> list[NextMeasurement]:
    """Return the measurements that were considered, those that tell most first."""
    known = [e for e in diagnosis.next_measurements if math.isfinite(e.expected_log_bayes_factor)]
    return sorted(known, key=lambda each: -each.expected_log_bayes_factor)


def next_step(diagnosis: Diagnosis) -> str:
    """Return the measurement that tells most; next to no gap, only one that counts."""
    found = ranked_measurements(diagnosis)
    if diagnosis.verdict.outcome is Outcome.NO_GAP:
        found = [each for each in found if _rival(diagnosis, each) >= _LEAST_RIVAL]
    best = next(iter(found), None)
    if best is None:
        return ""
    one, other = (formatting.quantity(each) for each in best.separates)
    if best.expected_log_bayes_factor < _WORTH_MEASURING:
        return f"No measurement that was considered would tell {one} from {other} for sure."
    return f"To tell {one} from {other}, measure next: {best.what}."


def _rival(diagnosis: Diagnosis, measurement: NextMeasurement) -> float:
    """Return the probability of the best cause that a measurement tells from another answer."""
    wording = (e.probability for e in diagnosis.causes if e.effect in measurement.separates)
    return max(wording, default=0.0)


def promise(measurement: NextMeasurement) -> str:
    """Return the expected log Bayes factor; beyond certainty nobody counts."""
    factor = measurement.expected_log_bayes_factor
    return f"{factor:.1f}" if factor < _CERTAIN else f"{_CERTAIN:.0f} or more"


_CLAIMED: Mapping[Outcome, str] = {
    Outcome.NO_GAP: "Probability of no gap",
    Outcome.UNEXPLAINED: "Something else",
}


def facts(sheet: DiagnosisSheet) -> tuple[Fact, ...]:
    """Return the figures on top: what, value, and what belongs to it."""
    verdict = sheet.diagnosis.verdict
    found = (
        (
            _CLAIMED.get(verdict.outcome, "Probability of the cause"),
            formatting.probability(verdict.probability),
            _list_causes(verdict),
        ),
        _give_tension(sheet.diagnosis),
        _give_fit(verdict),
    )
    return tuple(fact for fact in found if fact is not None)


def _give_tension(diagnosis: Diagnosis) -> Fact | None:
    before_n, after_n = diagnosis.tension_before_n, diagnosis.tension_after_n
    if math.isnan(before_n.mean):
        return None
    unit = tension_unit(diagnosis)
    before = short_tension_words(before_n, unit)
    if math.isnan(after_n.mean):
        return ("Tension", before, f"by {diagnosis.baseline} alone")
    return (
        "Tension",
        short_tension_words(after_n, unit),
        f"{AFTER}; {diagnosis.baseline} alone {before}",
    )


def _give_fit(verdict: GapVerdict) -> Fact | None:
    if math.isnan(verdict.fit_p_value):
        return None
    sds = f"frequencies {formatting.plain(verdict.rms_z, 2)} standard deviations rms, "
    return (
        "What is left",
        "within the errors" if verdict.is_within_errors else "more than the errors",
        f"{sds if math.isfinite(verdict.rms_z) else ''}posterior predictive p-value "
        f"{formatting.probability(verdict.fit_p_value)}",
    )
