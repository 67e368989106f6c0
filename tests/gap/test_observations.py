"""The data vector: what of the tests is used, and how it is scaled."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from shm.errors import BadInput
from shm.gap import GapOptions, diagnose
from shm.gap.causes.search import fit_alone, hypotheses
from shm.gap.hypotheses.data_checks import usable
from shm.gap.hypotheses.noise import nodes
from shm.gap.hypotheses.observations import observed, remark_on_rounding, rounding_covariance
from shm.gap.hypotheses.problem import GapProblem
from shm.inference.problem.data_checks import step_hz
from shm.simulate import PlantedEffect
from shm.values import NAN, AddedMass, ModalTest, Mode, ShapePoint
from tests.helpers.effects import all_but
from tests.helpers.gap_campaigns import HANGER, campaign, fit_of, problem_of, simulated
from tests.helpers.gap_campaigns import HANGER as PLAIN
from tests.helpers.hangers import HANGER_3


def _test(name: str = "t1", *modes: Mode, **conditions: object) -> ModalTest:
    own = modes or (_mode(1), _mode(2))
    return ModalTest(name, own, **conditions)  # type: ignore[arg-type]


def _mode(order: int, frequency_hz: float = 0.0, sd_hz: float = 0.01, *shape: ShapePoint) -> Mode:
    return Mode("transverse", order, frequency_hz or 6.0 * order, sd_hz, shape=shape)


def test_frequencies_are_logarithms_with_fractional_standard_deviations() -> None:
    """One of zero is an unknown one."""
    modes = _mode(1, 5.0, 0.01), _mode(2, 12.0, NAN), _mode(3, 20.0, 0.0)
    found = observed([_test("t1", *modes)], HANGER_3)
    np.testing.assert_allclose(found.value, np.log([5.0, 12.0, 20.0]))
    np.testing.assert_allclose(found.sd, [0.002, np.nan, np.nan])


def test_temperatures_count_from_the_mean_of_those_known_and_unknown_conditions_are_neutral() -> (
    None
):
    tests = [
        _test("a", temperature_c=0.0, amplitude=2.0),
        _test("b", temperature_c=10.0),
        _test("c"),
    ]
    conditions = observed(tests, HANGER_3).design.conditions
    assert [each.temperature_shift_k for each in conditions] == [-5.0, 5.0, 0.0]
    assert [each.amplitude for each in conditions] == [2.0, 1.0, 1.0]


def test_a_shape_has_unit_length_and_its_standard_deviations_shrink_with_it() -> None:
    shape = (ShapePoint(2.0, 3.0, 0.0, 0.1), ShapePoint(5.0, 4.0, NAN, 0.1))
    found = observed([_test("t1", _mode(1, 5.0, 0.01, *shape), _mode(2))], HANGER_3)
    np.testing.assert_allclose(found.value[2:], [0.6, 0.0, 0.8])
    error = HANGER_3.assumptions.shape_error.value
    np.testing.assert_allclose(found.sd[2:], math.hypot(0.02, error))
    assert found.design.shape_component.tolist() == [0, 1, 0]
    assert found.design.shape_place.tolist() == [0, 0, 1]


def test_an_uncertain_component_hardly_counts_in_the_length() -> None:
    """With sd of 1 beside 0.001 the length is that of the certain ones times a known factor."""
    exact = HANGER_3.assumptions.with_numbers(shape_error=1e-6)
    sure = [ShapePoint(x, 1.0, sd=0.001) for x in (2.0, 4.0, 6.0)]
    for wild in (0.5, 5.0):
        shape = (*sure, ShapePoint(8.0, wild, sd=1.0))
        test = _test("t1", _mode(1, 5.0, 0.01, *shape), _mode(2))
        found = observed([test], replace(HANGER_3, assumptions=exact))
        np.testing.assert_allclose(found.value[2:5], np.sqrt(0.25), rtol=1e-4)


def test_places_within_a_millimetre_are_one() -> None:
    """Points without a standard deviation or value are left out."""
    one = (ShapePoint(2.0, 1.0, sd=0.1), ShapePoint(5.0, 1.0, sd=0.1))
    other = (ShapePoint(2.0005, 1.0, sd=0.1), ShapePoint(5.0, 1.0, sd=0.1))
    less = (ShapePoint(3.0, NAN, sd=0.1), ShapePoint(4.0, 1.0))
    modes = _mode(1, 5.0, 0.01, *one, *less), _mode(2, 12.0, 0.01, *other)
    found = observed([_test("t1", *modes)], HANGER_3)
    assert found.design.places_m == (2.0, 5.0)
    assert np.isfinite(found.value).all()


@pytest.mark.parametrize(
    ("modes", "words"),
    [
        ((_mode(1, -3.0), _mode(2)), "no frequency"),
        ((_mode(1, np.nan),), "nan Hz is no frequency"),
        ((_mode(1, np.inf),), "inf Hz is no frequency"),
        ((_mode(0, 5.0), _mode(2)), "count from 1"),
    ],
)
def test_what_cannot_be_is_refused_in_words(modes: tuple[Mode, ...], words: str) -> None:
    with pytest.raises(BadInput, match=words) as raised:
        observed([ModalTest("t1", modes)], HANGER_3)
    assert raised.value.remedy


def rounded(step: float, sd_hz: float = NAN) -> ModalTest:
    (test,) = campaign(tests=1, modes=6, sd=1e-6)
    return replace(
        test,
        modes=tuple(
            replace(
                mode,
                frequency_hz=round(mode.frequency_hz / step) * step if step else mode.frequency_hz,
                frequency_sd_hz=sd_hz,
                shape=(),
            )
            for mode in test.modes
        ),
    )


@pytest.mark.parametrize("step", [0.5, 0.1, 0.125, 0.05, 0.01])
def test_the_step_is_found(step: float) -> None:
    """None of full numbers nor where errors are stated; the owner is told what it costs."""
    assert step_hz(rounded(step)) == pytest.approx(step)
    exact, stated = rounded(0.0), rounded(step, sd_hz=0.03)
    for each in (exact, stated):
        assert step_hz(each) == 0.0
        assert remark_on_rounding([each]) == ""
    assert f"rounded to {step:g} Hz" in remark_on_rounding([exact, rounded(step)])


def test_low_modes_err_most_and_equal_numbers_are_one_datum() -> None:
    test = rounded(0.1)
    seen = observed([test], HANGER)
    covariance, hz = rounding_covariance(seen), np.exp(seen.value)
    sd = 0.1 / np.sqrt(12) / hz
    equal = np.equal.outer(hz, hz)
    assert equal.sum() > len(hz)
    one, other = (int(k) for k in np.argwhere(np.triu(equal, 1))[0])
    pair = covariance[np.ix_([one, other], [one, other])]
    assert pair.mean() == pytest.approx(sd[one] ** 2)
    assert pair[0, 0] + pair[1, 1] - 2 * pair[0, 1] == pytest.approx(2 * sd[one] ** 2)
    alone = np.flatnonzero(equal.sum(axis=1) == 1)
    assert np.diag(covariance)[alone] == pytest.approx(sd[alone] ** 2)
    assert not covariance[~equal].any()


def test_what_rounding_does_to_a_sound_hanger_is_no_evidence_of_a_cause() -> None:
    """Taken as errors of one fraction they gave a loss of section odds of 295 to 1."""
    seen, rng = observed([rounded(0.2)], HANGER), np.random.default_rng(1)
    gained = []
    for each in (seen, replace(seen, rounding=None)):
        whole = problem_of([rounded(0.2)])
        problem = GapProblem(whole.model, whole.tests, each)
        nothing = fit_alone(problem, rng)
        (loss,) = hypotheses(problem, all_but("section_loss"))
        gained.append(fit_of(problem, loss).log_evidence - nothing.log_evidence)
    assert gained[0] < 0 < 3 < gained[1]


SLIP = PlantedEffect("joint_softening", "both ends", {"log10_k_at_reference_level": 8.3})
KNOWN = ("joint_softening", "rotational_end_flexibility")
SLOPE, SLOPE_SD, SD = -2e-3, 3e-5, 2e-4


def _sloped(order: int, slope: float = NAN, plane: str = "transverse") -> Mode:
    hz = 6.0 * order
    return Mode(plane, order, hz, SD * hz, amplitude_slope=slope, amplitude_slope_sd=SLOPE_SD)  # type: ignore[arg-type]


def test_a_test_counts_at_small_amplitude_and_at_that_of_its_hits() -> None:
    test = ModalTest(
        "t", (_sloped(1, SLOPE), _sloped(2)), amplitude=0.7, added_mass=AddedMass(9, 2)
    )
    found = observed([test], HANGER_3)
    assert [each.amplitude for each in found.design.conditions] == [0.0, 0.7]
    assert {each.added_mass for each in found.design.conditions} == {test.added_mass}
    assert found.design.frequency_test.tolist() == [0, 0, 1]
    assert found.design.survey.tests == ("t",)
    assert found.value[2] - found.value[0] == pytest.approx(np.log1p(SLOPE))


@pytest.mark.parametrize("slope", [NAN, 0.5 * SLOPE_SD, 0.03])
def test_a_slope_that_is_unknown_unsure_or_absurd_changes_nothing(slope: float) -> None:
    found = observed([ModalTest("t", (_sloped(1, slope), _sloped(2)), amplitude=0.7)], HANGER_3)
    assert [each.amplitude for each in found.design.conditions] == [0.7]


def test_both_frequencies_of_a_mode_share_their_error_but_that_of_the_slope() -> None:
    """ln f1 - ln f0 = ln(1 + c): its variance is that of c, whatever that of f0 and the model; and
    two planes that overlap, whose errors correlate, leave a proper covariance."""
    both = [
        _sloped(order, SLOPE, plane) for plane in ("transverse", "longitudinal") for order in (1, 2)
    ]
    found = observed([ModalTest("t", tuple(both), amplitude=1.0)], HANGER_3)
    weights = np.zeros(8)
    weights[0], weights[4] = -1, 1
    seen = [node.covariance.frequency for node in nodes(found)]
    factors = {round(float(weights @ each @ weights) / SLOPE_SD**2, 2) for each in seen}
    assert 1.0 in factors
    assert len(factors) == 5  # of stated standard deviations, see the module
    assert min(np.linalg.eigvalsh(each).min() for each in seen) > 0.1 * SLOPE_SD**2


@pytest.mark.slow
def test_the_slopes_of_one_test_name_the_joint_that_slips() -> None:
    def at(amplitude: float) -> ModalTest:
        return simulated(SLIP, seed=5, amplitudes=(amplitude,))[0]

    small, hit = at(1e-3), at(1.0)
    slopes = [
        two.frequency_hz / one.frequency_hz - 1
        for one, two in zip(small.modes, hit.modes, strict=True)
    ]
    modes = [
        replace(mode, amplitude_slope=slope, amplitude_slope_sd=2e-5)
        for mode, slope in zip(small.modes, slopes, strict=True)
    ]
    told = replace(small, modes=tuple(modes), amplitude=1.0)
    options = GapOptions(without=all_but(*KNOWN))
    found = diagnose([told], PLAIN, options)
    assert found.leading is not None
    assert found.leading.effect == "joint_softening"
    assert found.leading.probability > 0.9
    size = found.leading.parameters[0]
    assert size.mean == pytest.approx(8.3, abs=4 * size.sd)
    assert any("depend on amplitude" in remark for remark in found.remarks)
    assert "joint_softening" in dict(
        diagnose([replace(told, modes=hit.modes)], PLAIN, options).invisible
    )


@pytest.mark.parametrize("value", [math.nan, 0.0])
def test_a_shape_without_its_own_plane_is_not_used_and_named(value: float) -> None:
    """Scaled to unit length, what is seen across it alone would be noise."""
    (test,) = simulated(hanger=HANGER_3, modes=3, shape_sd=1e-3, seed=4)
    first, *rest = test.modes
    across = tuple(replace(point, value=value, cross=0.01) for point in first.shape)
    tests = [replace(test, modes=(replace(first, shape=across), *rest))]
    assert 0 not in observed(tests, HANGER_3).design.shape_mode
    assert any("1 of 6 mode shapes" in each for each in usable(tests, HANGER_3).remarks)
    assert not any("mode shapes have no value" in each for each in usable([test], HANGER_3).remarks)
