"""Figures of one hammer test: drawn for every kind of test, and showing what they must."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from shm.report.contents import ModalTestReport
from shm.report.figures import style
from shm.report.figures.every_figure import OF_MODAL_TEST
from shm.report.figures.every_figure import modal_test_figures as report_test_figures
from shm.report.figures.modal_test_response import ResponseCurves
from shm.report.figures.specification import Illustration
from shm.report.figures.specification import drawn as members_drawn
from shm.values import PLANES, Channel
from tests.report.sheets import (
    ambient,
    given_responses,
    make_points,
    make_recording,
    make_sheet,
    one_sensor,
    refused,
    warned,
)

DROPPED = {2: "double hit", 5: "not-a-number samples"}
EIGHT_M = (0.9, 2.1, 3.4, 4.6, 5.8, 7.1, 8.3, 9.6)
CASES: dict[str, Callable[[], ModalTestReport]] = {
    "two sensors": make_sheet,
    "eight sensors": lambda: make_sheet(places_m=EIGHT_M, orders=12),
    "dropped hits": lambda: make_sheet(hits=6, dropped=DROPPED),
    "single hit": lambda: make_sheet(hits=1),
    "given responses": given_responses,
    "one sensor": one_sensor,
    "ambient": ambient,
    "warned": lambda: warned(make_sheet()),
    "refused": lambda: refused(make_sheet()),
    "no records": lambda: replace(make_sheet(), records=(), hanger=None, band_hz=None),
}
TIMED = ["time_history", "hits"]
SPECTRAL = ["response", "stabilisation"]
DRAWN = {
    "two sensors": [*TIMED, *SPECTRAL, "shapes"],
    "eight sensors": [*TIMED, *SPECTRAL, "shapes"],
    "dropped hits": [*TIMED, *SPECTRAL, "shapes"],
    "single hit": [*TIMED, *SPECTRAL, "shapes"],
    "given responses": [*SPECTRAL, "shapes"],
    "one sensor": [*TIMED, *SPECTRAL],
    "ambient": ["time_history", *SPECTRAL, "shapes"],
    "warned": [*TIMED, *SPECTRAL, "shapes"],
    "refused": [*TIMED, *SPECTRAL, "shapes"],
    "no records": [*SPECTRAL, "shapes"],
}
Drawn = dict[str, dict[str, Illustration]]


@pytest.fixture(scope="module")
def drawn() -> Drawn:
    return {
        name: {item.name: item for item in report_test_figures(make())}
        for name, make in CASES.items()
    }


def alone(name: str, sheet: ModalTestReport) -> Illustration:
    """One figure by itself: all of them take a second."""
    (item,) = members_drawn(
        [member for member in OF_MODAL_TEST if member.name == name], ResponseCurves.of(sheet)
    )
    return item


def lines_named(axes: Axes, label: str) -> list[Line2D]:
    return [line for line in axes.lines if line.get_label() == label]


def marks(axes: Axes, label: str) -> int:
    return sum(np.size(line.get_xdata()) for line in lines_named(axes, label))


def legend_of(figure: Figure) -> list[str]:
    parents = [figure, *figure.subfigs]
    return [t.get_text() for part in parents for each in part.legends for t in each.get_texts()]


@pytest.mark.parametrize("name", CASES)
def test_every_kind_of_test_has_the_figures_it_has_data_for(name: str, drawn: Drawn) -> None:
    assert list(drawn[name]) == DRAWN[name]


def test_every_hit_is_marked_as_used_or_dropped_with_its_reason(drawn: Drawn) -> None:
    figure = drawn["dropped hits"]["time_history"].figure
    force = figure.axes[0]
    assert marks(force, "4 hits used") == 4
    assert marks(force, "1 hit dropped: double hit") == 1
    assert marks(force, "1 hit dropped: not-a-number samples") == 1
    assert sorted(text.get_text() for text in force.texts) == ["1", "2", "3", "4", "5", "6"]
    assert set(legend_of(figure)) >= {"4 hits used", "1 hit dropped: double hit"}
    assert "hit 2 at 4.5 s: double hit" in drawn["dropped hits"]["time_history"].alt


def test_records_of_one_hit_each_stand_one_after_the_other(drawn: Drawn) -> None:
    force = drawn["one sensor"]["time_history"].figure.axes[0]
    (marked,) = lines_named(force, "5 hits used")
    gaps = np.diff(np.asarray(marked.get_xdata(), float))
    assert gaps == pytest.approx([gaps[0]] * 4)
    assert gaps[0] > 12.0


def test_a_channel_that_was_left_out_is_drawn_with_the_reason() -> None:
    sheet = make_sheet(places_m=EIGHT_M)
    fault = replace(
        sheet.identification.dropped[0], what="channel acc_9", count=1, reason="dead cable"
    )
    found = replace(sheet.identification, dropped=(fault,))
    item = alone("time_history", replace(sheet, identification=found))
    titles = [axes.get_title(loc="right") for axes in item.figure.axes]
    assert "acc_9, transverse, 5.80 m, left out: dead cable" in titles
    assert "4 of 16 accelerations are drawn" in item.caption


def test_missing_samples_and_the_full_scale_are_marked() -> None:
    sheet = make_sheet()
    (record,) = sheet.recordings
    values = record.channels[1].values.copy()
    values[2000:3000] = np.nan
    spoilt: Channel = replace(record.channels[1], values=values, full_scale=8.0)
    channels = (record.channels[0], spoilt, *record.channels[2:])
    item = alone("time_history", replace(sheet, records=(replace(record, channels=channels),)))
    axes = item.figure.axes[1]
    assert marks(axes, "not a number") > 5
    levels = {
        float(np.asarray(line.get_ydata())[0]) for line in axes.lines if len(line.get_xdata()) == 2
    }
    assert {-8.0, 8.0} <= levels


def test_a_long_record_is_drawn_by_few_vertices_and_keeps_its_peak() -> None:
    sheet = make_sheet(places_m=EIGHT_M)
    record = make_recording(sheet.modes, make_points(EIGHT_M), 5, 12.0, 2048.0)
    hits = tuple(
        replace(hit, start=round((number * 12 + 0.5) * 2048), start_s=number * 12 + 0.5)
        for number, hit in enumerate(sheet.hits)
    )
    found = replace(sheet.identification, hits=hits)
    figure = alone("time_history", replace(sheet, identification=found, records=(record,))).figure
    drawn_values = np.asarray(figure.axes[1].lines[0].get_ydata(), float)
    assert np.nanmax(drawn_values) == record.channels[1].values.max()
    vertices = sum(np.size(line.get_xdata()) for axes in figure.axes for line in axes.lines)
    assert vertices < 12_000


def test_hits_are_laid_over_each_other_dropped_ones_in_red(drawn: Drawn) -> None:
    figure = drawn["dropped hits"]["hits"].figure
    pulse, spectrum = figure.axes
    assert len(pulse.lines) == 6
    assert len(spectrum.lines) == 7  # and the line of a tenth
    red = [line.get_label() for line in pulse.lines if line.get_color() == style.RED]
    assert red == ["hit 2, dropped: double hit", "hit 5, dropped: not-a-number samples"]
    peaks = [float(np.max(np.asarray(line.get_ydata()))) for line in pulse.lines]
    assert peaks == pytest.approx([900 + 50 * hit for hit in range(6)], abs=4)


def test_the_force_spectrum_reaches_as_far_as_its_pulse_allows() -> None:
    """Compare with a pulse of samples 1/2, 1, 1/2.

    Its spectrum is (1 + cos(2 pi f / rate))/2, a tenth of it where the cosine is -0.8: at 0.398
    of the sampling rate.
    """
    item = alone("hits", make_sheet())
    found = re.search(r"A tenth of the force is left at (\d+) Hz", item.alt)
    assert found is not None
    assert int(found[1]) == pytest.approx(0.398 * 256, abs=3)


def test_the_fit_lies_over_the_response_and_every_mode_is_marked(drawn: Drawn) -> None:
    figure = drawn["two sensors"]["response"].figure
    magnitudes = figure.axes[0:8:2]
    assert len(figure.axes) == 9
    for axes in magnitudes:
        assert [marks(axes, f"{plane} mode") for plane in PLANES] == [6, 6]
        (measured,), (fitted,) = (lines_named(axes, e) for e in ("measured", "fit of the modes"))
        assert np.max(fitted.get_ydata()) == pytest.approx(np.max(measured.get_ydata()), rel=0.02)
    assert figure.axes[-1].get_ylabel() == "coherence"


def test_ambient_motion_is_shown_by_its_spectral_density_with_peaks_at_the_modes(
    drawn: Drawn,
) -> None:
    item = drawn["ambient"]["response"]
    axes = item.figure.axes[0]
    assert axes.get_ylabel() == "spectral density\n((m/s²)²/Hz)"
    assert "nobody hit" in item.caption
    (curve,) = lines_named(axes, "measured")
    x, y = np.asarray(curve.get_xdata()), np.asarray(curve.get_ydata())
    near = (x > 5) & (x < 7)
    assert x[near][np.argmax(y[near])] == pytest.approx(5.8, abs=0.06)


def test_stable_and_dropped_poles_chosen_modes_and_set_aside_ones_are_told_apart(
    drawn: Drawn,
) -> None:
    axes = drawn["warned"]["stabilisation"].figure.axes[0]
    assert marks(axes, "stable pole") == 12 * 18
    assert marks(axes, "dropped pole") == 20 + 12 * 2
    assert [marks(axes, f"{plane} mode") for plane in PLANES] == [6, 6]
    assert marks(axes, "excluded") == 3


def test_each_mode_has_its_shape_with_bars_and_the_other_plane(drawn: Drawn) -> None:
    figure = drawn["two sensors"]["shapes"].figure
    assert len(figure.axes) == 12
    first = figure.axes[0]
    assert first.get_title(loc="left") == "1: 5.8 Hz"
    (points,) = [
        container for container in first.containers if container.get_label() == "transverse"
    ]
    assert points[0].get_ydata() == pytest.approx(np.sin(np.pi * np.array([2.5, 4.4]) / 12))
    (bar,) = points[2]
    low, high = bar.get_segments()[0][:, 1]
    assert high - low == pytest.approx(2 * 1.645 * 0.01, rel=1e-3)
    assert lines_named(first, "other plane")[0].get_ydata() == pytest.approx([0.02, 0.02])
    assert first.get_xlim()[0] < 0 < 12 < first.get_xlim()[1]


def test_a_guide_is_drawn_only_where_it_comes_near_the_points() -> None:
    sheet = make_sheet(places_m=EIGHT_M)
    wrong = replace(sheet.modes[0], order=2)
    found = replace(
        sheet.identification,
        test=replace(sheet.identification.test, modes=(sheet.modes[0], wrong)),
    )
    first, second = alone("shapes", replace(sheet, identification=found)).figure.axes
    (guide,) = lines_named(first, "guide: taut string")
    assert np.max(guide.get_ydata()) == pytest.approx(1, abs=0.01)
    assert not lines_named(second, "guide: taut string")
