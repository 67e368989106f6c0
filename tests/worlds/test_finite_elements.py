"""The population that the finite-element world draws; its bar stands in `test_bars.py`."""

import math
from typing import Any

import numpy as np
import pytest

from tests.worlds.bars import Array
from tests.worlds.finite_elements import Case, Nuisances, sound_hangers

pytestmark = pytest.mark.trial  # of the world alone: it shares nothing with the product


@pytest.fixture(scope="module")
def cases() -> list[Case]:
    return sound_hangers(2026, 500)


def _frequencies(case: Case) -> Array:
    modes: Any = case.modes
    return np.array([[m["frequency_hz"] for m in t["modes"]] for t in modes["tests"]])


def test_errors_of_the_frequencies_are_those_stated() -> None:
    """One knob off leaves every other draw alone, so the exact frequencies can be taken away."""
    noisy = sound_hangers(5, 150)
    biased = sound_hangers(5, 150, Nuisances(scatter=0.0))
    exact = sound_hangers(5, 150, Nuisances(scatter=0.0, repeat_sd=(0.0, 0.0)))
    scatter, repeat, misstated = [], [], []
    for one, two, three in zip(noisy, biased, exact, strict=True):
        assert one.hanger_toml == two.hanger_toml == three.hanger_toml
        assert one.truth["area_m2"] == three.truth["area_m2"]
        real, stated = float(one.truth["scatter_sd"]), float(one.truth["frequency_sd"])
        scatter.append((_frequencies(one) / _frequencies(two) - 1).ravel() / real)
        error = _frequencies(two) / _frequencies(three) - 1
        np.testing.assert_allclose(error, error[:1].repeat(len(error), 0), atol=1e-12)
        repeat.append(error[0] / float(one.truth["repeat_sd"]))
        misstated.append(math.log(real / stated))
    for values, sd in ((scatter, 1.0), (repeat, 1.0), ([np.array(misstated)], 0.2)):
        assert np.std(np.concatenate(values)) == pytest.approx(sd, rel=0.15)


def test_the_seed_decides(cases: list[Case]) -> None:
    assert sound_hangers(2026, 12) == cases[:12]  # whatever the count
    assert sound_hangers(2027, 12) != cases[:12]
