"""The first paragraph: what it says of tension, change, model, and what to do next."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shm.report.contents import HangerReport
from shm.report.formatting import Interval
from shm.report.hanger_sentences import advice, summary
from shm.values import Drift, Hanger, Thresholds
from tests.helpers.nouns import averaged, with_now
from tests.report.diagnoses import LED


def with_probability(data: HangerReport, probability: float) -> HangerReport:
    return with_now(data, drifts=(replace(data.drifts[0], probability=probability),))


def test_a_model_that_lost_the_selection_is_said_to_have_lost(season: HangerReport) -> None:
    assert season.selection is not None
    loser = replace(season, posterior=season.selection.posteriors[1])
    assert "beam1, less probable than beam2" in summary(loser)


def test_a_rise_of_stiffness_is_told_as_a_factor(season: HangerReport) -> None:
    rise = Drift(
        3, "t009", season.drifts[0].time, "longitudinal_end_stiffness", 7, 8, 1.0, 0.2, 0.5, 0.99
    )
    told = summary(with_now(season, drifts=(rise,)))
    assert "end stiffness rose to about 10 times its former value, beyond its threshold." in told


def test_the_change_without_a_drift_comes_from_both_posteriors(season: HangerReport) -> None:
    """Compare with two independent normal tensions, ratio 650/700, sd of each 0.012 * 711 kN.

    The interval of the relative change has half width 1.645 * sqrt(1 + r^2) * 8.53/700.
    """
    change = with_now(season, drifts=()).now.change
    assert change is not None
    ratio = 650 / 700
    assert change.mean == pytest.approx(ratio - 1, abs=0.002)
    half = 1.645 * np.sqrt(1 + ratio**2) * 0.012 * 711 / 700
    assert change.width / 2 == pytest.approx(half, rel=0.1)


def test_sampling_that_has_not_settled_is_said(season: HangerReport) -> None:
    unsettled = replace(season, posterior=replace(season.posterior, r_hat=1.4))
    assert any("R-hat 1.40" in text for text in advice(unsettled))


def test_an_interval_wider_than_the_threshold_is_said(season: HangerReport, hanger: Hanger) -> None:
    sharp = replace(hanger, thresholds=Thresholds(tension_shift_fraction=0.01))
    assert any(
        "no better than the threshold of 1 %" in t for t in advice(with_now(season, hanger=sharp))
    )


def misfitted(data: HangerReport, parts: list[float], sd: float) -> HangerReport:
    """Its modes predicted so much off, as a part of themselves, with so large a deviation."""
    rows = data.posterior.predicted
    predicted = tuple(
        replace(row, mean_hz=row.measured_hz * (1 + part), sd_hz=row.measured_hz * sd)
        for row, part in zip(rows, parts, strict=True)
    )
    return replace(data, posterior=replace(data.posterior, predicted=predicted))


def test_modes_within_their_intervals_leave_nothing_unexplained(season: HangerReport) -> None:
    told = summary(misfitted(season, [0.001] * 12, sd=0.002))
    assert "Each lies within its 90 % interval: the model explains what was measured." in told


def test_one_mode_of_many_may_lie_outside_by_chance(season: HangerReport) -> None:
    told = summary(misfitted(season, [0.006, *[0.0] * 11], sd=0.001))
    assert "Transverse 1 lies outside the 90 % interval, no more than by chance" in told


def test_more_modes_outside_than_chance_has_are_left_unexplained(season: HangerReport) -> None:
    told = summary(misfitted(season, [0.01] * 6 + [0.0] * 6, sd=0.001))
    assert "6 modes lie outside the 90 % interval: the model does not explain these" in told


def test_a_class_that_misses_the_modes_is_not_said_to_explain_them(season: HangerReport) -> None:
    fitted = misfitted(season, [0.0] * 12, sd=0.002)
    told = summary(
        replace(fitted, posterior=replace(fitted.posterior, misfit_percent=1.2)),
    )
    assert "It misses 12 measured frequencies by 1.2 % (root mean square)" in told
    assert "explains what was measured" not in told


def test_wide_intervals_are_not_praised_for_holding_a_large_misfit(season: HangerReport) -> None:
    told = summary(misfitted(season, [0.01] * 12, sd=0.02))
    assert "so wide that they may hide a misfit" in told


def test_a_hanger_whose_tension_is_hardly_known_is_not_said_to_stand_still(
    season: HangerReport,
) -> None:
    still = with_probability(season, 0.01)
    wide = averaged(Interval(650e3, 450e3, 1100e3))
    unsure = summary(with_now(still, baseline=wide))
    assert "These modes do not determine the tension (90 % interval" in unsure
    assert "nominal" not in unsure
    assert "do not determine" not in summary(still)


def test_the_paragraph_reads_so_from_beginning_to_end(
    season: HangerReport, bare: HangerReport
) -> None:
    """Every sentence and their order; what the other tests hold is the choice between them."""
    told = summary(replace(season, diagnosis=LED))
    assert told == (
        "Hanger 3: tension fell by 7.2 ± 2.0 %, beyond its threshold. Repeat the hammer test "
        "today and decide on traffic until then; if the loss stays, inspect its anchorages "
        "and the rod, and compare the hangers beside it (`shm drift bridge`). Its tension is "
        "now 650 ± 19 kN. The model class is beam2, the most probable (compared with beam1). It "
        "predicts 12 measured frequencies to 0.4 % (root mean square). To tell point mass from "
        "section loss, measure next: known mass of 25 kg at 3.6 m."
    )
    assert summary(bare) == (
        "Hanger 3: tension 711 ± 14 kN, and no test after its baseline. Choose a warmer or colder "
        "day at the next planned test, so that the baseline covers temperature. Its tension is "
        "711 ± 14 kN by test only. The model class is beam1. It predicts one measured frequency "
        "to 0.34 % (root mean square). Each lies within its 90 % interval: the model explains "
        "what was measured. Record the temperature with the next test: it moves the tension."
    )
