"""What loggers put into HDF5, MATLAB, TDMS and NumPy files, and how a sidecar names it."""

from __future__ import annotations

import sys
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import scipy.io
from nptdms import ChannelObject, GroupObject, RootObject, TdmsWriter

from shm.errors import UsageError
from shm.read import Peek, peek, read, sidecar_path
from shm.values import Channel, Recording
from tests.helpers.written import recorded, refused, responded, write

SAMPLES = 200
FORCE, FIRST, SECOND = np.random.default_rng(7).standard_normal((3, SAMPLES))
UNITS = {"force_unit": "N", "acc_1_unit": "m/s2"}
savemat: Any = scipy.io.savemat


def npz(folder: Path, **arrays: Any) -> Path:
    path = folder / "test.npz"
    np.savez(path, **arrays)
    return path


def tdms(folder: Path, channels: dict[str, tuple[Any, dict[str, Any]]], **root: Any) -> Path:
    path = folder / "test.tdms"
    objects = [
        ChannelObject("Log", name, values, said) for name, (values, said) in channels.items()
    ]
    with TdmsWriter(str(path)) as writer:
        writer.write_segment([RootObject(root), GroupObject("Log"), *objects])
    return path


def version_7_3(folder: Path, arrays: dict[str, Any]) -> Path:
    """Return a file as MATLAB's save -v7.3 lays it out: texts as codes, classes as attributes."""
    path = folder / "test.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, value in arrays.items():
            text = isinstance(value, str)
            stored = np.array([[ord(c)] for c in value], "u2") if text else np.atleast_2d(value)
            if np.iscomplexobj(stored):
                stored = pairs(stored)
            dataset = file.create_dataset(name, data=stored)
            dataset.attrs["MATLAB_class"] = np.bytes_("char" if text else "double")
        cells = file.create_dataset("notes", data=np.zeros((1, 2)))
        cells.attrs["MATLAB_class"] = np.bytes_("cell")
        file.create_group("#refs#").create_dataset("a", data=np.zeros(30))
    with path.open("r+b") as stream:
        stream.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64, Created on: Mon May  4 2026")
    return path


def pairs(values: Any) -> Any:
    found = np.zeros(values.shape, [("real", "f8"), ("imag", "f8")])
    found["real"], found["imag"] = values.real, values.imag
    return found


def told(found: Peek) -> list[tuple[str, str | None, str]]:
    return [(channel.name, channel.quantity, channel.unit) for channel in found.channels]


def test_a_tdms_file_of_a_logger_gives_rate_time_and_units(tmp_path: Path) -> None:
    wave = {"wf_increment": 1 / 2048, "wf_start_time": np.datetime64("2026-05-01T10:00:30.250")}
    path = tdms(
        tmp_path,
        {
            "Dev1/ai0": (FORCE, {**wave, "unit_string": "N"}),
            "Dev1/ai1": (FIRST, {**wave, "unit_string": "g"}),
            "Strain": (SECOND, {**wave, "unit_string": "um/m"}),
        },
        Operator="Ann",
    )
    assert told(peek(path)) == [("Dev1/ai0", "force", "N"), ("Dev1/ai1", "acceleration", "g")]
    assert peek(path).left_out == ("Strain",)
    found = recorded(path)
    assert found.sampling_rate_hz == 2048
    assert found.time == datetime(2026, 5, 1, 10, 0, 30, 250000, tzinfo=UTC)
    np.testing.assert_allclose(found.accelerations[0].values, 9.80665 * FIRST)


def test_channels_of_one_name_in_two_groups_are_told_apart(tmp_path: Path) -> None:
    path = tmp_path / "test.h5"
    with h5py.File(path, "w") as file:
        file.attrs["fs"] = 512
        for group, values in (("north", FIRST), ("south", SECOND)):
            file[f"{group}/acc"] = values
    sidecar_path(path).write_text(
        '[channel."north/acc"]\nunit = "g"\n[channel."south/acc"]\nunit = "m/s2"\n'
    )
    found = recorded(path)
    assert [c.name for c in found.channels] == ["north/acc", "south/acc"]
    np.testing.assert_allclose(found.channels[0].values, 9.80665 * FIRST)


def test_attributes_of_an_hdf5_file_say_what_a_header_does(tmp_path: Path) -> None:
    path = tmp_path / "test.hdf5"
    with h5py.File(path, "w") as file:
        group = file.create_group("run")
        group.attrs.update({"Sample Rate": 512, "hanger": 4, "start_time": "2026-05-01T10:00:00Z"})
        for name, values, said in (
            ("acc_10", FIRST, {"unit": "g", "plane": "transverse", "x_m": 2.5, "full_scale": 5.0}),
            ("acc_2", SECOND, {"units": b"mm/s2", "calibration": 100.0}),
            ("hammer", FORCE.astype("f4"), {"unit": "kN"}),
        ):
            group.create_dataset(name, data=values, compression="gzip").attrs.update(said)
    found = recorded(path)
    assert [c.name for c in found.channels] == ["acc_2", "acc_10", "hammer"]
    assert (found.hanger, found.sampling_rate_hz) == (4, 512)
    assert found.time == datetime(2026, 5, 1, 10, tzinfo=UTC)
    np.testing.assert_allclose(found.channels[0].values, 0.1 * SECOND)
    assert found.channels[1].full_scale == pytest.approx(5 * 9.80665)
    assert (found.channels[1].plane, found.channels[1].x_m) == ("transverse", 2.5)
    assert found.force is not None


def test_a_matlab_file_of_version_7_3_is_read(tmp_path: Path) -> None:
    arrays = {
        "force": FORCE, "acc_1": FIRST, "sampling_rate_hz": 512.0, "acc_1_unit": "mm/s2",
        "force_unit": "N",
        "time": "2026-05-01T10:00:00Z",
    }  # fmt: skip
    path = version_7_3(tmp_path, arrays)
    assert peek(path).left_out == ("notes",)
    found = recorded(path)
    np.testing.assert_allclose(found.accelerations[0].values, 1e-3 * FIRST)
    assert (found.sampling_rate_hz, found.time) == (512, datetime(2026, 5, 1, 10, tzinfo=UTC))


def test_complex_responses_of_version_7_3_are_read(tmp_path: Path) -> None:
    response = FIRST + 1j * SECOND
    path = version_7_3(tmp_path, {"frequency": np.arange(SAMPLES) / 4, "frf_low": response})
    found = responded(path)
    np.testing.assert_allclose(found.accelerance[0], response)


def test_compressed_variables_of_version_5_are_read_and_structs_left_out(tmp_path: Path) -> None:
    path = tmp_path / "test.mat"
    arrays = {
        "force": FORCE, "acc_1": FIRST[:, None], "fs": 512, "settings": {"gain": 2.0},
        **UNITS, "cells": np.array(["a", "b"], dtype=object),
    }  # fmt: skip
    savemat(path, arrays, do_compression=True)
    assert peek(path).left_out == ("settings (struct)", "cells (cell)")
    np.testing.assert_array_equal(recorded(path).accelerations[0].values, FIRST)


@pytest.mark.parametrize("ending", ["mat", "npz"])
def test_a_name_alone_promises_no_unit(tmp_path: Path, ending: str) -> None:
    path = tmp_path / f"test.{ending}"
    arrays: dict[str, Any] = {"force": FORCE, "acc_1": FIRST, "fs": 512.0, "acc_1_unit": "g"}
    (savemat if ending == "mat" else lambda p, a: np.savez(p, **a))(path, arrays)
    assert any("force: nothing says its unit" in problem for problem in peek(path).problems)
    refused(path, "force: nothing says its unit")
    sidecar_path(path).write_text('[channel.force]\nunit = "kN"\n')
    np.testing.assert_allclose(recorded(path).channels[0].values, 1e3 * FORCE)


def test_a_table_is_named_column_by_column(tmp_path: Path) -> None:
    path = tmp_path / "test.mat"
    savemat(path, {"data": np.column_stack([FORCE, FIRST, SECOND]), "fs": 512})
    assert peek(path).left_out == ("data_1", "data_2", "data_3")
    refusal = refused(path, "The file holds data_1, data_2, data_3")
    assert '[channel."data_1"]' in refusal.remedy
    sidecar_path(path).write_text(
        '[channel.data_1]\nunit = "kN"\n[channel.data_3]\nunit = "m/s2"\nx_m = 2.5\n'
    )
    found = recorded(path)
    np.testing.assert_array_equal([c.values for c in found.channels], [1e3 * FORCE, SECOND])
    assert found.accelerations[0].x_m == 2.5
    assert peek(path).left_out == ("data_2",)


def test_the_rows_of_a_npy_file_are_named_by_its_sidecar(tmp_path: Path) -> None:
    path = tmp_path / "test.npy"
    np.save(path, np.vstack([np.arange(SAMPLES) / 512, FORCE, FIRST]))
    sidecar_path(path).write_text(
        '[channel.row_1]\nunit = "s"\n[channel.row_2]\nunit = "N"\n[channel.row_3]\nunit = "g"\n'
    )
    found = recorded(path)
    assert found.sampling_rate_hz == pytest.approx(512)
    assert peek(path).sampling_rate_hz == pytest.approx(512)
    assert [c.quantity for c in found.channels] == ["force", "acceleration"]


def test_fortran_order_bytes_and_integers_are_read(tmp_path: Path) -> None:
    counts = np.asfortranarray(np.vstack([np.arange(SAMPLES), -np.arange(SAMPLES)]).astype(">i2"))
    path = npz(tmp_path, acc=counts, fs=np.float32(100), hanger=np.bytes_(b"3"))
    sidecar_path(path).write_text('unit = ["m/s2", "m/s2"]')
    found = recorded(path)
    assert [c.name for c in found.channels] == ["acc_1", "acc_2"]
    np.testing.assert_array_equal(found.channels[1].values, -np.arange(SAMPLES))
    assert (found.hanger, found.sampling_rate_hz) == (3, 100)


def test_times_give_the_rate_and_show_the_gaps(tmp_path: Path) -> None:
    kept = np.delete(np.arange(SAMPLES), [50, 51])
    path = npz(tmp_path, time=kept / 512, force=FORCE[kept], acc_1=FIRST[kept], **UNITS)
    found = recorded(path)
    assert (found.samples, found.sampling_rate_hz) == (SAMPLES, pytest.approx(512))
    assert np.flatnonzero(np.isnan(found.channels[0].values)).tolist() == [50, 51]


def test_a_step_in_place_of_a_rate_will_do(tmp_path: Path) -> None:
    assert (
        recorded(npz(tmp_path, dt=1 / 512, acc_1=FIRST, acc_1_unit="m/s2")).sampling_rate_hz == 512
    )


def test_channels_of_different_length_or_rate_are_refused(tmp_path: Path) -> None:
    refusal = refused(
        npz(tmp_path, force=FORCE, acc_1=FIRST[:100], fs=512), "has 100 values, force 200"
    )
    assert refusal.channel == "acc_1"
    rates = [{"unit_string": unit, "wf_increment": step} for unit, step in (("N", 0.1), ("g", 0.2))]
    path = tdms(tmp_path, {"a": (FORCE, rates[0]), "b": (FIRST, rates[1])})
    refused(path, "different sampling rates")
    assert any("different sampling rates" in problem for problem in peek(path).problems)


def test_a_voltage_needs_the_unit_that_its_calibration_leads_to(tmp_path: Path) -> None:
    path = tdms(tmp_path, {"acc_1": (FIRST, {"unit_string": "V", "wf_increment": 0.01})})
    refused(path, "the unit 'V' is not one of acceleration")
    sidecar_path(path).write_text('[channel.acc_1]\nunit = "g"\ncalibration = 10\n')
    np.testing.assert_allclose(recorded(path).channels[0].values, 98.0665 * FIRST)


def test_an_analysers_matlab_file_gives_time_records_or_responses_as_its_sidecar_says(
    tmp_path: Path,
) -> None:
    """The variables of shared/data/vtb_low_coherence."""
    path, response = tmp_path / "test.mat", FIRST + 1j * SECOND
    arrays = {
        "Time_domain": np.arange(SAMPLES) / 1280, "Time_chan_1": FORCE, "Time_chan_2": FIRST,
        "Freq_domain": np.arange(SAMPLES) * 0.3125, "Hf_chan_2": response,
        "Hf_coh_chan_2": np.full(SAMPLES, 0.5), "Cross": response,
    }  # fmt: skip
    savemat(path, arrays)
    sidecar_path(path).write_text(
        '[channel.Time_chan_1]\nunit = "N"\n[channel.Time_chan_2]\nunit = "m/s2"\n'
    )
    assert recorded(path).sampling_rate_hz == pytest.approx(1280)
    sidecar_path(path).write_text(
        '[channel.Hf_chan_2]\nunit = "g/N"\nx_m = 1.5\ncoherence = "Hf_coh_chan_2"\n'
    )
    found = responded(path)
    assert (found.points[0].name, found.points[0].x_m) == ("Hf_chan_2", 1.5)
    np.testing.assert_allclose(found.accelerance[0], 9.80665 * response)
    assert found.coherence is not None
    np.testing.assert_array_equal(found.coherence, np.full((1, SAMPLES), 0.5))
    look = peek(path)
    assert (look.lines, look.frequency_step_hz) == (SAMPLES, pytest.approx(0.3125))
    assert "Cross" in look.left_out


def test_responses_without_frequencies_are_refused(tmp_path: Path) -> None:
    path = npz(tmp_path, frf_1=FIRST + 1j * SECOND)
    words = "no array holds the frequencies of its 200 lines"
    refused(path, words)
    assert words in peek(path).problems[0]


def test_responses_from_a_first_line_get_the_lines_below_as_gaps(tmp_path: Path) -> None:
    path = npz(tmp_path, frequency_hz=10 + 0.5 * np.arange(SAMPLES), frf_1=FIRST + 1j * SECOND)
    found = responded(path)
    np.testing.assert_allclose(found.frequency_hz, 0.5 * np.arange(SAMPLES + 20))
    assert np.isnan(found.accelerance[0, :20]).all()
    np.testing.assert_array_equal(found.accelerance[0, 20:], FIRST + 1j * SECOND)


@pytest.mark.parametrize("name", ["acc 1", "1acc", "time", "acc_1_unit", "acc/1", "x" * 50])
@pytest.mark.parametrize("suffix", [".npz"])
def test_a_name_that_some_program_could_not_take_is_not_written(
    tmp_path: Path, name: str, suffix: str
) -> None:
    odd = Recording("", (Channel(name, "acceleration", FIRST),), 512.0)
    with pytest.raises(UsageError, match="cannot name an array"):
        write(odd, tmp_path / f"test{suffix}")
    assert list(tmp_path.iterdir()) == []


def test_a_single_array_file_is_not_written(recording: Recording, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"Write a \.npz file"):
        write(recording, tmp_path / "test.npy")


@pytest.mark.parametrize("suffix", [".h5", ".tdms", ".npz"])
def test_a_peek_loads_no_channel(
    recording: Recording, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, suffix: str
) -> None:
    path = tmp_path / f"test{suffix}"
    write(recording, path)

    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("a peek loaded an array")

    monkeypatch.setattr("shm.read.array_reading._loaded", refuse)
    assert peek(path).samples == SAMPLES
    with pytest.raises(AssertionError, match="loaded an array"):
        read(path)


def test_our_matlab_and_numpy_files_are_plain_to_other_software(
    recording: Recording, tmp_path: Path
) -> None:
    write(recording, tmp_path / "test.mat")
    write(recording, tmp_path / "test.npz")
    loaded: dict[str, Any] = scipy.io.loadmat(tmp_path / "test.mat", squeeze_me=True)
    with np.load(tmp_path / "test.npz") as archive:
        for found in (loaded, archive):
            np.testing.assert_array_equal(found["force"], recording.channels[0].values)
            assert (found["sampling_rate_hz"], found["hanger"]) == (512, 3)
            assert (found["acc_1_unit"], found["acc_1_x_m"]) == ("m/s2", 2.52)


def test_tdms_without_its_extra_says_what_to_install(
    recording: Recording, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write(recording, tmp_path / "test.tdms")
    monkeypatch.setitem(sys.modules, "nptdms", None)
    refused(tmp_path / "test.tdms", r"extra `tdms`.*shm\[tdms\]")
