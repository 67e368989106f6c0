"""A gap diagnosis in words: what it claims, and its page, text, document and place in a report."""

from __future__ import annotations

import json
import re
from dataclasses import replace

import pytest

from shm import documents
from shm.models.effects import EFFECTS, Survey
from shm.report import formatting
from shm.report.as_html import as_html
from shm.report.as_text import as_text
from shm.report.contents import DiagnosisSheet, HangerReport
from shm.report.diagnosis_report import diagnosis_json, diagnosis_paper
from shm.report.diagnosis_summary import facts, write_details, write_summary
from shm.report.diagnosis_wording import label, phrase, tension_words
from shm.report.hanger_report import hanger_json, hanger_paper
from shm.report.sizes import size
from shm.values import (
    NAN,
    AddedMass,
    Cause,
    Diagnosis,
    EffectEstimate,
    NextMeasurement,
    Outcome,
    Shrinkage,
    TensionEstimate,
)
from shm.values.rounding import force_unit
from tests.report.diagnoses import (
    ALIKE,
    HANGER,
    LED,
    MASS,
    NO_GAP,
    STRING_HANGER,
    UNDECIDED,
    UNEXPLAINED,
    make_cause,
    sheet,
)
from tests.report.outline import Outline, flat, page_words, text_words

RATIO = EffectEstimate("stiffness_ratio", "times EI", 20.1, 20.0, 2.13, 80.4)
RICH = Survey(
    tests=("t1", "t2"), planes=("transverse", "longitudinal"), sensor_places_m=(2.0, 4.0),
    biaxial=True, temperatures_c=(5.0, 25.0), amplitudes=(0.5, 2.0),
    added_masses=(AddedMass(25.0, 3.6),),
)  # fmt: skip


FITS_TOO = "point mass + section loss fits, but so would much that has another cause"
FITS = replace(UNEXPLAINED, causes=(make_cause("point_mass + section_loss", 0.43),),
               unexplained_probability=0.57, fit_p_value=0.4)  # fmt: skip
SHARED = replace(
    ALIKE, causes=tuple(replace(each, probability=0.2, group=0) for each in ALIKE.causes[:3]),
    no_gap_probability=0.04, unexplained_probability=0.36,
)  # fmt: skip
"""A group that is claimed by its sum, where no member leads alone."""
DOUBTED = replace(LED, remarks=("Doubtful: test t1. It does not fit hanger 3.",))
SAG_TOLD = NextMeasurement("two-axis sensors at 3.1 m", ("no gap", "sag"), 39.0)
POOR = NextMeasurement("two more modes", ("point_mass", "no gap"), 0.6)


def said(diagnosis: Diagnosis) -> str:
    return f"{write_summary(diagnosis)} {write_details(diagnosis)}"


@pytest.mark.parametrize(
    ("diagnosis", "words"),
    [
        (LED, "The gap is explained by point mass, probability 0.93; what is left is within the "
              "stated errors."),
        (LED, "The cause: a point mass of 12 kg (9 to 15) at 3.4 m (3.1 to 3.7)."),
        (LED, "Averaged over all explanations, the tension is 702 ± 12 kN."),
        (LED, "To tell point mass from section loss, measure next: known mass of 25 kg at 3.6 m."),
        (ALIKE, "Measure section, length and weight with calliper and tape first: several causes "
                "fit alike"),
        (ALIKE, "effective length (both ends) and bending stiffness, together probability 0.90."),
        (NO_GAP, "No gap is visible: the baseline beam1 explains the measurements (no gap, "
                 "probability 0.92)."),
        (NO_GAP, "What acts only beyond swings of these hits, such as a guide with more play"),
        (replace(NO_GAP, widest_swing_m=8.3e-5),
         "What acts only beyond swings of 0.083 mm at the sensors"),
        (replace(LED, causes=(make_cause("sensor_misalignment", 0.93),)),
         "What differs is the measurement's, not the hanger's: the gap is explained by"),
        (replace(LED, causes=(make_cause("timebase", 0.6), make_cause("point_mass", 0.33))),
         "What differs is the measurement's, not the hanger's: the gap is most likely due to"),
        (replace(NO_GAP, no_gap_probability=0.3),
         "No cause is claimed, for it may be that there is no gap"),
        (UNEXPLAINED, "Not explained: most likely none of the effects that were tried (rotational "
                      "end flexibility left out) explains it, and the probability of something "
                      "else is 0.87."),
        (replace(UNEXPLAINED, left_out=(), unexplained_probability=0.95),
         "Not explained: none of the effects in the catalogue explains it"),
        (UNEXPLAINED, "The most probable: a point mass of 12 kg (9 to 15)"),
        (UNEXPLAINED, "702 ± 12 kN, not to be relied on while the gap is open."),
        (UNDECIDED, "Several causes fit alike, and these data cannot tell them apart: point mass "
                    "and sag, together probability 0.75."),
        (replace(LED, fit_p_value=0.002),
         "Point mass explains part of the gap, but more is left than the errors allow: "
         "measurements as far off would come by chance with probability below 0.01 only."),
        (replace(ALIKE, fit_p_value=0.002), "first: rotational end flexibility (both ends)"),
        (SHARED, "rotational end flexibility (both ends), effective"),
        (FITS, FITS_TOO),
        # Beside "no gap" a rival that counts calls for a measurement.
        (replace(NO_GAP, causes=(make_cause("sag", 0.2),), no_gap_probability=0.7,
                 next_measurements=(SAG_TOLD,)),
         "To tell no gap from sag, measure next: two-axis sensors"),
        (DOUBTED, "not to be relied on while it may be another hanger"),
        # A gap that shrinks only where it was fitted.
        (replace(LED, shrinkage=Shrinkage(2.3, 0.2, 2.5, 2.6)), "do not rely on the cause yet"),
        (replace(LED, shrinkage=Shrinkage(2.3, 0.2, NAN, NAN)), "that the cause moves was held"),
        (replace(LED, next_measurements=(POOR,)),
         "No measurement that was considered would tell point mass from no gap"),
        (replace(LED, next_measurements=(POOR, replace(POOR, expected_log_bayes_factor=1.2))),
         "measure next: two more modes"),
    ],
)  # fmt: skip
def test_paragraphs_say(diagnosis: Diagnosis, words: str) -> None:
    assert words in said(diagnosis)


@pytest.mark.parametrize(
    ("diagnosis", "words"),
    [
        (replace(FITS, fit_p_value=0.001), FITS_TOO),
        (replace(UNEXPLAINED, fit_p_value=0.4), "so would much"),
        (replace(NO_GAP, causes=(make_cause("sag", 0.02),), next_measurements=(SAG_TOLD,)),
         "measure next"),
        (LED, "make sure"),
        (LED, "held out"),
    ],
)  # fmt: skip
def test_paragraphs_do_not_say(diagnosis: Diagnosis, words: str) -> None:
    assert words not in said(diagnosis)


def test_paragraphs_begin_with_what_comes_first() -> None:
    """That another hanger may have been hit; that the baseline misses by percents."""
    assert said(DOUBTED).startswith("Make sure first that these tests are of this hanger: ")
    assert DOUBTED.verdict.is_doubted
    assert DOUBTED.verdict.outcome is LED.verdict.outcome
    missed = replace(NO_GAP, shrinkage=Shrinkage(2.4, NAN, NAN, NAN))
    assert said(missed).startswith("No gap can be shown, though the baseline")
    assert SHARED.verdict.outcome is Outcome.ALIKE
    assert SHARED.verdict.probability == pytest.approx(0.6)


@pytest.mark.parametrize(("count", "words"), [(1, "one mode"), (3, "three modes")])
def test_of_few_data_it_says_how_little_they_say(count: int, words: str) -> None:
    few = tuple(each for each in NO_GAP.where if each.plane == "transverse" and each.order <= count)
    tension_n = TensionEstimate(700e3, 14e3, 677e3, 723e3, 672e3, 728e3)
    told = write_summary(replace(NO_GAP, where=few, tension_after_n=tension_n))
    assert told.startswith(f"Nothing visible in {words} of transverse vibration")
    assert "the tension may be off by 4 % (95 %)" in told
    unexplained = replace(UNEXPLAINED, where=few, tension_after_n=tension_n)
    assert "decide little" in write_summary(unexplained)


def test_a_mean_outside_its_interval_is_not_told() -> None:
    """Most draws at a bound and a few far off: the mean lies below the 5 % quantile."""
    piled = TensionEstimate(2099.2, 8.1, 2099.27, 2100.0)
    assert tension_words(piled, force_unit(2099.2)) == "2.09927 to 2.10000 kN (90 % interval)"


@pytest.mark.parametrize(
    ("estimate", "words"),
    [
        (EffectEstimate("mass_kg", "kg", 12.13, 1.8, 9.2, 15.1), "12 kg (9 to 15)"),
        (EffectEstimate("x_m", "m", 3.412, 0.04, 3.343, 3.478), "3.41 m (3.34 to 3.48)"),
        (EffectEstimate("mass_kg", "kg", 1234.0, 300.0, 734.0, 1734.0), "1200 kg (700 to 1700)"),
        (EffectEstimate("loss", "fraction", 0.081, 0.01, 0.065, 0.098), "8.1 % (6.5 to 9.8)"),
        (EffectEstimate("log10_k1", "N m/rad", 6.8, 0.1, 6.6, 7.0), "6.3 MN m/rad (4.0 to 10)"),
        (EffectEstimate("stiffness_n_m", "N/m", 4.2e4, 3e3, 3.7e4, 4.7e4), "42 kN/m (37 to 47)"),
        (RATIO, "20 times EI (2.1 to 80)"),
        (EffectEstimate("mass_kg", "kg", 12.0, NAN, NAN, NAN), "12 kg"),
        (EffectEstimate("mass_kg", "kg", NAN, NAN, NAN, NAN), "of unknown size kg"),
    ],
)
def test_sizes_have_digits_of_intervals(estimate: EffectEstimate, words: str) -> None:
    assert str(size(estimate)) == words


@pytest.mark.parametrize(
    ("mean", "q05", "q95", "words"),
    [
        (0.12, 0.09, 0.15, "0.12 m (0.09 to 0.15) longer"),
        (-0.12, -0.15, -0.09, "0.12 m (0.09 to 0.15) shorter"),
        (0.02, -0.05, 0.09, "+0.02 m (-0.05 to +0.09) longer"),
    ],
)
def test_sure_directions_are_words(mean: float, q05: float, q95: float, words: str) -> None:
    length = EffectEstimate("length_change_m", "m", mean, 0.02, q05, q95)
    cause = make_cause("effective_length", 0.9, "deck end", parameters=(length,))
    assert phrase(cause) == f"an effective length {words} than described at the deck end"


def estimates(effect: str, at: str) -> Cause:
    """Return a cause with each parameter of the effect in the middle of its prior."""
    variant = next(v for v in EFFECTS[effect].variants(HANGER, RICH) if v.at == at)
    found = []
    for each in EFFECTS[effect].parameters(HANGER, variant):
        mid, width = (each.lower + each.upper) / 2, 0.1 * (each.upper - each.lower)
        found.append(EffectEstimate(each.name, each.unit, mid, width, mid - width, mid + width))
    return make_cause(effect, 0.9, at, parameters=tuple(found))


@pytest.mark.parametrize("effect", EFFECTS)
def test_every_effect_has_words_and_size(effect: str) -> None:
    for variant in EFFECTS[effect].variants(HANGER, RICH):
        told = phrase(estimates(effect, variant.at))
        assert not told.startswith(formatting.quantity(effect) + " at")
        assert told.count("(") >= 1
        assert "_" not in told


def test_pair_tells_both_sizes_and_places() -> None:
    turned = EffectEstimate("log10_k1", "N m/rad", 6.8, 0.1, 6.6, 7.0)
    pair = make_cause(
        "point_mass + rotational_end_flexibility", 0.9, "everywhere + deck end, transverse",
        parameters=(*MASS, turned),
    )  # fmt: skip
    assert phrase(pair) == (
        "a point mass of 12 kg (9 to 15) at 3.4 m (3.1 to 3.7) together with ends that turn "
        "against springs of 6.3 MN m/rad (4.0 to 10) at the deck end in the transverse plane"
    )
    assert label(pair) == "point mass + rotational end flexibility (deck end, transverse)"
    found = tuple(
        EffectEstimate(name, unit, mean, 0.1 * mean, 0.8 * mean, 1.2 * mean)
        for name, unit, mean in (
            ("mass_kg", "kg", 10.0), ("point_mass.x_m", "m", 3.0),
            ("intermediate_support.x_m", "m", 9.0), ("stiffness_n_m", "N/m", 5e4),
        )
    )  # fmt: skip
    told = phrase(make_cause("point_mass + intermediate_support", 0.9, parameters=found))
    assert "a point mass of 10.0 kg (8.0 to 12.0) at 3.0 m" in told
    assert "an intermediate support of 50 kN/m (40 to 60) at 9.0 m" in told
    assert phrase(make_cause("sag", 0.9, "everywhere, transverse")) == "sag in the transverse plane"


def test_every_form_leads_with_the_answer(unpainted: None) -> None:
    """The cause, its size, place and probability; remarks on bad data stand beside it."""
    page = page_words(diagnosis_paper(sheet("led")))
    verdict = "The gap is explained by point mass, probability 0.93;"
    cause = "The cause: a point mass of 12 kg (9 to 15) at 3.4 m (3.1 to 3.7)."
    order = ["Explained", verdict, cause, "What causes the gap"]
    assert sorted(map(page.index, order)) == [page.index(words) for words in order]
    assert page.index("transverse 9 and 10 are out of order") < page.index("What causes the gap")
    assert "What to mind about these data" not in page_words(diagnosis_paper(sheet("alike")))
    document = json.loads(documents.dump(diagnosis_json(sheet("led"))))
    assert document["answer"] == "explained"
    assert document["summary"].startswith("The gap is explained by point mass")
    assert document["details"].startswith("The cause: a point mass of 12 kg")
    assert document["causes"][0]["effect"] == "point_mass"
    assert document["tension_n"]["after"]["mean"] == pytest.approx(702.3e3)


def test_tables_keep_no_gap_and_lead_with_an_excluded_frequency() -> None:
    text = as_text(diagnosis_paper(sheet("led")))
    table = text[text.index("CAUSES") : text.index("SIZES")]
    assert "no gap" in table
    assert "something not in" in table
    assert "9 further effects" in flat(table)
    text = as_text(diagnosis_paper(sheet("blunder")))
    rows = text[text.index("WHERE THE GAP LIES") :].splitlines()
    (marked,) = (line for line in rows if "excluded" in line)
    assert marked.split()[:3] == ["transverse", "3", "t4"]
    others = [line for line in rows if re.search(r" t\d ", line) and line is not marked]
    assert rows.index(marked) < rows.index(others[0])


def test_report_holds_diagnosis_or_command(bare: HangerReport) -> None:
    paper = hanger_paper(bare)
    for written in (page_words(paper), text_words(paper)):
        assert "shm gap diagnose --hanger 3" in written
    assert hanger_json(bare)["diagnosis"] is None
    watched = "beam1 with point mass, adopted 2026-05-01: gap 2.30 % before, 0.62 % now."
    diagnosed = replace(bare, diagnosis=LED, gap_watch=watched)
    outline = Outline.of(as_html(hanger_paper(diagnosed)))
    assert {"causes-title", "gap_map-title"} <= {each.get("id") for _, each in outline.tags}
    for written in (outline.told, text_words(hanger_paper(diagnosed))):
        assert "explained by point mass" in written
        assert watched in written
        assert "has not been diagnosed" not in written
    document = hanger_json(diagnosed)
    assert document["diagnosis"]["causes"][0]["effect"] == "point_mass"
    assert document["gap_watch"] == watched


def test_facts_have_intervals_and_no_endless_number() -> None:
    found = facts(DiagnosisSheet(replace(LED, fit_p_value=1e-29), STRING_HANGER))
    told = {what: (value, beside) for what, value, beside in found}
    p_value = "posterior predictive p-value < 0.01"
    assert told["What is left"] == ("more than the errors", p_value)
    assert told["Tension"] == (
        "702 ± 12 kN", "averaged over all explanations; beam1 alone 731.4 ± 3.4 kN",
    )  # fmt: skip
