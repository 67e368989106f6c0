"""Files that other people's loggers wrote (shared/data)."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
import pyuff

from shm.read import bundle, peek, peek_test, read_test, sidecar_path
from shm.values import Channel, FrequencyResponse, Recording
from tests.helpers.written import recorded, refused, responded, write

LOGGED = "MPSTD_Set001_2024_10_08_10_27_07.uff"
MICROPHONES = ("Sample_UFF58_ascii.uff", "Sample_UFF58b_bin.uff")
HAMMER_X_M = (0.1, 0.25, 0.375, 0.5, 0.65, 0.8, 0.925, 1.05, 1.2)


@pytest.fixture(scope="module")
def folder(shared_data: Path) -> Path:
    return shared_data / "pyuff_uff58"


def test_four_logged_accelerations_are_an_ambient_record(folder: Path) -> None:
    found = peek(folder / LOGGED)
    assert [(c.name, c.quantity, c.unit) for c in found.channels] == [
        (f"acc_{i}", "acceleration", "m/s2") for i in (1, 2, 3, 4)
    ]
    assert (found.samples, found.sampling_rate_hz) == (222_400, 3200.0)
    assert found.time == datetime(2024, 10, 8, 10, 27, 7, tzinfo=UTC)
    assert found.problems == ()
    record = recorded(folder / LOGGED)
    assert record.force is None
    assert len(record.accelerations) == 4


def test_the_logged_accelerations_are_read_once_a_force_stands_beside_them(
    folder: Path, tmp_path: Path
) -> None:
    force = np.random.default_rng(1).standard_normal(222_400)
    write(Recording("", (Channel("force", "force", force),), 3200.0), tmp_path / "force.uff")
    joined = tmp_path / "joined.uff"
    joined.write_bytes((folder / LOGGED).read_bytes() + (tmp_path / "force.uff").read_bytes())
    sidecar_path(joined).write_text('hanger = 2\nplane = "transverse"\n[channel.acc_3]\nx_m = 2\n')
    found = recorded(joined)
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
    assert found.left_out == ("data set 1 (Pressure)",)
    assert any("no channel holds an acceleration" in problem for problem in found.problems)
    refused(folder / name, "no channel holds an acceleration")


def test_a_real_roving_hammer_test_is_read_and_survives_as_a_test_of_several_files(
    shared_data: Path, tmp_path: Path
) -> None:
    """Nine analyser exports, gzipped, with places by sidecar; the first mode at 111.992 Hz."""
    paths = roving_beam(shared_data / "modelab_roving_beam", tmp_path)
    archive = bundle(paths, tmp_path / "beam.zip")
    for look in peek_test(archive):
        assert (look.lines, look.frequency_step_hz) == (51_201, 0.01953125)
        assert look.problems == ()
    records = [record for record in read_test(archive) if isinstance(record, FrequencyResponse)]
    assert [record.points[0].x_m for record in records] == list(HAMMER_X_M)
    for record in records:
        assert record.points[0].plane == "transverse"
        band = (record.frequency_hz > 108) & (record.frequency_hz < 116)
        peak = record.frequency_hz[band][np.abs(record.accelerance[0, band]).argmax()]
        assert peak == pytest.approx(111.992, abs=0.03)


def roving_beam(folder: Path, into: Path) -> list[Path]:
    """Return the nine files of the crew, each with a sidecar that says where was hit."""
    paths = []
    for place in HAMMER_X_M:
        name = f"Hxysv0000{len(paths) + 1}.txt.gz"
        path = into / name
        path.write_bytes((folder / name).read_bytes())
        sidecar_path(path).write_text(f'x_m = {place}\nplane = "transverse"\n')
        paths.append(path)
    return paths


@pytest.mark.parametrize("suffix", [".uff", ".csv", ".h5", ".mat", ".tdms", ".npz"])
def test_a_real_frequency_response_survives_every_format(
    shared_data: Path, tmp_path: Path, suffix: str
) -> None:
    original = responded(shared_data / "modelab_roving_beam" / "Hxysv00002.txt.gz")
    path = tmp_path / f"beam{suffix}"
    write(original, path)
    found = responded(path)
    assert found.points == original.points
    np.testing.assert_allclose(found.frequency_hz, original.frequency_hz, rtol=1e-12)
    np.testing.assert_allclose(found.accelerance, original.accelerance, rtol=1e-9)


@pytest.mark.parametrize(("case", "peak_hz"), [("case1", 212.0925), ("case2", 192.594)])
def test_an_analysers_matlab_file_is_read_as_its_sidecar_says(
    shared_data: Path, tmp_path: Path, case: str, peak_hz: float
) -> None:
    """The toolbox's own doc-tests find these peaks in lines 500 to 1000 of Hf_chan_2."""
    path = tmp_path / f"{case}.mat"
    path.write_bytes((shared_data / "vtb_low_coherence" / f"{case}.mat").read_bytes())
    assert len(peek(path).left_out) == 14
    refused(path, "The file holds Time_chan_1, Time_chan_2")
    sidecar_path(path).write_text(
        '[channel.Time_chan_1]\nunit = "N"\n[channel.Time_chan_2]\nunit = "m/s2"\n'
    )
    record = recorded(path)
    assert (record.samples, record.sampling_rate_hz) == (4096, 1280)
    assert [channel.quantity for channel in record.channels] == ["force", "acceleration"]
    sidecar_path(path).write_text(
        '[channel.Hf_chan_2]\nunit = "m/s2/N"\ncoherence = "Hf_coh_chan_2"\n'
    )
    response = responded(path)
    assert response.coherence is not None
    assert np.median(response.coherence) < 0.4
    lines = np.abs(response.accelerance[0, 500:1000])
    assert response.frequency_hz[500 + lines.argmax()] == pytest.approx(peak_hz, abs=0.5)


def test_hits_in_a_table_without_names_are_read_as_their_sidecar_says(
    shared_data: Path, tmp_path: Path
) -> None:
    """Row 0 time, row 1 force, row 2 acceleration; peak forces as in the NOTE."""
    paths = []
    for hit in (1, 2, 3, 4, 5):
        path = tmp_path / f"measurements_{hit}.npy"
        path.write_bytes((shared_data / "pyfrf_hits" / path.name).read_bytes())
        sidecar_path(path).write_text(
            '[channel.row_1]\nunit = "s"\n[channel.row_2]\nunit = "N"\n'
            '[channel.row_3]\nunit = "m/s2"\n'
        )
        paths.append(path)
    records = read_test(bundle(paths, tmp_path / "hits.zip"))
    forces = [record.force for record in records if isinstance(record, Recording)]
    peaks = [np.abs(force.values).max() for force in forces if force is not None]
    assert peaks == pytest.approx([68.6, 83.7, 85.4, 88.9, 76.5], abs=0.05)
    for record in records:
        assert isinstance(record, Recording)
        assert (record.samples, record.sampling_rate_hz) == (25_600, pytest.approx(25_600))
