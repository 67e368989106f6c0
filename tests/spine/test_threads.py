"""Numerical libraries keep to one thread unless the owner says otherwise."""

from __future__ import annotations

import os

import pytest

from shm.resources import one_thread_a_process

NAMES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def test_one_thread_is_the_default_and_a_given_number_stays(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for name in NAMES:
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("OMP_NUM_THREADS", "4")
    one_thread_a_process()
    assert [os.environ[name] for name in NAMES] == ["4", "1", "1"]
