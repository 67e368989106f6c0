"""`shm import`: the first file of a logger is asked about once, the second needs nothing."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyuff
from scipy.io import savemat, wavfile

from shm.pipeline.intake import as_taken_in
from shm.read import read, sidecar_path
from shm.store import Stage, Workspace
from shm.store.recordings import list_recordings
from shm.values import Channel, Recording
from tests.cli.conftest import Shm
from tests.helpers.nouns import NOW
from tests.helpers.taken_in import ingest_quickly
from tests.helpers.workspaces import QUICK, make_workspace, write_test
from tests.helpers.written import write_counts

HEAD = "catman\nMessung;quer\nAbtastrate;{rate:.0f} Hz\n\nZeit [s];Kraft [N];A1 [m/s²];A2 [g]\n"
SAID = (
    "--hanger", 3, "--place", "2.52", "--place", "Kraft=1.9", "--plane", "transverse,longitudinal"
)  # fmt: skip


@pytest.fixture
def workspace(tmp_path: Path) -> Workspace:
    return make_workspace(tmp_path / "bridge", hangers=(3, 4))


@pytest.fixture
def shm(shm: Shm, workspace: Workspace) -> Shm:
    return shm.at(workspace)


@pytest.fixture
def refused(workspace: Workspace) -> Callable[[], bool]:
    """Return whether an import has kept nothing."""
    return lambda: files_of(workspace) == [] and not (workspace.folder / "loggers").exists()


def found_in(workspace: Workspace, name: str) -> Recording:
    found = read(workspace.spool / name)
    assert isinstance(found, Recording)
    return found


def abouts(document: Any) -> list[str]:
    return [question["about"] for question in document["questions"]]


def export(path: Path, seed: int = 1, columns: str = "A1") -> Path:
    """Return a German export of numbers that look like a hammer test."""
    rng = np.random.default_rng(seed)
    rate, count = 500.0, 4000
    times = np.arange(count) / rate
    ring = np.exp(-0.3 * (times % 4.0)) * np.sin(2 * np.pi * 6.0 * times)
    force = np.where(np.arange(count) % 2000 == 500, 900.0, rng.normal(0, 0.5, count))
    rows = zip(times, force, ring + rng.normal(0, 0.01, count), ring / 9.81, strict=True)
    body = "".join(";".join(f"{v:.5f}" for v in row) + "\n" for row in rows).replace(".", ",")
    head = HEAD.format(rate=rate).replace("A1", columns)
    path.write_bytes((head + body).encode("latin-1"))
    return path


def files_of(workspace: Workspace) -> list[str]:
    return sorted(path.name for path in workspace.spool.iterdir() if path.is_file())


def test_import_without_terminal(shm: Shm, refused: Callable[[], bool], tmp_path: Path) -> None:
    ended = shm("import", export(tmp_path / "a.csv"))
    assert ended.code == 3
    for word in ("Kraft", "force", "acceleration", "2 hits", "500 Hz", "█"):
        assert word in ended.out
    for option in ("--hanger N", "--place A1=M", "--plane A2=transverse|longitudinal"):
        assert option in ended.err
    assert refused()


def test_second_file_needs_nothing(shm: Shm, workspace: Workspace, tmp_path: Path) -> None:
    first = shm("import", export(tmp_path / "a.csv"), *SAID)
    assert first.code == 0
    assert f"`shm --workspace {workspace.folder} daemon --once` takes it" in first.told
    (profile,) = (workspace.folder / "loggers").iterdir()
    kept = tomllib.loads(profile.read_text())
    assert kept["hanger"] == 3
    assert kept["channel"]["A2"] == {"x_m": 2.52, "plane": "longitudinal"}
    assert kept["channel"]["Kraft"] == {"x_m": 1.9}
    second = shm("import", export(tmp_path / "b.csv", 2), "--json")
    assert second.code == 0
    assert second.document["questions"] == []
    assert second.document["hanger"] == 3
    assert files_of(workspace) == ["a.csv", "a.toml", "b.csv", "b.toml"]
    found = found_in(workspace, "b.csv")
    assert [(c.plane, c.x_m) for c in found.accelerations] == [
        ("transverse", 2.52),
        ("longitudinal", 2.52),
    ]


def test_unstated_unit_is_asked(shm: Shm, workspace: Workspace, tmp_path: Path) -> None:
    """Names such as force mean newtons in nobody's file for certain."""
    bare = tmp_path / "bare.csv"
    rows = "".join(f"{n % 7},{n % 5}\n" for n in range(100))
    bare.write_text(f"# sampling_rate_hz: 512\nforce,acc_1\n{rows}")
    said = f"import {bare} --hanger 3 --place 2.5 --plane transverse"
    asked = shm(said)
    assert asked.code == 3
    assert "In what unit is force recorded" in asked.err
    shm.done(f"{said} --unit force=N --unit acc_1=g")
    found = found_in(workspace, "bare.csv")
    assert all(channel.states_unit for channel in found.channels)


def test_later_files_are_read_by_profile(shm: Shm, workspace: Workspace, tmp_path: Path) -> None:
    shm("import", export(tmp_path / "a.csv"), *SAID)
    with as_taken_in(export(tmp_path / "b.csv", 2), workspace) as path:
        found = read(path)
    assert isinstance(found, Recording)
    assert found.accelerations[1].plane == "longitudinal"
    assert not sidecar_path(tmp_path / "b.csv").exists()
    for path in workspace.spool.iterdir():
        if path.is_file():
            path.unlink()
    export(workspace.spool / "later.csv", 3)
    sidecar_path(workspace.spool / "later.csv").write_text("temperature_c = 4.5\n")
    ingest_quickly(workspace)
    with workspace.store() as store:
        (stored,) = list_recordings(store)
        with workspace.archive.opened(stored.file) as path:
            found = read(path)
    assert isinstance(found, Recording)
    assert (found.hanger, found.temperature_c) == (3, 4.5)
    assert found.accelerations[0].plane == "transverse"
    assert files_of(workspace) == []


def test_unknown_logger_is_refused(workspace: Workspace) -> None:
    export(workspace.spool / "first.csv")
    ingest_quickly(workspace)
    with workspace.store() as store:
        (stored,) = list_recordings(store)
    assert stored.stage is Stage.REFUSED
    assert stored.reason is not None
    assert "shm import FILE" in stored.reason["remedy"]


def test_roaming_logger_is_asked(shm: Shm, workspace: Workspace, tmp_path: Path) -> None:
    shm("import", export(tmp_path / "a.csv"), *SAID)
    other = export(tmp_path / "b.csv", 2)
    moved = shm("import", other, "--hanger", 4)
    assert moved.code == 0
    assert "each file must say its own" in moved.out
    third = shm("import", export(tmp_path / "c.csv", 3), "--json")
    assert third.code == 3
    assert abouts(third.document) == ["hanger"]
    named = export(tmp_path / "haenger_03_c.csv", 4)
    assert shm("import", named).code == 0


def test_wrong_answer_is_refused(shm: Shm, refused: Callable[[], bool], tmp_path: Path) -> None:
    """Also a place off the hanger; a dry run keeps nothing either."""
    path = export(tmp_path / "a.csv")
    for more, code, words in (
        ("--place 1,2,3", 2, "3 values for 2 channels"),
        ("--place 1,2,3", 2, "Give one each, in this order: A1, A2. Name any other column,"),
        ("--place 1,2,3", 2, "--place Kraft=..."),
        ("--plane up", 2, "'up' is no plane"),
        ("--place A9=1", 2, "no column 'A9'"),
        ("--unit A1=V", 2, "no unit that is read"),
        ("--sensitivity A1=much", 2, "no sensitivity"),
        ("--rate 0", 2, "no rate"),
        ("--place 2.52 --plane transverse,longitudinal --hanger 9", 4, "hanger 9 is not described"),
        ("--hanger 3 --place 22 --plane transverse,longitudinal", 3,
         "A1: it is said to be at 22 m from the deck end"),
    ):  # fmt: skip
        ended = shm(f"import {path} {more}")
        assert ended.code == code
        assert words in ended.err + ended.out
        assert refused()
    shm.done("import", path, *SAID, "--dry-run")
    assert refused()


def test_volts_are_asked_for_worth(shm: Shm, workspace: Workspace, tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    path = tmp_path / "tape.wav"
    wavfile.write(path, 1000, (rng.normal(0, 0.1, (3000, 2)) * 32767).astype(np.int16))
    asked = shm("import", path, "--json").document
    assert abouts(asked) == ["hanger", "unit", "unit"]
    shm.done(
        f"import {path} --hanger 3 --sensitivity 'channel_1=2000 N' --sensitivity "
        "'channel_2=50 g' --place 2.52 --plane transverse"
    )
    found = found_in(workspace, "tape.wav")
    assert [c.quantity for c in found.channels] == ["force", "acceleration"]
    assert np.std(found.channels[0].values) == pytest.approx(200, rel=0.05)


def test_bare_table_is_read(shm: Shm, workspace: Workspace, tmp_path: Path) -> None:
    rows = np.random.default_rng(1).normal(0, 1, (3000, 3))
    rows[:, 0] = np.arange(3000) / 512
    path = tmp_path / "table.mat"
    savemat(str(path), {"data": rows})
    told = f"import {path} --hanger 3 --unit data_1=s --unit data_2=N --unit data_3=g"
    asked = shm(f"{told} --json").document
    assert abouts(asked) == ["place", "place", "plane"]
    assert asked["sampling_rate_hz"] == pytest.approx(512)
    shm.done(f"{told} --place 2.52 --plane transverse")
    found = found_in(workspace, "table.mat")
    assert (found.samples, found.sampling_rate_hz) == (3000, pytest.approx(512))


def test_counts_are_asked_for_worth(shm: Shm, workspace: Workspace, tmp_path: Path) -> None:
    rows = np.random.default_rng(1).normal(0, 1e5, (2, 3000))
    path = tmp_path / "night.mseed"
    channels = (Channel("acc_1", "acceleration", rows[0]),)
    write_counts(path, rows, Recording("", channels, 200.0, None, NOW))
    asked = shm("import", path, "--json").document
    assert abouts(asked) == ["hanger", "unit", "unit"]
    assert "What is one count of XX_HGR3_00_HN1 worth" in asked["questions"][1]["text"]
    shm.done(
        f"import {path} --hanger 3 --sensitivity 'XX_HGR3_00_HN1=2e-6 m/s2' --sensitivity "
        "'XX_HGR3_00_HN2=1e-4 mg' --place 2.52 --plane transverse,longitudinal"
    )
    found = found_in(workspace, "night.mseed")
    assert np.allclose(found.channels[0].values, 2e-6 * np.round(rows[0]), rtol=1e-9)


def test_modes_of_another_program(shm: Shm, workspace: Workspace, tmp_path: Path) -> None:
    path = modes_file(tmp_path / "m.uff")
    asked = shm("import", path, "--json")
    assert asked.code == 3
    assert abouts(asked.document) == ["hanger", "plane", "plane"]
    planes = "x=transverse,y=longitudinal"
    ended = shm("import", path, "--hanger", 3, "--plane", planes)
    assert ended.code == 0
    ingest_quickly(workspace)
    with workspace.store() as store:
        (test,) = (stored.test for stored in store.tests.list_all(3))
    found = [(mode.plane, mode.order, mode.frequency_hz) for mode in test.modes]
    assert found == [
        ("transverse", 1, 6.1), ("longitudinal", 1, 6.3), ("transverse", 2, 13.0),
        ("longitudinal", 2, 13.2),
    ]  # fmt: skip
    assert all(np.isnan(mode.frequency_sd_hz) for mode in test.modes)
    assert test.modes[0].damping_ratio == pytest.approx(0.004)
    assert [point.x_m for point in test.modes[0].shape] == [2.0, 4.0, 6.0, 8.0, 10.0]
    again = shm("import", path)
    assert again.code == 0


def modes_file(path: Path, with_nodes: bool = True) -> Path:
    """Two modes in each of two planes, with the nodes along z."""
    places = np.array([2.0, 4.0, 6.0, 8.0, 10.0])
    nodes = np.arange(1, 6)
    zeros = np.zeros(5)
    sets: list[dict[str, Any]] = [
        {
            "type": 2411, "node_nums": nodes, "def_cs": zeros, "disp_cs": zeros, "color": zeros,
            "x": zeros, "y": zeros, "z": places,
        }
    ]  # fmt: skip
    for number, (frequency, axis) in enumerate([(6.1, 1), (6.3, 2), (13.0, 1), (13.2, 2)], start=1):
        shape = np.sin((number + 1) // 2 * np.pi * places / 12)
        sets.append(
            {
                "type": 55, "id1": "Modal 7", "id2": "", "id3": "", "id4": "", "id5": "",
                "model_type": 1, "analysis_type": 2, "data_ch": 2, "spec_data_type": 8,
                "data_type": 2, "n_data_per_node": 3, "node_nums": nodes, "load_case": 1,
                "r1": shape if axis == 1 else zeros, "r2": shape if axis == 2 else zeros,
                "r3": zeros, "mode_n": number, "freq": frequency, "modal_m": 1.0,
                "modal_damp_vis": 0.004, "modal_damp_his": 0.0,
            }
        )  # fmt: skip
    pyuff.UFF(str(path)).write_sets(sets[not with_nodes :], mode="add")
    return path


def bare_export(path: Path, seed: int = 1, decimals: int = 6) -> Path:
    """Write the numbers of a logger that writes no heading at all, times first."""
    rng = np.random.default_rng(seed)
    count = 4000
    force = np.where(np.arange(count) % 2000 == 500, 900.0, rng.normal(0, 0.5, count))
    rows = zip(np.arange(count) / 512, force, rng.normal(0, 1, count), strict=True)
    path.write_text("".join(f"{t:.{decimals}f},{f:.4f},{a:.5f}\n" for t, f, a in rows))
    return path


def test_import_file_without_heading(shm: Shm, tmp_path: Path) -> None:
    """Its first column is rounded, and yet its times; what is asked once the next file knows."""
    units = "--unit column_2=N --unit column_3=m/s2"
    said = f"{units} --hanger 3 --place 2.52 --plane transverse"
    document = shm.json(f"import {bare_export(tmp_path / 'a.csv')} {said}")
    assert document["sampling_rate_hz"] == pytest.approx(512, rel=1e-5)
    (found,) = shm.json("ingest", "--peek", bare_export(tmp_path / "b.csv", 2))["files"]
    assert found["sampling_rate_hz"] == pytest.approx(512, rel=1e-5)
    assert [channel["name"] for channel in found["channels"]] == ["column_2", "column_3"]


def test_import_column_in_seconds(shm: Shm, workspace: Workspace, tmp_path: Path) -> None:
    """What the import accepts is read: a column that a person calls times is no channel."""
    file = bare_export(tmp_path / "a.csv")
    file.write_text("ticks,b,c\n" + file.read_text())
    units = "--unit ticks=s --unit b=N --unit c=m/s2"
    shm.done(f"import {file} {units} --hanger 3 --place 2.52 --plane transverse")
    found = found_in(workspace, "a.csv")
    assert [channel.name for channel in found.channels] == ["b", "c"]
    assert found.sampling_rate_hz == pytest.approx(512, rel=1e-5)


def test_example_of_init_is_doubted(shm: Shm, tmp_path: Path) -> None:
    folder = tmp_path / "arch"
    at_example = shm.at(folder)
    at_example.done("init", folder)
    doubt = "Hanger 3 is still the example that `shm init` wrote: do not use its tension."
    action = "Replace its numbers and its name in bridge.toml by those of your bar today."
    imported = at_example("import", export(tmp_path / "a.csv"), *SAID, "--dry-run")
    assert f"note: {doubt} {action}" in imported.told
    workspace = Workspace.open(folder)
    settings = "[settings]\n" + "".join(f"{k} = {json.dumps(v)}\n" for k, v in QUICK.items())
    described = folder / "bridge.toml"
    described.write_text(described.read_text().replace("[settings]\n", settings, 1))
    write_test(workspace.spool / "t1.modes.json", workspace)
    ingest_quickly(workspace)
    assert at_example.told("report", "--hanger", 3).count(doubt) == 1
    assert f"{doubt} {action}" in at_example.told("status")
    assert at_example.json("status")["hangers"][0]["state"] == doubt
    assert doubt.split(": ")[0] in at_example("doctor").told
    described.write_text(described.read_text().replace("example: replace by your own", "north"))
    for verb in ("report --hanger 3", "status", "doctor"):
        assert "is still the example" not in at_example(verb).told
