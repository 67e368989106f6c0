"""Modes of a window from the last known ones, on motion that is exact by construction."""

from __future__ import annotations

import os
from dataclasses import replace
from datetime import timedelta
from pathlib import Path

import numpy as np
import pytest

from shm.identify import IdentifyOptions, identify
from shm.monitor import read_window, tracking
from shm.monitor.limits import LIMITS
from shm.values import PLANES, Channel, FloatArray, Hanger, Mode, Plane, Recording
from shm.values.stream import Piece, Stream, StreamChannel, WindowReading
from tests.helpers.ambient_stream import (
    LENGTH_M,
    START,
    Motion,
    drawn,
    piece,
    stream,
    values,
)
from tests.helpers.slow import few_of

OPTIONS = IdentifyOptions(band_high_hz=60.0)
HANGER = Hanger(3, LENGTH_M, 2.1e11, 5.03e-3, 2.01e-6, 39.5, 400e3)
DATA = Path(os.environ.get("SHM_DATA", Path(__file__).parents[2] / "../shared/data")).resolve()


def _read(motion: Motion, rng: np.random.Generator, known: tuple[Mode, ...]) -> WindowReading:
    return read_window([piece(values(motion, rng))], stream(), known, HANGER, OPTIONS)


def _by_name(modes: tuple[Mode, ...]) -> dict[tuple[str, int], Mode]:
    return {(mode.plane, mode.order): mode for mode in modes}


def test_the_planes_do_not_exchange_modes_when_one_passes_by_the_other() -> None:
    """The transverse modes rise by 1.2 %, past the longitudinal ones 0.6 % above, in six steps."""
    rng = np.random.default_rng(5)
    motion = replace(drawn(rng, orders=3), turned=0.03)
    hz = {
        (plane, order): motion.frequency_hz["transverse", order] * factor
        for plane, factor in (("transverse", 1.0), ("longitudinal", 1.006))
        for order in (1, 2, 3)
    }
    motion = replace(motion, frequency_hz=hz)
    known = _by_name(motion.known())
    for step in range(1, 7):
        now = replace(motion, frequency_hz={
            key: f * (1 + 0.002 * step) if key[0] == "transverse" else f for key, f in hz.items()
        })  # fmt: skip
        reading = _read(now, rng, tuple(known.values()))
        known |= _by_name(reading.modes)
    for (plane, order), mode in _by_name(reading.modes).items():
        assert mode.frequency_hz == pytest.approx(now.frequency_hz[plane, order], rel=1e-3)
    assert len(reading.modes) >= 5


def test_two_modes_that_were_taken_for_one_are_told_apart_by_their_planes() -> None:
    """From scratch, two modes 0.8 % apart may come out as one that moves both planes alike."""
    rng = np.random.default_rng(22)
    motion = drawn(rng, orders=2)
    hz = motion.frequency_hz["transverse", 1]
    true = {**motion.frequency_hz, ("longitudinal", 1): 1.008 * hz}
    mixed = [
        replace(
            mode,
            frequency_hz=1.005 * hz,
            damping_ratio=0.008,
            shape=tuple(replace(point, cross=0.9 * point.value) for point in mode.shape),
        )
        if mode.order == 1
        else mode
        for mode in motion.known()
    ]
    reading = _read(replace(motion, frequency_hz=true), rng, tuple(mixed))
    found = _by_name(reading.modes)
    assert len(found) == 4
    for key, mode in found.items():
        assert abs(mode.frequency_hz - true[key]) < 4 * mode.frequency_sd_hz


@pytest.mark.parametrize("minute", few_of([20, 30], 1))
def test_modes_that_were_missed_at_first_join_the_others_once(
    minute: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Sought each hour here, by this stream in the window at half past."""
    monkeypatch.setattr(tracking, "LIMITS", replace(LIMITS, review_s=3600))
    rng = np.random.default_rng(7)
    motion = drawn(rng, orders=4)
    missed = {("transverse", 3), ("longitudinal", 4)}
    known = tuple(mode for mode in motion.known() if (mode.plane, mode.order) not in missed)
    at = replace(piece(values(motion, rng)), start=START.replace(minute=minute))
    reading = read_window([at], stream(), known, HANGER, OPTIONS)
    assert reading.how == "tracked"
    joined = _by_name(reading.modes).keys() - _by_name(known).keys()
    assert joined == (missed if minute == 30 else set())
    for key in joined:
        assert _by_name(reading.modes)[key].frequency_hz == pytest.approx(
            motion.frequency_hz[key], rel=1e-3
        )


def test_a_lone_peak_of_the_deck_gives_way_to_the_modes_of_the_hanger() -> None:
    rng = np.random.default_rng(7)
    motion = drawn(rng, orders=4)
    second = motion.scaled(1.0).known()[1]
    lone = replace(second, plane="transverse", order=1)
    at = replace(piece(values(motion, rng)), start=START.replace(minute=30))
    reading = read_window([at], stream(), (lone,), HANGER, OPTIONS)
    assert reading.how == "from scratch"
    assert len(reading.modes) == 8


def test_a_mode_that_is_gone_is_told_and_the_others_stay() -> None:
    rng = np.random.default_rng(7)
    motion = drawn(rng)
    gone = ("longitudinal", 2)
    hz = {key: f for key, f in motion.frequency_hz.items() if key != gone}
    reading = _read(replace(motion, frequency_hz=hz), rng, motion.known())
    assert gone not in _by_name(reading.modes)
    assert len(reading.modes) == 9
    assert "longitudinal 2" in reading.why


def detached(seed: int, rows: list[int], n_windows: int) -> tuple[Motion, list[FloatArray]]:
    """Return a motion, and windows of it in which the sensors `rows` lie on the deck instead."""
    rng = np.random.default_rng(seed)
    motion = drawn(rng, orders=4)
    deck = {(plane, order): rng.uniform(2, 40) for plane in PLANES for order in range(1, 7)}
    off = replace(motion, frequency_hz=deck, damping=dict.fromkeys(deck, 0.01))
    windows = []
    for _ in range(n_windows):
        samples = values(motion, rng)
        samples[rows] = values(off, rng)[rows]
        windows.append(samples)
    return motion, windows


@pytest.mark.parametrize("seed", few_of([1, 2], 1))
def test_read_window_detached_plane(seed: int) -> None:
    """Known modes keep their numbers though the transverse sensors see the deck instead.

    A peak of the deck may pass for a mode, but within 0.4 % of where that mode was.
    """
    motion, (samples,) = detached(seed, [0, 2], 1)
    at = replace(piece(samples), start=START.replace(minute=30))
    reading = read_window([at], stream(), motion.known(), HANGER, OPTIONS)
    for mode in reading.modes:
        expected = motion.frequency_hz[mode.plane, mode.order]
        assert mode.frequency_hz == pytest.approx(expected, rel=5e-3)
    assert sum(mode.plane == "longitudinal" for mode in reading.modes) >= 3


@pytest.mark.parametrize("seed", few_of([101, 103], 1))
def test_read_window_excludes_strays(seed: int) -> None:
    """A peak of the deck near a lost mode is not followed from window to window."""
    motion, windows = detached(seed, [0, 1, 2, 3], 3)
    known = {(mode.plane, mode.order): mode for mode in motion.known()}
    for number, samples in enumerate(windows):
        at = replace(piece(samples), start=START + timedelta(minutes=10 * number))
        reading = read_window([at], stream(), tuple(known.values()), HANGER, OPTIONS)
        known |= {(mode.plane, mode.order): mode for mode in reading.modes}
    for name, mode in known.items():
        assert mode.frequency_hz == pytest.approx(motion.frequency_hz[name], rel=5e-3)


@pytest.mark.parametrize("seed", few_of([302, 309], 1))
def test_read_window_detached_plane_gains_no_mode(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A search for missed modes adds none to a plane whose known modes are lost."""
    monkeypatch.setattr("shm.monitor.tracking._is_due", lambda window, every_s: True)
    motion, (samples,) = detached(seed, [0, 2], 1)
    known = tuple(m for m in motion.known() if m.plane != "transverse" or m.order <= 2)
    reading = read_window([piece(samples)], stream(), known, HANGER, OPTIONS)
    for mode in reading.modes:
        expected = motion.frequency_hz[mode.plane, mode.order]
        assert mode.frequency_hz == pytest.approx(expected, rel=5e-3)


@pytest.mark.parametrize("plane", PLANES)
@pytest.mark.parametrize("fall", [0.02, 0.057])
def test_read_window_loosened_plane(plane: Plane, fall: float) -> None:
    """The modes of one plane fall, the lowest most: all are followed, each by its own number."""
    rng = np.random.default_rng(5)
    motion = drawn(rng, orders=4)
    hz = {
        key: f * (1 - fall * (1.1 - 0.1 * key[1]) * (key[0] == plane))
        for key, f in motion.frequency_hz.items()
    }
    now = replace(motion, frequency_hz=hz)
    reading = read_window([piece(values(now, rng))], stream(), motion.known(), HANGER, OPTIONS)
    assert len(reading.modes) == 8
    for mode in reading.modes:
        assert mode.frequency_hz == pytest.approx(hz[mode.plane, mode.order], rel=2e-3)


@pytest.mark.parametrize("share", few_of([-0.3, 0.3], 1))
def test_read_window_large_change(share: float) -> None:
    """A change of tension beyond reach is found from scratch and keeps all numbers."""
    rng = np.random.default_rng(3)
    motion = drawn(rng, orders=4)
    added = share * motion.frequency_hz["transverse", 1] ** 2
    hz = {key: (f**2 + added * key[1] ** 2) ** 0.5 for key, f in motion.frequency_hz.items()}
    now = replace(motion, frequency_hz=hz)
    at = replace(piece(values(now, rng)), start=START.replace(minute=30))
    reading = read_window([at], stream(), motion.known(), HANGER, OPTIONS)
    assert reading.how == "from scratch"
    assert len(reading.modes) >= 6
    for mode in reading.modes:
        assert mode.frequency_hz == pytest.approx(hz[mode.plane, mode.order], rel=2e-3)


def test_without_known_modes_they_are_found_from_scratch_and_then_tracked() -> None:
    rng = np.random.default_rng(8)
    motion = drawn(rng, orders=4)
    first = _read(motion, rng, ())
    assert first.how == "from scratch"
    assert len(first.modes) >= 6
    second = _read(motion, rng, first.modes)
    assert second.how == "tracked"
    assert set(_by_name(second.modes)) == set(_by_name(first.modes))
    assert all(mode.acceleration_m_s2 > 0 for mode in second.modes)


def test_two_cables_exchanged_are_no_new_modes() -> None:
    rng = np.random.default_rng(10)
    motion = drawn(rng)
    samples = values(motion, rng)[[1, 0, 2, 3]]
    reading = read_window([piece(samples)], stream(), motion.known(), HANGER, OPTIONS)
    assert reading.modes == ()
    assert "exchanged" in reading.why


def test_a_real_recording_in_chunks_gives_the_modes_of_the_whole() -> None:
    """Five hits on a structure that nobody described, one after the other, as a stream of 25 kHz.

    What is tracked in chunks of the later hits lies where all hits together put it.
    """
    folder = DATA / "pyfrf_hits"
    if not folder.is_dir():
        pytest.skip("the published records are not beside the checkout (set SHM_DATA)")
    signals = [np.load(file) for file in sorted(folder.glob("*.npy"))]
    records = [
        Recording(
            "hits",
            (Channel("force", "force", force), Channel("acc", "acceleration", acceleration)),
            25_600.0,
        )
        for _, force, acceleration in signals
    ]
    options = IdentifyOptions(band_low_hz=500.0, band_high_hz=4000.0)
    whole = identify(records, options, test_id="hits", hanger=Hanger.without_model(1)).test.modes
    assert whole
    # A hundredth of the rate: 100 s of stream, so that windows are as long as they must be.
    slow = [replace(m, frequency_hz=m.frequency_hz / 100, shape=()) for m in whole]
    places = Stream("lab", 1, 256.0, (StreamChannel("acc", whole[0].plane, 0.5),))
    ring = [signal[2][200:] for signal in signals]
    pieces = [
        Piece("lab", START + timedelta(seconds=100 * number), 256.0, ("acc",), part[np.newaxis])
        for number, part in enumerate(ring)
    ]
    reading = read_window(pieces, places, slow, Hanger.without_model(1), OPTIONS)
    found = _by_name(reading.modes)
    for mode in slow:
        if (mode.plane, mode.order) in found:
            own = found[mode.plane, mode.order]
            assert own.frequency_hz == pytest.approx(mode.frequency_hz, rel=2e-3)
    hz = 100 * np.array([mode.frequency_hz for mode in reading.modes])
    # The peaks that the folder's NOTE.md names
    named = [810, 851, 900, 2640, 3008, 3669]
    near = [each for each in named if np.min(np.abs(hz / each - 1)) < 3e-3]
    assert len(near) >= 5
