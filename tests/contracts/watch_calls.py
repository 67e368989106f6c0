"""Fixed histories of the contract of the watch, and what is compared of them.

`write_watch_golden.py` makes the golden files from them, `test_watch_contract.py` compares.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from datetime import UTC, datetime, timedelta
from functools import partial
from typing import Any

import numpy as np

from shm.documents import alert_document, dump
from shm.modes_document import load_modes
from shm.report.shifts import pattern_json
from shm.store.blobs import watch_document
from shm.values import (
    Alert,
    Beside,
    Channel,
    Hanger,
    ModalTest,
    Mode,
    Plane,
    Recording,
    WatchedTest,
)
from shm.watch import Newest, WatchOptions, watch_frequencies, watch_newest
from shm.watch.neighbours import HangerShift
from shm.watch.words.neighbours_words import bridge_pattern
from tests.contracts.inference_calls import GOLDEN
from tests.helpers.hangers import HANGER_3
from tests.helpers.modelled_tests import EVERYTHING, frequencies, posterior

FOLDER = GOLDEN / "watch"
START = datetime(2026, 1, 5, 12, tzinfo=UTC)
SD, MODEL = 3e-4, "beam2"
SOUND = (1.0, 1.0, 7.3, 7.1, 7.2, 7.4)
"""Tension and length as fractions of the described ones, then log10 of k1 to k4."""
LOST = (0.92, *SOUND[1:])
LOOSENED = (1.0, 1.0, 6.3, 7.1, 7.2, 7.4)
OF_ANOTHER = (1.35, 0.8, *SOUND[2:])
BASELINE_TESTS = 3
STATES: Mapping[str, Sequence[Sequence[float]]] = {
    "sound": [SOUND] * 8,
    "lost": [*[SOUND] * 3, *[LOST] * 5],
    "loosened": [*[SOUND] * 3, *[LOOSENED] * 6],
    "disturbed": [*[SOUND] * 3, OF_ANOTHER, *[SOUND] * 4],
}
"""The states of a hanger at its tests after three of the baseline, two weeks apart."""


def make_test(number: int, theta: Sequence[float], rng: np.random.Generator) -> ModalTest:
    """Return a test of a hanger in a state, with errors of 0.03 % of a frequency."""
    exact = frequencies(theta, MODEL).ravel()
    hz = exact * (1 + SD * rng.standard_normal(len(exact)))
    modes = tuple(
        Mode(plane, order, round(float(one), 5), round(float(SD * one), 6))
        for (plane, order), one in zip(EVERYTHING, hz, strict=True)
    )
    time = START + timedelta(weeks=2 * number)
    return ModalTest(f"t{number}", modes, HANGER_3.id, time, 10.0 + 3 * float(rng.normal()))


def make_history(name: str) -> list[ModalTest]:
    """Return the tests of a history, those of the baseline first."""
    rng = np.random.default_rng(sorted(STATES).index(name))
    states = [*[SOUND] * BASELINE_TESTS, *STATES[name]]
    return [make_test(n, theta, rng) for n, theta in enumerate(states)]


DECK: tuple[tuple[Plane, int, float], ...] = (
    ("transverse", 1, 2.0),
    ("longitudinal", 1, 2.12),
    ("transverse", 2, 4.1),
)
"""Plane, order and frequency (Hz) of a structure without a model."""


def make_deck() -> list[ModalTest]:
    """Return four months of daily tests, the last of which have 2 % lower frequencies."""
    rng, found = np.random.default_rng(9), []
    for day in range(121):
        warmth_c = 10 + 15 * math.cos(2 * math.pi * (day + 40) / 365)
        moved = -0.02 if day >= 90 else 0.0
        modes = tuple(
            Mode(plane, order, round(hz * math.exp(moved + 4e-4 * rng.normal()), 6), 4e-4 * hz)
            for plane, order, hz in DECK
        )
        found.append(ModalTest(f"d{day}", modes, 9, START + timedelta(days=day), warmth_c))
    return found


def dated(tests: Sequence[ModalTest]) -> list[tuple[ModalTest, datetime]]:
    """Return tests with their times."""
    return [(test, test.time) for test in tests if test.time is not None]


def watch_one_by_one(tests: Sequence[ModalTest], hanger: Hanger = HANGER_3) -> list[Newest]:
    """Return the result of each test since the baseline, as the daemon watches them."""
    first, kept, found = tests[:BASELINE_TESTS], None, []
    baseline = posterior(SOUND, MODEL)
    for n, test in enumerate(tests[BASELINE_TESTS:], BASELINE_TESTS):
        before = tests[BASELINE_TESTS:n][::-1][:2]
        beside = Beside(came=(before, ()), dated=(before, ()))
        newest = watch_newest(
            baseline, dated(first), dated([test]), hanger, WatchOptions(), kept, beside
        )
        assert newest is not None
        kept = newest.kept
        found.append(newest)
    return found


def document(tests: Sequence[WatchedTest], alerts: Sequence[Alert]) -> Any:
    """Return what is stored and shown of a history: its last test, and all alerts."""
    last = tests[-1]
    return read_back(
        {
            "watch": watch_document(last),
            "drifts": [asdict(each) for each in last.drifts],
            "reported": [asdict(each) for each in last.published_drifts],
            "called": [each.test for each in tests if each.change.called],
            "alerts": [alert_document(each) for each in alerts],
        }
    )


def read_back(found: object) -> Any:
    """Return a document as it is read from JSON."""
    return json.loads(dump(found))


def watch_history(name: str) -> Any:
    """Return the document of a hanger's history."""
    found = watch_one_by_one(load_modes(FOLDER / f"{name}.modes.json"))
    return document([each.test for each in found], [each.alert for each in found if each.alert])


def watch_deck() -> Any:
    """Return the document of a history of a structure without a model."""
    found = watch_frequencies(load_modes(FOLDER / "deck.modes.json"), name="Deck")
    return document(found.tests, found.alerts)


def compare_hangers() -> Any:
    """Return the pattern of a bridge of seven hangers, one of which has lost a tenth."""
    fractions = (0.002, 0.001, 0.035, -0.1, 0.037, -0.001, 0.0)
    shifts = [
        HangerShift(
            hanger=n,
            place=n,
            time=START + timedelta(hours=n),
            baseline_n=7e5,
            shift_n=7e5 * fraction,
            shift_sd_n=2100.0,
            position_m=8.0 * n,
        )
        for n, fraction in enumerate(fractions, 1)
    ]
    return read_back(pattern_json(bridge_pattern(shifts)))


def record_hit() -> Recording:
    """Return a recording of one hit: a decaying tone of 12 Hz in a little noise."""
    rng, rate_hz = np.random.default_rng(3), 400.0
    t = np.arange(2048) / rate_hz
    tone = np.where(t > 0.5, np.exp(-2 * (t - 0.5)) * np.sin(2 * np.pi * 12 * (t - 0.5)), 0.0)
    samples = np.round(tone + 1e-3 * rng.standard_normal(len(t)), 6)
    return Recording("made", (Channel("acc_1", "acceleration", samples),), rate_hz, 3)


CASES: Mapping[str, Callable[[], Any]] = {
    **{name: partial(watch_history, name) for name in STATES},
    "deck": watch_deck,
    "bridge": compare_hangers,
}
"""What makes the document of each golden file."""


def golden(name: str) -> Any:
    """Return a golden file."""
    return json.loads((FOLDER / f"{name}.json").read_text(encoding="utf-8"))
