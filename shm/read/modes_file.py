"""A modal-tests document with the sidecar beside it: what that says goes before the document."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

from shm import modes_document
from shm.errors import BadInput
from shm.read.bundles import entries_of_test
from shm.read.header import CHANNEL_KEYS, Header
from shm.read.sidecar import document_beside, sidecar_path
from shm.values import ModalTest


def load_modes(path: Path) -> tuple[ModalTest, ...]:
    """The tests of a `*.modes.json` file; raises BadInput with file, test, mode and remedy.

    Hanger, time, temperature and the known mass of a sidecar are those of its tests.
    """
    tests = modes_document.load_modes(path)
    _refuse_channels(path)
    said = entries_of_test(path)
    _refuse_what_samples_have(said, tests, path)
    return tuple(_as_said(test, said) for test in tests)


def _as_said(test: ModalTest, said: Header) -> ModalTest:
    return replace(
        test,
        hanger=test.hanger if said.hanger is None else said.hanger,
        time=said.time or test.time,
        temperature_c=test.temperature_c if math.isnan(said.temperature_c) else said.temperature_c,
        added_mass=said.added_mass or test.added_mass,
    )


def _refuse_channels(path: Path) -> None:
    for key in document_beside(path).keys() & {"channel", *CHANNEL_KEYS}:
        raise BadInput(
            f"{key!r} is said of modes, which have no channels.",
            file=sidecar_path(path),
            remedy=f"Say hanger, time and temperature_c here, all else in {path.name}.",
        )


def _refuse_what_samples_have(said: Header, tests: tuple[ModalTest, ...], path: Path) -> None:
    sidecar = sidecar_path(path)
    if not math.isnan(said.sampling_rate_hz):
        raise BadInput(
            "sampling_rate_hz is said of modes, whose frequencies are known.",
            file=sidecar,
            remedy=f"Correct the frequencies in {path.name} and send it again.",
        )
    if said.time is not None and len(tests) > 1:
        raise BadInput(
            f"one time is said of {len(tests)} tests.",
            file=sidecar,
            remedy=f"Give each test its own time in {path.name}.",
        )
