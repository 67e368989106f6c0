"""State one verdict everywhere: text, page, document, facts, figures and remarks of a diagnosis.

Over every combination of what is probable, what is left, how the sampler did and which frequencies
were excluded, over all diagnoses that tests have made by hand, and over the golden files.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator
from dataclasses import replace
from itertools import product
from typing import Any

import pytest

from shm import documents
from shm.diagnosis_document import diagnosis_document, diagnosis_of
from shm.report.as_html import as_html
from shm.report.as_text import as_text
from shm.report.contents import DiagnosisSheet
from shm.report.diagnosis_report import causes, diagnosis_json, diagnosis_paper, diagnosis_part
from shm.report.diagnosis_summary import write_lead, write_summary
from shm.report.figures import gap_causes, gap_map
from shm.values import NAN, Cause, Diagnosis, Outcome, Outlier, Shrinkage, effect_label
from shm.values.verdict import Reason
from tests.benchmarks.blind_scores import find_contradictions
from tests.contracts import gap_calls as calls
from tests.helpers.diagnoses import a_diagnosis
from tests.report.diagnoses import ALIKE, CASES, HANGER, LED, MASS, make_cause

PAIR = "point_mass + sag"
HELD = ", not to be relied on while the gap is open"
FAILED = (
    "The sampler failed for point mass: 53 effective draws, 200 are needed. Its probability and "
    "its tension are uncertain."
)
PROBABLE: dict[str, tuple[float, float, tuple[Cause, ...]]] = {
    "no gap": (0.9, 0.02, (make_cause("point_mass", 0.08),)),
    "hardly a gap": (0.06, 0.1, (make_cause("point_mass", 0.84, log_bayes_factor=9.0),)),
    "one cause": (0.001, 0.03, LED.causes[:1]),
    "a pair": (0.001, 0.1, (make_cause(PAIR, 0.899, "everywhere + everywhere, transverse"),)),
    "a group": (0.001, 0.049, ALIKE.causes),
    "an exact cause": (0.0, 0.68, (make_cause("point_mass", 0.32, log_bayes_factor=300.0),)),
    "section": (0.001, 0.03, (make_cause("bending_stiffness", 0.969),)),
    "the clock": (0.001, 0.03, (make_cause("sensor_misalignment", 0.969),)),
    "several": (0.04, 0.21, (make_cause("point_mass", 0.45), make_cause("sag", 0.3))),
    "unknown": (0.0, 0.87, (make_cause("point_mass", 0.11, log_bayes_factor=1.0),)),
}
# Standardised residuals, p-value, root mean square in percent.
LEFT = ((1.0, 0.4, 0.2), (30.0, 0.4, 0.2), (1.0, 1e-5, 0.2), (NAN, 0.4, 0.2), (NAN, 0.4, 1.4),
        (NAN, 1e-5, 0.2))  # fmt: skip
GUIDE = Outlier("transverse", 3, "t4", 28.17, 21.7, 0.02, 0.9, acts_alone=0.3)
SLIP = replace(GUIDE, acts_alone=0.0)


def construct() -> Iterator[tuple[str, Diagnosis]]:
    sampled = ((NAN, LED.remarks), (900.0, LED.remarks), (53.0, (FAILED, *LED.remarks)))
    for (name, shares), left, (draws, remarks), aside, orders in product(
        PROBABLE.items(), LEFT, sampled, ((), (SLIP,), (GUIDE,)), (8, 1)
    ):
        no_gap, unknown, found = shares
        where = tuple(
            replace(each, after_z=left[0], z=each.z if no_gap < 0.05 else left[0])
            for each in LED.where
            if each.order <= orders
        )
        yield (
            f"{name}, {left}, {draws}, {len(aside) and aside[0].acts_alone}, {orders}",
            replace(
                LED, where=where, no_gap_probability=no_gap, unexplained_probability=unknown,
                causes=found, fit_p_value=left[1], effective_draws=draws, remarks=remarks,
                shrinkage=Shrinkage(3.0 if no_gap < 0.05 else 0.5, left[2], 3.3, 0.34),
                outliers=aside, groups=ALIKE.groups if name == "a group" else (),
            ),
        )  # fmt: skip


CONSTRUCTED = dict(construct())


def read_golden() -> Iterator[tuple[str, Diagnosis]]:
    for name in calls.SINGLE:
        yield f"golden {name}", _timed(calls.golden(name))
    for each in calls.golden("bridge")["diagnoses"]:
        yield f"golden bridge, hanger {each['hanger']}", _timed(each)
    for name, each in calls.golden("former").items():
        yield f"golden former {name}", diagnosis_of(each)


def _timed(document: dict[str, Any]) -> Diagnosis:
    """Return the diagnosis of a golden document, which states no seconds."""
    return diagnosis_of({**document, calls.VOLATILE: 0.0})


COMPUTED = dict(read_golden())
STORED = {**CASES, "helper": a_diagnosis(), **COMPUTED}
# A page and a document take time: one diagnosis of each verdict is written out in full.
IN_FULL = {
    (each.verdict.outcome, each.verdict.reason, each.verdict.is_uncertain): each
    for each in (*CONSTRUCTED.values(), *STORED.values())
}


def count_numbers(paragraph: str) -> int:
    """Return how many numbers a reader meets; an interval belongs to its number."""
    plain = re.sub(r"\([^()]*(interval|95 %)[^()]*\)", "", paragraph)
    plain = re.sub(r"\b(transverse|longitudinal) \d+|\btest \S+|\bbeam\d", "", plain)
    return len(re.findall(r"(?<![\w.])\d[\d.]*", plain))


def check_words(diagnosis: Diagnosis) -> None:
    verdict, sheet = diagnosis.verdict, DiagnosisSheet(diagnosis, HANGER)
    lead, paragraph = write_lead(diagnosis), write_summary(diagnosis)
    part = diagnosis_part(sheet, "In short")
    assert part.status == verdict.outcome.value
    assert part.full_summary == paragraph
    assert paragraph.startswith(lead)
    assert count_numbers(paragraph) <= 3
    rms_z = [r.after_z for r in diagnosis.where if (r.plane, r.order, r.test) not in [
        (each.plane, each.order, each.test) for each in diagnosis.outliers]]  # fmt: skip
    squares = [z**2 for z in rms_z if math.isfinite(z)]
    is_left = bool(squares) and math.sqrt(sum(squares) / len(squares)) > 2
    explains = verdict.outcome in (Outcome.EXPLAINED, Outcome.ALIKE)
    if explains:
        assert not is_left
        assert diagnosis.fit_p_value >= 0.01
        assert not diagnosis.effective_draws < 200
        assert not any("The sampler failed" in remark for remark in diagnosis.remarks)
        assert max((each.acts_alone for each in diagnosis.outliers), default=0.0) < 0.05
        assert not (math.isnan(verdict.rms_z) and diagnosis.shrinkage.rms_after_percent > 1)
    # What is said of the gap in the sentence is what the status says.
    assert ("is explained by" in lead or "most likely due to" in lead) == (
        verdict.outcome is Outcome.EXPLAINED
    )
    assert ("ot explained: " in lead) == (verdict.outcome is Outcome.UNEXPLAINED)
    assert ("part of the gap" in lead) == (verdict.outcome is Outcome.PARTLY)
    assert ("several causes fit alike" in lead.lower()) == (verdict.outcome is Outcome.ALIKE)
    no_gap = re.search(r"no gap|nothing visible", lead.lower())
    assert bool(no_gap) == (verdict.outcome is Outcome.NO_GAP)
    if no_gap:
        assert diagnosis.leading is None
        assert diagnosis.no_gap_probability >= 0.05
    assert (HELD in paragraph) <= verdict.is_open
    assert verdict.is_uncertain == ("sampler failed" in lead)
    names = {effect for each in (verdict.claim.causes if verdict.claim else ()) for effect in
             each.effects}  # fmt: skip
    off = {"bending_stiffness", "section_size", "distributed_mass", "effective_length"}
    assert ("calliper and tape" in lead) == bool(names & off)
    marked = [row[0] for row, mark in zip(causes(sheet).rows, causes(sheet).marks, strict=True)
              if mark == "claimed"]  # fmt: skip
    if verdict.claim is not None:
        assert len(marked) == len(verdict.claim.causes)
        first = verdict.claim.causes[0]
        labels = (
            [marked[0]] if len(marked) == 1 else [effect_label(each, "") for each in first.effects]
        )
        assert all(each.lower() in lead.lower() for each in labels)
    else:
        what = "no gap" if verdict.outcome is Outcome.NO_GAP else "something not in the catalogue"
        assert marked == [what]
    left = {fact[0]: fact[1] for fact in part.facts}.get("What is left", "")
    assert not (left == "within the errors" and (is_left or not diagnosis.fit_p_value >= 0.01))
    assert not (explains and left == "more than the errors")
    assert not (verdict.outcome is Outcome.PARTLY and verdict.alone is None
                and left == "within the errors")  # fmt: skip


@pytest.mark.parametrize("case", PROBABLE)
def test_words_agree_constructed(case: str) -> None:
    found = [each for name, each in CONSTRUCTED.items() if name.startswith(f"{case}, ")]
    assert len(found) == 108
    for each in found:
        check_words(each)


@pytest.mark.parametrize("name", STORED)
def test_words_agree_stored(name: str) -> None:
    check_words(STORED[name])


@pytest.mark.parametrize("name", COMPUTED)
def test_no_answer_contradicts_itself(name: str) -> None:
    """Probabilities, verdict, lead, remarks, residuals and interval, each computed once more."""
    assert find_contradictions(COMPUTED[name]) == []


def test_every_outcome_is_constructed() -> None:
    assert {outcome for outcome, *_ in IN_FULL} == set(Outcome)


@pytest.mark.parametrize("key", IN_FULL, ids=str)
def test_text_page_and_document_agree(key: tuple[Outcome, Reason, bool]) -> None:
    diagnosis, (outcome, *_) = IN_FULL[key], key
    sheet = DiagnosisSheet(diagnosis, HANGER)
    text = " ".join(as_text(diagnosis_paper(sheet)).split())
    page = as_html(diagnosis_paper(sheet))
    document = json.loads(documents.dump(diagnosis_json(sheet)))
    lead = write_lead(diagnosis)
    assert f": {outcome.value} =" in text
    assert f">{outcome.value}</" in page
    assert document["answer"] == document["verdict"]["outcome"] == outcome.name.lower()
    assert lead in text
    assert lead.replace("'", "&#39;") in page
    assert document["summary"].startswith(lead)
    assert lead in " ".join(diagnosis.summary().split())
    assert outcome.value.lower() in repr(diagnosis)
    is_drawn = gap_map.has_cause(sheet)
    assert is_drawn <= (diagnosis.verdict.claim is not None)
    assert lead in gap_causes.FIGURE.alt(sheet)


@pytest.mark.parametrize("key", IN_FULL, ids=str)
def test_verdict_survives_the_document(key: tuple[Outcome, Reason, bool]) -> None:
    back = diagnosis_of(json.loads(documents.dump(diagnosis_document(IN_FULL[key]))))
    assert (back.verdict.outcome, back.verdict.reason, back.verdict.is_uncertain) == key


def test_former_documents_are_read() -> None:
    document = diagnosis_document(replace(LED, remarks=(FAILED,)))
    for residual in document["where"]:
        del residual["after_z"]
    for key in ("effective_draws", "verdict"):
        del document[key]
    document["not_falsified"] = ["no gap"]
    document["compatibility"] = {"not_falsified": ["no gap"], "falsified": [],
                                 "bound_percent": 0.2, "data": 80}  # fmt: skip
    document["remainder"] = {"rms_percent": 0.8, "like_tension": 0.3, "tension_percent": -2.3,
                             "law": []}  # fmt: skip
    back = diagnosis_of(json.loads(documents.dump(document)))
    assert back.effective_draws == 53
    assert back.verdict.outcome is Outcome.UNEXPLAINED
    sound = diagnosis_of({**document, "remarks": []})
    assert math.isnan(sound.effective_draws)
    assert sound.verdict.outcome is Outcome.EXPLAINED
    assert sound.verdict.claim is not None
    assert sound.verdict.claim.leading.parameters == MASS
