"""`shm simulate` writes recordings that `shm identify` turns into a modal-tests document."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from shm.bridge import load_hanger
from shm.errors import NothingThere
from shm.identify import IdentifyOptions
from shm.models import THESIS, build
from shm.modes_document import load_modes
from shm.read import read
from shm.values import Recording
from shm_cli.main import run
from tests.cli.conftest import Shm
from tests.helpers.painting import unpaint

SHORT = ("--hits", "3", "--seconds", "8")


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory, hanger_file: Path) -> Path:
    folder = tmp_path_factory.mktemp("recording")
    planted = ("--tension-n", "650e3", "--k1", "1e7", "--k3", "1e7", "--temperature-c", "7.5")
    call = ["simulate", "--hanger-file", str(hanger_file), *planted, *SHORT, "--out", str(folder)]
    assert run(call) == 0
    (path,) = folder.glob("*.csv")
    return path


def test_identified_frequencies_are_those_of_the_planted_state(
    shm: Shm, recording: Path, hanger_file: Path
) -> None:
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


def test_the_document_can_be_written_to_a_file_beside_the_table(
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
def test_standard_deviations_hold_what_differs_from_test_to_test(
    shm: Shm, recording: Path, hanger_file: Path
) -> None:
    def sds(*allowance: object) -> list[float]:
        ask = ("--hanger-file", hanger_file, "--cross-check", "none", *allowance, "--json")
        (test,) = shm("identify", recording, *ask).document["tests"]
        return [mode["frequency_sd_hz"] / mode["frequency_hz"] for mode in test["modes"]]

    alone, more = sds("--frequency-allowance", 0), sds("--frequency-allowance", 0.001)
    assert more == pytest.approx(np.hypot(alone, 0.001))
    assert min(sds()) >= 1e-4


def test_a_page_shows_one_test_only(shm: Shm, recording: Path, tmp_path: Path) -> None:
    ended = shm("identify", recording, recording, "--html", tmp_path / "sheet.html")
    assert ended.code == 2
    assert "--together" in ended.err


def test_the_same_seed_simulates_the_same_files(
    shm: Shm, hanger_file: Path, tmp_path: Path
) -> None:
    for folder, seed in (("a", 1), ("b", 1), ("c", 2)):
        shm(
            "simulate", "--hanger-file", hanger_file, *SHORT, "--seed", seed,
            "--out", tmp_path / folder, "--first", "2026-03-01",
        )  # fmt: skip
    first, again, other = (next((tmp_path / name).iterdir()).read_bytes() for name in "abc")
    assert first == again
    assert first != other


def test_tests_are_a_week_apart_and_uff_has_its_sidecar(
    shm: Shm, hanger_file: Path, tmp_path: Path
) -> None:
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


def test_a_file_of_another_hanger_than_described_is_refused(
    shm: Shm, recording: Path, hanger_file: Path, tmp_path: Path
) -> None:
    other = tmp_path / "H.toml"
    other.write_text(hanger_file.read_text().replace("id = 3", "id = 8"))
    ended = shm("identify", recording, "--hanger-file", other)
    assert ended.code == 3
    assert "says hanger 3, the description is of hanger 8" in ended.err


@pytest.mark.slow
def test_a_file_that_names_no_hanger_is_of_the_described_one(
    shm: Shm, recording: Path, hanger_file: Path, tmp_path: Path
) -> None:
    nameless = tmp_path / "nameless.csv"
    lines = recording.read_text().splitlines(keepends=True)
    nameless.write_text("".join(line for line in lines if not line.startswith("# hanger")))
    assert shm("identify", nameless, "--json").document["hanger"] is None
    known = shm("identify", nameless, "--hanger-file", hanger_file, "--json")
    assert known.document["hanger"] == 3
    both = shm("identify", nameless, recording)
    assert both.code == 2
    assert "several hangers (3, none)" in both.err


@pytest.mark.parametrize(
    ("content", "said"), [("", "the file is empty"), ("force\n1\n", "sampling rate is missing")]
)
def test_a_recording_that_cannot_be_used_is_bad_input(
    shm: Shm, tmp_path: Path, content: str, said: str
) -> None:
    path = tmp_path / "bad.csv"
    path.write_text(content)
    ended = shm("identify", path, "--json")
    assert (ended.code, ended.document["error"]) == (3, "bad_input")
    assert said in ended.err


def test_every_choice_of_the_command_reaches_the_identification(
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
