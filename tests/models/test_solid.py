"""The solid classes against the thesis's tables, theory and themselves."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest

from shm.models.base import silent
from shm.models.solid import S1, S2, Solid0, Solid1, Solid2
from shm.models.solid.affine import natural_modes
from shm.models.solid.assembly import Mesh, assembled
from shm.models.solid.basis import transverse_basis
from shm_cli import thesis
from tests.helpers.hangers import HANGER_3
from tests.helpers.timoshenko import clamped_frequencies_hz

TABLES = tomllib.loads(Path(thesis.TABLES_FILE).read_text(encoding="utf-8"))


def transverse_hz(model) -> np.ndarray:
    return model.reference_frequencies_hz(np.array([[1.0]]), 6)[0, 0]


def deviation_percent(found: np.ndarray, printed: list) -> float:
    return float(100 * np.abs(found / printed - 1).max())


def test_the_plain_rod_gives_table_a_1() -> None:
    assert deviation_percent(transverse_hz(S1(HANGER_3)), TABLES["s1"]["converged"]) < 0.3


def test_the_rod_between_the_plates_is_a_timoshenko_beam() -> None:
    theory = clamped_frequencies_hz(HANGER_3, length_m=9.817, tension_n=711e3, modes=6)
    assert deviation_percent(transverse_hz(S2(HANGER_3)), theory) < 0.3


def test_the_hanger_with_plates_and_fixed_faces_gives_table_a_3() -> None:
    assert deviation_percent(transverse_hz(Solid0(HANGER_3)), TABLES["solid0"]["converged"]) < 0.3


@pytest.mark.parametrize(
    ("model_class", "springs", "log10_k"),
    [(Solid1, 8, [7, 8, 9, 10, 11]), (Solid2, 4, [5, 6, 7, 8, 9, 10, 13])],
)
def test_springs_give_tables_a_4_and_a_5(model_class, springs: int, log10_k: list[int]) -> None:
    theta = np.array([[1.0, *[k] * springs] for k in log10_k])
    found = model_class(HANGER_3).reference_frequencies_hz(theta, 6)[:, 0]
    printed = [TABLES[model_class.name][f"k1e{k}"] for k in log10_k]
    assert deviation_percent(found, printed) < 1.5


def test_the_meshed_volume_is_that_of_rod_and_plates() -> None:
    geometry = Solid0(HANGER_3).description().geometry
    plate, radius, half = geometry.plate, 0.065, 0.02
    disc = np.pi * radius**2
    within_plate = 2 * (half * np.sqrt(radius**2 - half**2) + radius**2 * np.arcsin(half / radius))
    plates = plate.length_m * plate.thickness_m * (plate.end_width_m + plate.neck_width_m)
    overlaps = 2 * plate.slot_m * (disc - within_plate)
    expected = plates + overlaps + disc * (12 - 2 * plate.length_m)
    assert 4 * _volume(Mesh.of(geometry)) == pytest.approx(expected, rel=2e-4)


def _volume(mesh: Mesh) -> float:
    from skfem import Basis, ElementHex2

    return float(Basis(mesh.cells, ElementHex2(), intorder=4).dx.sum())


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
    ("model_class", "most_unknowns"), [(Solid0, 15), (Solid2, 30), (Solid1, 70)]
)
def test_the_reduced_basis_is_within_two_hundredths_of_a_percent(
    model_class, most_unknowns
) -> None:
    model = model_class(HANGER_3)
    rng, prior = np.random.default_rng(42), model.prior
    inside = rng.uniform(prior.lower, prior.upper, (2, len(prior.names)))
    corners = np.where(rng.random(inside.shape) < 0.5, prior.lower, prior.upper)
    theta = np.vstack([inside, corners])
    reference = model.reference_frequencies_hz(theta, 6)
    np.testing.assert_allclose(model.frequencies_hz(theta, 6), reference, rtol=2e-4)
    basis = transverse_basis(model.description(), 6, silent)
    assert basis.projected.unknowns <= most_unknowns


def test_a_basis_of_eight_modes_survives_local_motions_whose_mass_is_lost_in_rounding() -> None:
    model = Solid2(HANGER_3)
    theta = np.array([[1.2, 5.5, 7.0, 8.0, 9.5]])
    reference = model.reference_frequencies_hz(theta, 8)
    np.testing.assert_allclose(model.frequencies_hz(theta, 8), reference, rtol=2e-4)
