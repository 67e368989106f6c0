"""What a gap diagnosis claims, in words."""

from __future__ import annotations

from dataclasses import replace

import pytest

from shm.models.effects import EFFECTS, Survey
from shm.report import formatting
from shm.report.diagnosis_summary import write_details, write_summary
from shm.report.diagnosis_wording import label, phrase, tension_words
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
    UNDECIDED,
    UNEXPLAINED,
    make_cause,
)

RICH = Survey(
    tests=("t1", "t2"), planes=("transverse", "longitudinal"), sensor_places_m=(2.0, 4.0),
    biaxial=True, temperatures_c=(5.0, 25.0), amplitudes=(0.5, 2.0),
    added_masses=(AddedMass(25.0, 3.6),),
)  # fmt: skip


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
         "Point mass explains a part of the gap, but more is left than the errors allow: "
         "measurements as far off would come by chance with probability below 0.01 only."),
        (replace(ALIKE, fit_p_value=0.002), "first: one of rotational end flexibility (both ends)"),
    ],
)  # fmt: skip
def test_the_paragraphs_say(diagnosis: Diagnosis, words: str) -> None:
    assert words in said(diagnosis)


@pytest.mark.parametrize(("count", "words"), [(1, "one mode"), (3, "three modes")])
def test_of_few_data_it_says_how_little_they_say(count: int, words: str) -> None:
    few = tuple(each for each in NO_GAP.where if each.plane == "transverse" and each.order <= count)
    tension_n = TensionEstimate(700e3, 14e3, 677e3, 723e3, 672e3, 728e3)
    told = write_summary(replace(NO_GAP, where=few, tension_after_n=tension_n))
    assert told.startswith(f"Nothing visible in {words} of transverse vibration")
    assert "the tension may be off by 4 % (95 %)" in told
    unexplained = replace(UNEXPLAINED, where=few, tension_after_n=tension_n)
    assert "decide little" in write_summary(unexplained)


def test_a_group_is_claimed_by_its_sum_where_no_member_leads_alone() -> None:
    shared = [replace(cause, probability=0.2, group=0) for cause in ALIKE.causes[:3]]
    diagnosis = replace(
        ALIKE, causes=tuple(shared), no_gap_probability=0.04, unexplained_probability=0.36
    )
    assert diagnosis.verdict.outcome is Outcome.ALIKE
    assert diagnosis.verdict.probability == pytest.approx(0.6)
    assert "rotational end flexibility (both ends), effective" in said(diagnosis)


def test_of_a_cause_that_fits_and_is_not_claimed_it_says_why() -> None:
    pair = make_cause("point_mass + section_loss", 0.43)
    fits = replace(UNEXPLAINED, causes=(pair,), unexplained_probability=0.57, fit_p_value=0.4)
    why = "point mass + section loss fits, but so would much that has another cause"
    assert why in said(fits)
    assert why not in said(replace(fits, fit_p_value=0.001))
    assert "so would much" not in said(replace(UNEXPLAINED, fit_p_value=0.4))


def test_beside_no_gap_only_a_rival_that_counts_calls_for_a_measurement() -> None:
    told = NextMeasurement("two-axis sensors at 3.1 m", ("no gap", "sag"), 39.0)
    faint = replace(NO_GAP, causes=(make_cause("sag", 0.02),), next_measurements=(told,))
    assert "measure next" not in said(faint)
    rival = replace(faint, causes=(make_cause("sag", 0.2),), no_gap_probability=0.7)
    assert "To tell no gap from sag, measure next: two-axis sensors" in said(rival)


def test_where_another_hanger_may_have_been_hit_that_comes_first_and_nothing_is_relied_on() -> None:
    sure = LED
    doubted = replace(sure, remarks=("Doubtful: test t1. It does not fit hanger 3.",))
    assert "make sure" not in said(sure)
    assert doubted.verdict.is_doubted
    assert doubted.verdict.outcome is sure.verdict.outcome
    assert said(doubted).startswith("Make sure first that these tests are of this hanger: ")
    assert "not to be relied on while it may be another hanger" in said(doubted)


def test_a_mean_outside_its_interval_is_not_told() -> None:
    """Most draws at a bound and a few far off: the mean lies below the 5 % quantile."""
    piled = TensionEstimate(2099.2, 8.1, 2099.27, 2100.0)
    assert tension_words(piled, force_unit(2099.2)) == "2.09927 to 2.10000 kN (90 % interval)"


def test_a_gap_that_shrinks_only_where_it_was_fitted_is_not_relied_on() -> None:
    only_inside = replace(LED, shrinkage=Shrinkage(2.3, 0.2, 2.5, 2.6))
    assert "do not rely on the cause yet" in said(only_inside)
    unchecked = replace(LED, shrinkage=Shrinkage(2.3, 0.2, NAN, NAN))
    assert "Nothing was held out of the fit" in said(unchecked)
    assert "held out" not in said(LED)


def test_no_gap_is_not_called_an_explanation_where_the_baseline_misses_by_percents() -> None:
    missed = replace(NO_GAP, shrinkage=Shrinkage(2.4, NAN, NAN, NAN))
    assert said(missed).startswith("No gap can be shown, though the baseline")


def test_a_measurement_that_hardly_tells_is_not_recommended() -> None:
    poor = NextMeasurement("two more modes", ("point_mass", "no gap"), 0.6)
    assert "No measurement that was considered would tell point mass from no gap" in said(
        replace(LED, next_measurements=(poor,))
    )
    fair = replace(poor, expected_log_bayes_factor=1.2)
    assert "measure next: two more modes" in said(replace(LED, next_measurements=(poor, fair)))


@pytest.mark.parametrize(
    ("estimate", "words"),
    [
        (EffectEstimate("mass_kg", "kg", 12.13, 1.8, 9.2, 15.1), "12 kg (9 to 15)"),
        (EffectEstimate("x_m", "m", 3.412, 0.04, 3.343, 3.478), "3.41 m (3.34 to 3.48)"),
        (EffectEstimate("mass_kg", "kg", 1234.0, 300.0, 734.0, 1734.0), "1200 kg (700 to 1700)"),
        (EffectEstimate("loss", "fraction", 0.081, 0.01, 0.065, 0.098), "8.1 % (6.5 to 9.8)"),
        (EffectEstimate("log10_k1", "N m/rad", 6.8, 0.1, 6.6, 7.0), "6.3 MN m/rad (4.0 to 10)"),
        (EffectEstimate("stiffness_n_m", "N/m", 4.2e4, 3e3, 3.7e4, 4.7e4), "42 kN/m (37 to 47)"),
        (
            EffectEstimate("stiffness_ratio", "times EI", 20.1, 20.0, 2.13, 80.4),
            "20 times EI (2.1 to 80)",
        ),
        (EffectEstimate("mass_kg", "kg", 12.0, NAN, NAN, NAN), "12 kg"),
        (EffectEstimate("mass_kg", "kg", NAN, NAN, NAN, NAN), "of unknown size kg"),
    ],
)
def test_sizes_have_the_digits_that_their_intervals_deserve(
    estimate: EffectEstimate, words: str
) -> None:
    assert str(size(estimate)) == words


@pytest.mark.parametrize(
    ("mean", "q05", "q95", "words"),
    [
        (0.12, 0.09, 0.15, "0.12 m (0.09 to 0.15) longer"),
        (-0.12, -0.15, -0.09, "0.12 m (0.09 to 0.15) shorter"),
        (0.02, -0.05, 0.09, "+0.02 m (-0.05 to +0.09) longer"),
    ],
)
def test_directions_are_said_in_words_where_they_are_sure(
    mean: float, q05: float, q95: float, words: str
) -> None:
    length = EffectEstimate("length_change_m", "m", mean, 0.02, q05, q95)
    cause = make_cause("effective_length", 0.9, "deck end", parameters=(length,))
    assert phrase(cause) == f"an effective length {words} than described at the deck end"


def estimates(effect: str, at: str) -> Cause:
    """Return a cause with each parameter of the effect in the middle of its prior."""
    variant = next(v for v in EFFECTS[effect].variants(HANGER, RICH) if v.at == at)
    found = []
    for parameter in EFFECTS[effect].parameters(HANGER, variant):
        middle = (parameter.lower + parameter.upper) / 2
        width = 0.1 * (parameter.upper - parameter.lower)
        found.append(
            EffectEstimate(
                parameter.name, parameter.unit, middle, width, middle - width, middle + width
            )
        )
    return make_cause(effect, 0.9, at, parameters=tuple(found))


@pytest.mark.parametrize("effect", EFFECTS)
def test_every_effect_of_the_catalogue_is_put_in_words_with_its_size_at_every_place(
    effect: str,
) -> None:
    for variant in EFFECTS[effect].variants(HANGER, RICH):
        told = phrase(estimates(effect, variant.at))
        assert not told.startswith(formatting.quantity(effect) + " at")
        assert told.count("(") >= 1
        assert "_" not in told


def test_a_pair_is_told_with_both_sizes_and_places() -> None:
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


def test_a_pair_whose_effects_share_a_name_tells_each_its_own() -> None:
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


def test_a_cause_of_unknown_size_is_told_by_its_name() -> None:
    assert phrase(make_cause("sag", 0.9, "everywhere, transverse")) == "sag in the transverse plane"
