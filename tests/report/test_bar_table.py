"""Every report names the bar it is about, on its first page, as described, with a sketch."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from matplotlib.axes import Axes

from shm import documents
from shm.report.as_html import as_html
from shm.report.as_pdf import as_pdf
from shm.report.bar_table import bar_document, bar_rows, bar_table, bars_table
from shm.report.bridge_diagnosis_report import bridge_diagnosis_json, bridge_diagnosis_paper
from shm.report.bridge_report import bridge_json, bridge_paper
from shm.report.contents import BridgeDiagnosisSheet, BridgeReport, DiagnosisSheet, HangerReport
from shm.report.diagnosis_report import diagnosis_json, diagnosis_paper
from shm.report.figures.bar_sketch import FIGURE
from shm.report.hanger_report import hanger_json, hanger_paper
from shm.report.hanger_status import Status
from shm.report.modal_test_report import modal_test_json, modal_test_paper
from shm.report.paper import Paper
from shm.values import (
    NAN,
    EndPlate,
    Hanger,
    ModalTest,
    Mode,
    ResponsePoint,
    ShapePoint,
    Supports,
    Survey,
    Turnbuckle,
)
from shm.values.bar_description import BarDescription, describe_bar, list_sensors
from tests.gap.test_shared_causes import bridge as shared_diagnosis
from tests.helpers.hangers import HANGER_3
from tests.helpers.nouns import a_summary, with_now
from tests.helpers.pdf_words import Pdf
from tests.report.conftest import START
from tests.report.diagnoses import CASES
from tests.report.outline import Outline
from tests.report.sheets import ambient, given_responses, make_points, make_sheet, one_sensor

SURVEY = Survey("pins", "steel tape, 2026-04", "Bridge office, A. Berg")
DESCRIBED = Hanger(
    3, 12.0, 200e9, 0.013273, 1.4019e-5, 103.5, 711e3, diameter_m=0.130,
    supports=Supports("pinned", "clamped"), fittings_m=(0.6, 0.55), survey=SURVEY,
    ends="fork", inclination_deg=72.5,
)  # fmt: skip
BARE = Hanger(8, 21.5, 160e9, 2.96e-3, 9.07e-7, 24.5, 850e3, name="strand")
SENSORS = make_points()
ROWS = (
    ("Section", "diameter 130 mm, area 13273 mm²"),
    ("Length", "12 m, 72.5° from the horizontal"),
    ("Length taped", "pin to pin, steel tape, 2026-04"),
    ("Elastic modulus", "200 GPa"),
    ("Density", "7798 kg/m³ (103.5 kg/m)"),
    ("Fittings", "0.6 m (deck), 0.55 m (arch)"),
    ("Ends", "fork; pinned (deck), clamped (arch)"),
    ("Sensors", "both planes at 2.5 and 4.4 m"),
    ("Bar measured by", "Bridge office, A. Berg"),
)


def of_hanger(season: HangerReport) -> tuple[Paper, dict[str, Any]]:
    response = season.frequency_response
    assert response is not None
    lines = response.accelerance
    seen = replace(response, points=SENSORS, accelerance=lines)
    data = replace(with_now(season, hanger=DESCRIBED), frequency_response=seen)
    return hanger_paper(data), hanger_json(data)["bar"]


def of_test(_: HangerReport) -> tuple[Paper, dict[str, Any]]:
    sheet = replace(make_sheet(), hanger=DESCRIBED)
    return modal_test_paper(sheet), modal_test_json(sheet)["bar"]


def of_diagnosis(_: HangerReport) -> tuple[Paper, dict[str, Any]]:
    sheet = DiagnosisSheet(CASES["led"], DESCRIBED, "Arch", SENSORS)
    return diagnosis_paper(sheet), diagnosis_json(sheet)["bar"]


def of_bridge(season: HangerReport) -> tuple[Paper, dict[str, Any]]:
    lines = (
        a_summary(BARE),
        a_summary(DESCRIBED, Status.FIRST, season.tension_n, sensors=SENSORS),
    )
    data = BridgeReport("Arch", lines, None, "Too few.", START, "0.1.0")
    return bridge_paper(data), bridge_json(data)["hangers"][1]["bar"]


def of_bridge_diagnosis(_: HangerReport) -> tuple[Paper, dict[str, Any]]:
    found = shared_diagnosis((8, 8), (0.05, 0.05))
    bars = (describe_bar(BARE), describe_bar(DESCRIBED, SENSORS))
    sheet = BridgeDiagnosisSheet(found, "Arch", bars)
    return bridge_diagnosis_paper(sheet), bridge_diagnosis_json(sheet)["bars"][1]


REPORTS = (of_hanger, of_test, of_diagnosis, of_bridge, of_bridge_diagnosis)
every_report = pytest.mark.parametrize("make", REPORTS)
Made = Callable[[HangerReport], tuple[Paper, dict[str, Any]]]


def squeezed(text: str) -> str:
    return "".join(text.split())


def missing(text: str) -> list[str]:
    """Return the values of the bar that a text does not have."""
    return [value for _, value in ROWS if squeezed(value) not in squeezed(text)]


@every_report
def test_forms_describe_bar_first(make: Made, season: HangerReport, unpainted: None) -> None:
    """On page 1 of the PDF, and before the figures of the page."""
    paper = make(season)[0]
    first = Pdf.parse(as_pdf(paper)).pages[0]
    if make in (of_bridge, of_bridge_diagnosis):  # cells fold: words of columns stand mixed
        assert [w for _, value in ROWS for w in value.split() if w not in first] == []
    else:
        assert missing(first) == []
    outline = Outline()
    outline.feed(as_html(paper).split("<figure")[0])
    assert missing(outline.told) == []


def test_what_is_not_stated_is_said_never_invented() -> None:
    assert dict(bar_rows(describe_bar(BARE))) == {
        "Section": "area 2960 mm²",
        "Length": "21.5 m",
        "Length taped": "not stated",
        "Elastic modulus": "160 GPa",
        "Density": "8277 kg/m³ (24.5 kg/m)",
        "Fittings": "not stated",
        "Ends": "not stated",
        "Sensors": "not stated",
        "Bar measured by": "not stated",
    }
    *stated, last = bar_table(describe_bar(BARE)).rows
    assert [label for label, _ in stated] == ["Section", "Length", "Elastic modulus", "Density"]
    assert last == ("Not stated", "length taped, fittings, ends, sensors and bar measured by")
    document = json.loads(documents.dump(bar_document(describe_bar(BARE))))
    unknown = {key for key, value in document.items() if value is None}
    assert unknown == {
        "diameter_m", "length_by", "length_measured", "fittings_m", "plate", "ends", "end_kind",
        "inclination_deg", "measured_by",
    }  # fmt: skip


def test_rows_name_what_was_described_and_no_more() -> None:
    plate = EndPlate(1.0915, 0.040, 1.0644, 0.241, 0.562, 0.0425)
    coupler = Turnbuckle(1.4, 0.45, 62.0, 4.1e6)
    ends = Supports("free", "pinned", 40.0)
    rows = dict(
        bar_rows(describe_bar(replace(BARE, plate=plate, turnbuckles=(coupler,), supports=ends)))
    )
    assert rows["Fittings"] == "end plates 1.0915 m long, 40 mm thick; turnbuckle of 62 kg at 1.4 m"
    assert rows["Ends"] == "free (deck), pinned (arch), 40 kg hang from the free end"
    rows = bar_rows(given_responses().bar)
    assert rows[0] == ("Bar", "not described")
    assert rows[1][1].startswith("plane not stated, at 0.1, 1.4")
    assert [label for label, _ in rows] == ["Bar", "Sensors"]


@pytest.mark.parametrize(
    ("sensors", "words"),
    [
        ((ResponsePoint("a"),), "1 channel, places not stated"),
        ((ResponsePoint("a", "transverse", 2.5),), "transverse at 2.5 m"),
        ((ResponsePoint("a", "transverse", 2.5), ResponsePoint("b", "longitudinal", 1.00049)),
         "transverse at 2.5 m; longitudinal at 1 m"),
    ],
)  # fmt: skip
def test_sensors_by_plane_and_place(sensors: tuple[ResponsePoint, ...], words: str) -> None:
    assert dict(bar_rows(BarDescription(3, sensors=sensors)))["Sensors"] == words


def test_list_sensors_takes_records_then_shapes() -> None:
    sheet = ambient()
    assert [p.name for p in sheet.bar.sensors] == ["acc_1", "acc_2", "acc_3", "acc_4"]
    assert [p.name for p in one_sensor().bar.sensors] == ["acc"]  # five records of the same one
    shapes = (ShapePoint(4.4, 0.3), ShapePoint(2.5, 1.0))
    test = ModalTest("t", (Mode("transverse", 1, 5.8, shape=shapes),))
    assert list_sensors(test) == (
        ResponsePoint("", "transverse", 2.5),
        ResponsePoint("", "transverse", 4.4),
    )
    assert list_sensors(ModalTest("t", ())) == ()


def test_tables_of_bars_fold() -> None:
    """What all bars share is named once; a folded table has its second half at the right."""
    bars = [describe_bar(replace(DESCRIBED, id=n, length_m=10.0 + n)) for n in (1, 2)]
    table = bars_table(bars)
    assert table.headings == ("hanger", "length")
    lean = ", 72.5° from the horizontal"
    assert table.rows == (("1", f"11 m{lean}"), ("2", f"12 m{lean}"))
    assert "All bars: section diameter 130 mm" in table.note
    assert "bar measured by Bridge office, A. Berg." in table.note
    (only,) = bars_table(bars[:1]).rows
    assert only[1:] == tuple(value for _, value in bar_rows(bars[0]))
    assert bars_table([]).rows == ()
    table = bar_table(describe_bar(DESCRIBED, SENSORS))
    assert table.is_folded
    folded = table.folded()
    assert folded.rows[0] == (*ROWS[0], *ROWS[5])
    assert folded.rows[-1] == (*ROWS[4], "", "")
    assert {len(row) for row in folded.rows} == {len(folded.headings)}


SKETCHED = (
    ResponsePoint("acc_1", "transverse", 2.5),
    ResponsePoint("acc_2", "longitudinal", 2.5),
    ResponsePoint("acc_3", "transverse", 4.4),
)
HITS = (ResponsePoint("hit", None, 1.9),)


@pytest.fixture
def bar() -> BarDescription:
    return describe_bar(replace(HANGER_3, fittings_m=(0.6, 0.4)), SKETCHED, HITS)


def drawn(bar: BarDescription) -> Axes:
    figure = FIGURE.figure(bar)
    assert figure is not None
    (axes,) = figure.axes
    return axes


def places(axes: Axes, name: str) -> list[float]:
    (line,) = [line for line in axes.lines if line.get_label() == name]
    return np.asarray(line.get_xdata()).tolist()


def test_sketch_has_sensors_by_plane_hits_and_fittings(bar: BarDescription) -> None:
    axes = drawn(bar)
    assert places(axes, "sensor, transverse") == [2.5, 4.4]
    assert places(axes, "sensor, longitudinal") == [2.5]
    assert places(axes, "hit") == [1.9]
    low, high = axes.get_xlim()
    assert low < 0 < bar.length_m < high
    ends = [
        np.asarray(line.get_xdata()).tolist()
        for line in drawn(bar).lines
        if line.get_linewidth() == 9.0
    ]
    assert ends == [[0.0, 0.6], [bar.length_m - 0.4, bar.length_m]]


def test_sketch_says_what_is_not_stated(bar: BarDescription) -> None:
    unknown = replace(bar, hits=(replace(HITS[0], x_m=NAN),))
    assert "hits is not stated" in FIGURE.caption(unknown)
    assert "not stated" not in FIGURE.caption(bar)
    assert "3 sensors and 1 place of hits" in FIGURE.alt(bar)
    assert FIGURE.figure(replace(bar, sensors=(), hits=())) is None
