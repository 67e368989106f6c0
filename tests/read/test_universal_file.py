from __future__ import annotations

import struct
import warnings
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyuff

from shm.errors import BadInput
from shm.read import peek, read, sidecar_path, write
from shm.read.registry import survey
from shm.values import FloatArray, FrequencyResponse, Recording
from tests.helpers.written import recorded, refused, responded

POINTS = 64


def time_set(unit: str, code: int, node: int, direction: int, **more: Any) -> dict[str, Any]:
    """Return a time history as other software writes it."""
    values = np.random.default_rng(node).standard_normal(POINTS)
    return {
        "type": 58, "func_type": 1, "rsp_node": node, "rsp_dir": direction, "ref_node": 0,
        "ref_dir": 0, "abscissa_spacing": 1, "abscissa_spec_data_type": 17,
        "ordinate_spec_data_type": code, "ordinate_axis_units_lab": unit,
        "orddenom_spec_data_type": 0, "x": np.arange(POINTS) / 512, "data": values, **more,
    }  # fmt: skip


def test_sets_without_a_unit_are_what_the_sidecar_says(tmp_path: Path) -> None:
    path = tmp_path / "test.uff"
    bare = [
        time_set("NONE", 0, node, 3, func_type=0, id1=f"Ch{node}", ordinate_axis_lab="NONE")
        for node in (1, 2, 3)
    ]
    pyuff.UFF(str(path)).write_sets(bare, mode="add")
    look = peek(path)
    assert (look.samples, look.sampling_rate_hz) == (POINTS, 512)
    assert survey(path).columns[1].name == "Ch2"
    sidecar_path(path).write_text('[channel.Ch1]\nunit = "kN"\n[channel.Ch3]\nunit = "g"\n')
    found = recorded(path)
    assert [(c.name, c.quantity) for c in found.channels] == [
        ("Ch1", "force"), ("Ch3", "acceleration"),
    ]  # fmt: skip
    np.testing.assert_allclose(found.channels[0].values, 1e3 * bare[0]["data"], rtol=1e-5)


def frf_set(node: int, hammer: int, **more: Any) -> dict[str, Any]:
    rng = np.random.default_rng(100 * node + hammer)
    return {
        "type": 58, "func_type": 4, "rsp_node": node, "rsp_dir": 3, "ref_node": hammer,
        "ref_dir": 3, "abscissa_spacing": 1, "abscissa_spec_data_type": 18,
        "ordinate_spec_data_type": 12, "orddenom_spec_data_type": 13,
        "x": 0.25 * np.arange(POINTS),
        "data": rng.standard_normal(POINTS) + 1j * rng.standard_normal(POINTS), **more,
    }  # fmt: skip


def uff(folder: Path, *sets: dict[str, Any], name: str = "test.uff") -> Path:
    path = folder / name
    pyuff.UFF(str(path)).write_sets([dict(one) for one in sets], mode="add")
    return path


def binary_set(values: FloatArray, code: int, unit: str, node: int, order: str = "<") -> bytes:
    """Return a 58b data set in single precision, as analysers write it."""
    data = struct.pack(f"{order}{len(values)}f", *values)
    head = [
        "    -1",
        f"    58b{1 if order == '<' else 2:6d}{2:6d}{11:12d}{len(data):12d}" + "     0" * 2,
        "Hammer", "NONE", "08-Oct-24 10:27:07", "NONE", "NONE",
        f"{1:5d}{0:10d}{0:5d}{0:10d} {'NONE':>10}{node:10d}{3:4d} {'NONE':>10}{0:10d}{0:4d}",
        f"{2:10d}{len(values):10d}{1:10d}{0:13.5e}{1 / 512:13.5e}{0:13.5e}",
        f"{17:10d}{0:5d}{0:5d}{0:5d} {'Time':<20} {'s':<20}",
        f"{code:10d}{0:5d}{0:5d}{0:5d} {'NONE':<20} {unit:<20}",
        f"{0:10d}{0:5d}{0:5d}{0:5d} {'NONE':<20} {'NONE':<20}",
        f"{0:10d}{0:5d}{0:5d}{0:5d} {'NONE':<20} {'NONE':<20}",
    ]  # fmt: skip
    return "\r\n".join([*head, ""]).encode() + data + b"    -1\r\n"


FORCE = time_set("N", 13, 1, 2)
ACCELERATION = time_set("m/s2", 12, 2, 2)


def test_a_file_of_others_gets_plain_names_and_says_nothing_it_does_not_know(
    tmp_path: Path,
) -> None:
    tacho = time_set("rpm", 16, 9, 0, ordinate_axis_lab="Tacho")
    path = uff(tmp_path, ACCELERATION, tacho, FORCE, time_set("g", 12, 2, -3))
    found = recorded(path)
    assert [c.name for c in found.channels] == ["acc_1", "force", "acc_2"]
    assert all(c.plane is None and np.isnan(c.x_m) for c in found.channels)
    assert (found.hanger, found.time, found.sampling_rate_hz) == (None, None, 512.0)
    np.testing.assert_allclose(found.channels[0].values, ACCELERATION["data"], rtol=1e-9)
    told = peek(path)
    assert [c.unit for c in told.channels] == ["m/s2", "N", "g"]
    assert (told.problems, told.left_out) == ((), ("data set 2 (Tacho)",))


def test_units_become_si_and_negative_directions_turn_the_sign(tmp_path: Path) -> None:
    turned = time_set("g", 12, 2, -3)
    found = recorded(uff(tmp_path, time_set("kN", 13, 1, 3), turned))
    np.testing.assert_allclose(found.channels[0].values, 1e3 * time_set("kN", 13, 1, 3)["data"])
    np.testing.assert_allclose(found.channels[1].values, -9.80665 * turned["data"])


def test_the_type_says_what_is_measured_where_no_unit_does(tmp_path: Path) -> None:
    path = uff(tmp_path, time_set("NONE", 13, 1, 1), time_set("m/s2", 12, 2, 1))
    found = recorded(path)
    assert [(c.quantity, c.states_unit) for c in found.channels] == [
        ("force", False), ("acceleration", True),
    ]  # fmt: skip


def test_the_date_of_the_run_is_read_as_utc(tmp_path: Path) -> None:
    dated = [{**one, "id3": "08-Oct-24 10:27:07"} for one in (FORCE, ACCELERATION)]
    assert peek(uff(tmp_path, *dated)).time == datetime(2024, 10, 8, 10, 27, 7, tzinfo=UTC)


@pytest.mark.parametrize("date", ["sometime", "31-Feb-24 10:00:00", "1-May-26 noon", "-May-"])
def test_a_date_that_is_none_is_left_unknown(tmp_path: Path, date: str) -> None:
    assert peek(uff(tmp_path, {**FORCE, "id3": date}, ACCELERATION)).time is None


@pytest.mark.parametrize("rate", [512, 2048, 51200, 65536, 4096, 100])
def test_a_whole_rate_is_read_through_the_six_digits_of_its_step(tmp_path: Path, rate: int) -> None:
    x = np.arange(POINTS) / rate
    found = recorded(uff(tmp_path, {**FORCE, "x": x}, {**ACCELERATION, "x": x}))
    assert found.sampling_rate_hz == rate


def test_an_abscissa_that_lists_every_value_gives_the_rate_too(tmp_path: Path) -> None:
    listed = [{**one, "abscissa_spacing": 0} for one in (FORCE, ACCELERATION)]
    path = uff(tmp_path, *listed)
    assert peek(path).sampling_rate_hz == pytest.approx(512, rel=1e-4)
    found = recorded(path)
    np.testing.assert_allclose(found.channels[1].values, ACCELERATION["data"], rtol=1e-9)


@pytest.mark.parametrize("order", ["<", ">"])
def test_binary_data_sets_are_read_in_both_byte_orders(tmp_path: Path, order: str) -> None:
    values = np.random.default_rng(2).standard_normal((2, 333)).astype(np.float32).astype(float)
    path = tmp_path / "test.uff"
    path.write_bytes(
        binary_set(values[0], 13, "N", 1, order) + binary_set(values[1], 12, "m/s2", 2, order)
    )
    found = recorded(path)
    np.testing.assert_array_equal([c.values for c in found.channels], values)
    assert (peek(path).samples, found.sampling_rate_hz) == (333, 512.0)


def test_responses_to_one_hammer_point_stand_where_they_were_measured(tmp_path: Path) -> None:
    sets = [frf_set(node, 7) for node in (1, 2, 3)]
    found = responded(uff(tmp_path, *sets))
    assert [point.name for point in found.points] == ["point_1", "point_2", "point_3"]
    np.testing.assert_allclose(found.frequency_hz, sets[0]["x"])
    np.testing.assert_allclose(found.accelerance, [one["data"] for one in sets], rtol=1e-9)
    assert found.coherence is None


def test_a_roving_hammer_gives_points_where_it_hit(tmp_path: Path) -> None:
    sets = [frf_set(4, hammer) for hammer in (1, 2, 3)]
    path = uff(tmp_path, *sets)
    sidecar_path(path).write_text(
        'hanger = 5\nplane = "transverse"\n[channel.point_2]\nx_m = 0.25\n'
    )
    found = responded(path)
    assert [point.plane for point in found.points] == ["transverse"] * 3
    assert (found.points[1].x_m, found.hanger, peek(path).hanger) == (0.25, 5, 5)
    np.testing.assert_allclose(found.accelerance, [one["data"] for one in sets], rtol=1e-9)


def test_accelerance_in_g_over_lbf_becomes_si_and_direction_turns_the_sign(tmp_path: Path) -> None:
    one = frf_set(1, 7, ordinate_axis_units_lab="g", orddenom_axis_units_lab="lbf", ref_dir=-3)
    found = responded(uff(tmp_path, one))
    expected = -one["data"] * 9.80665 / 4.4482216152605
    np.testing.assert_allclose(found.accelerance[0], expected, rtol=1e-9)


def test_responses_of_ours_under_one_name_are_refused(
    response: FrequencyResponse, tmp_path: Path
) -> None:
    path = tmp_path / "test.uff"
    write(replace(response, points=(response.points[0], response.points[0])), path)
    refused(path, "several frequency responses have one name")


@pytest.mark.parametrize("step", ["a_lot", "77", "nan"])
def test_a_step_of_ours_that_contradicts_the_abscissa_is_not_believed(
    response: FrequencyResponse, tmp_path: Path, step: str
) -> None:
    path = tmp_path / "test.uff"
    write(response, path)
    text = path.read_text()
    assert "frequency_step_hz=0.01953125" in text
    path.write_text(text.replace("step_hz=0.01953125", f"step_hz={step}"))
    found = responded(path)
    np.testing.assert_allclose(found.frequency_hz, response.frequency_hz, rtol=1e-5)


def test_time_histories_go_before_the_responses_made_of_them(tmp_path: Path) -> None:
    assert isinstance(read(uff(tmp_path, frf_set(1, 7), FORCE, ACCELERATION)), Recording)
    alone = uff(tmp_path, frf_set(1, 7), ACCELERATION, name="alone.uff")
    assert isinstance(read(alone), FrequencyResponse)


@pytest.mark.parametrize(
    ("sets", "words"),
    [
        ([time_set("furlong", 12, 1, 1), FORCE], "unit 'furlong' is not one of acceleration"),
        ([FORCE, ACCELERATION, {**ACCELERATION, "x": np.arange(POINTS) / 100}], "every 0.01 s"),
        ([FORCE, {**ACCELERATION, "x": np.zeros(POINTS)}], "every 0 s"),
        ([{**one, "x": np.zeros(POINTS)} for one in (FORCE, ACCELERATION)], "rate is missing"),
        ([FORCE, ACCELERATION, FORCE, ACCELERATION], "several of one sensor"),
        ([FORCE, ACCELERATION, {**FORCE, "id1": "hit 2"}], "several of one sensor"),
        ([{**FORCE, "abscissa_spacing": 0, "x": np.arange(POINTS) ** 2.0}], "uneven abscissa"),
        ([frf_set(1, 2), frf_set(2, 1)], "2 hammer points and 2 sensors"),
        ([frf_set(1, 7), frf_set(2, 7, x=np.arange(POINTS) * 1.0)], "other frequencies"),
        ([frf_set(1, 7, x=0.1 + 0.25 * np.arange(POINTS))], "even grid from 0"),
        ([frf_set(1, 7, ordinate_spec_data_type=8)], "not an acceleration over a force"),
        ([frf_set(1, 7, ordinate_axis_units_lab="mm")], "in mm over no unit"),
        ([{"type": 15, "node_nums": [1], "def_cs": [0], "disp_cs": [0], "color": [0],
           "x": [0.0], "y": [0.0], "z": [0.0]}], "no channel holds an acceleration"),
    ],
)  # fmt: skip
def test_what_cannot_be_used_is_refused_with_a_remedy(
    tmp_path: Path, sets: list[dict[str, Any]], words: str
) -> None:
    refusal = refused(uff(tmp_path, *sets), words)
    assert refusal.where.startswith("test.uff")


def damaged(tmp_path: Path, old: str, new: str, *, times: int = 1) -> Path:
    path = uff(tmp_path, FORCE, ACCELERATION)
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, times))
    return path


def first_line_of_data(path: Path) -> str:
    return path.read_text().splitlines()[13]


def test_a_lost_line_of_data_is_noticed_and_its_data_set_named(tmp_path: Path) -> None:
    lost = first_line_of_data(uff(tmp_path, FORCE, ACCELERATION, name="whole.uff")) + "\n"
    refused(damaged(tmp_path, lost, ""), "data set 1 holds 60 values where its header says 64")


def test_a_number_that_is_none_is_refused_with_the_line_of_its_data_set(tmp_path: Path) -> None:
    whole = uff(tmp_path, FORCE, ACCELERATION, name="whole.uff").read_text().splitlines()
    last = whole[-2]
    begins = len(whole) // 2 + 1
    refusal = refused(
        damaged(tmp_path, last, last.replace("e", "x", 1)), "data set 2 cannot be read"
    )
    assert refusal.line == begins


def test_a_file_that_ends_within_a_data_set_is_refused(tmp_path: Path) -> None:
    path = uff(tmp_path, FORCE, ACCELERATION)
    path.write_bytes(path.read_bytes()[:-400])
    begun = tmp_path / "begun.uff"
    begun.write_bytes(uff(tmp_path, FORCE, name="whole.uff").read_bytes() + b"    -1\n")
    refused(begun, "ends within a data set")
    for verb in (read, peek):
        with pytest.raises(BadInput, match="ends within a data set") as refusal:
            verb(path)
        assert refusal.value.line == len(path.read_bytes().split(b"\n"))


def test_floating_point_formats_of_old_machines_are_refused(tmp_path: Path) -> None:
    raw = binary_set(np.ones(20), 13, "N", 1).replace(f"{1:6d}{2:6d}{11:12d}".encode(),
                                                     f"{1:6d}{3:6d}{11:12d}".encode())  # fmt: skip
    (tmp_path / "test.uff").write_bytes(raw)
    refused(tmp_path / "test.uff", "not IEEE 754")


def test_our_files_are_plain_to_other_software(recording: Recording, tmp_path: Path) -> None:
    path = tmp_path / "test.uff"
    write(recording, path)
    nodes, force, first, second = pyuff.UFF(str(path)).read_sets()
    assert (nodes["type"], list(nodes["x"])) == (2411, [1.92, 2.52])
    assert [one["ordinate_spec_data_type"] for one in (force, first, second)] == [13, 12, 12]
    assert [one["ordinate_axis_units_lab"] for one in (force, first, second)] == ["N"] + [
        "m/s2"
    ] * 2
    assert [(one["rsp_node"], one["rsp_dir"]) for one in (force, first, second)] == [
        (1, 0), (2, 2), (2, 3),
    ]  # fmt: skip
    assert force["id3"] == "01-May-26 10:00:30"
    assert all(len(line) <= 80 for line in path.read_text().splitlines())


def test_the_sidecar_is_there_before_the_file(
    recording: Recording, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[bool] = []
    whole = Path.replace

    def noting(self: Path, target: Path) -> Path:
        seen.append(sidecar_path(tmp_path / "test.uff").exists())
        return whole(self, target)

    monkeypatch.setattr(Path, "replace", noting)
    write(recording, tmp_path / "test.uff")
    assert seen == [False, True]


def test_no_warning_escapes(tmp_path: Path) -> None:
    path = damaged(tmp_path, "1.95312e-03", "1.95312e300", times=2)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(BadInput):
            read(path)
