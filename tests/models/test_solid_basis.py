"""Reduced bases are made once, kept, and made again where they cannot be read."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shm.models.classes.base import silent
from shm.models.classes.solid import S1, Solid2, basis, reduction
from tests.helpers.hangers import HANGER_3

SHORT = replace(HANGER_3, length_m=3.0, plate=None)


@pytest.fixture(autouse=True)
def empty_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("SHM_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(basis, "_made", {})
    return tmp_path / "cache"


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A basis as made, and the progress that was told."""
    told: list[float] = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SHM_CACHE", str(tmp_path_factory.mktemp("made")))
        return basis.transverse_basis(S1(SHORT).description(), 6, told.append), told


@pytest.fixture
def made_at_once(made, monkeypatch) -> None:
    """What is made is the basis made before."""
    monkeypatch.setattr(basis.Description, "system", lambda *_: None)
    monkeypatch.setattr(reduction, "reduce", lambda *_: made[0])


def a_basis():
    return basis.transverse_basis(S1(SHORT).description(), 6, silent)


def test_a_basis_is_made_once_and_then_read_from_disk(made_at_once, monkeypatch) -> None:
    first = a_basis()
    monkeypatch.setattr(basis, "_made", {})
    monkeypatch.setattr(reduction, "reduce", None)
    again = a_basis()
    np.testing.assert_array_equal(again.projected.matrices, first.projected.matrices)
    assert again.estimated_error == first.estimated_error


def test_a_broken_file_is_reported_and_made_anew(
    made_at_once, empty_cache, monkeypatch, caplog
) -> None:
    first = a_basis()
    (kept,) = empty_cache.glob("basis-*.npz")
    kept.write_bytes(kept.read_bytes()[:100])
    monkeypatch.setattr(basis, "_made", {})
    again = a_basis()
    assert "cannot be read" in caplog.text
    np.testing.assert_array_equal(again.projected.matrices, first.projected.matrices)
    assert basis.load(S1(SHORT).description().key(6)) is not None


def test_a_folder_that_cannot_be_written_is_reported_and_work_goes_on(
    made_at_once, tmp_path, monkeypatch, caplog
) -> None:
    blocked = tmp_path / "a file"
    blocked.write_text("")
    monkeypatch.setenv("SHM_CACHE", str(blocked))
    assert a_basis().projected.unknowns > 5
    assert "Set SHM_CACHE" in caplog.text


def test_the_key_changes_with_geometry_material_prior_and_modes() -> None:
    description = Solid2(HANGER_3).description()
    thicker = replace(HANGER_3.plate, thickness_m=0.05)
    others = [
        Solid2(replace(HANGER_3, plate=thicker)).description(),
        Solid2(replace(HANGER_3, elastic_modulus_pa=205e9)).description(),
        replace(description, upper=(9e6, *description.upper[1:])),
    ]
    keys = {description.key(6), description.key(12), *(other.key(6) for other in others)}
    assert len(keys) == 5
