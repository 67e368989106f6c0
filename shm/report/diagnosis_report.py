"""Report a gap diagnosis: as a paper, or as a part of a hanger's."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

from shm.diagnosis_document import diagnosis_document
from shm.report import formatting
from shm.report.assumed import assumptions_line, assumptions_table, with_assumptions
from shm.report.bar_table import bar_document, bar_table
from shm.report.contents import DiagnosisSheet
from shm.report.diagnosis_summary import (
    facts,
    name,
    promise,
    ranked_measurements,
    write_details,
    write_lead,
    write_summary,
    write_tension,
)
from shm.report.diagnosis_wording import (
    AFTER,
    label,
    tension_of,
    tension_unit,
)
from shm.report.figures.gap_causes import FIGURE as CAUSES
from shm.report.figures.gap_map import FIGURE as GAP_MAP
from shm.report.figures.specification import drawn
from shm.report.paper import (
    CREDIBLE,
    LEAST_PROBABILITY,
    Paper,
    Section,
    Table,
    filled,
    fold_improbable,
)
from shm.report.sizes import quantity, size
from shm.values import (
    NO_GAP,
    Cause,
    Outcome,
    TensionEstimate,
    group_causes,
    is_excluded,
)
from shm.values.rounding import ForceUnit, two_digits

FIGURES = (CAUSES, GAP_MAP)

_STYLES = {
    Outcome.EXPLAINED: "first",
    Outcome.ALIKE: "first",
    Outcome.NO_GAP: "steady",
    Outcome.PARTLY: "watch",
    Outcome.UNEXPLAINED: "alert",
}


def diagnosis_paper(sheet: DiagnosisSheet) -> Paper:
    """Return the paper: verdict, figures, the answer in numbers, what it rests on."""
    part = diagnosis_part(sheet, "In short")
    return Paper(
        title=name(sheet),
        bridge=sheet.bridge,
        status=part.status,
        style=part.style,
        parts=(
            replace(part, figures=tuple, tables=(bar_table(sheet.bar),), status=""),
            Section("Figures", figures=part.figures),
            Section("The answer in numbers", tables=answers(sheet)),
            Section(
                "What it rests on",
                tables=(*evidence(sheet), *filled(assumptions_table(sheet.hanger))),
            ),
        ),
        closing=f"From {_origin(sheet)}. {CREDIBLE}; places count from the deck end. "
        + assumptions_line(sheet.hanger),
    )


def diagnosis_part(sheet: DiagnosisSheet, title: str, paragraphs: Sequence[str] = ()) -> Section:
    """Return all of it: verdict, remarks on the data, figures, tables."""
    verdict = sheet.diagnosis.verdict
    outcome = verdict.outcome
    return Section(
        title,
        paragraphs,
        lead=write_lead(sheet.diagnosis),
        summary=write_tension(sheet.diagnosis),
        details=write_details(sheet.diagnosis),
        facts=facts(sheet),
        remarks=sheet.diagnosis.remarks,
        figures=lambda: drawn(FIGURES, sheet),
        tables=(*answers(sheet), *evidence(sheet)),
        status=outcome.value,
        style="watch" if verdict.is_uncertain or verdict.is_doubted else _STYLES[outcome],
    )


def _origin(sheet: DiagnosisSheet) -> str:
    diagnosis = sheet.diagnosis
    tests = formatting.counted(len(diagnosis.tests), "test")
    seconds = f" in {diagnosis.seconds:.0f} s" if math.isfinite(diagnosis.seconds) else ""
    named = f"{tests} ({', '.join(diagnosis.tests)})"
    return f"{named}, baseline {diagnosis.baseline}, seed {diagnosis.seed}{seconds}"


_LETTERS = "ABCDEFGHIJKLMNOPQRSTUVWXYZ"
_WORST = 16
_ROWS_SHOWN = 10
"""Of a table in a terminal."""


def answers(sheet: DiagnosisSheet) -> tuple[Table, ...]:
    """Return the tables of what the diagnosis found, in reading order."""
    return _made(sheet, (causes, sizes, shrinkage, tension, next_measurements))


def evidence(sheet: DiagnosisSheet) -> tuple[Table, ...]:
    """Return the tables of where the gap lies and what these data cannot show."""
    return _made(sheet, (where, places, invisible))


def _made(
    sheet: DiagnosisSheet, makers: tuple[Callable[[DiagnosisSheet], Table], ...]
) -> tuple[Table, ...]:
    made = filled(*(make(sheet) for make in makers))
    # What is always said last, such as `no gap`, stays in a terminal.
    return tuple(table.shortened(_ROWS_SHOWN, last=2 if table.marks else 0) for table in made)


def causes(sheet: DiagnosisSheet) -> Table:
    """Return every cause that was tried, no gap and something unknown, those claimed marked."""
    diagnosis, verdict = sheet.diagnosis, sheet.diagnosis.verdict
    found = [cause for claim in group_causes(diagnosis.causes) for cause in claim.causes]
    claimed = verdict.claim.causes if verdict.claim else ()
    rest = (
        (NO_GAP, diagnosis.no_gap_probability, Outcome.NO_GAP),
        (
            "something not in the catalogue",
            diagnosis.unexplained_probability,
            Outcome.UNEXPLAINED,
        ),
    )
    shown = [each for each in found if not each.probability < LEAST_PROBABILITY]
    shown = found if len(found) - len(shown) < 2 else shown
    folded = [False] * (len(found) > len(shown))
    marks = [each in claimed for each in shown] + folded
    marks += [each is verdict.outcome for *_, each in rest]
    left_out = ", ".join(formatting.quantity(effect) for effect in diagnosis.left_out)
    return Table(
        "Causes, most probable first",
        (
            "cause",
            "probability",
            "group",
            "log Bayes factor",
            "gain of fit",
            "Occam's factor",
            "how",
        ),
        (
            *fold_improbable(
                [_cause_row(cause) for cause in found],
                [cause.probability for cause in found],
                "effects",
            ),
            *((what, formatting.probability(share), *("",) * 5) for what, share, _ in rest),
        ),
        note=(
            f"Against the baseline {diagnosis.baseline}, in natural logarithms: the Bayes factor "
            "is what the better fit gains and what Occam's factor takes for free parameters. "
            "Causes with the same letter cannot be told apart with these data. How far each was "
            "taken: screened by a linear fit, or fitted in full with a normal or a sampled "
            "posterior." + (f" Taken out of the catalogue: {left_out}." if left_out else "")
        ),
        marks=tuple("claimed" if is_claimed else "left" for is_claimed in marks),
    )


def _cause_row(cause: Cause) -> tuple[str, ...]:
    return (
        label(cause),
        formatting.probability(cause.probability),
        "" if cause.group is None else _LETTERS[cause.group % len(_LETTERS)],
        formatting.number(cause.log_bayes_factor, "+z.1f"),
        formatting.number(cause.log_fit, "+z.1f"),
        formatting.number(cause.log_occam, "+z.1f"),
        cause.method,
    )


def sizes(sheet: DiagnosisSheet) -> Table:
    """Return the parameters of the most probable causes."""
    return Table(
        "Sizes of the most probable causes",
        ("cause", "parameter", "size (90 % interval)"),
        tuple(
            (label(cause), quantity(estimate), str(size(estimate)))
            for claim in group_causes(sheet.diagnosis.causes)
            if claim.probability >= 0.05
            for cause in claim.causes
            if cause.probability >= 0.01
            for estimate in cause.parameters
        ),
        note="Places count from the deck end. Sizes of logarithmic parameters are the medians.",
    )


def shrinkage(sheet: DiagnosisSheet) -> Table:
    """Return the errors of the frequencies before and after, in and out of the fit."""
    found = sheet.diagnosis.shrinkage
    rows = (
        ("fitted", found.rms_before_percent, found.rms_after_percent),
        ("held out of the fit", found.held_out_before_percent, found.held_out_after_percent),
    )
    return Table(
        "How far the gap shrinks",
        ("frequencies", "before, % rms", "after, % rms"),
        tuple(
            (what, formatting.plain(before), formatting.plain(after))
            for what, before, after in rows
            if math.isfinite(before)
        ),
    )


def tension(sheet: DiagnosisSheet) -> Table:
    """Return the tension by the baseline, and over all explanations."""
    diagnosis = sheet.diagnosis
    unit = tension_unit(diagnosis)
    rows = (
        (f"before: the baseline {diagnosis.baseline}", diagnosis.tension_before_n),
        (f"after: {AFTER}", diagnosis.tension_after_n),
    )
    return Table(
        "Tension before and after",
        (
            "tension",
            *(f"{what}, {unit.name}" for what in ("mean", "sd", "90 % interval")),
            "% of nominal (90 %)",
        ),
        tuple(
            (what, *_tension_cells(each, sheet.hanger.nominal_tension_n, unit))
            for what, each in rows
            if math.isfinite(each.mean)
        ),
    )


def _tension_cells(estimate: TensionEstimate, nominal_n: float, unit: ForceUnit) -> tuple[str, ...]:
    interval = tension_of(estimate).in_unit(unit)
    known = (formatting.plain(interval.mean), "not known", "not known")
    if math.isfinite(interval.width):
        sd = two_digits(unit.of(estimate.sd))
        known = (formatting.mean(interval), sd, formatting.span(interval))
    of_nominal = "no nominal"
    if nominal_n > 0:
        share = tension_of(estimate).scaled(100 / nominal_n)
        is_known = math.isfinite(share.width)
        of_nominal = formatting.with_span(share) if is_known else f"{share.mean:.1f}"
    return (*known, of_nominal)


def _range(low: float, high: float, form: str) -> str:
    is_known = math.isfinite(low + high)
    return f"{low:{form}} to {high:{form}}" if is_known else "not known"


def next_measurements(sheet: DiagnosisSheet) -> Table:
    """Return the measurements that were considered, best first."""
    return Table(
        "What would tell, best first",
        ("measurement", "separates", "from", "expected log Bayes factor"),
        tuple(
            (each.what, *map(formatting.quantity, each.separates), promise(each))
            for each in ranked_measurements(sheet.diagnosis)
        ),
        note="A log Bayes factor of 3 is odds of 20 to 1, of 5 odds of 150 to 1.",
    )


def where(sheet: DiagnosisSheet) -> Table:
    """Return the excluded frequencies, then the residuals with the largest shares."""
    diagnosis = sheet.diagnosis
    residuals = sorted(
        diagnosis.where,
        key=lambda r: (not is_excluded(diagnosis, r), math.isnan(r.share), -r.share),
    )
    left = len(residuals) - _WORST
    more = f" {left} more residuals are in the JSON document." if left > 0 else ""
    return Table(
        "Where the gap lies, largest share first",
        ("mode", "test", "measured, Hz", "baseline, Hz", "off, %", "z", "share", "off after, %",
         "z after"),
        tuple(
            (
                f"{each.plane} {each.order}",
                each.test,
                formatting.number(each.measured_hz, ".3f"),
                formatting.number(each.predicted_hz, ".3f"),
                formatting.number(each.residual_percent, "+z.2f"),
                formatting.number(each.z, "+z.1f"),
                "excluded" if is_excluded(diagnosis, each) else _share(each.share),
                formatting.number(each.after_percent, "+z.2f", ""),
                formatting.number(each.after_z, "+z.1f", ""),
            )
            for each in residuals[:_WORST]
        ),
        note="Off: measured over predicted frequency, less 1; z: the same in standard deviations. "
        f"After: with the leading cause.{more}",
    )  # fmt: skip


def _share(value: float) -> str:
    return f"{100 * value:.0f} %" if math.isfinite(value) else "not known"


def places(sheet: DiagnosisSheet) -> Table:
    """Return where along the hanger a local cause of each kind would sit."""
    return Table(
        "Where along the hanger a local cause would sit",
        ("kind of cause", "at, m", "90 % interval, m", "share of the misfit explained"),
        tuple(
            (
                formatting.quantity(each.kind),
                formatting.number(each.x_m, ".2f"),
                _range(each.low_m, each.high_m, ".2f"),
                _share(each.share),
            )
            for each in sheet.diagnosis.places
        ),
        note="Places count from the deck end.",
    )


def invisible(sheet: DiagnosisSheet) -> Table:
    """Return the effects that these data cannot show, and why."""
    return Table(
        "What these data cannot show",
        ("effect", "why"),
        tuple((formatting.quantity(effect), why) for effect, why in sheet.diagnosis.invisible),
    )


def diagnosis_json(sheet: DiagnosisSheet) -> dict[str, Any]:
    """Return a document for `shm.documents.dump`; unknown numbers become null there."""
    document = {
        **diagnosis_document(sheet.diagnosis),
        "answer": sheet.diagnosis.verdict.outcome.name.lower(),
        "summary": write_summary(sheet.diagnosis),
        "details": write_details(sheet.diagnosis),
        "bar": bar_document(sheet.bar),
    }
    return with_assumptions(document, sheet.hanger)
