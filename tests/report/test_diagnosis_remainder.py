"""What a diagnosis leaves open, in words."""

from __future__ import annotations

from dataclasses import replace

import pytest

from shm.diagnosis_document import diagnosis_document, diagnosis_of
from shm.report.contents import DiagnosisSheet
from shm.report.diagnosis_report import causes
from shm.report.diagnosis_summary import consequences, verdict
from shm.values import Compatibility, LawTerm, Remainder, TensionEstimate
from tests.report.diagnoses import HANGER, LED, NO_GAP, UNEXPLAINED, make_residuals

LONGITUDINAL = LawTerm(
    "order squared", "all tests", ("longitudinal",), 2.1, 0.1, 8.2, coefficient=3e-4
)
ABOVE = LawTerm(
    "local", "above a level", ("transverse", "longitudinal"), -0.6, 0.1, 4.6,
    x_m=3.6, threshold=0.65, coefficient=-6e-3,
)  # fmt: skip
WARM = LawTerm("even", "temperature", ("transverse",), 0.4, 0.1, 5.0, coefficient=2e-4)
LEFT = Remainder(0.8, 0.3, -2.3, (LONGITUDINAL, ABOVE, WARM), 1.1, 0.4)
WITH_LAW = replace(UNEXPLAINED, remainder=LEFT)
KEPT = Compatibility(("no gap", "point_mass"), ("section_loss",), 0.17, 80)


def test_the_law_is_told_with_its_evidence_and_what_is_held_out() -> None:
    said = consequences(WITH_LAW)
    assert "grows with the order squared in the longitudinal plane only (+2.1 %" in said
    assert "log Bayes factor 8" in said
    assert "only above a level of 0.65" in said
    assert "held out it shrinks from 1.1 to 0.4 %" in said
    assert "30 % looks like a change of the tension, of -2.3 %" in said
    assert "What is left" not in consequences(LED)
    large = replace(LEFT, law=(replace(WARM, change_percent=-207.0),))
    assert "(-207 % over its range" in consequences(replace(WITH_LAW, remainder=large))


def test_what_is_compatible_stands_in_the_table_and_in_a_sentence() -> None:
    found = replace(LED, compatibility=KEPT)
    rows = {row[0]: row[3] for row in causes(DiagnosisSheet(found, HANGER)).rows}
    assert (rows["point mass"], rows["section loss"]) == ("yes", "no")
    assert (rows["no gap"], rows["something not in the catalogue"]) == ("yes", "")
    assert "do not contradict no gap and point mass" in consequences(found)
    none = replace(KEPT, not_falsified=(), falsified=("no gap",))
    assert "contradict all that was fitted" in consequences(replace(LED, compatibility=none))


@pytest.mark.parametrize(("count", "words"), [(1, "one mode"), (3, "three modes")])
def test_of_few_data_the_first_sentence_says_how_little_they_say(count: int, words: str) -> None:
    few = tuple(each for each in make_residuals(1, count) if each.plane == "transverse")
    tension_n = TensionEstimate(700e3, 14e3, 677e3, 723e3, 672e3, 728e3)
    said = verdict(replace(NO_GAP, where=few, tension_after_n=tension_n))
    assert said.startswith(f"Nothing visible in {words} of transverse vibration")
    assert "the tension may be off by 4 % (95 %)" in said
    assert "decide little" in verdict(replace(UNEXPLAINED, where=few))


def test_the_document_holds_all_of_it() -> None:
    found = replace(WITH_LAW, compatibility=KEPT)
    document = diagnosis_document(found)
    assert document["not_falsified"] == ["no gap", "point_mass"]
    back = diagnosis_of(document)
    assert back.compatibility == KEPT
    assert back.remainder is not None
    assert back.remainder.law[1] == ABOVE
    for key in ("not_falsified", "compatibility", "remainder"):
        del document[key]
    assert diagnosis_of(document).remainder is None
