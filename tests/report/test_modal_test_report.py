"""The report of one hammer test: its words in every form, and its figures for every kind."""

from __future__ import annotations

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from shm import documents
from shm.report.contents import ModalTestReport
from shm.report.figures import style
from shm.report.figures.modal_test_axes import ResponseCurves
from shm.report.figures.specification import (
    Illustration,
    drawn,
    envelope_places,
    peak_places,
)
from shm.report.figures.time_axes import places as thinned_places
from shm.report.modal_test_report import (
    FIGURES,
    modal_test_figures,
    modal_test_json,
    modal_test_paper,
)
from shm.report.shared_tables import headline
from shm.values import PLANES, Channel, FloatArray, QualityCheck
from tests.report.outline import page_words, text_words
from tests.report.sheets import (
    EIGHT_M,
    SHEETS,
    make_points,
    make_recording,
    make_sheet,
    warned,
)

# ------------------------------------------------------------ words


def dropped() -> ModalTestReport:
    return warned(make_sheet(hits=6, dropped={2: "double hit"}))


def test_page_says_how_far_it_can_be_used_and_every_number(unpainted: None) -> None:
    page = page_words(modal_test_paper(dropped()))
    paragraph = page[page.index("In short") : page.index("Modes and quality")]
    for words in (
        "Excluded, as they are no modes of the hanger: harmonic at 11.6 Hz, tone at 50 Hz and",
        "The modes can be used with care: 2 of 4 checks warn (double hits and tones)",
        "Next: Hit freely. Move the cables",
    ):
        assert words in paragraph
    for words in (
        "transverse 1 5.8000 0.001 0.400 0.02 0.4",
        "harmonic 11.600 0.4000 twice the frequency of transverse 1",
        "tone 50.000 not known mains",
        "2 made.csv 4.500 950 no: double hit",
        "poles 41 not stable over the model orders",
        "double hits ! warning 1 hits 0 hits hit 2 struck twice Hit freely.",
        "cross-check ? unknown not known 0.2 %",
        "transverse order 4 was not found; the others keep their numbers",
        "2 to 90 Hz",
        "hit level over reference level 0.97",
        "Hanger 3 (north), 12 m, nominal tension 711 kN",
    ):
        assert words in page, words


def test_text_counts_good_checks_and_tells_doubts_in_full() -> None:
    text = text_words(modal_test_paper(dropped()))
    for words in (
        "double hits ! warning 1 hits 0 hits hit 2 struck twice Hit freely.",
        "2 further checks good.",
        "1 transverse order 4 was not found",
        "LEFT OUT what how many why",
    ):
        assert words in text
    assert "clipping" not in text
    refusal = "Do not use it: refused by noise. Next: Hit harder."
    assert refusal in text_words(modal_test_paper(SHEETS["refused"]()))
    unchecked = "Its quality was not checked: judge by the figures before using the modes."
    assert unchecked in text_words(modal_test_paper(SHEETS["ambient"]()))
    checks = (
        QualityCheck("clipping", "good", 0.2, 0.95, "", "sound"),
        QualityCheck("coherence", "unknown", float("nan"), 0.8, "", "one hit gives none"),
    )
    sheet = make_sheet(hits=1)
    sheet = replace(sheet, identification=replace(sheet.identification, quality=checks))
    trusted = text_words(modal_test_paper(sheet))
    assert trusted.startswith("Test t1, Hanger 3 (north): Good")
    for words in (
        "the one check that could be made is good",
        "Nothing needs doing before using them.",
        "1 further check good.",
    ):
        assert words in trusted


def test_document_holds_what_the_page_tells() -> None:
    document = json.loads(documents.dump(modal_test_json(dropped())))
    assert (document["schema"], document["verdict"]) == ("shm.test-sheet/1", "warning")
    assert document["test"]["modes"][0]["frequency_hz"] == 5.8
    assert [check["verdict"] for check in document["quality"]].count("warning") == 2
    assert document["quality"][-1]["value"] is None
    assert document["set_aside"][1] == {
        "kind": "tone", "frequency_hz": 50.0, "damping_ratio": None, "reason": "mains",
        "plane": None, "frequency_sd_hz": None, "damping_sd": None,
    }  # fmt: skip
    assert document["hits"][1]["reason"] == "double hit"
    assert document["band_hz"] == [2.0, 90.0]


def test_headline_names_a_missing_first_order() -> None:
    lost = QualityCheck("first orders", "warning", 1, 0, "", "transverse order 1 not found", "Hit.")
    good = QualityCheck("noise", "good", 30, 20, "dB", "quiet")
    assert headline([good, lost]) == "Use with care: transverse order 1 not found"
    assert headline([good]) == "Good"


# ------------------------------------------------------------ figures

TIMED = ["time_history", "hits"]
SPECTRAL = ["response", "stabilisation"]
DRAWN = {name: [*TIMED, *SPECTRAL, "shapes"] for name in SHEETS} | {
    "given responses": [*SPECTRAL, "shapes"],
    "one sensor": [*TIMED, *SPECTRAL],
    "ambient": ["time_history", *SPECTRAL, "shapes"],
    "no records": [*SPECTRAL, "shapes"],
}


@pytest.mark.parametrize("name", SHEETS)
def test_every_kind_of_test_has_the_figures_it_has_data_for(name: str) -> None:
    assert [item.name for item in modal_test_figures(SHEETS[name]())] == DRAWN[name]


def alone(name: str, sheet: ModalTestReport) -> Illustration:
    """One figure by itself: all of them take a second."""
    (item,) = drawn([each for each in FIGURES if each.name == name], ResponseCurves.of(sheet))
    return item


def lines_named(axes: Axes, label: str) -> list[Line2D]:
    return [line for line in axes.lines if line.get_label() == label]


def marks(axes: Axes, label: str) -> int:
    return sum(np.size(line.get_xdata()) for line in lines_named(axes, label))


def values(line: Line2D) -> FloatArray:
    return np.asarray(line.get_ydata(), float)


def test_hits_are_marked_as_used_or_dropped_with_the_reason() -> None:
    """On the record, and laid over each other, dropped ones in red."""
    sheet = SHEETS["dropped hits"]()
    item = alone("time_history", sheet)
    force = item.figure.axes[0]
    assert marks(force, "4 hits used") == 4
    for reason in ("double hit", "not-a-number samples"):
        assert marks(force, f"1 hit dropped: {reason}") == 1
    assert sorted(text.get_text() for text in force.texts) == ["1", "2", "3", "4", "5", "6"]
    legends = [each for part in (item.figure, *item.figure.subfigs) for each in part.legends]
    named = {text.get_text() for each in legends for text in each.get_texts()}
    assert named >= {"4 hits used", "1 hit dropped: double hit"}
    assert "hit 2 at 4.5 s: double hit" in item.alt
    pulse, spectrum = alone("hits", sheet).figure.axes
    assert (len(pulse.lines), len(spectrum.lines)) == (6, 7)  # and the line of a tenth
    red = [line.get_label() for line in pulse.lines if line.get_color() == style.RED]
    assert red == ["hit 2, dropped: double hit", "hit 5, dropped: not-a-number samples"]
    peaks = [float(values(line).max()) for line in pulse.lines]
    assert peaks == pytest.approx([900 + 50 * hit for hit in range(6)], abs=4)


def test_records_of_one_hit_each_stand_one_after_the_other() -> None:
    force = alone("time_history", SHEETS["one sensor"]()).figure.axes[0]
    (marked,) = lines_named(force, "5 hits used")
    gaps = np.diff(np.asarray(marked.get_xdata(), float))
    assert gaps == pytest.approx([gaps[0]] * 4)
    assert gaps[0] > 12.0


def test_faults_of_channels_are_marked() -> None:
    """One that was left out with the reason; missing samples and the full scale."""
    sheet = make_sheet(places_m=EIGHT_M)
    fault = replace(
        sheet.identification.dropped[0], what="channel acc_9", count=1, reason="dead cable"
    )
    found = replace(sheet.identification, dropped=(fault,))
    item = alone("time_history", replace(sheet, identification=found))
    titles = [axes.get_title(loc="right") for axes in item.figure.axes]
    assert "acc_9, transverse, 5.80 m, left out: dead cable" in titles
    assert "4 of 16 accelerations are drawn" in item.caption
    sheet = make_sheet()
    (record,) = sheet.recordings
    samples = record.channels[1].values.copy()
    samples[2000:3000] = np.nan
    spoilt: Channel = replace(record.channels[1], values=samples, full_scale=8.0)
    channels = (record.channels[0], spoilt, *record.channels[2:])
    item = alone("time_history", replace(sheet, records=(replace(record, channels=channels),)))
    axes = item.figure.axes[1]
    assert marks(axes, "not a number") > 5
    assert {-8.0, 8.0} <= {values(line)[0] for line in axes.lines if len(line.get_xdata()) == 2}


def test_a_long_record_is_drawn_by_few_vertices_and_keeps_its_peak() -> None:
    sheet = make_sheet(places_m=EIGHT_M)
    record = make_recording(sheet.modes, make_points(EIGHT_M), 5, 12.0, 2048.0)
    hits = tuple(
        replace(hit, start=round((number * 12 + 0.5) * 2048), start_s=number * 12 + 0.5)
        for number, hit in enumerate(sheet.hits)
    )
    found = replace(sheet.identification, hits=hits)
    figure = alone("time_history", replace(sheet, identification=found, records=(record,))).figure
    assert np.nanmax(values(figure.axes[1].lines[0])) == record.channels[1].values.max()
    vertices = sum(np.size(line.get_xdata()) for axes in figure.axes for line in axes.lines)
    assert vertices < 12_000


def test_the_force_spectrum_reaches_as_far_as_its_pulse_allows() -> None:
    """Compare with a pulse of samples 1/2, 1, 1/2.

    Its spectrum is (1 + cos(2 pi f / rate))/2, a tenth of it where the cosine is -0.8: at 0.398
    of the sampling rate.
    """
    item = alone("hits", make_sheet())
    found = re.search(r"A tenth of the force is left at (\d+) Hz", item.alt)
    assert found is not None
    assert int(found[1]) == pytest.approx(0.398 * 256, abs=3)


def test_fit_lies_over_the_response_and_every_mode_is_marked() -> None:
    figure = alone("response", make_sheet()).figure
    assert len(figure.axes) == 9
    for axes in figure.axes[0:8:2]:
        assert [marks(axes, f"{plane} mode") for plane in PLANES] == [6, 6]
        (measured,), (fitted,) = (lines_named(axes, e) for e in ("measured", "fit of the modes"))
        assert values(fitted).max() == pytest.approx(values(measured).max(), rel=0.02)
    assert figure.axes[-1].get_ylabel() == "coherence"
    item = alone("response", SHEETS["ambient"]())  # its spectral density peaks at the modes
    axes = item.figure.axes[0]
    assert axes.get_ylabel() == "spectral density\n((m/s²)²/Hz)"
    assert "nobody hit" in item.caption
    (curve,) = lines_named(axes, "measured")
    x = np.asarray(curve.get_xdata())
    near = (x > 5) & (x < 7)
    assert x[near][np.argmax(values(curve)[near])] == pytest.approx(5.8, abs=0.06)


def test_stable_and_dropped_poles_modes_and_excluded_ones_are_told_apart() -> None:
    axes = alone("stabilisation", SHEETS["warned"]()).figure.axes[0]
    assert marks(axes, "stable pole") == 12 * 18
    assert marks(axes, "dropped pole") == 20 + 12 * 2
    assert [marks(axes, f"{plane} mode") for plane in PLANES] == [6, 6]
    assert marks(axes, "excluded") == 3


def test_each_mode_has_its_shape_with_bars_and_the_other_plane() -> None:
    """A guide is drawn only where it comes near the points."""
    figure = alone("shapes", make_sheet()).figure
    assert len(figure.axes) == 12
    first = figure.axes[0]
    assert first.get_title(loc="left") == "1: 5.8 Hz"
    (points,) = [each for each in first.containers if each.get_label() == "transverse"]
    assert points[0].get_ydata() == pytest.approx(np.sin(np.pi * np.array([2.5, 4.4]) / 12))
    (bar,) = points[2]
    low, high = bar.get_segments()[0][:, 1]
    assert high - low == pytest.approx(2 * 1.645 * 0.01, rel=1e-3)
    assert lines_named(first, "other plane")[0].get_ydata() == pytest.approx([0.02, 0.02])
    assert first.get_xlim()[0] < 0 < 12 < first.get_xlim()[1]
    sheet = make_sheet(places_m=EIGHT_M)
    modes = (sheet.modes[0], replace(sheet.modes[0], order=2))
    found = replace(sheet.identification, test=replace(sheet.identification.test, modes=modes))
    near, far = alone("shapes", replace(sheet, identification=found)).figure.axes
    (guide,) = lines_named(near, "guide: taut string")
    assert values(guide).max() == pytest.approx(1, abs=0.01)
    assert not lines_named(far, "guide: taut string")


# ------------------------------------------------------------ thinned signals

VALUES = st.lists(st.floats(-1e6, 1e6) | st.just(float("nan")), min_size=1, max_size=300)


@given(VALUES, st.integers(1, 40))
def test_thinning_loses_no_peak_and_invents_no_value(numbers: list[float], bins: int) -> None:
    signal = np.array(numbers)
    places = envelope_places(signal, bins)
    assert np.all(np.diff(places) > 0)
    assert len(places) <= max(2 * bins, 1)
    known = signal[np.isfinite(signal)]
    if len(known):
        assert np.nanmax(signal[places]) == known.max()
        assert np.nanmin(signal[places]) == known.min()
        assert np.nanmax(signal[peak_places(signal, min(bins, len(signal)))]) == known.max()


def test_a_gap_longer_than_a_bin_breaks_the_line() -> None:
    signal = np.sin(np.arange(10_000) / 50)
    signal[4000:5000] = np.nan
    shown = signal[envelope_places(signal, 100)]
    assert np.sum(np.isnan(shown)) >= 9
    assert len(shown) <= 200
    assert list(envelope_places(np.arange(5.0), 3)) == [0, 1, 2, 3, 4]  # short: as it is


@pytest.mark.parametrize("seed", range(3))
def test_places_keep_the_extremes_of_every_curve(seed: int) -> None:
    rng = np.random.default_rng(seed)
    curves: list[FloatArray] = [rng.normal(size=20_000) for _ in range(3)]
    chosen = thinned_places(*curves, always=(7, 11))
    for curve in curves:
        assert curve[chosen].max() == curve.max()
        assert curve[chosen].min() == curve.min()
    assert {0, 7, 11, 19_999} <= set(chosen.tolist())
    assert np.all(np.diff(chosen) > 0)
