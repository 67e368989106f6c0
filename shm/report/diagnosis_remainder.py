"""Say what a diagnosis leaves open: few data, bounds of errors, the law of the unknown."""

from __future__ import annotations

import math

from shm.report import formatting
from shm.report.diagnosis_wording import Answer, answer
from shm.values import (
    FEW_MODES,
    NO_GAP,
    Diagnosis,
    LawTerm,
    Remainder,
    TensionEstimate,
)

_WORTH_SAYING = 0.01  # of what is left: less rounds to nothing
_MOST_NAMED = 3  # what a sentence bears
_COUNTS = ("no mode", "one mode", "two modes", "three modes")


def told_of_few(diagnosis: Diagnosis) -> str:
    """What fewer than four modes say, and how far off the tension may be; else empty."""
    modes = {(each.plane, each.order) for each in diagnosis.where}
    if len(modes) >= FEW_MODES or not modes:
        return ""
    planes = sorted({plane for plane, _ in modes})
    measured = f"{_COUNTS[len(modes)]} of {formatting.listed(planes)} vibration"
    off = _off_percent(diagnosis.tension_after_n)
    if answer(diagnosis) is not Answer.NO_GAP:
        sure = f": the tension may be off by {off} (95 %)" if off else ""
        return f"So few data, {measured}, decide little{sure}."
    chance = formatting.told_probability(diagnosis.no_gap_probability)
    tension = (
        f"; the tension may be off by {off} (95 %): the ends, mass, length and stiffness are known "
        "no better"
        if off
        else ""
    )
    return (
        f"Nothing visible in {measured}, where little can be (no gap, probability {chance})"
        f"{tension}."
    )


def _off_percent(tension_n: TensionEstimate) -> str:
    """The larger half of the 95 % interval."""
    reach = max(tension_n.q975 - tension_n.mean, tension_n.mean - tension_n.q025)
    if not (math.isfinite(reach) and tension_n.mean > 0):
        return ""
    return f"{formatting.plain(100 * reach / tension_n.mean, 2)} %"


def compatible(diagnosis: Diagnosis) -> str:
    """What the data do not contradict at the bounds of their errors."""
    found = diagnosis.compatibility
    if found is None or found.data < 2:
        return ""
    start = (
        f"Whatever the priors, at bounds that all {found.data} data keep with 95 % "
        f"({formatting.plain(found.bound_percent, 2)} % of a frequency), the data"
    )
    if not found.not_falsified:
        return f"{start} contradict all that was fitted, no gap among it."
    causes = [formatting.quantity(each) for each in found.not_falsified if each != NO_GAP]
    named = [NO_GAP] if NO_GAP in found.not_falsified else []
    named += causes[:_MOST_NAMED]
    if len(causes) > _MOST_NAMED:
        named.append(f"{len(causes) - _MOST_NAMED} more")
    contradicted = (
        f", but {len(found.falsified)} of {len(found.falsified) + len(found.not_falsified)} others"
        if found.falsified
        else ""
    )
    return f"{start} do not contradict {formatting.listed(named)}{contradicted}."


def like_tension(remainder: Remainder | None) -> str:
    """Which part of what is left looks like another tension."""
    if remainder is None or not remainder.like_tension >= _WORTH_SAYING:
        return ""
    return (
        f"Of what something unknown would leave ({formatting.plain(remainder.rms_percent, 2)} % "
        f"rms), {100 * remainder.like_tension:.0f} % looks like a change of the tension, "
        f"of {formatting.change(remainder.tension_percent)}: the data cannot tell the two apart."
    )


def law(remainder: Remainder | None) -> str:
    """`What is left grows with the order squared in the longitudinal plane only (...)`."""
    if remainder is None or not remainder.law:
        return ""
    terms = "; beside that it ".join(_term(term) for term in remainder.law)
    before, after = (
        formatting.plain(each, 2)
        for each in (remainder.held_out_before_percent, remainder.held_out_after_percent)
    )
    return f"What is left {terms}; held out it shrinks from {before} to {after} %."


_OVER_ORDERS = {
    "even": "is the same for all orders",
    "order": "grows with the order",
    "order squared": "grows with the order squared",
    "alternating": "alternates from order to order",
    "lowest orders": "sits in the lowest orders",
}


def _term(term: LawTerm) -> str:
    over = _OVER_ORDERS.get(
        term.over_orders, f"goes with the motion at {term.x_m:.2g} m from one end"
    )
    plane = "in both planes" if len(term.planes) > 1 else f"in the {term.planes[0]} plane only"
    tests = {
        "all tests": "",
        "temperature": ", and with the temperature",
        "level": ", and with the level of the motion",
        "level squared": ", and with the level of the motion squared",
        "above a level": f", and only above a level of {term.threshold:.2g}",
    }[term.over_tests]
    sign = "+" if term.change_percent > 0 else ""
    size = f"{sign}{formatting.plain(term.change_percent, 2)} % over its range"
    return f"{over} {plane}{tests} ({size}, log Bayes factor {term.log_bayes_factor:.0f})"
