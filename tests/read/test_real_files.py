"""Files that other people's loggers wrote (shared/data/pyuff_uff58, modelab_roving_beam)."""

from __future__ import annotations

import gzip
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
import pyuff

from shm.errors import BadInput
from shm.read import peek, read, sidecar_path, write
from shm.values import Channel, FloatArray, FrequencyResponse, Recording, ResponsePoint

LOGGED = "MPSTD_Set001_2024_10_08_10_27_07.uff"
MICROPHONES = ("Sample_UFF58_ascii.uff", "Sample_UFF58b_bin.uff")
HAMMER_X_M = (0.1, 0.25, 0.375, 0.5, 0.65, 0.8, 0.925, 1.05, 1.2)


@pytest.fixture(scope="module")
def folder(shared_data: Path) -> Path:
    return shared_data / "pyuff_uff58"


def test_four_logged_accelerations_are_seen_and_the_hammer_is_missed(folder: Path) -> None:
    found = peek(folder / LOGGED)
    assert [(c.name, c.quantity, c.unit) for c in found.channels] == [
        (f"acc_{i}", "acceleration", "m/s2") for i in (1, 2, 3, 4)
    ]
    assert (found.samples, found.sampling_rate_hz) == (222_400, 3200.0)
    assert found.time == datetime(2024, 10, 8, 10, 27, 7, tzinfo=UTC)
    assert len(found.problems) == 1
    assert "hammer's force" in found.problems[0]
    with pytest.raises(BadInput, match="no channel holds the hammer's force"):
        read(folder / LOGGED)


def test_the_logged_accelerations_are_read_once_a_force_stands_beside_them(
    folder: Path, tmp_path: Path
) -> None:
    force = np.random.default_rng(1).standard_normal(222_400)
    write(Recording("", (Channel("force", "force", force),), 3200.0), tmp_path / "force.uff")
    joined = tmp_path / "joined.uff"
    joined.write_bytes((folder / LOGGED).read_bytes() + (tmp_path / "force.uff").read_bytes())
    sidecar_path(joined).write_text('hanger = 2\nplane = "transverse"\n[channel.acc_3]\nx_m = 2\n')
    found = read(joined)
    assert isinstance(found, Recording)
    raw = pyuff.UFF(str(folder / LOGGED)).read_sets()
    for channel, one in zip(found.accelerations, raw, strict=True):
        np.testing.assert_array_equal(channel.values, one["data"])
    assert found.force is not None
    np.testing.assert_allclose(found.force.values, force, rtol=1e-9)
    assert (found.hanger, found.accelerations[2].x_m) == (2, 2.0)
    assert {channel.plane for channel in found.accelerations} == {"transverse"}


@pytest.mark.parametrize("name", MICROPHONES)
def test_a_microphone_is_no_hammer_test(folder: Path, name: str) -> None:
    found = peek(folder / name)
    assert found.channels == ()
    assert "data set 1 (Pressure) is neither force nor acceleration" in found.problems[0]
    with pytest.raises(BadInput, match="no channel holds the hammer's force"):
        read(folder / name)


def test_a_real_roving_hammer_test_survives_as_a_universal_file(
    shared_data: Path, tmp_path: Path
) -> None:
    original = roving_beam(shared_data / "modelab_roving_beam")
    path = tmp_path / "beam.uff"
    write(original, path)
    found = read(path)
    assert isinstance(found, FrequencyResponse)
    assert found.points == original.points
    np.testing.assert_allclose(found.frequency_hz, original.frequency_hz, rtol=1e-12)
    np.testing.assert_allclose(found.accelerance, original.accelerance, rtol=1e-9)
    band = (found.frequency_hz > 100) & (found.frequency_hz < 120)
    peak = found.frequency_hz[band][np.abs(found.accelerance[0, band]).argmax()]
    assert peak == pytest.approx(111.992, abs=0.02)


def roving_beam(folder: Path) -> FrequencyResponse:
    """The first three of nine responses, up to 125 Hz."""
    tables = [table(folder / f"Hxysv0000{i}.txt.gz")[:6401] for i in (1, 2, 3)]
    points = tuple(
        ResponsePoint(f"hit_{i}", "transverse", x) for i, x in enumerate(HAMMER_X_M[:3], start=1)
    )
    accelerance = np.array([one[:, 1] + 1j * one[:, 2] for one in tables])
    return FrequencyResponse("", points, 0.01953125 * np.arange(6401), accelerance)


def table(path: Path) -> FloatArray:
    """Frequency, real and imaginary part, (lines, 3)."""
    with gzip.open(path, "rt", encoding="latin1") as stream:
        lines = stream.read().splitlines()
    first = next(i for i, line in enumerate(lines) if line.strip().startswith("0.000"))
    return np.loadtxt(lines[first:])[:, :3]
