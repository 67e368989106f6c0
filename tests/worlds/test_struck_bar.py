"""Proof of the struck bar's world against closed forms and against energy."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from tests.worlds import struck_bar as world

pytestmark = pytest.mark.trial  # of the world alone: it shares nothing with the product

SHORT = world.Crew(
    hits=1, ring_s=1.5, noise_m_s2=0.0, noise_n=0.0, gain=0.0, place_m=0.0, turned_deg=0.0
)


@pytest.mark.parametrize("tension_n", [1e-3, 711e3])
def test_a_clamped_bar_has_the_frequencies_of_the_closed_form(tension_n: float) -> None:
    bar = world.Bar(tension_n=tension_n)
    pull = bar.tension_n * bar.length_m**2 / bar.bending_nm2

    def zero(b: float) -> float:
        a = np.sqrt(pull + b**2)
        return float(2 * a * b * (1 / np.cosh(a) - np.cos(b)) + pull * np.tanh(a) * np.sin(b))

    tried = np.arange(2.0, 18.0, 0.1)
    b = np.array([
        brentq(zero, low, low + 0.1) for low in tried if zero(low) * zero(low + 0.1) < 0
    ])  # fmt: skip
    stiffness = bar.bending_nm2 / bar.mass_kg_m / bar.length_m**4
    exact = np.sqrt(b**2 * (b**2 + pull) * stiffness)
    assert len(b) > 3
    assert world.modes_of(bar).omega[: len(b)] == pytest.approx(exact, rel=1e-4)


def test_the_moment_at_the_clamp_is_that_of_the_shape() -> None:
    modes = world.modes_of(world.Bar())
    assert np.allclose(modes.deflection[:, 0], 0)
    # Next to a clamp w = w'' x^2/2, less the bending that dies out over sqrt(EI/T), here 2 m.
    near = modes.at(0.3)[0] / (0.3**2 / 2)
    assert near == pytest.approx(modes.at(0.0, bent=True)[0] * (1 - 0.3 / 2 / 3), rel=0.05)


@pytest.mark.parametrize(
    ("part", "as_large"),
    [
        (world.Guide(3.4, 6e5, 1e-5), 1e-5),
        (world.Crack(3.4, 3e-8, 40.0), 40.0),
        (world.Joint(3e-8, 553.0), 0.0),
    ],
)
def test_parts_act_above_their_threshold_only_and_take_no_energy_from_nowhere(
    part: world.Part, as_large: float
) -> None:
    loud, still = (
        world.tested(world.Hanger(part=part), SHORT, level, np.random.default_rng(1))[0]
        for level in (1.0, 1e-3)
    )
    free_loud, free_still = (
        world.tested(world.Hanger(), SHORT, level, np.random.default_rng(1))[0]
        for level in (1.0, 1e-3)
    )
    assert loud.largest_m > as_large
    change = np.abs(loud.motion_m_s2 - free_loud.motion_m_s2).max()
    assert change > 0.01 * np.abs(free_loud.motion_m_s2).max()
    if as_large:
        assert still.largest_m < as_large
        assert np.allclose(still.motion_m_s2, free_still.motion_m_s2, atol=1e-12)
    end = loud.motion_m_s2[:, :, -512:]
    assert np.sum(end**2) < 1.5 * np.sum(free_loud.motion_m_s2[:, :, -512:] ** 2)


def test_errors_of_sensors_repeat_in_all_hits_of_a_test() -> None:
    crew = replace(SHORT, hits=2, gain=0.1)
    records = world.tested(world.Hanger(), crew, 1.0, np.random.default_rng(2))
    plain = world.tested(world.Hanger(), replace(crew, gain=0.0), 1.0, np.random.default_rng(2))
    gains = [
        np.linalg.norm(one.motion_m_s2[0, 0]) / np.linalg.norm(other.motion_m_s2[0, 0])
        for one, other in zip(records, plain, strict=True)
    ]
    assert np.ptp(gains) < 1e-6
    assert abs(gains[0] - 1) > 1e-3
