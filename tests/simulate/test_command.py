"""`shm simulate` writes every format, with what goes wrong, and listens where nobody hits."""

from __future__ import annotations

from pathlib import Path

import pytest

from shm.read import FORMATS, read
from shm.values import Recording
from shm_cli.main import run

HANGER = """
[[hanger]]
id = 3
diameter_m = 0.130
length_m = 12.0
elastic_modulus_pa = 200e9
density_kg_m3 = 7800
nominal_tension_n = 711e3
"""
FORMS = [known.suffixes[0].lstrip(".") for known in FORMATS]


def simulated(tmp_path: Path, *more: str, form: str = "csv") -> Recording:
    tmp_path.mkdir(exist_ok=True)
    (tmp_path / "H.toml").write_text(HANGER)
    out = tmp_path / "out"
    call = ["simulate", "--hanger-file", str(tmp_path / "H.toml"), "--format", form]
    assert run([*call, "--hits", "2", "--seconds", "2", *more, "--out", str(out)]) == 0
    (path,) = out.glob(f"*.{form}")
    recording = read(path)
    assert isinstance(recording, Recording)
    return recording


@pytest.mark.parametrize("form", FORMS)
def test_every_format_is_offered_and_can_be_read(tmp_path: Path, form: str) -> None:
    recording = simulated(tmp_path, form=form)
    assert recording.samples == 2048
    assert recording.force is not None
    assert len(recording.accelerations) == 4


def test_sensors_hammer_and_rate_are_those_that_were_asked_for(tmp_path: Path) -> None:
    recording = simulated(tmp_path, "--sensors", "3", "--hammer-x", "1.5", "--rate", "1024")
    assert len(recording.accelerations) == 6
    assert recording.sampling_rate_hz == 1024
    assert recording.force is not None
    assert recording.force.x_m == 1.5


def test_disturbances_are_planted(tmp_path: Path) -> None:
    usual = simulated(tmp_path / "a")
    both = simulated(tmp_path / "b", "--disturbance", "machine", "--disturbance", "no_pre_trigger")
    assert both.samples < usual.samples


def test_nobody_hits_in_wind_and_traffic(tmp_path: Path) -> None:
    recording = simulated(tmp_path, "--ambient", "--seconds", "10")
    assert recording.force is None
    assert recording.duration_s == 10.0


def test_a_disturbance_of_hits_does_not_go_with_ambient(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "H.toml").write_text(HANGER)
    call = ["simulate", "--hanger-file", str(tmp_path / "H.toml"), "--out", str(tmp_path)]
    assert run([*call, "--ambient", "--disturbance", "mains"]) == 2
    assert "hammer test" in capsys.readouterr().err


def test_the_help_tells_every_disturbance(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["simulate", "--help"]) == 0
    said = capsys.readouterr().out
    assert "double_hit" in said
    assert "outlier_hit" in said
