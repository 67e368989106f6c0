"""`shm simulate` writes its formats, plants effects, and listens where nobody hits."""

from __future__ import annotations

from pathlib import Path

import numpy as np
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
FORMS = [known.suffixes[0].lstrip(".") for known in FORMATS if known.write]


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


def test_an_effect_is_planted_in_a_recording(tmp_path: Path) -> None:
    usual = simulated(tmp_path / "a")
    clamp = "point_mass:everywhere:mass_kg=60,x_m=3.4"
    heavier = simulated(tmp_path / "b", "--effect", clamp)
    known = simulated(tmp_path / "c", "--added-mass", "60:3.4")
    own, other, same = (each.accelerations[0].values for each in (usual, heavier, known))
    assert not np.array_equal(own, other)
    np.testing.assert_allclose(other, same, atol=1e-4)  # four steps of the converter


def test_effects_follow_temperature_and_level(tmp_path: Path) -> None:
    warmth = "temperature_tension:everywhere:tension_per_kelvin_n_k=-3000"
    usual = simulated(tmp_path / "a", "--effect", warmth, "--temperature-c", "10")
    warm = simulated(tmp_path / "b", "--effect", warmth, "--temperature-c", "30")
    plain = simulated(tmp_path / "c", "--temperature-c", "30")
    same = simulated(tmp_path / "d", "--effect", warmth, "--reference-c", "30",
                     "--temperature-c", "30")  # fmt: skip
    values = [each.accelerations[0].values for each in (usual, warm, plain, same)]
    assert not np.array_equal(values[0], values[1])
    np.testing.assert_allclose(values[0], values[3], atol=1e-4)
    hard = simulated(tmp_path / "e", "--amplitude", "2")
    assert hard.force is not None
    assert plain.force is not None
    assert hard.force.values.max() == pytest.approx(2 * plain.force.values.max(), rel=1e-2)


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (("--effect", "point_mass:everywhere"), "NAME:AT:param=value"),
        (("--effect", "point_mass:everywhere:mass_kg=x,x_m=1"), "NAME:AT:param=value"),
        (("--effect", "point_mass:everywhere:mass_kg=1"), "x_m"),
        (("--effect", "ghost:everywhere:x=1"), "no effect"),
        (("--added-mass", "25"), "KG:X"),
        (("--ambient", "--effect", "point_mass:everywhere:mass_kg=1,x_m=1"), "--ambient"),
    ],
)
def test_what_cannot_be_planted_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], more: tuple[str, ...], said: str
) -> None:
    (tmp_path / "H.toml").write_text(HANGER)
    call = ["simulate", "--hanger-file", str(tmp_path / "H.toml"), "--out", str(tmp_path)]
    assert run([*call, *more]) == 2
    assert said in capsys.readouterr().err
