"""What a screen tells over a mark: in the units of the axes, true to the point, in these words."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from datetime import datetime
from typing import Any

import pytest

from shm.report.contents import HangerReport
from shm.report.figures.every_figure import OF_DIAGNOSIS, OF_HANGER, OF_MODAL_TEST
from shm.report.figures.modal_test_response import ResponseCurves
from shm.report.figures.specification import Panel, Points, Rule, Specification
from tests.report.diagnoses import CASES, sheet
from tests.report.test_modal_test_figures import CASES as SHEETS

Told = tuple[str, Specification, Panel, Any]
_FIELD = re.compile(r"%\{(\w+)(?::([^}]+))?\}")
_NUMBER = re.compile(r"(?<![\w.])[+-]?\d+(?:\.\d+)?(?:e[+-]?\d+)?(?![\w.]*\w)")


def specifications(season: HangerReport) -> Iterator[tuple[str, Specification]]:
    """Of every case of every report that a screen draws, as it draws them."""
    drawn: list[tuple[str, Any]] = []
    for case, make in SHEETS.items():
        shown = ResponseCurves.of(make())
        drawn += [(f"{case}: {member.name}", member.draw(shown)) for member in OF_MODAL_TEST]
    for case in CASES:
        made = sheet(case)
        drawn += [(f"{case}: {member.name}", member.draw(made)) for member in OF_DIAGNOSIS]
    drawn += [(f"season: {member.name}", member.draw(season)) for member in OF_HANGER]
    return ((name, each) for name, each in drawn if isinstance(each, Specification))


@pytest.fixture(scope="module")
def told(season: HangerReport) -> list[Told]:
    """Every mark that tells something, with its figure and its panel."""
    return [
        (name, figure, panel, mark)
        for name, figure in specifications(season)
        for panel in figure.panels
        for mark in panel.marks
        if mark.hover or len(mark.texts)
    ]


def labels(figure: Specification, panel: Panel) -> dict[str, str]:
    """Return the labels of a panel's axes, shared ones too."""
    row = next(k for k, panels in enumerate(figure.rows) if panel in panels)
    below = [each for panels in figure.rows[row:] for each in panels if each.x and each.x.label]
    own = panel.x.label if panel.x else ""
    beside = [each.y.label for panels in figure.rows[: row + 1] for each in panels]
    return {
        "x": own or figure.x_label or (below[0].x.label if below and below[0].x else ""),
        "y": panel.y.label or next((each for each in beside[::-1] if each), ""),
    }


def rendered(mark: Any, place: int) -> str:
    """Return the hover text at one place of a mark, as plotly fills a template."""
    found = {"x": mark.at, "y": mark.at} if isinstance(mark, Rule) else _values(mark, place)
    if len(mark.texts):
        found["text"] = mark.texts[place]
    return _FIELD.sub(
        lambda field: format(found[field[1]], field[2] or ""), mark.hover or "%{text}"
    )


def _values(mark: Any, place: int) -> dict[str, Any]:
    y = mark.y if hasattr(mark, "y") else mark.high
    return {"x": mark.x[place], "y": y[place]}


def test_a_template_asks_for_nothing_but_what_the_mark_has(told: list[Told]) -> None:
    for name, _, _, mark in told:
        fields = {field for field, _ in _FIELD.findall(mark.hover)}
        assert fields <= {"x", "y"} | ({"text"} if len(mark.texts) else set()), name
        assert not (mark.texts and mark.hover and "text" not in fields), name
        assert "%{" not in _FIELD.sub("", mark.hover), name


def test_every_place_of_a_mark_has_a_text_of_its_own(told: list[Told]) -> None:
    for name, _, _, mark in told:
        if len(mark.texts):
            assert len(mark.texts) == len(mark.x), name
            assert all(re.search(r"\w", text) for text in mark.texts), name
            assert not any(re.search(r"\bnan\b|\bNone\b", text) for text in mark.texts), name


def test_a_template_tells_each_number_in_the_unit_of_its_axis(told: list[Told]) -> None:
    checked = 0
    for name, figure, panel, mark in told:
        axes = labels(figure, panel)
        for field, unit in re.findall(r"%\{([xy])(?::[^}]+)?\} ([^\s,:<]+)", mark.hover):
            assert unit in re.split(r"[\s()]+", axes[field]) or f"({unit})" in axes[field], (
                name,
                unit,
                axes,
            )
            checked += 1
    assert checked > 50


def test_a_text_tells_the_place_or_the_height_of_its_point(told: list[Told]) -> None:
    """To the last digit that it gives."""
    for name, _, _, mark in told:
        if not len(mark.texts) or mark.hover not in ("", "%{text}"):
            continue
        for place in range(0, len(mark.texts), max(1, len(mark.texts) // 20)):
            point = _values(mark, place)
            known = [v for v in point.values() if not isinstance(v, datetime)]
            text = mark.texts[place]
            if re.search(r" (fell|rose) by ", text):
                continue  # a message of an alert
            assert any(_tells(text, float(value)) for value in known), (name, text, point)


def test_an_interval_is_told_with_the_ends_that_are_drawn(told: list[Told]) -> None:
    seen = 0
    for name, _, _, mark in told:
        if not isinstance(mark, Points) or mark.low is None or mark.high is None:
            continue
        for place, text in enumerate(mark.texts):
            if "(90 %" in text and math.isfinite(mark.low[place]):
                assert _tells(text, float(mark.low[place])), (name, text)
                assert _tells(text, float(mark.high[place])), (name, text)
                seen += 1
    assert seen > 3


def _tells(text: str, value: float) -> bool:
    least = re.search(r"< ([\d.]+)$", text)
    if least:
        return value < float(least[1])
    return any(_is(number, value) for number in _NUMBER.findall(text))


def _is(number: str, value: float) -> bool:
    """Whether a written number is a value rounded to its digits."""
    digits = number.partition("e")[0].partition(".")[2]
    power = int(number.partition("e")[2] or 0)
    half = 0.5 * 10.0 ** (power - len(digits))
    if power == 0 and "." not in number and abs(value) >= 1000:
        half = 0.5 * 10 ** (math.floor(math.log10(abs(value))) - 3)  # four digits of a large one
    return abs(float(number) - value) <= half * (1 + 1e-9)


def said(told: list[Told], figure: str) -> list[str]:
    """Return the hover text of each mark's first place, each once."""
    lines = [rendered(mark, 0) for name, _, _, mark in told if name == figure]
    return list(dict.fromkeys(lines))


WORDS: dict[str, list[str]] = {
    "dropped hits: time_history": [
        "0.020 s: -0.4958 N",
        "hit 1, 0.500 s, 900 N, used",
        "hit 2, 4.500 s, 950 N, dropped: double hit",
        "hit 5, 16.500 s, 1100 N, dropped: not-a-number samples",
        "0.012 s: -0.001055 m/s²",
        "0.016 s: 0.001309 m/s²",
        "0.012 s: -0.002118 m/s²",
        "0.004 s: -0.001673 m/s²",
    ],
    "dropped hits: stabilisation": [
        "5.800 Hz, order 2.0, damping 0.4 %",
        "5.800 Hz, order 6.0, damping 0.4 %",
        "transverse 1: 5.8 Hz",
        "longitudinal 1: 6.1 Hz",
    ],
    "dropped hits: shapes": [
        "2.5 m: 0.609",
        "2.5 m: 0.02",
        "2.5 m: 0.966",
        "2.5 m: 0.924",
        "2.5 m: 0.5",
        "2.5 m: -0.131",
        "2.5 m: -0.707",
    ],
    "blunder: gap_map": [
        "transverse 1, t1: -0.69 %, measured 5.760 Hz",
        "transverse 3, t4: +30.00 %, measured 28.178 Hz",
        "transverse, with the cause: -0.03 %",
        "transverse, with the cause, held out: -0.02 %",
        "longitudinal 1, t1: -0.41 %, measured 5.776 Hz",
        "longitudinal, with the cause: 0.12 %",
        "longitudinal, with the cause, held out: 0.34 %",
    ],
    "blunder: causes": [
        "point mass: 0.93",
        "section loss: 0.02",
        "point mass + sag (transverse): 0.01",
        "intermediate support (transverse): < 0.01",
        "rotational end flexibility (both ends): < 0.01",
        "something not in the catalogue: 0.03",
        "no gap: < 0.01",
    ],
    "season: trend": [
        "t000: 700.6 (90 %: 686.8 to 715.8)",
        "711",
        "700.6",
        "735.6",
        "665.5",
        "tension fell by 7.2 %",
    ],
    "season: frequencies": [
        "transverse 1: predicted 5.797 ± 0.035 Hz, measured 5.820 Hz",
        "longitudinal 1: predicted 6.066 ± 0.037 Hz, measured 6.090 Hz",
    ],
    "season: stiffness": [
        "t000: 140.4 (90 %: 60.42 to 329.4)",
        "140.4",
        "444.1",
        "44.41",
        "t000: 145.8 (90 %: 63.09 to 332.7)",
        "145.8",
        "461.2",
        "46.12",
    ],
}


@pytest.mark.parametrize("figure", WORDS)
def test_these_are_the_words(told: list[Told], figure: str) -> None:
    assert said(told, figure)[:8] == WORDS[figure]
