"""Tensions are told in the unit that fits their size: a string's, a tie rod's, a main cable's."""

from __future__ import annotations

import re
from dataclasses import replace
from datetime import UTC, datetime
from math import nan

import numpy as np
import pytest

from shm import notebook
from shm.report.as_html import as_html
from shm.report.as_text import as_text
from shm.report.bridge_report import bridge_paper
from shm.report.contents import BridgeReport, DiagnosisSheet, HangerReport, summary_of
from shm.report.diagnosis_report import diagnosis_paper
from shm.report.figures.along_the_bridge import bridge_illustration
from shm.report.figures.hanger_trend import FIGURE as TREND
from shm.report.figures.specification import drawn
from shm.report.formatting import Interval
from shm.report.hanger_report import hanger_json, hanger_paper
from shm.report.hanger_status import Status
from shm.report.hanger_tables import history, models
from shm.report.shifts import shift_unit
from shm.values import Hanger, Posterior, Selection, TensionEstimate
from shm.values.rounding import force_unit
from shm.watch.neighbours import HangerShift
from shm.watch.words.neighbours_words import bridge_pattern
from tests.helpers.nouns import a_summary
from tests.helpers.slow import few_of
from tests.report.diagnoses import HANGER, sheet
from tests.report.outline import text_words

NOW = datetime(2026, 5, 1, tzinfo=UTC)
SIZES = [(5.4, "N"), (20e3, "kN"), (12e6, "MN")]
NAMES = ["string", "tie rod", "cable"]
WITH_UNIT = re.compile(r"(-?\d[\d.]*) (N|kN|MN)\b(?![ /]m)")
DRAWING = re.compile(r"<svg.*?</svg>", re.S)
NOTHING = re.compile(r"(?<![\d.])0\.0*(?!\d)")


@pytest.mark.parametrize(
    ("force_n", "unit", "told", "decimals"),
    [
        (5.4321, "N", "5.432 N", 3),
        (999.9, "N", "999.9 N", 1),
        (1000.0, "kN", "1 kN", 3),
        (20_040.0, "kN", "20.04 kN", 2),
        (-654_080.0, "kN", "-654.1 kN", 1),
        (711e3, "kN", "711 kN", 1),
        (1.2e6, "kN", "1200 kN", 1),
        (9_999_600.0, "kN", "10000 kN", 1),
        (1e7, "MN", "10 MN", 2),
        (0.0, "N", "0 N", 1),
    ],
)
def test_force_unit_of_size(force_n: float, unit: str, told: str, decimals: int) -> None:
    found = force_unit(force_n)
    assert found.name == unit
    assert found.with_unit(force_n) == told
    assert found.decimals(force_n) == decimals
    assert found.of(np.array([force_n])) == pytest.approx([force_n / found.newtons])


def test_several_forces_have_one_unit_by_the_largest() -> None:
    assert force_unit(5.0, 1200.0, nan).name == "kN"
    assert force_unit(300e3, 12e6).name == "MN"
    assert force_unit().name == force_unit(nan).name == "kN"


def of_size(season: HangerReport, tension_n: float) -> HangerReport:
    """Return the season with `tension_n` at the latest test, by its selected class."""
    factor = tension_n / season.trend[-1].tension_n.mean

    def scaled(posterior: Posterior) -> Posterior:
        return replace(posterior, nominal_tension_n=factor * posterior.nominal_tension_n)

    assert season.baseline is not None
    assert season.selection is not None
    hanger = replace(season.hanger, nominal_tension_n=factor * season.hanger.nominal_tension_n)
    selection = season.selection
    compared = Selection(tuple(map(scaled, selection.posteriors)), selection.probabilities)
    posterior, baseline = scaled(season.posterior), scaled(season.baseline)
    now = summary_of(hanger, season.latest, posterior, baseline, compared)
    trend = tuple(replace(row, tension_n=row.tension_n.scaled(factor)) for row in season.trend)
    now = replace(now, drifts=season.drifts)
    return replace(season, now=now, posterior=posterior, baseline=baseline, selection=compared,
                   trend=trend)  # fmt: skip


@pytest.mark.parametrize(("tension_n", "unit"), few_of(SIZES, 1), ids=NAMES)
def test_report_tells_tensions_in_unit(season: HangerReport, tension_n: float, unit: str) -> None:
    data = of_size(season, tension_n)
    for told in (text_words(hanger_paper(data)), DRAWING.sub("", as_html(hanger_paper(data)))):
        found = WITH_UNIT.findall(told)
        assert {each for _, each in found} == {unit}
        assert not [value for value, _ in found if NOTHING.fullmatch(value)]
        assert f"tension, {unit}" in told
    for table, columns in ((history(data), (4, 5)), (models(data), (4, 5))):
        cells = [row[column] for row in table.rows for column in columns]
        assert not [cell for cell in cells if NOTHING.search(cell)], cells
    assert hanger_json(data)["trend"][-1]["tension_n"]["mean"] == pytest.approx(tension_n)


@pytest.mark.parametrize(("tension_n", "unit"), SIZES, ids=NAMES)
def test_figures_are_in_unit(season: HangerReport, tension_n: float, unit: str) -> None:
    (item,) = drawn((TREND,), of_size(season, tension_n))
    trend, *_ = item.figure.axes
    assert trend.get_ylabel() == f"tension ({unit})"
    marks = next(line for line in trend.lines if line.get_label() == "alert")
    assert marks.get_ydata() == pytest.approx([tension_n / force_unit(tension_n).newtons])
    assert f" {unit} (90 % interval" in item.alt
    assert not NOTHING.search(item.alt)


@pytest.mark.parametrize(("tension_n", "unit"), SIZES, ids=NAMES)
def test_bridge_has_one_unit(hanger: Hanger, tension_n: float, unit: str) -> None:
    moved = {3: -0.05, 4: 0.03}
    shifts = [
        HangerShift(i, i - 1, NOW, tension_n, moved.get(i, 0.0) * tension_n, 0.002 * tension_n)
        for i in range(1, 7)
    ]
    pattern = bridge_pattern(shifts, range(1, 7))
    carried = Interval(0.95 * tension_n, 0.94 * tension_n, 0.96 * tension_n)
    lines = tuple(
        a_summary(replace(hanger, id=number), Status.STEADY, carried) for number in range(1, 7)
    )
    told = as_text(bridge_paper(BridgeReport("Arch", lines, pattern, "", NOW, "0.1.0")))
    assert f"tension, {unit}" in told
    found, places = shift_unit(pattern)
    assert f"{-0.05 * found.of(tension_n):+.{places}f} (" in told
    shown = bridge_illustration(pattern)
    assert shown.figure.axes[0].get_ylabel() == f"lost or gained ({unit})"
    assert re.search(rf"hanger 3 -[\d.]*[1-9][\d.]* {unit} \(-5\.0 %\)", shown.alt)


def test_the_largest_tension_of_a_bridge_decides_for_all(hanger: Hanger) -> None:
    lines = tuple(
        a_summary(replace(hanger, id=number), Status.STEADY, Interval(t, 0.9 * t, 1.1 * t))
        for number, t in ((1, 900.0), (2, 30e3))
    )
    told = as_text(bridge_paper(BridgeReport("Arch", lines, None, "too few", NOW, "0.1.0")))
    assert "tension, kN" in told
    assert "0.900 ± 0.090" in told


@pytest.mark.parametrize(("tension_n", "unit"), SIZES, ids=NAMES)
def test_a_diagnosis_tells_both_tensions_in_that_unit(tension_n: float, unit: str) -> None:
    before, after = (
        TensionEstimate(t, 0.01 * t, 0.984 * t, 1.016 * t) for t in (1.04 * tension_n, tension_n)
    )
    diagnosis = replace(sheet("led").diagnosis, tension_before_n=before, tension_after_n=after)
    data = DiagnosisSheet(diagnosis, replace(HANGER, nominal_tension_n=tension_n))
    told = as_text(diagnosis_paper(data))
    table = told[told.index("TENSION BEFORE AND AFTER") : told.index("WHAT WOULD TELL")]
    assert f"mean, {unit}" in table
    assert not NOTHING.search(table)


@pytest.mark.parametrize(("tension_n", "unit"), SIZES, ids=NAMES)
def test_a_notebook_shows_that_unit(season: HangerReport, tension_n: float, unit: str) -> None:
    data = of_size(season, tension_n)
    assert data.selection is not None
    shown = notebook.sheet(data.posterior).html
    (lead,) = re.findall(r"<p>(Tension [^<]*)</p>", shown)
    assert f" {unit} " in lead
    assert not NOTHING.search(lead)
    assert f">tension, {unit}</th>" in notebook.sheet(data.selection).html
    described = notebook.sheet(data.hanger).html
    (nominal,) = re.findall(r"nominal tension</th><td[^>]*>([^<]*)", described)
    assert nominal.endswith(f" {unit}")
    assert not NOTHING.search(nominal)
