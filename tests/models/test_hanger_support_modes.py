"""Supports with modes beyond the first, against finite elements of bar and support together."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import eigh

from shm.models.hanger import PhysicalHanger, SupportMode
from shm.values import FloatArray
from tests.helpers.physical_hangers import (
    EI,
    LENGTH,
    MASS,
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
