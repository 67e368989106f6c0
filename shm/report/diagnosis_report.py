"""The report of a gap diagnosis: a paper of its own, or a part of a hanger's."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from shm.report import words
from shm.report.content import DiagnosisSheet
from shm.report.diagnosis.content import Answer, answer, claimed
from shm.report.diagnosis.phrases import label
from shm.report.diagnosis.summary import consequences, name, verdict
from shm.report.diagnosis.tables import answers, evidence
from shm.report.diagnosis.tensions import tension_unit, tension_words
from shm.report.paper import CREDIBLE, Fact, Paper, Part

if TYPE_CHECKING:
    from shm.report.figures.member import Illustration

_STYLES = {
    Answer.EXPLAINED: "first",
    Answer.ALIKE: "first",
    Answer.NO_GAP: "steady",
    Answer.UNEXPLAINED: "alert",
    Answer.UNDECIDED: "watch",
}


def diagnosis_paper(sheet: DiagnosisSheet) -> Paper:
    """The answer, figures, the answer in numbers, what it rests on."""
    part = diagnosis_part(sheet, "In short")
    return Paper(
        title=name(sheet),
        bridge=sheet.bridge,
        status=part.status,
        style=part.style,
        parts=(
            replace(part, figures=tuple, tables=(), status=""),
            Part("Figures", figures=part.figures),
            Part("The answer in numbers", tables=answers(sheet)),
            Part("What it rests on", tables=evidence(sheet)),
        ),
        closing=f"From {_origin(sheet)}. {CREDIBLE}; places count from the deck end.",
    )


def diagnosis_part(sheet: DiagnosisSheet, title: str, paragraphs: Sequence[str] = ()) -> Part:
    """The whole of it: the answer with what follows, remarks on the data, figures, tables."""
    found = answer(sheet.diagnosis)
    return Part(
        title,
        paragraphs,
        lead=verdict(sheet.diagnosis),
        summary=consequences(sheet.diagnosis),
        facts=facts(sheet),
        remarks=sheet.diagnosis.remarks,
        figures=lambda: _figures(sheet),
        tables=(*answers(sheet), *evidence(sheet)),
        status=found.value,
        style=_STYLES[found],
    )


def _figures(sheet: DiagnosisSheet) -> Sequence[Illustration]:
    from shm.report.diagnosis.figures import diagnosis_figures

    return diagnosis_figures(sheet)


def facts(sheet: DiagnosisSheet) -> tuple[Fact, ...]:
    """The figures on top: what, value, what stands beside it."""
    facts = (_claim(sheet), _misses(sheet), _tension(sheet), _fit(sheet))
    return tuple(fact for fact in facts if fact is not None)


def _claim(sheet: DiagnosisSheet) -> Fact:
    diagnosis, claim = sheet.diagnosis, claimed(sheet.diagnosis)
    if claim is not None:
        more = len(claim.causes) - 1
        alike = f" or {words.counted(more, 'cause')} like it" if more else ""
        told = words.probability(claim.probability)
        return ("Probability of the cause", told, f"{label(claim.leading)}{alike}")
    no_gap, unknown = diagnosis.no_gap_probability, diagnosis.unexplained_probability
    if diagnosis.leads == "no gap":
        return ("Probability of no gap", words.probability(no_gap), f"by {diagnosis.baseline}")
    return ("Something else", words.probability(unknown), "probability, not in the catalogue")


def _misses(sheet: DiagnosisSheet) -> Fact | None:
    found = sheet.diagnosis.shrinkage
    if math.isnan(found.rms_before_percent):
        return None
    both = (found.rms_before_percent, found.rms_after_percent)
    before, with_it = (words.plain(value, 2) for value in both)
    if math.isnan(found.rms_after_percent) or claimed(sheet.diagnosis) is None:
        return ("Error of the frequencies", f"{before} %", "rms, by the baseline")
    held = found.held_out_after_percent
    told = f"rms; held out {words.plain(held, 2)} %" if math.isfinite(held) else "rms"
    return ("Error of the frequencies", f"{before} → {with_it} %", told)


def _tension(sheet: DiagnosisSheet) -> Fact | None:
    plain, better = sheet.diagnosis.tension_before_n, sheet.diagnosis.tension_after_n
    if math.isnan(plain.mean):
        return None
    unit = tension_unit(sheet.diagnosis)
    if math.isnan(better.mean):
        told = f"baseline: {tension_words(plain, unit)}"
        return ("Tension", words.rounded_tension(plain.mean, unit), told)
    told = f"{tension_words(better, unit)}; baseline alone {tension_words(plain, unit)}"
    return ("Tension", words.rounded_tension(better.mean, unit), told)


def _fit(sheet: DiagnosisSheet) -> Fact | None:
    p_value = sheet.diagnosis.fit_p_value
    if math.isnan(p_value):
        return None
    told = "good" if p_value >= 0.05 else "doubtful" if p_value >= 0.01 else "poor"
    return ("Fit of the answer", told, f"posterior predictive p-value {words.probability(p_value)}")


def _origin(sheet: DiagnosisSheet) -> str:
    diagnosis = sheet.diagnosis
    tests = words.counted(len(diagnosis.tests), "test")
    seconds = f" in {diagnosis.seconds:.0f} s" if math.isfinite(diagnosis.seconds) else ""
    named = f"{tests} ({', '.join(diagnosis.tests)})"
    return f"{named}, baseline {diagnosis.baseline}, seed {diagnosis.seed}{seconds}"
