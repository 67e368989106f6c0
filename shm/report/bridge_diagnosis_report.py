"""The report of a joint diagnosis: what hangers share, who has it, and what it does to tension."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from shm.assumptions import DEFAULTS
from shm.diagnosis_document import bridge_diagnosis_document
from shm.report import formatting
from shm.report.bar_table import bar_document, bars_table
from shm.report.contents import BridgeDiagnosisSheet
from shm.report.diagnosis_summary import write_lead
from shm.report.diagnosis_wording import effect_phrase, tension_of
from shm.report.figures.gap_causes import SHARED
from shm.report.figures.specification import drawn
from shm.report.paper import CREDIBLE, Paper, Section, Table, filled
from shm.report.sizes import quantity, size
from shm.values import BridgeDiagnosis, SharedCause, TensionEstimate, effect_label
from shm.values.rounding import ForceUnit, force_unit

_STATES = {
    "shared cause": ("A shared cause", "first"),
    "each for itself": ("Nothing shared", "steady"),
    "shared unknown": ("Shared, not explained", "alert"),
}
_WORTH_A_ROW = 0.001  # of a probability: what the three decimals show
_MOST_SIMILAR = 3  # what a sentence bears


def bridge_diagnosis_paper(sheet: BridgeDiagnosisSheet) -> Paper:
    """Return the answer, its figure, the answer in numbers, each hanger for itself."""
    diagnosis = sheet.diagnosis
    status, style = _STATES[diagnosis.leads]
    seconds = f" in {diagnosis.seconds:.0f} s" if math.isfinite(diagnosis.seconds) else ""
    return Paper(
        title=f"Gap diagnosis, {len(diagnosis.hangers)} hangers",
        bridge=sheet.bridge,
        status=status,
        style=style,
        parts=(
            Section(
                "In short",
                lead=shared_verdict(diagnosis),
                summary=_consequences(diagnosis),
                tables=filled(bars_table(sheet.bars)),
            ),
            Section("Who has it", figures=lambda: drawn((SHARED,), diagnosis)),
            Section(
                "The answer in numbers",
                tables=filled(_causes(diagnosis), _members(diagnosis), _tensions(diagnosis)),
            ),
            Section("Each hanger for itself", tables=(_alone(diagnosis),)),
        ),
        closing=(
            f"From hangers {_hangers(diagnosis.hangers)}, baseline {diagnosis.baseline}, seed "
            f"{diagnosis.seed}{seconds}. {CREDIBLE}."
        ),
    )


def bridge_diagnosis_json(sheet: BridgeDiagnosisSheet) -> dict[str, Any]:
    """Return a document for `shm.documents.dump`; unknown numbers become null there."""
    summary = f"{shared_verdict(sheet.diagnosis)} {_consequences(sheet.diagnosis)}".rstrip()
    return {
        **bridge_diagnosis_document(sheet.diagnosis),
        "answer": sheet.diagnosis.leads,
        "summary": summary,
        "bars": [bar_document(bar) for bar in sheet.bars],
    }


def shared_verdict(diagnosis: BridgeDiagnosis) -> str:
    """Return `Rotational end flexibility is shared by hangers 3, 5 and 7 (0.97)` or its like."""
    apart, leading = diagnosis.each_for_itself_probability, diagnosis.leading
    if leading is not None:
        claim = formatting.spoken_probability(diagnosis.claim(leading))
        what = effect_label(leading.effect, leading.at)
        similar = _similar(diagnosis, leading)
        start = f"{what[0].upper()}{what[1:]}{similar}"
        everyone = len(leading.named) == len(diagnosis.hangers)
        who = (
            f"all {len(leading.named)} hangers"
            if everyone
            else f"hangers {_hangers(leading.named)}"
        )
        return f"{start} is shared by {who} ({claim})."
    if diagnosis.leads == "shared unknown":
        chance = formatting.spoken_probability(diagnosis.unknown_probability)
        return f"Hangers share something that is not in the catalogue ({chance})."
    return (
        "No cause is shown that hangers share: each has its own or none "
        f"({formatting.spoken_probability(apart)})."
    )


def _similar(diagnosis: BridgeDiagnosis, leading: SharedCause) -> str:
    """Return what these data cannot distinguish from it."""
    if leading.group is None:
        return ""
    names = [n for n in diagnosis.groups[leading.group] if n != leading.effect][:_MOST_SIMILAR]
    return f", or {formatting.listed([formatting.quantity(each) for each in names])},"


def _hangers(numbers: Sequence[int]) -> str:
    return formatting.listed([str(each) for each in numbers]) if numbers else "none for sure"


def _heaviest_sensor_kg() -> float:
    """Return what hardly any accelerometer exceeds: a joint diagnosis is of many hangers."""
    mass_kg = DEFAULTS.accelerometer_mass_kg
    return mass_kg.value + 3 * mass_kg.sd


def _consequences(diagnosis: BridgeDiagnosis) -> str:
    leading = diagnosis.leading
    if leading is None:
        return "Each hanger's own diagnosis stands."
    others = [each for each in diagnosis.hangers if each not in leading.named]
    wording = f"It is {effect_phrase(leading.effect, leading.at, [leading.size])}"
    wording += f", from hanger to hanger within some {100 * leading.scatter:.0f} %."
    if leading.also_at:
        wording += f" About as likely: {formatting.listed(list(leading.also_at[:_MOST_SIMILAR]))}."
    if leading.effect == "point_mass" and leading.size.q05 < _heaviest_sensor_kg():
        wording += (
            " So small a mass may be that of the sensors: it is then no cause in the hangers."
        )
    if others:
        wording += f" Without it: {_hangers(others)}."
    moved = [
        100 * (each.jointly_n.mean / each.before_n.mean - 1)
        for each in diagnosis.tensions
        if each.hanger in leading.named and math.isfinite(each.jointly_n.mean)
    ]
    if moved:
        wording += f" It changes their tensions by {min(moved):+.1f} to {max(moved):+.1f} %."
    return wording


def _causes(diagnosis: BridgeDiagnosis) -> Table:
    rows = [
        (
            effect_label(each.effect, each.at),
            formatting.probability(each.probability),
            "" if each.group is None else "A",
            formatting.number(each.log_bayes_factor, "+z.1f"),
            f"{each.likeness} ({len(each.named)} of {len(each.family)})",
        )
        for each in diagnosis.causes
        if each.probability >= _WORTH_A_ROW
    ]
    rest = (
        ("each hanger for itself", diagnosis.each_for_itself_probability),
        ("something not in the catalogue, shared", diagnosis.unknown_probability),
    )
    return Table(
        "Causes in common, most probable first",
        ("cause", "probability", "group", "log Bayes factor", "family (members)"),
        (*rows, *((what, formatting.probability(share), "", "", "") for what, share in rest)),
        note=(
            "Against each hanger having causes of its own, in natural logarithms. Causes with the "
            "letter A cannot be told apart with these data."
        ),
    )


def _members(diagnosis: BridgeDiagnosis) -> Table:
    if (leading := diagnosis.leading) is None:
        return Table("Who has it", (), ())
    return Table(
        "Who has it",
        ("hanger", "probability", "size (90 % interval)"),
        tuple(
            (
                str(each.hanger),
                formatting.probability(each.probability),
                f"{quantity(each.size)} {size(each.size)}" if each.hanger in leading.named else "",
            )
            for each in leading.members
        ),
        note="A hanger in which the size would be invisible has the share of its family.",
    )


def _tensions(diagnosis: BridgeDiagnosis) -> Table:
    known = [each for each in diagnosis.tensions if math.isfinite(each.before_n.mean)]
    unit = force_unit(*(each.before_n.mean for each in known)) if known else force_unit(1.0)
    return Table(
        f"Tension of each hanger, {unit.name} (90 % interval)",
        ("hanger", f"baseline {diagnosis.baseline}", "diagnosed alone", "diagnosed together"),
        tuple(
            (
                str(each.hanger),
                *(_tension(t, unit) for t in (each.before_n, each.alone_n, each.jointly_n)),
            )
            for each in known
        ),
    )


def _tension(estimate: TensionEstimate, unit: ForceUnit) -> str:
    wording, places = tension_of(estimate).in_unit(unit), unit.decimals(estimate.mean)
    return f"{wording.mean:.{places}f} ({wording.low:.{places}f} to {wording.high:.{places}f})"


def _alone(diagnosis: BridgeDiagnosis) -> Table:
    return Table(
        "What each hanger says for itself",
        ("hanger", "tests", "its own diagnosis"),
        tuple(
            (str(each.hanger), str(len(each.tests)), write_lead(each))
            for each in diagnosis.diagnoses
        ),
    )
