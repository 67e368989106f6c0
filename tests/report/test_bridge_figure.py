"""The figure of a bridge: bars of the shifts by hanger, and no arch without positions."""

from __future__ import annotations

from datetime import UTC, datetime

import numpy as np
import pytest
from matplotlib.colors import to_hex

from shm.report.figures import style
from shm.report.figures.along_the_bridge import bridge_illustration
from shm.watch.neighbours import BridgePattern, HangerShift
from shm.watch.neighbours_words import bridge_pattern

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
    (axes,) = bridge_illustration(pattern).figure.axes
    colours = {
        round(bar.get_x() + bar.get_width() / 2): to_hex(bar.get_facecolor())  # type: ignore[attr-defined]
        for bar in axes.patches
    }
    assert colours[6] == style.ORANGE
    assert colours[5] == colours[7] == style.BLUE
    assert colours[0] == style.QUIET


def test_bars_show_kilonewtons_with_their_intervals(pattern: BridgePattern) -> None:
    (axes,) = bridge_illustration(pattern).figure.axes
    heights = sorted(patch.get_height() for patch in axes.patches)  # type: ignore[attr-defined]
    assert heights == pytest.approx(sorted(row.shift_n / 1e3 for row in pattern.rows))
    assert axes.get_ylabel() == "lost or gained (kN)"
    assert len(axes.containers) == 4  # lost, gained, unchanged, intervals


def test_every_hanger_has_its_number_and_one_without_a_test_a_cross(
    pattern: BridgePattern,
) -> None:
    (axes,) = bridge_illustration(pattern).figure.axes
    assert [label.get_text() for label in axes.get_xticklabels()] == [str(i) for i in range(1, 13)]
    (cross,) = [line for line in axes.lines if line.get_label() == "not compared"]
    assert np.asarray(cross.get_xdata()).tolist() == [2.0]


def test_no_arch_is_drawn_without_positions(pattern: BridgePattern) -> None:
    (axes,) = bridge_illustration(pattern).figure.axes
    assert axes.get_xlabel() == "hanger, in the order of the bridge"
    assert max(len(np.asarray(line.get_xdata())) for line in axes.lines) <= len(pattern.rows)


def test_numbers_of_many_hangers_do_not_overlap() -> None:
    (axes,) = bridge_illustration(bridge_pattern(shifts(100), range(1, 101))).figure.axes
    assert min(np.diff(axes.get_xticks())) >= 4


def test_the_words_say_what_the_picture_shows(pattern: BridgePattern) -> None:
    shown = bridge_illustration(pattern)
    assert "hanger 7 -34 kN (-4.9 %)" in shown.alt
    assert pattern.sentence in shown.caption
    assert shown.png().startswith(b"\x89PNG")
    assert shown.svg().startswith("<svg")
