"""The bar as made against the same bar described as it was made, and solved anew."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shm.assumptions import DEFAULTS
from shm.models import THESIS, AsMade, build, described
from shm.models.classes.base import Conditions
from shm.values import AddedMass, FloatArray, Hanger
from tests.helpers.classes_as_made import as_made
from tests.helpers.hangers import HANGER_3, ROD

STRAND = replace(ROD, kind="strand", bending_stiffness_factor=0.7)
SPRINGS = {"log10_k1": 6.2, "log10_k2": 6.9, "log10_k3": 7.3, "log10_k4": 5.1}
REDUCED = 5e-6  # of a frequency, by the reduced basis
DEVIATIONS = {"theta_L": 1.004, "section": 0.02, "density": -0.006, "modulus": 0.03}


@pytest.fixture(autouse=True)
def _weightless(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave the bar's own weight out: the classes of the thesis have none."""
    monkeypatch.setattr("shm.models.one_hanger.hanger_model.GRAVITY_M_S2", 0.0)


def packed(model: AsMade, **values: float) -> FloatArray:
    known = {**SPRINGS, **DEVIATIONS, "theta_F": 0.8, "bending_factor": 0.45, "shear_share": 1.0}
    known |= {"inclination": 90.0, "sag_shape": 0.5, **values}
    return model.pack({name: known[name] for name in model.parameter_names})[None]


def described_as_made(hanger: Hanger, bending_factor: float = 1.0) -> Hanger:
    """The hanger whose description has the deviations: area, density, modulus and length."""
    section, density, modulus = (
        float(np.exp(DEVIATIONS[name])) for name in ("section", "density", "modulus")
    )
    return replace(
        hanger,
        length_m=hanger.length_m * DEVIATIONS["theta_L"],
        area_m2=hanger.area_m2 * section,
        second_moment_m4=hanger.second_moment_m4 * section**2,
        mass_per_length_kg_m=hanger.mass_per_length_kg_m * section * density,
        elastic_modulus_pa=hanger.elastic_modulus_pa * modulus,
        bending_stiffness_factor=bending_factor,
    )


def solved_anew(
    name: str, hanger: Hanger, modes: int, conditions: Conditions | None = None
) -> FloatArray:
    model = described(name, hanger)
    known = {"theta_F": 0.8, "theta_L": 1.0, **SPRINGS}
    theta = model.pack({name: known[name] for name in model.parameter_names})[None]
    return model.frequencies_at(theta, modes, conditions or Conditions())


@pytest.mark.parametrize("name", ["beam1", "beam2", "beam3"])
def test_a_bar_that_deviates_has_the_frequencies_of_one_described_so(name: str) -> None:
    model = as_made(name, ROD)
    found, made = model.frequencies_hz(packed(model), 6), described_as_made(ROD)
    np.testing.assert_allclose(found, solved_anew(name, made, 6), rtol=REDUCED)
    assert np.abs(found / solved_anew(name, ROD, 6) - 1).max() > 0.005


def test_a_strand_whose_wires_slip_has_the_frequencies_of_one_described_so() -> None:
    model = as_made("beam2", STRAND)
    found = model.frequencies_hz(packed(model), 6)
    made = described_as_made(STRAND, bending_factor=0.45)
    np.testing.assert_allclose(found, solved_anew("beam2", made, 6), rtol=REDUCED)


def test_a_known_mass_weighs_against_the_bar_as_made() -> None:
    """It sits at its share of the length, and turns as if it were as much longer."""
    model, mass, longer = as_made("beam2", ROD), AddedMass(60.0, 3.6, 0.08), DEVIATIONS["theta_L"]
    found = model.frequencies_at(packed(model), 5, Conditions(added_mass=mass))
    there = AddedMass(60.0, 3.6 * longer, 0.08 * longer)
    expected = solved_anew("beam2", described_as_made(ROD), 5, Conditions(added_mass=there))
    np.testing.assert_allclose(found, expected, rtol=REDUCED)


def test_ranges_are_those_of_the_world_whatever_the_diameter() -> None:
    thin = replace(ROD, second_moment_m4=ROD.second_moment_m4 / 1e4)
    for hanger in (ROD, thin):
        bounds = as_made("beam2", hanger).bounds
        assert bounds["theta_F"] == DEFAULTS.tension_ratio.bounds
        unit = hanger.bending_stiffness_n_m2 / hanger.length_m
        taut = np.sqrt(hanger.bending_stiffness_n_m2 * hanger.nominal_tension_n)
        pinned, clamped = DEFAULTS.end_restraint.bounds
        assert 10 ** np.array(bounds["log10_k3"]) == pytest.approx(
            (pinned * unit, clamped * (unit + taut))
        )
        assert bounds["theta_L"] == pytest.approx((1 - 6 * 0.0005, 1 + 6 * 0.0005))
    assert described("beam2", ROD).bounds["theta_L"] == (0.5, 1.5)
    assert build("beam2", ROD, THESIS).parameter_names == described("beam2", ROD).parameter_names


def test_plates_leave_the_effective_length_open() -> None:
    """Between their necks and their end faces, and the springs' bar is as long."""
    model = as_made("beam2", HANGER_3)
    assert HANGER_3.plate is not None
    assert model.length_is_open
    assert model.bounds["theta_L"] == pytest.approx((1 - 2 * HANGER_3.plate.length_m / 12.0, 1.0))
    theta = packed(model, theta_L=0.85, section=0.0, density=0.0, modulus=0.0)
    short = described("beam2", HANGER_3).pack({"theta_F": 0.8, "theta_L": 0.85, **SPRINGS})
    expected = described("beam2", HANGER_3).frequencies_hz(short[None], 6)
    np.testing.assert_allclose(model.frequencies_hz(theta, 6), expected, rtol=REDUCED)
    assert not as_made("beam2", ROD).length_is_open
    assert not as_made("solid2", HANGER_3).length_is_open


def test_ends_with_other_fittings_cannot_be_exchanged() -> None:
    assert as_made("beam2", replace(ROD, fittings_m=(0.3, 0.3))).swaps
    assert not as_made("beam2", replace(ROD, fittings_m=(0.3, 0.1))).swaps


# ------------------------------------------------ the shear of round sections


def tube(outer_m: float, wall_m: float) -> Hanger:
    inner_m = outer_m - 2 * wall_m
    area = np.pi * (outer_m**2 - inner_m**2) / 4
    second_moment = np.pi * (outer_m**4 - inner_m**4) / 64
    return replace(ROD, area_m2=area, second_moment_m4=second_moment)


def test_the_shear_coefficient_is_cowpers_of_a_solid_circle_and_of_a_thin_tube() -> None:
    """Cowper 1966, table 1: 6 (1 + nu)/(7 + 6 nu), and 2 (1 + nu)/(4 + 3 nu)."""
    for nu in (0.0, 0.3, 0.45):
        solid, thin = (replace(each, poissons_ratio=nu) for each in (ROD, tube(0.1, 1e-5)))
        assert solid.shear_coefficient == pytest.approx(6 * (1 + nu) / (7 + 6 * nu), rel=1e-9)
        assert thin.shear_coefficient == pytest.approx(2 * (1 + nu) / (4 + 3 * nu), rel=1e-4)


def test_a_tube_shears_more_than_a_solid_bar() -> None:
    """Frequencies of a clamped tube of 88.9 by 6.3 mm, of a coefficient of a thin tube's 0.53.

    Its walls add 0.02 % at most; a solid bar's coefficient would make the sixth 0.6 % higher.
    """
    hanger = Hanger(
        id=35,
        length_m=8.44,
        elastic_modulus_pa=210e9,
        area_m2=0.0016348,
        second_moment_m4=1.4024e-06,
        mass_per_length_kg_m=12.833,
        nominal_tension_n=102e3,
    )
    assert hanger.shear_coefficient == pytest.approx(0.5356, abs=1e-4)
    model = described("beam3", hanger)
    known = {"theta_F": 1.3581, "theta_L": 1.0} | dict.fromkeys(SPRINGS, 9.5)
    theta = model.pack({name: known[name] for name in model.parameter_names})[None]
    expected = [10.17302, 24.65408, 45.07656, 71.73372, 104.639, 143.7071, 188.8052, 239.7714]
    np.testing.assert_allclose(model.frequencies_hz(theta, 8)[0, 0], expected, rtol=3e-4)
