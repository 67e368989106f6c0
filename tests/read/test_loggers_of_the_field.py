"""What loggers of a make write, each as small as it goes, and what must be understood of it."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import csiio
import numpy as np
import pandas as pd
import pytest
import pyuff
import scipy.io
from sdypy_sep005.sep005 import assert_sep005

import shm
from shm.errors import BadInput
from shm.pipeline.importing import Answers, keep_profile, look_into
from shm.pipeline.intake import as_taken_in
from shm.read import bundle, peek, peek_test, read_test, sidecar_path
from shm.read.registry import layout_of, survey
from shm.store import Workspace
from shm.values import Recording
from tests.helpers.logger_texts import ACC, FORCE, PLAIN, RATE, german, rows
from tests.helpers.mutations import a_recording
from tests.helpers.workspaces import make_workspace
from tests.helpers.written import mini_seed_names, recorded, refused, write_counts

TWO = rows(lambda i: f"{i},{FORCE[i] / 1e4:.5f},{ACC[i]:.4f}")


def written(folder: Path, text: str, name: str = "export.csv") -> Path:
    path = folder / name
    path.write_text(text)
    return path


def named(path: Path) -> list[tuple[str, str]]:
    return [(channel.name, channel.unit) for channel in peek(path).channels]


@pytest.mark.parametrize("mark", [",", ";"])
def test_a_wireless_node_gives_units_by_channel_number(tmp_path: Path, mark: str) -> None:
    head = (
        "Node, 418\nTime, 05/14/2026 09:20:11\nFs, 500 Hz\n\nApplied Filters\n"
        f"{mark}Channel,1,Units,G,Slope,0.0042,Offset,-8.2\n"
        f"{mark}Channel,2,Units,mg,Slope,0.0042,Offset,-8.2\nSweeps,Channel 1,Channel 2\n"
    )
    path = written(tmp_path, head + TWO)
    assert named(path) == [("Channel 1", "G"), ("Channel 2", "mg")]
    found = recorded(path)
    assert (found.sampling_rate_hz, found.samples) == (500, len(ACC))
    np.testing.assert_allclose(found.channels[1].values, 1e-3 * 9.80665 * ACC)


def test_axes_that_are_named_by_digits_have_the_unit_of_the_first(tmp_path: Path) -> None:
    body = rows(lambda i: f"{5 * i}.0,{ACC[i]},{-ACC[i]},{2 * ACC[i]},41.2")
    head = '"time (ms)","Accelerometer [m/s2]","1","2","temperature [°C]"\n'
    found = recorded(written(tmp_path, head + body))
    assert [c.name for c in found.channels] == [
        "Accelerometer", "Accelerometer 1", "Accelerometer 2",
    ]  # fmt: skip
    assert np.isnan(found.temperature_c)  # the camera's


def campbell_text(names: str, units: str, more: str) -> str:
    first = datetime(2026, 5, 14, 10)
    head = (
        f'"TOA5","Hanger_5","CR6","2187"\n"TIMESTAMP","RECORD",{names}\n"TS","RN",{units}\n'
        + ",".join('""' for _ in range(names.count(",") + 3))
        + "\n"
    )
    return head + rows(
        lambda i: f'"{first + timedelta(milliseconds=10 * i)}",{i},{ACC[i]},{ACC[i] / 2}{more}'
    )


@pytest.mark.parametrize(
    ("names", "units", "more", "temperature_c"),
    [
        ('"T_steel"', '"Deg C"', ",11.5", 11.5),
        ('"T_air","T_steel"', '"Deg C","degC"', ",3.0,11.5", 11.5),
        ('"T_air"', '"Deg C"', ",3.0", 3.0),
        ('"PTemp"', '"Deg C"', ",41.0", np.nan),
        ('"T_steel_1","T_steel_2"', '"Deg C","Deg C"', ",11.0,12.0", np.nan),
    ],
)
def test_a_campbell_table_keeps_its_array_elements_and_says_the_temperature(
    tmp_path: Path, names: str, units: str, more: str, temperature_c: float
) -> None:
    text = campbell_text(f'"Acc_Z(1)","Acc_Z(2)",{names}', f'"g","g",{units}', more)
    found = recorded(written(tmp_path, text, "a.dat"))
    assert [channel.name for channel in found.channels] == ["Acc_Z(1)", "Acc_Z(2)"]
    assert found.hanger == 5
    assert found.temperature_c == pytest.approx(temperature_c, nan_ok=True)


@pytest.mark.parametrize("kind", ["tob1", "tob3"])
def test_a_binary_table_of_campbell_is_read(tmp_path: Path, kind: str) -> None:
    index = pd.date_range("2026-05-14 10:00", periods=len(ACC), freq="2ms", name="TIMESTAMP")
    columns = {"Acc_Z(1) (g)": ACC, "Acc_Z(2) (g)": -ACC, "T_box (Deg C)": 0 * ACC + 20}
    frame = pd.DataFrame(columns, index=index).astype("float32")
    path = tmp_path / "a.dat"
    getattr(csiio, f"write_csi_{kind}")(str(path), frame, station="Hanger_5")
    found = recorded(path)
    assert (found.time, found.hanger) == (datetime(2026, 5, 14, 10, tzinfo=UTC), 5)
    assert found.sampling_rate_hz == pytest.approx(RATE, rel=1e-6)
    assert [channel.name for channel in found.channels] == ["Acc_Z(1)", "Acc_Z(2)"]
    np.testing.assert_allclose(found.channels[0].values, 9.80665 * ACC, rtol=1e-6, atol=1e-6)
    path.write_bytes(path.read_bytes()[:90])
    refused(path, "cannot be read")


def test_catmans_t0_is_the_time(tmp_path: Path) -> None:
    body = rows(lambda i: f"{german(i / RATE)}\t{german(FORCE[i])}\t{german(ACC[i])}")
    text = f"T0 = 14.05.2026 10:12:31\ndt = 2E-3\nZeit\tHammer\ta quer\ns\tN\tm/s²\n{body}"
    assert recorded(written(tmp_path, text, "a.asc")).time == datetime(
        2026, 5, 14, 10, 12, 31, tzinfo=UTC
    )


def test_signals_one_below_the_other_are_one_record(tmp_path: Path) -> None:
    def part(title: str, unit: str, values: np.ndarray) -> str:
        head = f"Header Size:\t5\nX-axis delta:\t0.002\nY-axis unit:\t{unit}\n"
        head += f"Title1:\t{title}\nDate:\t2026-05-14\nTime:\t10:00:00\n"
        return head + rows(lambda i: f"{i + 1}\t{i / RATE:.8e}\t{values[i]:.6e}")

    both = part("Hammer", "N", FORCE) + part("Acc", "m/s²", ACC)
    found = recorded(written(tmp_path, both, "a.txt"))
    assert [(c.name, c.quantity) for c in found.channels] == [
        ("Hammer", "force"), ("Acc", "acceleration"),
    ]  # fmt: skip
    assert (found.time, found.sampling_rate_hz) == (datetime(2026, 5, 14, 10, tzinfo=UTC), RATE)
    np.testing.assert_allclose(found.channels[1].values, ACC)


def test_a_record_over_the_end_of_summer_time_runs_on(tmp_path: Path) -> None:
    begin = datetime(2026, 10, 25, 2, 59, 59, 700_000)

    def line(i: int) -> str:
        back = timedelta(hours=i >= 150)
        return (
            f"{begin + timedelta(seconds=i / RATE) - back:%Y-%m-%d %H:%M:%S.%f},{FORCE[i]},{ACC[i]}"
        )

    path = written(tmp_path, "Time,Force [N],Acc [m/s2]\n" + rows(line))
    found = recorded(path)
    assert (found.samples, found.sampling_rate_hz) == (len(ACC), pytest.approx(RATE))
    assert "clock went back one hour at line 152" in survey(path).remarks[0]
    doubled = rows(line).splitlines(keepends=True)
    path.write_text("Time,Force [N],Acc [m/s2]\n" + "".join([*doubled, *doubled]))
    refused(path, r"does not increase|uneven")


# ---------------------------------------------------------------- LabVIEW


def labview(x: str, names: str, line: Callable[[int], str], parts: int = 1, **more: str) -> str:
    count, end = names.count("\t") + 1, "***End_of_Header***"
    said = {"Samples": "400", "Y_Unit_Label": "N", "Delta_X": "0.002", "X_Dimension": "Time"} | more
    lines = [f"Channels\t{count}", "Date\t2026/05/14", "Time\t10:12:40.5"]
    lines += [f"{k}\t" + (v if "\t" in v else "\t".join([v] * count)) for k, v in said.items()]
    part = "\n".join(["", *lines, end, f"X_Value\t{names}\tComment", ""])
    head = f"LabVIEW Measurement\nSeparator\tTab\nX_Columns\t{x}\n{end}\n"
    return head + (part + rows(line)) * parts


def test_labview_without_an_x_column(tmp_path: Path) -> None:
    text = labview(
        "No", "F\tp_1", lambda i: f"\t{FORCE[i]}\t{ACC[i]}", Y_Unit_Label="Newtons\tm/s^2"
    )
    path = written(tmp_path, text, "a.lvm")
    assert named(path) == [("F", "Newtons"), ("p_1", "m/s^2")]
    found = recorded(path)
    assert found.time == datetime(2026, 5, 14, 10, 12, 40, 500_000, tzinfo=UTC)
    np.testing.assert_allclose([c.values for c in found.channels], [FORCE, ACC])


def test_labview_with_several_headings_is_a_test_of_as_many_hits(tmp_path: Path) -> None:
    text = labview("No", "F\tp_1", lambda i: f"\t{FORCE[i]}\t{ACC[i]}", 2, Y_Unit_Label="N\tm/s^2")
    path = written(tmp_path, text, "a.lvm")
    records = read_test(path)
    assert [Path(each.source).name for each in records] == ["record_1", "record_2"]
    assert [each.samples for each in records if isinstance(each, Recording)] == [400, 400]
    assert [each.samples for each in peek_test(path)] == [400, 400]
    assert "2 records" in survey(path).remarks[-1]
    refused(path, "holds 2 records")


def test_headings_of_labview_over_which_x_goes_on_are_one_record(tmp_path: Path) -> None:
    def line(i: int) -> str:
        return f"{i / RATE:.6f}\t{FORCE[i]}\t{ACC[i]}"

    text = labview("One", "F\tp_1", line, 2, Y_Unit_Label="N\tm/s^2")
    path = written(tmp_path, text, "a.lvm")
    assert len(read_test(path)) == 2
    for i in range(len(ACC)):
        tail = f"\t{FORCE[i]}\t{ACC[i]}\n"
        head, _, last = text.rpartition(f"{i / RATE:.6f}{tail}")
        text = f"{head}{(i + len(ACC)) / RATE:.6f}{tail}{last}"
    path.write_text(text)
    found = recorded(path)
    assert (found.samples, found.sampling_rate_hz) == (2 * len(ACC), pytest.approx(RATE))


def test_labview_with_an_x_column_for_each_channel(tmp_path: Path) -> None:
    text = labview(
        "Multi", "Hammer\tX_Value\tAcc", lambda i: f"{i / RATE}\t{FORCE[i]}\t{i / RATE}\t{ACC[i]}",
        Samples="400\t\t400", Y_Unit_Label="N\t\tg", Delta_X="0.002\t\t0.002",
        X_Dimension="Time\t\tTime",
    )  # fmt: skip
    path = written(tmp_path, text, "a.lvm")
    assert named(path) == [("Hammer", "N"), ("Acc", "g")]
    assert peek(path).sampling_rate_hz == pytest.approx(RATE)


def test_empty_channels_of_labview_are_left_out_and_damaged_cells_are_counted(
    tmp_path: Path,
) -> None:
    text = labview(
        "One", "Dev1/ai0\tUntitled\tDev1/ai2", lambda i: f"{i / RATE}\t{FORCE[i]}\t\t{ACC[i]}",
        Samples="400\t0\t400", Y_Unit_Label="N\t\tm/s^2", Delta_X="0.002\t1.0\t0.002",
    )  # fmt: skip
    path = written(tmp_path, text, "a.lvm")
    assert named(path) == [("Dev1/ai0", "N"), ("Dev1/ai2", "m/s^2")]
    path.write_text(text.replace(f"\t{ACC[9]}\n", "\tx.1\n"))
    assert survey(path).remarks == ("1 values of Dev1/ai2 are no numbers; taken as missing.",)


# ---------------------------------------------------------------- arrays, archives


def test_a_matlab_struct_counts_as_its_fields(tmp_path: Path) -> None:
    path = tmp_path / "a.mat"
    units = np.array(["N", "m/s2"], dtype=object)
    test: dict[str, Any] = {"force": FORCE, "acc_1": ACC, "fs": RATE, "unit": units}
    scipy.io.savemat(path, {"test": {**test, "date": "14-May-2026 09:12:00"}})
    found = recorded(path)
    assert [channel.name for channel in found.channels] == ["force", "acc_1"]
    assert (found.sampling_rate_hz, found.time) == (RATE, datetime(2026, 5, 14, 9, 12, tzinfo=UTC))
    cells = {key: np.array(texts, dtype=object) for key, texts in
             {"channel_names": ["Hammer", "A1"], "units": ["N", "m/s^2"]}.items()}  # fmt: skip
    meas = {"data": np.column_stack([FORCE, ACC]), "fs": RATE, **cells}
    scipy.io.savemat(path, {"meas": {**meas, "start": "05-Jul-2025 10:51:43"}})
    found = recorded(path)
    assert [(c.name, c.quantity) for c in found.channels] == [
        ("Hammer", "force"), ("A1", "acceleration"),
    ]  # fmt: skip
    np.testing.assert_allclose(found.channels[1].values, ACC)
    assert found.time == datetime(2025, 7, 5, 10, 51, 43, tzinfo=UTC)
    scipy.io.savemat(path, {"test": {"gain": 2.0}, "two": [{"a": ACC}, {"a": ACC}]})
    assert "test (struct)" in peek(path).left_out


def test_f_of_matlab_is_frequencies_only_beside_responses(tmp_path: Path) -> None:
    path = tmp_path / "a.mat"
    scipy.io.savemat(path, {"F": FORCE, "acc1": ACC, "fs": RATE})
    assert [column.name for column in survey(path).columns] == ["acc1", "F"]
    sidecar_path(path).write_text('[channel.F]\nunit = "N"\n[channel.acc1]\nunit = "g"\n')
    assert recorded(path).force is not None
    sidecar_path(path).unlink()
    scipy.io.savemat(path, {"F": np.arange(400.0), "frf_1": FORCE + 1j * ACC})
    assert (peek(path).lines, peek(path).frequency_step_hz) == (400, 1.0)


CLOCK = '"event","experiment time","system time","system time text"\n'
START = '"START",0.0E0,1.778745600123E9,"2026-05-14 10:00:00.123 UTC+02:00"\n'


def phyphox(folder: Path) -> Path:
    path = folder / "Acceleration.zip"
    body = rows(lambda i: f"{i / RATE:.9E},{ACC[i]:.9E},{-ACC[i]:.9E}")
    with zipfile.ZipFile(path, "w") as archive:
        heads = '"Time (s)","Acceleration x (m/s^2)","Acceleration y (m/s^2)"\n'
        archive.writestr("Raw Data.csv", heads + body)
        archive.writestr("meta/device.csv", '"property","value"\n"deviceModel","5"\n')
        archive.writestr("meta/time.csv", CLOCK + START)
    return path


def test_an_export_of_phyphox_is_one_recording_with_its_time(tmp_path: Path) -> None:
    path = phyphox(tmp_path)
    (look,) = peek_test(path)
    assert (Path(look.source).name, look.problems) == ("Raw Data.csv", ())
    (found,) = read_test(path)
    assert found.time == datetime(2026, 5, 14, 8, 0, 0, 123_000, tzinfo=UTC)
    assert len(survey(path).columns) == 2


@pytest.fixture
def workspace(tmp_path: Path) -> Workspace:
    return make_workspace(tmp_path / "bridge", hangers=(2,))


def test_the_profile_of_a_logger_holds_for_a_test_of_one_file_for_each_hit(
    tmp_path: Path, workspace: Workspace
) -> None:
    text = "Time [s];Hammer [N];A1 [m/s2]\n" + PLAIN.replace(",", ";")
    hits = [written(tmp_path, text, f"hit_{n}.csv") for n in (1, 2, 3)]
    said = {"A1": {"x_m": 2.1, "plane": "transverse"}, "Hammer": {"x_m": 1.6}}
    found = look_into(hits[0], workspace, Answers(2, channels=said))
    assert found.is_ready
    keep_profile(found, workspace)
    archive = bundle(hits, tmp_path / "hits.zip")
    assert layout_of(archive).fingerprint == layout_of(hits[0]).fingerprint
    with as_taken_in(archive, workspace) as path:
        records = read_test(path)
    assert len(records) == 3
    for each in records:
        assert isinstance(each, Recording)
        assert (each.hanger, each.channels[1].x_m, each.channels[1].plane) == (2, 2.1, "transverse")


@pytest.mark.parametrize(
    ("stamp", "hour"),
    [("2026-05-14 10:00:00", 8), ("2026-05-14T10:00:00Z", 10), ("2026-01-14 10:00:00", 9)],
)
def test_a_clock_that_names_no_zone_is_in_the_zone_of_the_bridge(
    tmp_path: Path, workspace: Workspace, stamp: str, hour: int
) -> None:
    described = workspace.folder / "bridge.toml"
    text = described.read_text()
    described.write_text(text.replace("[bridge]", '[bridge]\ntime_zone = "Europe/Berlin"', 1))
    workspace = Workspace.open(workspace.folder)
    path = written(tmp_path, f"Start time: {stamp}\nTime [s],Hammer [N],A1 [m/s2]\n{PLAIN}")
    with as_taken_in(path, workspace) as taken:
        found = recorded(taken)
    assert found.time is not None
    assert (found.time.hour, found.time.tzinfo) == (hour, UTC)
    assert look_into(path, workspace, Answers()).described.get("time", found.time) == found.time


def test_modes_alone_are_imported_not_read(tmp_path: Path) -> None:
    path = tmp_path / "modes.uff"
    shape = {"node_nums": [1, 2, 3], "r1": [0.1, 0.2, 0.1], "r2": [0.0] * 3, "r3": [0.0] * 3}
    mode = pyuff.prepare_55(
        model_type=1, id1="a", analysis_type=2, data_ch=2, spec_data_type=8, load_case=1, mode_n=1,
        freq=5.0, modal_m=1.0, modal_damp_vis=0.01, modal_damp_his=0.0, **shape,
    )  # fmt: skip
    pyuff.UFF(str(path)).write_sets([mode], mode="add")
    (problem,) = peek(path).problems
    assert "holds 1 modes at 0 places" in problem
    assert "shm import FILE" in problem
    refused(path, "modes at 0 places")


def test_the_sidecar_of_an_archive_describes_channels_of_all_files(tmp_path: Path) -> None:
    text = "Time [s],Hammer,A1\n" + PLAIN
    hits = [written(tmp_path, text, f"hit_{n}.csv") for n in (1, 2)]
    sidecar_path(hits[1]).write_text('[channel.A1]\nunit = "g"\n')
    archive = bundle(hits, tmp_path / "hits.zip")
    sidecar_path(archive).write_text(
        '[channel.Hammer]\nunit = "N"\n[channel.A1]\nunit = "m/s2"\nx_m = 2\n'
    )
    first, second = read_test(archive)
    assert isinstance(first, Recording)
    assert isinstance(second, Recording)
    np.testing.assert_allclose(second.channels[1].values, 9.80665 * first.channels[1].values)
    other = bundle([hits[0], phyphox(tmp_path).rename(tmp_path / "b.csv")], tmp_path / "two.zip")
    with pytest.raises(BadInput):
        survey(other)


def test_a_channel_of_counts_that_is_left_out_needs_no_worth(tmp_path: Path) -> None:
    path, names = tmp_path / "a.mseed", mini_seed_names(2)
    recording = a_recording(np.random.default_rng(1))
    write_counts(path, [1e6 * channel.values for channel in recording.accelerations], recording)
    worth = f'[channel.{names[0]}]\nunit = "m/s2"\ncalibration = 1e-6\n'
    sidecar_path(path).write_text(f"{worth}[channel.{names[1]}]\nleave_out = true\n")
    assert [channel.name for channel in recorded(path).channels] == names[:1]
    assert peek(path).left_out == (names[1],)
    sidecar_path(path).write_text(f'{worth}[channel.{names[1]}]\nunit = "m/s2"\n')
    refused(path, "holds counts, and nobody says what one is worth")


# ---------------------------------------------------------------- SEP005


def test_channels_of_other_programs_come_in_and_go_out() -> None:
    start = {"start_timestamp": "2026-05-14T10:00:00+02:00"}
    channels: list[dict[str, Any]] = [
        {"data": FORCE, "name": "hammer", "unit_str": "kN", "fs": RATE, **start},
        {"data": ACC, "name": "a1", "unit_str": "g", "fs": RATE, **start},
        {"data": ACC, "name": "strain", "unit_str": "um/m", "fs": RATE},
    ]
    found = shm.from_sep005(channels, hanger=3)
    assert [channel.name for channel in found.channels] == ["hammer", "a1"]
    assert (found.hanger, found.time) == (3, datetime(2026, 5, 14, 8, tzinfo=UTC))
    np.testing.assert_allclose(found.channels[0].values, 1e3 * FORCE)
    given = found.to_sep005()
    assert_sep005(given)
    again = shm.from_sep005(given, hanger=3)
    np.testing.assert_allclose(again.channels[1].values, found.channels[1].values)
    assert (again.time, again.sampling_rate_hz) == (found.time, found.sampling_rate_hz)
    timed = {"data": ACC, "name": "a1", "unit_str": "m/s^2", "time": np.arange(400) / RATE}
    assert shm.from_sep005(timed).sampling_rate_hz == pytest.approx(RATE)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"fs": None}, "it has no fs or time"),
        ({"data": np.zeros((2, 400))}, "no single row"),
        ({"unit_str": "mm"}, "no channel holds an acceleration"),
        ({"fs": 100.0}, "every 0.01 s"),
        ({"start_timestamp": "2026-05-15"}, "begin at different times"),
        ({"time": 2 * np.arange(400) / RATE}, f"{RATE:g}, but the times in the data give"),
        ({"time": np.arange(399) / RATE}, "400 values, its time 399"),
        ({"name": "a"}, "channel a: two channels have this name"),
        ({"hanger": 4}, r"different hanger \(3, 4\)"),
    ],
)
def test_channels_that_cannot_be_a_recording_are_refused(
    change: dict[str, Any], words: str
) -> None:
    sound = {"data": ACC, "name": "a", "unit_str": "g", "fs": RATE, "start_timestamp": "2026-05-14"}
    sound["hanger"] = 3
    several = "no channel" not in words
    with pytest.raises(BadInput, match=words) as refusal:
        shm.from_sep005([sound] * several + [{**sound, "name": "b", **change}])
    assert refusal.value.remedy


def test_sep005_times_of_channels_agree() -> None:
    times = np.arange(400) / RATE
    one = {"data": ACC, "name": "a", "unit_str": "g", "time": times}
    found = shm.from_sep005([one, {**one, "name": "b"}])
    assert found.sampling_rate_hz == pytest.approx(RATE)
    with pytest.raises(BadInput, match="time of b differs"):
        shm.from_sep005([one, {**one, "name": "b", "time": 2 * times}])


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('{"schema": "shm.modes/1"}', "a document of the kind shm.modes/1.*NAME.modes.json"),
        ('{"type": "FeatureCollection"}', "JSON, but no list of channels"),
        ("[]", "an empty list"),
        ("[[1, 2], [3, 4]]", "a channel is no dictionary"),
        ('[{"data": [0.1, -NaN]}]', "line 1: it is no sound JSON.*null"),
        ("force,acc_1\n1,2\n", "the content is CSV"),
    ],
)
def test_json_that_is_no_recording(tmp_path: Path, text: str, words: str) -> None:
    refused(written(tmp_path, text, "a.json"), words)


def test_sep005_file_with_gaps(tmp_path: Path) -> None:
    values = [float("nan"), None, *map(float, ACC[2:])]
    channel = {"name": "acc_1", "unit_str": "m/s2", "fs": RATE, "hanger": 3, "data": values}
    for document in ([channel], channel):
        found = recorded(written(tmp_path, json.dumps(document), "a.json"))
        assert np.isnan(found.channels[0].values).sum() == 2
