"""`simulate`, `acquire`, `demo` make recordings up; `identify` and `predict` give frequencies."""

from __future__ import annotations

import zipfile
from datetime import UTC, datetime, timedelta
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from shm import acquire
from shm.bridge import load_hanger
from shm.bridge.description import load_bridge
from shm.errors import NothingThere
from shm.identify import IdentifyOptions
from shm.models import THESIS, build
from shm.modes_document import load_modes
from shm.read import read, read_test
from shm.values import Recording
from shm_cli import demo
from shm_cli.main import run
from tests.cli.conftest import Shm
from tests.helpers.painting import unpaint
from tests.helpers.workspaces import make_workspace

SHORT = ("--hits", "3", "--seconds", "8")


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory, hanger_file: Path) -> Path:
    folder = tmp_path_factory.mktemp("recording")
    planted = ("--tension-n", "650e3", "--k1", "1e7", "--k3", "1e7", "--temperature-c", "7.5")
    call = ["simulate", "--hanger-file", str(hanger_file), *planted, *SHORT, "--out", str(folder)]
    assert run(call) == 0
    (path,) = folder.glob("*.csv")
    return path


def test_identified_frequencies_are_planted(shm: Shm, recording: Path, hanger_file: Path) -> None:
    """Transverse ends on springs of 1e7 N m/rad, longitudinal ends clamped, 650 kN."""
    ended = shm("identify", recording, "--hanger-file", hanger_file, "--json")
    assert ended.code == 0, ended.err
    assert ended.document["schema"] == "shm.modes/1"
    assert ended.document["hanger"] == 3
    (test,) = ended.document["tests"]
    assert test["temperature_c"] == 7.5
    truth = build("beam2", load_hanger(hanger_file), THESIS).frequencies_hz(
        np.array([[650 / 711, 1, 7, 15, 7, 15]]), 8
    )[0]
    planes = ("transverse", "longitudinal")
    for mode in test["modes"]:
        exact = truth[planes.index(mode["plane"]), mode["order"] - 1]
        assert mode["frequency_hz"] == pytest.approx(exact, rel=2e-3)
    assert len(test["modes"]) >= 8


def test_identify_names_columns_left_out(shm: Shm, recording: Path, tmp_path: Path) -> None:
    """A force in percent is of no use, but nobody should believe that it was used."""
    found = read(recording)
    assert isinstance(found, Recording)
    heads = ["Time [s]", "force [%]", *(f"{c.name} [m/s2]" for c in found.accelerations)]
    values = np.array([np.arange(found.samples) / 512, *(c.values for c in found.channels)])
    path = tmp_path / "percent.csv"
    np.savetxt(path, values.T, "%.6g", ";", header=";".join(heads), comments="")
    assert "Left out of percent.csv: force." in shm("identify", path).said


def test_identify_writes_document(
    shm: Shm, recording: Path, hanger_file: Path, tmp_path: Path
) -> None:
    out = tmp_path / "t.modes.json"
    ended = shm("identify", recording, "--hanger-file", hanger_file, "--out", out)
    assert "frequency, Hz" in ended.out
    assert load_modes(out)[0].hanger == 3


def test_a_page_and_figures_let_a_person_check_the_modes(
    shm: Shm, recording: Path, hanger_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    unpaint(monkeypatch)
    page, figures = tmp_path / "sheet.html", tmp_path / "figures"
    ask = ("--hanger-file", hanger_file, "--html", page)
    ended = shm("identify", recording, *ask, "--cross-check", "ssi", "--figures", figures, "--json")
    assert ended.code == 0, ended.err
    (test,) = ended.document["tests"]
    checks = {check["name"]: check["verdict"] for check in test["quality"]}
    assert checks["cross-check"] == checks["noise"] == "good"
    assert page.read_text(encoding="utf-8").startswith("<!doctype html>")
    drawn = {path.stem.rpartition("-")[2] for path in figures.glob("*.png")}
    assert drawn >= {"time_history", "hits", "response", "stabilisation", "shapes"}


@pytest.mark.slow
def test_sds_hold_allowance(shm: Shm, recording: Path, hanger_file: Path) -> None:
    def sds(*allowance: object) -> list[float]:
        ask = ("--hanger-file", hanger_file, "--cross-check", "none", *allowance, "--json")
        (test,) = shm("identify", recording, *ask).document["tests"]
        return [mode["frequency_sd_hz"] / mode["frequency_hz"] for mode in test["modes"]]

    alone, more = sds("--frequency-allowance", 0), sds("--frequency-allowance", 0.001)
    assert more == pytest.approx(np.hypot(alone, 0.001))
    assert min(sds()) >= 1e-4


def test_seed_repeats_files(shm: Shm, hanger_file: Path, tmp_path: Path) -> None:
    for folder, seed in (("a", 1), ("b", 1), ("c", 2)):
        shm(
            "simulate", "--hanger-file", hanger_file, *SHORT, "--seed", seed,
            "--out", tmp_path / folder, "--first", "2026-03-01",
        )  # fmt: skip
    first, again, other = (next((tmp_path / name).iterdir()).read_bytes() for name in "abc")
    assert first == again
    assert first != other


def test_tests_are_a_week_apart(shm: Shm, hanger_file: Path, tmp_path: Path) -> None:
    ended = shm(
        "simulate", "--hanger-file", hanger_file, "--hits", 1, "--seconds", 2, "--tests", 2,
        "--format", "uff", "--out", tmp_path, "--first", "2026-03-01",
    )  # fmt: skip
    assert ended.code == 0, ended.err
    paths = sorted(tmp_path.glob("*.uff"))
    assert [str(path) for path in paths] == ended.out.split()
    records = [read(path) for path in paths]
    assert all(isinstance(record, Recording) and record.hanger == 3 for record in records)
    assert records[0].time is not None
    assert records[1].time is not None
    assert (records[1].time - records[0].time).days == 7


def test_file_of_another_hanger(
    shm: Shm, recording: Path, hanger_file: Path, tmp_path: Path
) -> None:
    other = tmp_path / "H.toml"
    other.write_text(hanger_file.read_text().replace("id = 3", "id = 8"))
    ended = shm("identify", recording, "--hanger-file", other)
    assert ended.code == 3
    assert "says hanger 3, the description is of hanger 8" in ended.err


@pytest.mark.slow
def test_file_without_hanger(shm: Shm, recording: Path, hanger_file: Path, tmp_path: Path) -> None:
    nameless = tmp_path / "nameless.csv"
    lines = recording.read_text().splitlines(keepends=True)
    nameless.write_text("".join(line for line in lines if not line.startswith("# hanger")))
    assert shm("identify", nameless, "--json").document["hanger"] is None
    known = shm("identify", nameless, "--hanger-file", hanger_file, "--json")
    assert known.document["hanger"] == 3
    both = shm("identify", nameless, recording)
    assert both.code == 2
    assert "several hangers (3, none)" in both.err


def test_identify_passes_every_choice(
    shm: Shm, recording: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[IdentifyOptions] = []

    def stop(group: object, hanger: object, options: IdentifyOptions, _: object) -> None:
        seen.append(options)
        raise NothingThere("seen.", remedy="None.")

    monkeypatch.setattr("shm_cli.identify._identified", stop)
    shm(
        "identify", recording, "--band", 3, 70, "--identifier", "pyoma2", "--cross-check", "ssi",
        "--estimator", "hv", "--reference-force", 500, "--frequency-allowance", 0.002, "--mains",
        60, "--window", 1.5,
    )  # fmt: skip
    expected = IdentifyOptions(
        band_low_hz=3, band_high_hz=70, identifier="pyoma2", cross_check="ssi", estimator="hv",
        reference_force_n=500, frequency_allowance=0.002, mains_hz=60, window_time_constant_s=1.5,
    )  # fmt: skip
    assert seen == [expected]


HIT = ("--hammer", "1.9:transverse:5000", "--sensor", "2.52:transverse:400",
       "--sensor", "4.4:transverse:400", "--seconds", "8", "--most-hits", "4")  # fmt: skip


@pytest.fixture
def described(shm: Shm, hanger_file: Path) -> tuple[str, ...]:
    return ("acquire", "--hanger-file", str(hanger_file), *HIT)


def test_acquired_test_is_ingested(shm: Shm, described: tuple[str, ...], tmp_path: Path) -> None:
    out = tmp_path / "test.zip"

    ended = shm(*described, "--device", "simulated", "--out", out, "--temperature-c", 8, "--json")

    assert ended.code == 0, ended.err
    assert ended.document["schema"] == "shm.acquire/1"
    assert ended.document["is_enough"]
    assert len(ended.document["rejected"]) == 2
    for words in ("hit now", "Double hit", "Overload", "noise"):
        assert words in ended.err
    records = read_test(out)
    assert len(records) == ended.document["hits"] == 3
    assert {(each.hanger, each.temperature_c) for each in records} == {(3, 8.0)}
    workspace = make_workspace(tmp_path / "bridge", settings={"models": "beam2"})
    at = ("--workspace", workspace.folder)
    assert shm(*at, "ingest", out).code == 0
    (row,) = shm(*at, "status", "--json").document["hangers"]
    tension = row["averaged"]["tension_n"]
    assert tension["q05"] < 711e3 < tension["q95"]


def test_acquire_lost_keeps_file(
    shm: Shm, described: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "test.zip"
    vanishing = partial(acquire.SimulatedDevice, lost_s=15.0)
    monkeypatch.setattr(acquire, "SimulatedDevice", vanishing)

    ended = shm(*described, "--device", "simulated", "--out", out)

    assert ended.code == 3
    assert "1 hit is kept in" in ended.err
    with zipfile.ZipFile(out) as archive:
        assert archive.namelist() == ["hit01.csv"]


STIFF = [part for k in range(1, 5) for part in ("--set", f"log10_k{k}=12")]


def test_the_document_holds_the_frequencies_of_the_model(shm: Shm, hanger_file: Path) -> None:
    ended = shm(
        "predict", "beam1", "--hanger-file", hanger_file, "--set", "theta_F=1.1",
        "--set", "theta_L=0.97", "--modes", 4, "--json",
    )  # fmt: skip
    assert ended.code == 0
    assert ended.document["model"] == "beam1"
    rows = ended.document["frequencies"]
    assert [(row["plane"], row["order"]) for row in rows] == [
        (plane, order) for plane in ("transverse", "longitudinal") for order in (1, 2, 3, 4)
    ]
    model = build("beam1", load_hanger(hanger_file), THESIS)
    exact = model.frequencies_hz(np.array([[1.1, 0.97]]), 4)[0]
    assert [row["frequency_hz"] for row in rows] == pytest.approx(exact.ravel())


def test_predict_sweep_has_a_row_a_value_and_a_column_a_mode(shm: Shm, hanger_file: Path) -> None:
    ended = shm(
        "predict", "beam2", "--hanger-file", hanger_file, *STIFF,
        "--sweep", "theta_F=0.5:2:4", "--json",
    )  # fmt: skip
    points = ended.document["points"]
    assert [point["theta_F"] for point in points] == [0.5, 1.0, 1.5, 2.0]
    first = [point["frequencies"][0]["frequency_hz"] for point in points]
    assert first == sorted(first)
    told = shm("predict", "beam1", "--hanger-file", hanger_file, "--sweep", "theta_L=0.9:1:2").out
    assert "T1" in told
    assert "L6" in told


NOW = datetime(2026, 9, 10, 13, 25, tzinfo=UTC)


def test_season_ends_today_and_simulates_nothing_measured(tmp_path: Path) -> None:
    """Of the hangers that are tested to its end; none is tested in the future."""
    described = tmp_path / "bridge.toml"
    described.write_text(demo.bridge_description(), encoding="utf-8")
    hangers = load_bridge(described).hangers
    planned = list(demo.planned(hangers, demo.season_start(NOW)))
    times = [each.time for each in planned if each.hanger.id in (demo.SOUND, demo.LOSING)]
    assert NOW - timedelta(hours=3) < max(times) < NOW
    simulated = {each.hanger.id for each in planned}
    assert simulated == {each.id for each in hangers} - {demo.MEASURED}
    assert demo.LOSING in simulated
    (measured,) = (each for each in hangers if each.id == demo.MEASURED)
    assert measured.length_m == 12.0  # as in the thesis
