"""The benchmark of identification counts what it says it counts."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from shm.errors import NotIdentifiable
from shm.identify import Identification
from shm.identify.contract import Hit, Poles
from shm.values import ModalTest, Mode, QualityCheck

FOLDER = Path(__file__).resolve().parents[1] / "benchmarks" / "identification"


@pytest.fixture(scope="module")
def bench() -> Iterator[dict[str, ModuleType]]:
    """Its modules, which import each other by their bare names."""
    names = ("cases", "scoring", "marks", "page", "comparing")
    sys.path.insert(0, str(FOLDER))
    yield {name: importlib.import_module(name) for name in names}
    sys.path.remove(str(FOLDER))
    for name in names:
        del sys.modules[name]


@pytest.fixture(scope="module")
def case(bench: dict[str, ModuleType]) -> Any:
    return bench["cases"].random_case(1, 0)


def answer(case: Any, modes: tuple[Mode, ...], **more: Any) -> Identification:
    hits = tuple(Hit(0, 0, strike.start_s, strike.peak_n) for strike in case.made.strikes)
    empty = np.zeros(0)
    poles = Poles(empty, empty, empty, empty.astype(bool))
    return replace(Identification(ModalTest("t", modes), None, hits, (), poles), **more)


def right(case: Any) -> tuple[Mode, ...]:
    """Return the truth, with an error of 1e-5 and standard deviations that cover it."""
    return tuple(
        Mode(t.plane, t.order, t.frequency_hz * (1 + 1e-5), t.frequency_hz * 1e-5,
             case.state.damping_ratio, 1e-4)
        for t in case.truths
    )  # fmt: skip


def scored(
    bench: dict[str, ModuleType], case: Any, monkeypatch: pytest.MonkeyPatch, result: Any
) -> Any:
    def identify(*args: Any, **more: Any) -> Identification:
        if isinstance(result, Exception):
            raise result
        return result

    monkeypatch.setattr(bench["scoring"], "identify", identify)
    return bench["scoring"].scored(case)


def test_a_right_answer_meets_every_mark(
    bench: dict[str, ModuleType], case: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    score = scored(bench, case, monkeypatch, answer(case, right(case)))
    assert score.found == score.expected > 5
    assert (score.false, score.misplaced, score.sound_hits_dropped) == (0, 0, 0)
    assert score.sound_hits == case.plan.hits
    judged = {mark.name: mark for mark in bench["marks"].marks([score])}
    missed = [name for name, mark in judged.items() if not mark.met]
    assert missed == [
        "90 % intervals of frequency cover",  # 100 % is too many
        "90 % intervals of damping cover",
        "planted faults flagged",  # there are none
    ]


def test_a_shifted_order_is_missed_and_misplaced_and_an_odd_frequency_is_false(
    bench: dict[str, ModuleType], case: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    wrong = [replace(mode, order=mode.order + 1) for mode in right(case)]
    odd = Mode("transverse", 99, 1.03 * max(mode.frequency_hz for mode in wrong))
    score = scored(bench, case, monkeypatch, answer(case, (*wrong, odd)))
    assert score.found == 0
    assert score.misplaced == len(wrong)
    assert score.false == 1


@pytest.mark.parametrize(("verdict", "told"), [("warning", True), ("good", False)])
def test_a_fault_is_flagged_by_a_check_of_its_kind_that_is_not_good(
    bench: dict[str, ModuleType], monkeypatch: pytest.MonkeyPatch, verdict: Any, told: bool
) -> None:
    faulty = bench["cases"].random_case(1, 0, "mains")
    check = QualityCheck("tones", verdict, 1.0, 0.5, "", "a line at 50 Hz")
    score = scored(bench, faulty, monkeypatch, answer(faulty, right(faulty), quality=(check,)))
    assert score.flagged is told


def test_noise_must_be_refused(
    bench: dict[str, ModuleType], monkeypatch: pytest.MonkeyPatch
) -> None:
    noise = bench["cases"].random_case(1, 0, "noise_only")
    score = scored(bench, noise, monkeypatch, NotIdentifiable("no hit", remedy="hit"))
    assert (score.flagged, score.expected) == (True, 0)
    assert scored(bench, noise, monkeypatch, answer(noise, right(noise))).flagged is False
