"""The elevation of the bridge: every hanger drawn where it stands, coloured by its shift."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest
from matplotlib.colors import to_rgb

from shm.report.figures.along_the_bridge import bridge_illustration
from shm.watch.neighbours import BridgePattern, HangerShift, bridge_pattern

NOW = datetime(2026, 5, 1, tzinfo=UTC)


def shifts(count: int = 12) -> list[HangerShift]:
    moved = {6: 16e3, 7: -34e3, 8: 17e3}
    return [
        HangerShift(i, i - 1, NOW, 700e3, moved.get(i, 0.0), 1.5e3)
        for i in range(1, count + 1)
        if i != 3
    ]


@pytest.fixture(scope="module")
def pattern() -> BridgePattern:
    return bridge_pattern(shifts(), range(1, 13))


def test_a_loss_is_orange_a_gain_blue_and_rest_grey(pattern: BridgePattern) -> None:
    above = bridge_illustration(pattern).figure.axes[0]
    colour = {line.get_xdata()[0]: to_rgb(line.get_color()) for line in above.lines}  # type: ignore[index]
    red, _, blue = colour[6.0]
    assert red > 2 * blue
    for gained in (5.0, 7.0):
        red, _, blue = colour[gained]
        assert blue > 2 * red
    assert np.ptp(colour[0.0]) < 0.05


def test_bars_show_kilonewtons_with_their_intervals(pattern: BridgePattern) -> None:
    below = bridge_illustration(pattern).figure.axes[1]
    heights = [patch.get_height() for patch in below.patches]  # type: ignore[attr-defined]
    assert heights == pytest.approx([row.shift_n / 1e3 for row in pattern.rows])
    assert below.get_ylabel() == "lost or gained (kN)"
    assert len(below.containers) == 2


def test_every_hanger_has_its_number_and_one_without_a_test_is_dotted(
    pattern: BridgePattern,
) -> None:
    above = bridge_illustration(pattern).figure.axes[0]
    assert {text.get_text() for text in above.texts} == {str(i) for i in range(1, 13)}
    dotted = [line for line in above.lines if line.get_linestyle() == ":"]
    assert [line.get_xdata()[0] for line in dotted] == [2.0]  # type: ignore[index]
    bold = {text.get_text() for text in above.texts if text.get_fontweight() == "bold"}
    assert bold == {"6", "7", "8"}


def test_places_in_metres_are_used_where_all_are_known() -> None:
    placed = [replace(each, position_m=4 + 5.5 * each.place) for each in shifts()]
    figure = bridge_illustration(bridge_pattern(placed, range(1, 13))).figure
    assert figure.axes[1].get_xlabel() == "along the bridge (m)"
    dotted = next(line for line in figure.axes[0].lines if line.get_linestyle() == ":")
    assert dotted.get_xdata()[0] == pytest.approx(15.0)  # type: ignore[index]


def test_numbers_of_many_hangers_do_not_overlap_and_keep_those_who_moved() -> None:
    figure = bridge_illustration(bridge_pattern(shifts(100), range(1, 101))).figure
    texts = {text.get_text(): text.get_position()[0] for text in figure.axes[0].texts}
    assert "7" in texts
    assert min(np.diff(sorted(texts.values()))) >= 4


def test_the_words_say_what_the_picture_shows(pattern: BridgePattern) -> None:
    shown = bridge_illustration(pattern)
    assert "hanger 7 -34 kN (-4.9 %)" in shown.alt
    assert pattern.sentence in shown.caption
    assert shown.png().startswith(b"\x89PNG")
    assert shown.svg().startswith("<svg")
