"""Formulas of practice against their limits and the exact beam that each supposes."""

from __future__ import annotations

import numpy as np
import pytest

from shm.models.classes.tensioned_beam import frequencies_hz
from shm.models.practice_formulas import FORMULAS, PracticeFormula

LENGTH_M, MASS_KG_M, STIFFNESS_N_M2 = 9.0, 80.0, 2e5
BAR = (LENGTH_M, MASS_KG_M, STIFFNESS_N_M2)
XI = np.geomspace(0.1, 1000, 400)
each = pytest.mark.parametrize("formula", FORMULAS, ids=lambda formula: formula.name)


def errors(formula: PracticeFormula, xi: np.ndarray) -> np.ndarray:
    """Of the tension, in EI/L^2, from the exact beam on the ends that the formula supposes."""
    tension = xi**2 * STIFFNESS_N_M2 / LENGTH_M**2
    spring = np.full_like(xi, 0.0 if formula.ends == "pinned" else np.inf)
    found = frequencies_hz(
        np.full_like(xi, LENGTH_M), tension, np.asarray(STIFFNESS_N_M2), np.asarray(MASS_KG_M),
        spring, spring, 2,
    )[:, formula.order - 1]  # fmt: skip
    stated = np.array([formula.tension_n(float(f), *BAR) for f in found])
    return (stated - tension) / (STIFFNESS_N_M2 / LENGTH_M**2)


@each
def test_without_bending_stiffness_it_is_the_string(formula: PracticeFormula) -> None:
    tension = 3e5
    string_hz = formula.order / (2 * LENGTH_M) * np.sqrt(tension / MASS_KG_M)
    stated = formula.tension_n(string_hz, LENGTH_M, MASS_KG_M, 0.0)
    assert stated == pytest.approx(tension, rel=1e-12)


@each
def test_over_its_range_it_errs_as_stated(formula: PracticeFormula) -> None:
    xi = XI[formula.valid_from_xi <= XI]
    worst = np.abs(errors(formula, xi) / xi**2).max()
    assert worst <= formula.worst_error
    assert worst > 0.7 * formula.worst_error or formula.ends == "pinned"


@pytest.mark.parametrize("formula", [f for f in FORMULAS if f.ends == "clamped"], ids=str)
def test_without_tension_it_finds_next_to_none(formula: PracticeFormula) -> None:
    assert abs(errors(formula, XI[:1])[0]) < 2
