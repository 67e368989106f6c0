"""bridge.toml: what it may say, and what is refused by name."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from shm.bridge import load_bridge, load_hanger
from shm.errors import BadInput

ROUND = """
[[hanger]]
id = 3
diameter_m = 0.130
length_m = 12.0
elastic_modulus_pa = 200e9
density_kg_m3 = 7800
nominal_tension_n = 711e3
"""


def written(folder: Path, text: str) -> Path:
    path = folder / "bridge.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_round_bar_has_the_section_of_its_diameter(tmp_path: Path) -> None:
    hanger = load_hanger(written(tmp_path, ROUND))
    assert hanger.area_m2 == pytest.approx(np.pi * 0.13**2 / 4)
    assert hanger.second_moment_m4 == pytest.approx(np.pi * 0.13**4 / 64)
    assert hanger.mass_per_length_kg_m == pytest.approx(7800 * hanger.area_m2)
    assert hanger.bending_stiffness_n_m2 == pytest.approx(200e9 * hanger.second_moment_m4)


def test_a_given_section_is_taken_as_it_is(tmp_path: Path) -> None:
    text = ROUND.replace(
        "diameter_m = 0.130",
        "area_m2 = 0.01\nsecond_moment_m4 = 1e-5\nmass_per_length_kg_m = 80",
    )
    hanger = load_hanger(written(tmp_path, text))
    assert (hanger.area_m2, hanger.second_moment_m4) == (0.01, 1e-5)
    assert hanger.mass_per_length_kg_m == 80


def test_a_given_mass_per_length_beats_the_density_of_a_round_bar(tmp_path: Path) -> None:
    text = ROUND.replace("density_kg_m3 = 7800", "mass_per_length_kg_m = 120")
    assert load_hanger(written(tmp_path, text)).mass_per_length_kg_m == 120


def test_thresholds_and_hooks_are_read(tmp_path: Path) -> None:
    text = ROUND + "thresholds = { tension_shift_fraction = 0.03, alert_probability = 0.9 }\n"
    text += '[[hook]]\nname = "mail"\ncommand = ["/usr/bin/true", "-x"]\n'
    text += "[settings]\nsamples = 300\n[bridge]\nname = 'Arch'\n"
    bridge = load_bridge(written(tmp_path, text))
    assert bridge.name == "Arch"
    assert bridge.hanger(3).thresholds.tension_shift_fraction == 0.03
    assert bridge.hooks[0].command == ("/usr/bin/true", "-x")
    assert bridge.settings_table == {"samples": 300}


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (("length_m = 12.0", ""), "length_m is missing"),
        (("length_m = 12.0", "length_m = -1"), "length_m = -1 is not a positive number"),
        (("length_m = 12.0", "length_m = 'long'"), "length_m = 'long'"),
        (("length_m = 12.0", "length_m = true"), "length_m = True"),
        (("density_kg_m3 = 7800", ""), "density_kg_m3 is missing"),
        (("id = 3", "id = 3.5"), "whole number"),
        (("id = 3", "id = 3\nlenght_m = 2"), "unknown key lenght_m"),
        (("diameter_m = 0.130", ""), "area_m2 is missing"),
        (("id = 3", "id = 3\nthresholds = { tension = 1 }"), "unknown key"),
        (("id = 3", "id = 3\nthresholds = { alert_probability = 1 }"), "below 1"),
        (("id = 3", "id = "), "not a readable TOML file"),
    ],
)
def test_what_does_not_fit_is_named(
    tmp_path: Path, change: tuple[str, str], complaint: str
) -> None:
    path = written(tmp_path, ROUND.replace(*change))
    with pytest.raises(BadInput, match=complaint) as refusal:
        load_bridge(path)
    assert "bridge.toml" in str(refusal.value)
    assert refusal.value.remedy


def test_doubles_are_refused(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="hanger id 3 is given twice"):
        load_bridge(written(tmp_path, ROUND + ROUND))


@pytest.mark.parametrize("hook", ["name = 'x'", "command = ['x']", "name='x'\ncommand='rm -rf'"])
def test_a_hook_needs_a_name_and_an_argument_list(tmp_path: Path, hook: str) -> None:
    with pytest.raises(BadInput, match="hook"):
        load_bridge(written(tmp_path, f"[[hook]]\n{hook}\n"))


def test_an_unknown_hanger_is_refused_with_the_known_ones(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match=r"hanger 9 is not described.*known: 3"):
        load_bridge(written(tmp_path, ROUND)).hanger(9)


def test_one_hanger_is_asked_for_where_a_file_has_several(tmp_path: Path) -> None:
    path = written(tmp_path, ROUND + ROUND.replace("id = 3", "id = 4"))
    assert load_hanger(path, 4).id == 4
    with pytest.raises(BadInput, match=r"2 .* tables where one is expected"):
        load_hanger(path)


def test_a_missing_file_tells_how_to_make_one(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="shm init"):
        load_bridge(tmp_path / "bridge.toml")
