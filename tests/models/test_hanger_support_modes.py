"""Supports with modes beyond the first, against finite elements of bar and support together."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import eigh

from shm.models.hanger import PhysicalHanger, SupportMode, solve
from shm.values import FloatArray
from tests.helpers.physical_hangers import (
    EI,
    LENGTH,
    MASS,
    NOWHERE,
    TENSION,
    clamped,
    frequencies_hz,
)

_BENDING = np.array([[12, 6, -12, 6], [6, 4, -6, 2], [-12, -6, 12, -6], [6, 2, -6, 4]], float)
_TENSION = np.array([[36, 3, -36, 3], [3, 4, -3, -1], [-36, -3, 36, -3], [3, -1, -3, 4]]) / 30
_MASS = np.array([[156, 22, 54, -13], [22, 4, 13, -3], [54, 13, 156, -22], [-13, -3, -22, 4]]) / 420
_ELEMENTS = 240
NEAR, FAR = (4000.0, 9.0e7), (9000.0, 2.0e8)
"""Masses (kg) of a chain and the springs (N/m) behind them: the first holds the hanger's end."""


def bar_on_chain(chain: list[tuple[float, float]]) -> tuple[FloatArray, FloatArray]:
    """The first 40 frequencies and the chain's share of the kinetic energy, by finite elements.

    The arch end is clamped; the deck end does not turn and hangs from the first mass.
    """
    # Elements crowd at the ends, where a taut bar bends in thin layers.
    nodes = LENGTH * (1 - np.cos(np.linspace(0, np.pi, _ELEMENTS + 1))) / 2
    bar = 2 * len(nodes)
    k, m = np.zeros((2, bar + len(chain) - 1, bar + len(chain) - 1))
    for index, h in enumerate(np.diff(nodes)):
        window = slice(2 * index, 2 * index + 4)
        scale = np.outer([1, h, 1, h], [1, h, 1, h])
        k[window, window] += scale * (_BENDING * EI / h**3 + _TENSION * TENSION / h)
        m[window, window] += scale * _MASS * MASS * h
    masses = [0, *range(bar, bar + len(chain) - 1)]
    own = np.zeros_like(m)
    for index, (mass_kg, spring_n_m) in enumerate(chain):
        own[masses[index], masses[index]] = mass_kg
        k[masses[index], masses[index]] += spring_n_m
        if index + 1 < len(chain):
            behind = masses[index + 1]
            k[behind, behind] += spring_n_m
            k[behind, masses[index]] = k[masses[index], behind] = -spring_n_m
    free = np.delete(np.arange(len(k)), [1, bar - 2, bar - 1])
    square = np.ix_(free, free)
    # The largest 1/omega^2 come out best.
    inverse, vectors = eigh(
        (m + own)[square], k[square], subset_by_index=[len(free) - 40, len(free) - 1]
    )
    inverse, vectors = inverse[::-1], vectors[:, ::-1]
    share = np.einsum("um,u,um->m", vectors, np.diag(own)[free], vectors) / inverse
    return 1 / np.sqrt(inverse) / (2 * np.pi), share


def as_modes(chain: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """(modal mass for a deflection of 1 of the first mass, compliance) of a chain's own modes."""
    springs = [spring for _, spring in chain]
    k = np.diag(springs) + np.diag([0.0, *springs[:-1]])
    k -= np.diag(springs[:-1], 1) + np.diag(springs[:-1], -1)
    squares, vectors = eigh(k, np.diag([mass for mass, _ in chain]))
    masses = 1 / vectors[0] ** 2
    return list(zip(masses, 1 / (masses * squares), strict=True))


def on_modes(
    hanger: PhysicalHanger, modes: list[tuple[float, float]], planes: list[int]
) -> PhysicalHanger:
    """The deck end on a support with these modes."""
    mass, compliance = np.zeros((2, len(modes), len(hanger.tension_n), 2, 2))
    for index, (mass_kg, compliance_m_n) in enumerate(modes):
        mass[index, :, 0, planes], compliance[index, :, 0, planes] = mass_kg, compliance_m_n
    return replace(
        hanger,
        translational_compliance_m_n=compliance[0],
        support_mass_kg=mass[0],
        support_modes=tuple(map(SupportMode, compliance[1:], mass[1:])),
    )


CHAINS = [
    [NEAR, FAR],
    [FAR, NEAR],
    [(300.0, 4e8), (90.0, 3e8)],
    [(6e4, 3e7), (2e5, 2e7)],
    [(2000.0, 8e7), (2500.0, 9e7), (4000.0, 3e8)],
]


@pytest.mark.parametrize("chain", CHAINS)
def test_a_support_with_further_modes_is_a_chain_of_masses(
    chain: list[tuple[float, float]],
) -> None:
    """Of all their modes those that move the chain's masses most are not the hanger's."""
    expected, chains = bar_on_chain(chain)
    chains_own = np.argsort(-chains)[: len(chain)]
    hangers_own = np.delete(expected, chains_own)[:8]
    hanger = on_modes(clamped(), as_modes(chain), [0])
    found = frequencies_hz(hanger, 8)[0]
    np.testing.assert_allclose(found[0], hangers_own, rtol=1e-6)
    np.testing.assert_allclose(found[1], frequencies_hz(clamped(), 8)[0, 1], rtol=1e-7)


def halved(hanger: PhysicalHanger) -> PhysicalHanger:
    """Each first mode as two of the same frequency, of twice the mass each: the same compliance."""
    half = SupportMode(hanger.translational_compliance_m_n / 2, 2 * hanger.support_mass_kg)
    return replace(
        hanger,
        translational_compliance_m_n=half.compliance_m_n,
        support_mass_kg=half.mass_kg,
        support_modes=(half,),
    )


@pytest.mark.parametrize("turned", [False, True])
def test_two_modes_of_one_frequency_are_one_mode(turned: bool) -> None:
    """Frequencies and shapes, in one plane at one end and where joints couple both planes."""
    plain = clamped(2)
    springs = np.zeros((2, 2, 2, 2))
    if turned:
        springs[:, 1] = np.outer([0.8, 0.6], [0.8, 0.6]) / 2e6
    mass, compliance = np.zeros((2, 2, 2, 2))
    mass[0, 0, 1], compliance[0, 0, 1] = 4000.0, 2e-8
    mass[1], compliance[1] = 9000.0, [[1e-8, 2e-8], [3e-8, 5e-9]]
    one = replace(
        plain,
        rotational_compliance_rad_n_m=springs,
        translational_compliance_m_n=compliance,
        support_mass_kg=mass,
    )
    places = np.array([1.5, 4.0])
    found, expected = solve(halved(one), 6, places), solve(one, 6, places)
    np.testing.assert_allclose(found.frequency_hz, expected.frequency_hz, rtol=1e-9)
    np.testing.assert_allclose(found.shape, expected.shape, atol=1e-6)
    assert np.abs(expected.frequency_hz / solve(plain, 6, NOWHERE).frequency_hz - 1).max() > 1e-3


def test_a_mode_without_mass_is_a_spring_in_series() -> None:
    springs = np.full((1, 2, 2), 3e-9)
    none = np.zeros_like(springs)
    once = replace(clamped(), translational_compliance_m_n=2 * springs)
    twice = replace(once, translational_compliance_m_n=springs)
    twice = replace(twice, support_modes=(SupportMode(springs, none),))
    np.testing.assert_allclose(frequencies_hz(twice, 8), frequencies_hz(once, 8), rtol=1e-9)
    beyond_a_held_end = replace(clamped(), support_modes=(SupportMode(2 * springs, none),))
    np.testing.assert_allclose(
        frequencies_hz(beyond_a_held_end, 8), frequencies_hz(once, 8), rtol=1e-8
    )


def test_a_hanger_without_further_modes_is_not_disturbed_by_its_neighbours() -> None:
    """One of a batch has them, the other has a support of one mode."""
    modes = as_modes([NEAR, FAR])
    both = on_modes(clamped(2), modes, [0, 1])
    both.support_modes[0].compliance_m_n[1] = both.support_modes[0].mass_kg[1] = 0.0
    found = frequencies_hz(both, 6)
    alone = [on_modes(clamped(), modes, [0, 1]), on_modes(clamped(), modes[:1], [0, 1])]
    for row, hanger in enumerate(alone):
        np.testing.assert_allclose(found[row], frequencies_hz(hanger, 6)[0], rtol=1e-9)
