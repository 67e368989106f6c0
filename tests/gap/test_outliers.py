"""One wrong frequency is an outlier; what moves many together is none."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy import stats

from shm.assumptions import DEFAULTS
from shm.gap import GapOptions, diagnose
from shm.gap.causes.outliers import (
    FREEDOM,
    SURE,
    acts_alone,
    left_out,
    log_gross,
    log_ordinary,
)
from shm.gap.causes.search import fit_alone
from shm.gap.hypotheses.observations import observed
from shm.simulate import PlantedEffect
from shm.values import ModalTest, Outcome
from tests.helpers.effects import all_but
from tests.helpers.gap_campaigns import HANGER as PLAIN
from tests.helpers.gap_campaigns import PLANTED_CLAMP, problem_of, simulated
from tests.worlds.simulated.reality import Reality

SHARE = DEFAULTS.gross_error_share.value


def only(*effects: str) -> GapOptions:
    return GapOptions(without=all_but(*effects))


def measured(*effects: PlantedEffect, **plan: Any) -> tuple[ModalTest, ...]:
    return simulated(*effects, **{"seed": 101, "shapes": False, **plan})


def spoiled(tests: Sequence[ModalTest], plane: str, order: int, factor: float) -> list[ModalTest]:
    """One frequency of the first test made larger by `factor`."""
    modes = tuple(
        replace(mode, frequency_hz=factor * mode.frequency_hz)
        if (mode.plane, mode.order) == (plane, order)
        else mode
        for mode in tests[0].modes
    )
    return [replace(tests[0], modes=modes), *tests[1:]]


def test_one_wrong_frequency_is_set_aside_and_nothing_else_is_the_matter() -> None:
    """It is told in a remark, kept in the residuals, and may be met by a guide.

    Of one test nobody knows; where a test as hard shows the mode in its place, it is a slip.
    """
    # A support that swings along could move this frequency alone: it is not among the causes.
    few = only("point_mass", "sag", "bending_stiffness")
    one_wrong = diagnose(spoiled(measured(), "longitudinal", 3, 1.03), PLAIN, few)
    (found,) = one_wrong.outliers
    assert (found.plane, found.order, found.test) == ("longitudinal", 3, "t1")
    assert found.measured_hz == pytest.approx(1.03 * found.expected_hz, rel=1e-3)
    assert found.expected_sd_hz < 1e-3 * found.expected_hz
    assert found.probability > SURE
    assert one_wrong.no_gap_probability > 0.5
    for said in ("Longitudinal 3 of test t1", "look at the recording again", "softer and with har"):
        assert said in one_wrong.remarks[0]
    assert not any("Should it prove right" in remark for remark in one_wrong.remarks)
    assert len(one_wrong.where) == 12
    (row,) = [r for r in one_wrong.where if (r.plane, r.order) == ("longitudinal", 3)]
    assert row.residual_percent == pytest.approx(3.0, abs=0.2)
    assert abs(row.z) > 50
    assert row.share == 0
    assert sum(r.share for r in one_wrong.where) == pytest.approx(1.0)
    assert one_wrong.shrinkage.rms_before_percent < 0.1
    assert 0.05 < found.acts_alone < 0.5
    assert one_wrong.leads == "unexplained"
    verdict = one_wrong.verdict
    assert (verdict.outcome, verdict.reason) == (Outcome.UNEXPLAINED, "acts alone")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("plane", "order", "factor", "shapes"),
    [("longitudinal", 1, 1.2, False), ("transverse", 4, 1.04, True)],
)
def test_a_frequency_far_off_or_with_a_shape_is_set_aside(
    plane: str, order: int, factor: float, shapes: bool
) -> None:
    tests = spoiled(measured(shapes=shapes), plane, order, factor)
    found = diagnose(tests, PLAIN, only("timebase"))
    assert [(each.plane, each.order) for each in found.outliers] == [(plane, order)]


@pytest.mark.slow
def test_an_effect_is_named_beside_a_wrong_frequency_and_loses_nothing_without_one() -> None:
    two, tests = only("point_mass", "bending_stiffness"), measured(PLANTED_CLAMP)
    found = diagnose(spoiled(tests, "transverse", 5, 0.97), PLAIN, two)
    assert [(o.plane, o.order) for o in found.outliers] == [("transverse", 5)]
    assert found.leading is not None
    assert found.leading.effect == "point_mass"
    assert diagnose(tests, PLAIN, two).outliers == ()


@pytest.mark.slow
def test_an_effect_whose_law_is_off_at_one_mode_is_no_gross_error_there() -> None:
    moving = PlantedEffect(
        "support_motion",
        "deck end, longitudinal",
        {"support_mass_kg": 850.0, "support_frequency_hz": 12.0},
    )
    tests = measured(moving, modes=8, reality=Reality())
    found = diagnose(tests, PLAIN, only("support_motion", "bending_stiffness"))
    assert not found.outliers
    assert found.leading is not None
    assert found.leading.effect == "support_motion"


def test_both_densities_are_the_prior_of_theirs_in_all() -> None:
    """And a residual of four and a half standard deviations is no proof."""
    size, sd = np.geomspace(1e-9, 60, 200_001), np.array([1e-4])
    both = [np.exp(log_gross(size, SHARE)), np.exp(log_ordinary(size, np.array(1e-3), SHARE))]
    inside = (size >= 1e-4) & (size <= 3)
    assert 2 * np.trapezoid(both[0][inside], size[inside]) == pytest.approx(SHARE, rel=1e-3)
    assert 2 * np.trapezoid(both[1], size) == pytest.approx(1 - SHARE, rel=1e-3)
    assert log_gross(4.5 * sd, SHARE) < log_ordinary(4.5 * sd, sd, SHARE)
    assert log_gross(8 * sd, SHARE) > log_ordinary(8 * sd, sd, SHARE) + np.log(SURE / (1 - SURE))
    assert FREEDOM == 20


def test_a_frequency_left_out_is_what_conditioning_on_all_others_says() -> None:
    """Data y = m + S z + e, z standard normal: y is normal about m with covariance S S' + C."""
    problem = problem_of(measured())
    fit = fit_alone(problem, np.random.default_rng(1))
    rows = np.array([2, 7])
    seen = left_out(problem, fit.hypothesis, fit.z, fit.predicted, fit.slopes, rows)
    away = problem.observations.value - fit.predicted + fit.slopes @ fit.z
    node = 3
    errors = problem.likelihood(fit.hypothesis).nodes[node].covariance.frequency
    whole = errors + fit.slopes @ fit.slopes.T
    for column, row in enumerate(rows):
        others = np.delete(np.arange(12), row)
        pull = np.linalg.solve(whole[np.ix_(others, others)], whole[others, row])
        deviation = away[row] - pull @ away[others]
        variance = whole[row, row] - pull @ whole[others, row]
        assert seen.deviation[node, column] == pytest.approx(deviation, rel=1e-5)
        assert seen.sd[node, column] == pytest.approx(np.sqrt(variance), rel=1e-5)
        evidence = stats.multivariate_normal(cov=whole).logpdf(away)
        weight = problem.likelihood(fit.hypothesis).log_weight[node]
        assert seen.log_all[node] == pytest.approx(evidence + weight, abs=1e-4)


@pytest.mark.parametrize(("other", "possible"), [(0.2, True), (1.0, False), (2.0, False)])
def test_what_another_test_hit_as_hard_shows_in_its_place_was_a_slip(
    other: float, possible: bool
) -> None:
    (test,) = measured()
    tests = [test, replace(test, id="t2", amplitude=other)]
    design = observed(tests, PLAIN).design
    kept = observed([replace(test, modes=test.modes[1:]), tests[1]], PLAIN).design
    assert (acts_alone(design, kept, 0, 0.1, SHARE) > 0) == possible
    assert acts_alone(design, kept, 0, 0.5, SHARE) == 0.0  # farther than any guide moves one
