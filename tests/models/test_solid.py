"""The solid classes against the thesis's tables, theory and themselves."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from shm.models import DESCRIPTION, THESIS, AsMade, build
from shm.models.classes.base import silent
from shm.models.classes.beam import Beam1
from shm.models.classes.solid import S1, Solid0, Solid1, Solid2
from shm.models.classes.solid.assembly import assembled
from shm.models.classes.solid.basis import transverse_basis
from shm.models.classes.solid.classes import SolidModel
from shm.models.classes.solid.reduction import Projected, natural_modes
from shm.values import Hanger
from tests.benchmarks.thesis import thesis_data
from tests.helpers.hangers import HANGER_3
from tests.helpers.slow import few_of

TABLES = tomllib.loads(Path(thesis_data.TABLES_FILE).read_text(encoding="utf-8"))


def transverse_hz(model, *log10_k: float) -> np.ndarray:
    """Of the full model at the nominal tension (values of log10 k or 1, 6), all springs alike."""
    description = model.description()
    springs = np.array(log10_k or [0.0])[:, None] * np.ones(len(description.lower) - 1)
    tension = np.full((len(springs), 1), HANGER_3.nominal_tension_n)
    return description.full_frequencies_hz(np.hstack([tension, springs]), 6)


def deviation_percent(found: np.ndarray, printed: list) -> float:
    return float(100 * np.abs(found / printed - 1).max())


def test_the_plain_rod_gives_table_a_1() -> None:
    found = transverse_hz(S1(HANGER_3).of_the_thesis())
    assert deviation_percent(found, TABLES["s1"]["converged"]) < 0.3
    # Without the stretch it would be 0.065 to 0.096 %; mode 1 is printed to 0.09 %.
    assert deviation_percent(found[:, 1:], TABLES["s1"]["converged"][1:]) < 0.06


def stretched(hanger: Hanger, tension_ratio: float) -> Hanger:
    """The rod as Hooke's law leaves it: longer, thinner, as heavy."""
    strain = tension_ratio * hanger.nominal_tension_n / hanger.elastic_modulus_pa / hanger.area_m2
    thinner = 1 - hanger.poissons_ratio * strain
    return replace(
        hanger,
        length_m=hanger.length_m * (1 + strain),
        diameter_m=hanger.diameter_m * thinner,
        area_m2=hanger.area_m2 * thinner**2,
        second_moment_m4=hanger.second_moment_m4 * thinner**4,
        mass_per_length_kg_m=hanger.mass_per_length_kg_m / (1 + strain),
    )


# The thesis's hanger is drawn without tension, which stretches it before it swings. Of mode 6 the
# stretch takes what issue and checklist ask: 0.05 % at nominal tension, 0.2 % at five times.
@pytest.mark.parametrize(("ratio", "percent_of_mode_6"), [(1.0, 0.05), (5.0, 0.2)])
def test_tension_stretches_a_bar_that_is_described_without_it(ratio, percent_of_mode_6) -> None:
    theta, after = np.array([[ratio]]), stretched(HANGER_3, ratio)
    drawn = S1(HANGER_3).of_the_thesis().reference_frequencies_hz(theta, 6)
    meshed = S1(after).reference_frequencies_hz(theta, 6)
    np.testing.assert_allclose(drawn, meshed, rtol=2e-6)
    change = drawn / S1(HANGER_3).reference_frequencies_hz(theta, 6) - 1
    clamped = [
        Beam1(each).frequencies_hz(np.array([[ratio, 1.0]]), 6) for each in (after, HANGER_3)
    ]
    np.testing.assert_allclose(change, clamped[0] / clamped[1] - 1, atol=3e-5)
    assert -100 * change[0, 0, 5] == pytest.approx(percent_of_mode_6, rel=0.1)


def test_a_hanger_described_as_it_hangs_is_not_stretched_again() -> None:
    hangs, drawn = (build("s1", HANGER_3, priors) for priors in (DESCRIPTION, THESIS))
    assert isinstance(hangs, AsMade)
    assert isinstance(hangs.model, SolidModel)
    assert isinstance(drawn, SolidModel)
    assert (hangs.model.is_unstressed, drawn.is_unstressed) == (False, True)
    assert not drawn.as_it_hangs().is_unstressed


# The table of docs/trials/validation.md: least and largest change of modes 1 to 6 in percent.


def test_the_hanger_with_plates_and_fixed_faces_gives_table_a_3() -> None:
    found = transverse_hz(Solid0(HANGER_3).of_the_thesis())
    assert deviation_percent(found, TABLES["solid0"]["converged"]) < 0.3


@pytest.mark.parametrize(
    ("model_class", "log10_k"),
    [
        (Solid1, [7, 9, 11]),
        (Solid2, [5, 8, 13]),
        pytest.param(Solid1, [8, 10], marks=pytest.mark.trial),
        pytest.param(Solid2, [6, 7, 9, 10], marks=pytest.mark.trial),
    ],
)
def test_springs_give_tables_a_4_and_a_5(model_class, log10_k: list[int]) -> None:
    found = transverse_hz(model_class(HANGER_3).of_the_thesis(), *log10_k)
    printed = [TABLES[model_class.name][f"k1e{k}"] for k in log10_k]
    assert deviation_percent(found, printed) < 1.5


@pytest.mark.slow
def test_the_mirrored_basis_is_the_longitudinal_plane() -> None:
    model = Solid1(HANGER_3)
    theta = np.array([[1.3, 6.0, 7.5, 8.0, 9.0, 8.5, 9.5, 7.5, 8.2]])
    description = model.description()
    parts = description.geometry, description.material, description.support
    system = assembled(*parts, "longitudinal")
    springs = np.array([10 ** theta[0, model.parameter_names.index(n)] for n in system.springs])
    direct = natural_modes(system, 1.3 * 711e3, springs, 6).frequencies_hz
    np.testing.assert_allclose(model.reference_frequencies_hz(theta, 6)[0, 1], direct, rtol=1e-7)


@pytest.mark.parametrize(
    ("model_class", "most_unknowns"), few_of([(Solid0, 15), (Solid2, 30), (Solid1, 70)], 1)
)
def test_the_reduced_basis_is_within_two_hundredths_of_a_percent(
    model_class, most_unknowns
) -> None:
    model = model_class(HANGER_3).of_the_thesis()
    rng, prior = np.random.default_rng(42), model.prior
    inside = rng.uniform(prior.lower, prior.upper, (2, len(prior.names)))
    corners = np.where(rng.random(inside.shape) < 0.5, prior.lower, prior.upper)
    theta = np.vstack([inside, corners])
    reference = model.reference_frequencies_hz(theta, 6)
    np.testing.assert_allclose(model.frequencies_hz(theta, 6), reference, rtol=2e-4)
    basis = transverse_basis(model.description(), 6, silent)
    assert basis.projected.unknowns <= most_unknowns


def test_motions_whose_mass_is_lost_in_rounding_are_left_out_of_a_basis() -> None:
    """Of three directions of unit energy one has no mass but that of rounding, here below 0."""
    matrices = np.array([np.diag([1.0, 4e-14, -1e-17]), np.eye(3)])
    projected, basis = Projected.on(matrices)
    assert basis.shape == (3, 2)
    assert np.sort(np.diag(projected.matrices[0])) == pytest.approx([1.0, 1 / 4e-14])


@pytest.mark.trial
def test_a_basis_of_eight_modes_survives_local_motions_whose_mass_is_lost_in_rounding() -> None:
    model = Solid2(HANGER_3)
    theta = np.array([[1.2, 5.5, 7.0, 8.0, 9.5]])
    reference = model.reference_frequencies_hz(theta, 8)
    np.testing.assert_allclose(model.frequencies_hz(theta, 8), reference, rtol=2e-4)
