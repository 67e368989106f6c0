"""The whole diagnosis: an answer with probabilities that add to 1, also of poor data."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from shm.diagnosis_document import diagnosis_document
from shm.documents import dump
from shm.errors import BadInput, UsageError
from shm.gap import GapOptions, diagnose
from shm.gap.causes.baseline import BEAMS
from shm.inference import select
from shm.models import build
from shm.models.effects import Variant
from shm.report.diagnosis_summary import write_lead
from shm.simulate import PlantedEffect
from shm.values import NAN, Diagnosis, EffectPrior, Hanger, ModalTest
from shm.values.verdict import SHAPES_OFF, Outcome
from tests.helpers.effects import all_but
from tests.helpers.gap_campaigns import HANGER as PLAIN
from tests.helpers.gap_campaigns import PLANTED_CLAMP as CLAMP
from tests.helpers.gap_campaigns import campaign as own_campaign
from tests.helpers.gap_campaigns import simulated

FEW_EFFECTS = GapOptions("beam1", without=all_but("timebase", "bending_stiffness"))
CLAMPS_ALONE = GapOptions("beam1", without=all_but("point_mass"))
GREMLINS = EffectPrior("gremlins", "mass_kg", 1.0, 2.0)
SOME = all_but("point_mass", "section_loss", "bending_stiffness", "timebase")


def planted(*effects: PlantedEffect, **plan: Any) -> tuple[ModalTest, ...]:
    return simulated(*effects, seed=101, **plan)


@pytest.fixture(scope="module")
def untouched() -> Diagnosis:
    """Of a hanger that nothing was planted on."""
    return diagnose(planted(), PLAIN, GapOptions("beam1", without=SOME))


def test_a_planted_clamp_is_named_with_its_size_and_place() -> None:
    """By the whole catalogue; the gap shrinks in and out of the fit."""
    clamped_on = diagnose(simulated(CLAMP, seed=102), PLAIN)
    assert clamped_on.leading is not None
    assert clamped_on.leading.effect == "point_mass"
    size = {each.name: each for each in clamped_on.leading.parameters}
    assert size["mass_kg"].mean == pytest.approx(12.0, abs=4 * size["mass_kg"].sd)
    assert size["x_m"].mean == pytest.approx(3.4, abs=4 * size["x_m"].sd)
    assert clamped_on.groups == () or clamped_on.leading.group is not None
    best = clamped_on.places[0]
    assert best.kind == "point mass"
    assert best.low_m - 0.05 < 3.4 < best.high_m + 0.05
    assert best.high_m - best.low_m < 0.5
    assert best.share > 0.9
    x_m, density = np.array(best.profile).T
    assert density.sum() * (x_m[1] - x_m[0]) == pytest.approx(1)
    shrunk = clamped_on.shrinkage
    assert shrunk.rms_after_percent < 0.2 * shrunk.rms_before_percent
    assert shrunk.held_out_after_percent < 0.3 * shrunk.held_out_before_percent
    assert sum(row.share for row in clamped_on.where) == pytest.approx(1.0)
    causes = sum(cause.probability for cause in clamped_on.causes)
    all_told = causes + clamped_on.no_gap_probability + clamped_on.unexplained_probability
    assert all_told == pytest.approx(1.0)


def test_the_mirror_image_of_a_place_is_named_and_the_size_is_of_one_side() -> None:
    """Without shapes frequencies tell a place from its mirror image hardly or not at all."""
    clamp = (("point_mass", Variant()),)
    unloaded = own_campaign(clamp, (12.0, 3.4), sd=5e-5)[0]
    found = diagnose([unloaded], PLAIN, CLAMPS_ALONE)
    leading = found.leading
    assert leading is not None
    (place,) = (each for each in leading.parameters if each.name == "x_m")
    (other,) = leading.also_at
    mirrored_m = PLAIN.length_m - float(other.removeprefix("at ").removesuffix(" m"))
    assert place.mean == pytest.approx(mirrored_m, abs=0.1)
    assert place.q95 - place.q05 < 0.5
    both = found.places[0]  # its interval spans the two
    assert both.low_m < 3.6
    assert both.high_m > 8.4
    assert both.x_m == pytest.approx(place.mean)


def test_an_end_that_turns_is_placed_at_its_end() -> None:
    springs = {"log10_k1": 7.0, "log10_k2": 7.0}
    turning = PlantedEffect("rotational_end_flexibility", "deck end", springs)
    options = GapOptions("beam1", without=all_but(turning.name))
    (found,) = diagnose(planted(turning), PLAIN, options).places
    assert found.kind == "flexible end"
    assert found.x_m == found.low_m == found.high_m == 0.0
    assert found.share > 0.9


def test_a_cause_that_moves_no_frequency_is_not_doubted_by_held_out_ones() -> None:
    turn = PlantedEffect("sensor_misalignment", "sensor at 3.48 m", {"angle_deg": 12.0})
    options = GapOptions("beam1", without=all_but(turn.name, "point_mass"))
    found = diagnose(planted(turn), PLAIN, options)
    assert found.leading is not None
    assert found.leading.effect == turn.name
    assert found.shrinkage.held_out_before_percent > 0
    assert found.verdict.holds_out is None


def test_shapes_that_are_off_by_more_than_they_state_are_said_to_be_what_is_left() -> None:
    (test,) = planted(CLAMP)
    points = [tuple(replace(p, sd=p.sd / 2.3) for p in mode.shape) for mode in test.modes]
    modes = tuple(replace(m, shape=s) for m, s in zip(test.modes, points, strict=True))
    exact = replace(PLAIN, assumptions=PLAIN.assumptions.with_numbers(shape_error=1e-6))
    found = diagnose([replace(test, modes=modes)], exact, CLAMPS_ALONE)
    assert found.verdict.outcome is Outcome.PARTLY
    assert "mode shapes as far off would come by chance" in write_lead(found)
    assert any(each.startswith(SHAPES_OFF) for each in found.remarks)


@pytest.mark.slow
def test_the_same_seed_gives_the_same_answer() -> None:
    one, again = (
        replace(diagnose(planted(CLAMP), PLAIN, CLAMPS_ALONE), seconds=0.0) for _ in range(2)
    )
    assert dump(diagnosis_document(again)) == dump(diagnosis_document(one))


def test_nothing_planted_is_no_gap(untouched: Diagnosis) -> None:
    found = untouched
    assert found.leading is None
    assert found.no_gap_probability > found.unexplained_probability
    assert found.tension_after_n.mean == pytest.approx(found.tension_before_n.mean, rel=0.01)


def test_an_effect_left_out_is_not_named_and_something_unknown_leads() -> None:
    found = diagnose(planted(CLAMP, modes=5), PLAIN, FEW_EFFECTS)
    assert "point_mass" not in [name for cause in found.causes for name in cause.effects]
    assert found.left_out == FEW_EFFECTS.without
    assert found.unexplained_probability > 0.5


@pytest.mark.slow
@pytest.mark.parametrize("baseline", ["beam2", "s1"])
def test_other_classes_may_be_the_baseline(baseline: str) -> None:
    options = replace(CLAMPS_ALONE, baseline=baseline)
    found = diagnose(planted(CLAMP, modes=4), PLAIN, options)
    assert found.baseline == baseline
    assert found.leading is not None
    assert found.leading.effect == "point_mass"


@pytest.mark.slow
def test_of_one_frequency_the_tension_is_as_wide_as_mass_and_length_are_known() -> None:
    """A string's tension goes with mass and length squared; the first mode bends as well."""
    (test,) = planted()
    drawn_n = 866e3  # by the campaign, about 711 kN: what all modes give between clamped ends
    found = diagnose([replace(test, modes=test.modes[:1])], PLAIN)
    tension_n, scatter = found.tension_after_n, PLAIN.scatter
    least = np.sqrt(scatter.section**2 + scatter.density**2 + (2 * scatter.length) ** 2)
    assert found.leads == "no gap"
    assert tension_n.q025 < drawn_n < tension_n.q975
    both = select([replace(test, modes=test.modes[:1])], [build(n, PLAIN) for n in BEAMS])
    assert tension_n.q975 == pytest.approx(np.quantile(both.tension_n, 0.975), rel=0.08)
    assert tension_n.sd / tension_n.mean > least
    assert found.places == ()


@pytest.mark.slow
def test_few_modes_are_answered_with_a_remark() -> None:
    (test,) = planted()
    found = diagnose([replace(test, modes=test.modes[:2])], PLAIN, FEW_EFFECTS)
    assert "Only 2 modes" in found.remarks[0]
    assert found.leading is None
    assert np.isnan(found.shrinkage.held_out_before_percent)


def test_a_description_in_other_units_is_doubted_before_anything_else(
    untouched: Diagnosis,
) -> None:
    in_kilonewtons = replace(PLAIN, nominal_tension_n=711.0)
    few, timebase = planted(modes=4, shapes=False), GapOptions("beam1", all_but("timebase"))
    found = diagnose(few, in_kilonewtons, timebase)
    assert "right hanger, right description?" in found.remarks[0]
    assert any("lies at the bound of its prior" in remark for remark in found.remarks)
    assert found.verdict.outcome is Outcome.UNEXPLAINED
    assert "Doubtful" not in "".join(untouched.remarks)


def test_unknown_standard_deviations_are_estimated_and_said() -> None:
    (test,) = planted(CLAMP)
    unknown = replace(
        test, modes=tuple(replace(mode, frequency_sd_hz=NAN, shape=()) for mode in test.modes)
    )
    found = diagnose([unknown], PLAIN, CLAMPS_ALONE)
    assert "No frequency has a standard deviation" in found.remarks[0]
    assert found.model_error_percent > 0


@pytest.mark.slow
def test_two_tests_that_contradict_each_other_make_something_unknown_likely() -> None:
    (test,) = planted()
    moved = tuple(
        replace(mode, frequency_hz=mode.frequency_hz * (1.01 if mode.order == 3 else 1.0))
        for mode in test.modes
    )
    found = diagnose([test, replace(test, id="other", modes=moved)], PLAIN, FEW_EFFECTS)
    assert "contradict each other" in found.remarks[0]
    assert found.unexplained_probability > 0.5


@pytest.mark.parametrize(
    ("options", "hanger", "refused", "said"),
    [
        (GapOptions("beam1", without=("gremlins",)), PLAIN, UsageError, "gremlins"),
        (GapOptions(baseline="beam9"), PLAIN, UsageError, "beam9"),
        (GapOptions("beam1", hold_out=("t77",)), PLAIN, UsageError, "t77"),
        (GapOptions(), replace(PLAIN, effect_priors=(GREMLINS,)), BadInput, "gremlins"),
    ],
)
def test_names_that_are_not_there_are_refused(
    options: GapOptions, hanger: Hanger, refused: type[Exception], said: str
) -> None:
    with pytest.raises(refused, match=said):
        diagnose(planted(), hanger, options)
