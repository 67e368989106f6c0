"""Shifts of the watch where chance puts nearly all weight on the last test."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from shm.watch import watcher
from shm.watch.posterior_summary import summarize_drifts
from tests.helpers.synthetic_readings import TENSION_ALONE, History, watch_of


def test_drifted_improbable_changes(monkeypatch: pytest.MonkeyPatch) -> None:
    """Changes before the last test count by each other, however improbable beside that of it."""
    given: list[tuple[Any, ...]] = []

    def note(*arguments: Any, is_baseline: bool) -> Any:
        given.append(arguments)
        return summarize_drifts(*arguments, is_baseline=is_baseline)

    monkeypatch.setattr(watcher, "summarize_drifts", note)
    watch_of(History(TENSION_ALONE, tests=8, outliers=0).readings(0), TENSION_ALONE)
    subject, evidence, causes, reading = given[-1]
    log_mass = causes.log_mass.copy()
    of_tension = log_mass[-1, :, :, 0]  # a view
    of_tension[np.unravel_index(of_tension.argmax(), of_tension.shape)] += 2000.0
    surely_last = replace(causes, log_mass=log_mass)

    before = summarize_drifts(subject, evidence, causes, reading, is_baseline=False)
    after = summarize_drifts(subject, evidence, surely_last, reading, is_baseline=False)

    for one, other in zip(before, after, strict=True):
        assert math.isfinite(other.shift_mean)
        assert other.shift_mean == pytest.approx(one.shift_mean, abs=one.shift_sd)
