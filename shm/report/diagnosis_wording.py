"""Write causes of a gap as names and clauses, with their sizes."""

from __future__ import annotations

import math
from collections.abc import Sequence

from shm.report import formatting
from shm.report.formatting import Interval
from shm.report.sizes import Sizes
from shm.values import Cause, Claim, Diagnosis, EffectEstimate, TensionEstimate, effect_label
from shm.values.diagnosis import joined
from shm.values.rounding import ForceUnit, force_unit

_PLACES = {
    "everywhere": "",
    "deck end": "at the deck end",
    "arch end": "at the arch end",
    "both ends": "at both ends",
    "all sensors": "of all sensors",
    "all tests": "in all tests",
    "transverse": "in the transverse plane",
    "longitudinal": "in the longitudinal plane",
    "both planes alike": "in both planes alike",
}
_MOST_PLACES = 2  # what a sentence bears
_PLACE_STARTS = {"sensor": "of the", "test": "in"}


def is_of_the_measurement(claim: Claim) -> bool:
    """Return whether all that is named are faults of sensors, clock or what was clamped on."""
    names = {effect for cause in claim.causes for effect in cause.effects}
    from shm.models.effects import EFFECTS  # the models take long to import, and few need it

    known = [EFFECTS.get(name) for name in names if name != "timebase"]
    return all(effect is not None and not effect.of_the_hanger for effect in known)


def inspection(cause: Cause) -> str:
    """Return what a crew looks at, as a sentence; empty where nothing is to be seen."""
    from shm.models.effects import EFFECTS

    known = [EFFECTS[name] for name in cause.effects if name in EFFECTS]
    every = [each.over_time.check if each.over_time else each.check for each in known]
    checks = [check for check in every if check]
    if not checks:
        return ""
    text = formatting.listed(checks)
    return f"{text[0].upper()}{text[1:]}."


def label(cause: Cause) -> str:
    """Return `rotational end flexibility (both ends)`, for tables and figures."""
    parts = zip(cause.effects, cause.places, strict=True)
    return joined(effect_label(effect, at) for effect, at in parts)


def phrase(cause: Cause) -> str:
    """Return `a point mass of 12 kg (9 to 15) at 3.4 m (3.1 to 3.7)`; `and` joins a pair."""
    clauses = [
        effect_phrase(effect, at, separate_estimates(cause, number))
        for number, (effect, at) in enumerate(zip(cause.effects, cause.places, strict=True))
    ]
    return " together with ".join(clauses) + _also(cause)


def _also(cause: Cause) -> str:
    """Return where else it may act as well."""
    if not cause.also_at:
        return ""
    places = [
        " and ".join(dict.fromkeys(_place(part) or "everywhere" for part in cause.each_at(at)))
        for at in cause.also_at[:_MOST_PLACES]
    ]
    return f" (about as likely: {formatting.listed(places)})"


def effect_phrase(effect: str, at: str, estimates: Sequence[EffectEstimate]) -> str:
    """Return what the effect is, how large, where; its name where the size is not known."""
    where = _place(at)
    try:
        from shm.models.effects import EFFECTS

        wording = EFFECTS[effect].phrase.format_map(Sizes(estimates))
    except KeyError:
        wording = formatting.quantity(effect)
    return f"{wording} {where}".rstrip()


def _place(at: str) -> str:
    """Return `deck end, transverse` as `at the deck end in the transverse plane`."""
    return " ".join(filter(None, (_place_part(part) for part in at.split(", "))))


def _place_part(part: str) -> str:
    start = _PLACE_STARTS.get(part.partition(" ")[0])
    return _PLACES.get(part, f"{start} {part}" if start else part)


def separate_estimates(cause: Cause, number: int) -> tuple[EffectEstimate, ...]:
    """Return the estimates of effect `number` of the cause.

    In a pair a name that both have carries its effect before a dot.
    """
    prefixed = {e.name: e.name.partition(".")[0] for e in cause.parameters if "." in e.name}
    this = cause.effects[number]
    return tuple(e for e in cause.parameters if prefixed.get(e.name, this) == this)


AFTER = "averaged over all explanations"
"""What the tension after the diagnosis is: no gap, every cause and the unknown count by their
probabilities."""


def tension_unit(diagnosis: Diagnosis) -> ForceUnit:
    """Return one unit for both tensions, so that they can be compared at a glance."""
    return force_unit(diagnosis.tension_before_n.mean, diagnosis.tension_after_n.mean)


def tension_of(estimate: TensionEstimate) -> Interval:
    """Return mean and 90 % interval in N."""
    return Interval(estimate.mean, estimate.q05, estimate.q95)


def tension_words(estimate: TensionEstimate, unit: ForceUnit) -> str:
    """Return `702 kN (90 % interval 690 to 714 kN)`; the mean alone where no interval is known."""
    tension_n = tension_of(estimate)
    if math.isnan(tension_n.width):
        return formatting.rounded_tension(estimate.mean, unit)
    if not tension_n.low <= tension_n.mean <= tension_n.high:  # most draws at a bound, few far off
        return f"{formatting.span(tension_n.in_unit(unit))} {unit.name} (90 % interval)"
    return formatting.tension(tension_n, unit)


def short_tension_words(estimate: TensionEstimate, unit: ForceUnit) -> str:
    """Return `702 ± 12 kN`, with half of the 90 % interval, where it is about symmetrical."""
    tension_n = tension_of(estimate)
    is_usual = tension_n.low <= tension_n.mean <= tension_n.high  # and no NaN
    return formatting.with_half(tension_n, unit) if is_usual else tension_words(estimate, unit)
