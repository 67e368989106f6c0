"""The population that the world of eight kinds draws; its bar stands in `test_bars.py`."""

from typing import Any

import numpy as np
import pytest

from tests.worlds.eight_kinds import (
    KINDS,
    PLANES,
    Case,
    Design,
    Draws,
    Member,
    Tolerances,
    describe,
    make_members,
    natural_frequencies_hz,
    sound_hangers,
)

pytestmark = pytest.mark.trial  # of the world alone: it shares nothing with the product


def _rebuild(seed: int, index: int) -> tuple[Design, tuple[Member, Member]]:
    draws = Draws(seed, index, 8)
    design = list(KINDS.values())[index % len(KINDS)](draws)
    describe(draws, design)
    members, _ = make_members(draws, design, Tolerances())
    return design, members


@pytest.fixture(scope="module")
def cases() -> list[Case]:
    return sound_hangers(2026, 480)


def test_convergence_of_the_population() -> None:
    for index in range(40):
        _, members = _rebuild(11, index)
        for member in members:
            usual, fine = (natural_frequencies_hz(member, 8, n) for n in (None, 24))
            np.testing.assert_allclose(usual, fine, rtol=1.5e-5, err_msg=str(index))


def test_rebuilt_hangers_are_those_measured() -> None:
    """The frequencies in the documents are those of the members, but for the stated errors."""
    for index, case in enumerate(sound_hangers(11, 16)):
        _, members = _rebuild(11, index)
        exact = {p: natural_frequencies_hz(m, 8) for p, m in zip(PLANES, members, strict=True)}
        modes: Any = case.modes["tests"]
        for mode in modes[0]["modes"]:
            error = mode["frequency_hz"] / exact[mode["plane"]][mode["order"] - 1] - 1
            assert 0 < abs(error) < 5 * float(case.truth["scatter_sd"])


def test_seed_decides(cases: list[Case]) -> None:
    assert sound_hangers(2026, 16) == cases[:16]  # whatever the count
    other = sound_hangers(2027, 16)
    assert all(a.modes != b.modes for a, b in zip(cases, other, strict=False))
