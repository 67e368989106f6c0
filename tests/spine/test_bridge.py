"""bridge.toml: what it may say, and what is refused by name."""

from __future__ import annotations

import pickle
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from shm.bridge import Bridge, load_bridge, load_hanger
from shm.errors import BadInput
from shm.values import MEASUREMENT_HOURS, EndPlate, Thresholds, Turnbuckle
from tests.helpers.comparing import assert_same

ROUND = """
[[hanger]]
id = 3
diameter_m = 0.130
length_m = 12.0
elastic_modulus_pa = 200e9
density_kg_m3 = 7800
nominal_tension_n = 711e3
"""


SQUARE = "area_m2 = 0.01\nsecond_moment_m4 = 1e-5\nmass_per_length_kg_m = 80\n"


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
    text = ROUND.replace("diameter_m = 0.130\n", SQUARE)
    hanger = load_hanger(written(tmp_path, text))
    assert (hanger.area_m2, hanger.second_moment_m4) == (0.01, 1e-5)
    assert hanger.mass_per_length_kg_m == 80


def test_a_given_mass_per_length_beats_the_density_of_a_round_bar(tmp_path: Path) -> None:
    text = ROUND.replace("density_kg_m3 = 7800", "mass_per_length_kg_m = 120")
    assert load_hanger(written(tmp_path, text)).mass_per_length_kg_m == 120


PLATE = """
[hanger.plate]
length_m = 1.0915
thickness_m = 0.040
end_width_m = 1.0644
neck_width_m = 0.241
slot_m = 0.562
edge_node_spacing_m = 0.0425
"""
TURNBUCKLE = """
[[hanger.turnbuckle]]
x_m = 1.5
length_m = 0.6
mass_kg = 150
bending_stiffness_n_m2 = 1e7
"""


def test_a_plain_round_bar_keeps_its_diameter_and_has_nothing_else(tmp_path: Path) -> None:
    hanger = load_hanger(written(tmp_path, ROUND))
    assert hanger.diameter_m == 0.130
    assert (hanger.poissons_ratio, hanger.bending_stiffness_factor) == (0.3, 1.0)
    assert (hanger.plate, hanger.turnbuckles, hanger.models) == (None, (), ())


def test_a_section_that_is_not_round_has_no_diameter(tmp_path: Path) -> None:
    text = ROUND.replace("diameter_m = 0.130\n", SQUARE)
    assert np.isnan(load_hanger(written(tmp_path, text)).diameter_m)


def test_a_strand_has_its_share_of_the_bending_stiffness(tmp_path: Path) -> None:
    text = ROUND + "bending_stiffness_factor = 0.4\npoissons_ratio = 0.28\n"
    hanger = load_hanger(written(tmp_path, text))
    assert hanger.bending_stiffness_n_m2 == pytest.approx(0.4 * 200e9 * hanger.second_moment_m4)
    assert hanger.poissons_ratio == 0.28


def test_admitted_models_plate_and_turnbuckles_are_read(tmp_path: Path) -> None:
    upper = TURNBUCKLE.replace("x_m = 1.5", "x_m = 9")
    text = ROUND + 'models = ["beam2", "solid2"]\n' + PLATE + upper + TURNBUCKLE
    hanger = load_hanger(written(tmp_path, text))
    assert hanger.models == ("beam2", "solid2")
    assert hanger.plate == EndPlate(1.0915, 0.040, 1.0644, 0.241, 0.562, 0.0425)
    assert [turnbuckle.x_m for turnbuckle in hanger.turnbuckles] == [1.5, 9.0]
    assert hanger.turnbuckles[0] == Turnbuckle(1.5, 0.6, 150.0, 1e7)


def test_a_described_hanger_survives_the_way_to_another_process(tmp_path: Path) -> None:
    hanger = load_hanger(written(tmp_path, ROUND + PLATE + TURNBUCKLE))
    assert_same(pickle.loads(pickle.dumps(hanger)), hanger)


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (("thickness_m = 0.040\n", ""), "plate: thickness_m is missing"),
        (("slot_m", "slit_m"), "plate: unknown key slit_m"),
        (("slot_m = 0.562", "slot_m = 1.2"), "slot_m = 1.2 is not shorter than the plate"),
        (("length_m = 1.0915", "length_m = 6"), "no free rod in a hanger of 12 m"),
        (("thickness_m = 0.040", "thickness_m = 0.13"), "thickness_m = 0.13 is not below the rod"),
        (("neck_width_m = 0.241", "neck_width_m = 0.1"), "neck_width_m = 0.1 is below the rod"),
        (("end_width_m = 1.0644", "end_width_m = 0.1"), "end_width_m = 0.1 is below the rod"),
        (("spacing_m = 0.0425", "spacing_m = 2"), "edge_node_spacing_m = 2 is above end_width_m"),
        (("[hanger.plate]", "[[hanger.plate]]"), "plate is not a table"),
        (("diameter_m = 0.130\n", SQUARE), "only a round rod can have plates"),
        (("x_m = 1.5", "x_m = 0.2"), r"from -0.1 m to 0.5 m, beyond the deck end \(0 m\)"),
        (("x_m = 1.5", "x_m = 11.8"), r"beyond the arch end \(12 m\)"),
        (("x_m = 9", "x_m = 2"), "beyond the turnbuckle that ends at 1.8 m"),
        (("mass_kg = 150", "mass_kg = 0"), "turnbuckle 2: mass_kg = 0 is not a positive"),
        (("mass_kg = 150\n", ""), "turnbuckle 2: mass_kg is missing"),
        (("mass_kg", "weight_kg"), "unknown key weight_kg"),
        (("[[hanger.turnbuckle]]", "[hanger.turnbuckle]"), "turnbuckle is not a list of tables"),
        (("elastic_modulus_pa = 200e9", "elastic_modulus_pa = 205"), "205 is that of no material"),
        (("density_kg_m3 = 7800", "density_kg_m3 = 7.85"), "7.85 kg/m3 is the density of no"),
        (("nominal_tension_n = 711e3", "nominal_tension_n = 711e6"), "makes a stress of 53"),
        (("diameter_m = 0.130", "diameter_m = 130"), "a section of 130 m is no hanger of 12 m"),
        (("length_m = 12.0", "length_m = 12000"), "length_m = 12000 is longer than any hanger"),
        (("id = 3", "id = 3\npoissons_ratio = 0.5"), "poissons_ratio = 0.5 is not from 0 to 0.499"),
        (("id = 3", "id = 3\nbending_stiffness_factor = 1.5"), "1.5 is not from 1e-06 to 1"),
        (("id = 3", "id = 3\nbending_stiffness_factor = 0"), "0 is not from 1e-06 to 1"),
        (("id = 3", "id = 3\nbending_stiffness_factor = 'half'"), "'half' is not a number"),
        (("id = 3", "id = 3\nmodels = 'beam1'"), "models = 'beam1' is not a list"),
        (("id = 3", "id = 3\nmodels = []"), "is not a list of different names"),
        (("id = 3", "id = 3\nmodels = ['beam1', 'beam1']"), "is not a list of different names"),
    ],
)
def test_a_part_that_cannot_be_is_named(
    tmp_path: Path, change: tuple[str, str], complaint: str
) -> None:
    upper = TURNBUCKLE.replace("x_m = 1.5", "x_m = 9").replace("mass_kg = 150", "mass_kg = 60")
    text = ROUND + PLATE + (upper + TURNBUCKLE if "list of" not in complaint else TURNBUCKLE)
    path = written(tmp_path, text.replace(*change))
    with pytest.raises(BadInput, match=complaint) as refusal:
        load_hanger(path)
    assert "[[hanger]] id 3" in str(refusal.value)
    assert refusal.value.remedy


def test_thresholds_and_hooks_are_read(tmp_path: Path) -> None:
    text = ROUND + (
        "thresholds = { tension_shift_fraction = 0.03, alert_probability = 0.9, "
        "false_call_years = 20 }\n"
    )
    text += '[[hook]]\nname = "mail"\ncommand = ["/usr/bin/true", "-x"]\n'
    text += "[settings]\nsamples = 300\n[bridge]\nname = 'Arch'\n"
    bridge = load_bridge(written(tmp_path, text))
    assert bridge.name == "Arch"
    assert bridge.hanger(3).thresholds == Thresholds(0.03, 0.5, 0.9, 20)
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
        (
            ("id = 3", "id = 3\nthresholds = { false_call_years = 0.01 }"),
            r"thresholds: false_call_years = 0.01 is not from 0.1 to 1e\+06",
        ),
        (("id = 3", "id = 3\nthresholds = { false_call_years = 'long' }"), "'long' is not a pos"),
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


def test_several_publish_tables_need_names(tmp_path: Path) -> None:
    table = '[[publish]]\nkind = "influx"\nurl = "http://localhost:8086"\ndatabase = "shm"\n'
    with pytest.raises(BadInput, match="publish name influx is given twice") as refusal:
        load_bridge(written(tmp_path, ROUND + table + table))
    assert 'name = "city"' in refusal.value.remedy
    named = load_bridge(written(tmp_path, f'{ROUND}{table}{table}name = "city"\n'))
    assert [each.name for each in named.publications] == ["influx", "city"]


@pytest.mark.parametrize("hook", ["name = 'x'", "command = ['x']", "name='x'\ncommand='rm -rf'"])
def test_a_hook_needs_a_name_and_an_argument_list(tmp_path: Path, hook: str) -> None:
    with pytest.raises(BadInput, match="hook"):
        load_bridge(written(tmp_path, f"[[hook]]\n{hook}\n"))


def quiet_bridge(tmp_path: Path, hours: str, zone: str = "Europe/Berlin") -> Bridge:
    text = f"[bridge]\ntime_zone = {zone!r}\n[[hook]]\nname = 'mail'\ncommand = ['x']\n"
    return load_bridge(written(tmp_path, f"{text}quiet_hours = {hours}\n"))


@pytest.mark.parametrize(
    ("hours", "at", "ends"),
    [
        ("22:00-06:00", "2026-11-25T21:00Z", "2026-11-26T05:00Z"),  # 22:00 there
        ("22:00-06:00", "2026-11-26T04:59Z", "2026-11-26T05:00Z"),
        ("22:00-06:00", "2026-11-26T05:00Z", None),
        ("22:00-06:00", "2026-11-25T20:59Z", None),
        ("22:00-06:00", "2026-07-01T20:30Z", "2026-07-02T04:00Z"),  # summer time
        ("22:00-06:00", "2026-03-28T21:00Z", "2026-03-29T04:00Z"),  # a night of 23 hours
        ("22:00-06:00", "2026-10-24T20:00Z", "2026-10-25T05:00Z"),  # of 25
        ("22:00-02:30", "2026-03-28T23:00Z", "2026-03-29T01:30Z"),  # no such time: 03:30 there
        ("22:00-02:30", "2026-10-25T00:15Z", "2026-10-25T00:30Z"),  # the first 02:30 of two
        ("22:00-02:30", "2026-10-25T01:15Z", None),
        ("12:00-13:30", "2026-11-26T12:29Z", "2026-11-26T12:30Z"),
        ("12:00-13:30", "2026-11-26T12:30Z", None),
    ],
)
def test_quiet_hours_are_those_of_the_clocks_at_the_bridge(
    tmp_path: Path, hours: str, at: str, ends: str | None
) -> None:
    (hook,) = quiet_bridge(tmp_path, f"'{hours}'").hooks
    assert hook.quiet_hours is not None
    found = hook.quiet_hours.until(datetime.fromisoformat(at))
    # In UTC: a time that comes twice equals none of another zone.
    assert (found and found.astimezone(UTC)) == (ends and datetime.fromisoformat(ends))


@pytest.mark.parametrize("hours", ["'22-6'", "'22:00-24:00'", "'06:00-06:00'", "22", "['22:00']"])
def test_quiet_hours_that_are_no_span_are_refused_with_key_and_line(
    tmp_path: Path, hours: str
) -> None:
    with pytest.raises(BadInput, match=r"hook mail: quiet_hours = .* is not a span") as refusal:
        quiet_bridge(tmp_path, hours)
    assert refusal.value.line == 6
    assert refusal.value.remedy == 'Give two different times: quiet_hours = "22:00-06:00".'


@pytest.mark.parametrize("zone", ["Europe/Atlantis", "", "../etc", "Europe"])
def test_a_time_zone_that_nobody_knows_is_refused(tmp_path: Path, zone: str) -> None:
    with pytest.raises(BadInput, match=r"bridge: time_zone = .* knows") as refusal:
        quiet_bridge(tmp_path, "'22:00-06:00'", zone)
    assert "bridge.toml" in str(refusal.value)
    assert "Europe/Berlin" in refusal.value.remedy


def test_an_unknown_hanger_is_refused_with_the_known_ones(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match=r"hanger 9 is not described.*known: 3"):
        load_bridge(written(tmp_path, ROUND)).hanger(9)


@pytest.mark.parametrize(
    ("text", "problem", "remedy"),
    [
        (ROUND.replace("711e3", "711"), "less than the weight of the hanger, 12.2 kN", "711e3"),
        (ROUND.replace("[[hanger]]", "[[hnager]]"), "unknown table or key hnager", "hanger?"),
        (ROUND.replace("length_m", "lenght_m"), "unknown key lenght_m", "Did you mean length_m?"),
        ('[bridge]\nnmae = "x"\n' + ROUND, "unknown key nmae", "Did you mean name?"),
    ],
)
def test_slips_of_a_description_are_named(
    tmp_path: Path, text: str, problem: str, remedy: str
) -> None:
    with pytest.raises(BadInput, match=problem) as caught:
        load_bridge(written(tmp_path, text))
    assert remedy in caught.value.remedy
    assert "bridge.toml" in str(caught.value)


@pytest.mark.parametrize("tension", ["0", "13e3"])
def test_tension_of_no_load_or_above_weight_is_taken(tmp_path: Path, tension: str) -> None:
    hanger = load_hanger(written(tmp_path, ROUND.replace("711e3", tension)))
    assert hanger.nominal_tension_n == float(tension)


def test_one_hanger_is_asked_for_where_a_file_has_several(tmp_path: Path) -> None:
    path = written(tmp_path, ROUND + ROUND.replace("id = 3", "id = 4"))
    assert load_hanger(path, 4).id == 4
    with pytest.raises(BadInput, match=r"2 .* tables where one is expected"):
        load_hanger(path)


def test_a_missing_file_tells_how_to_make_one(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="shm init"):
        load_bridge(tmp_path / "bridge.toml")


@pytest.mark.parametrize(
    ("machine", "fault"),
    [
        ("name = 'pump'\nlow_hz = 25\nhigh_hz = 24", "pump: it needs a name and a high_hz above"),
        ("low_hz = 24\nhigh_hz = 25", "disturbance: it needs a name"),
        ("name = 'pump'\nhigh_hz = 25", "low_hz is missing"),
        ("name = 'pump'\nlow_hz = 24\nhigh_hz = 25\nrpm = 1450", "unknown key rpm"),
    ],
)
def test_a_disturbance_needs_a_name_and_a_band(tmp_path: Path, machine: str, fault: str) -> None:
    with pytest.raises(BadInput, match=fault):
        load_bridge(written(tmp_path, f"[[disturbance]]\n{machine}\n"))


def test_hours_of_measurements_are_the_owners_where_given_and_usual_elsewhere(
    tmp_path: Path,
) -> None:
    hours = load_bridge(written(tmp_path, "[measurement_hours]\nlift_off = 40\n")).measurement_hours
    assert hours == {**MEASUREMENT_HOURS, "lift-off": 40.0}
    assert load_bridge(written(tmp_path, "")).measurement_hours == MEASUREMENT_HOURS


@pytest.mark.parametrize(
    ("hours", "fault"),
    [
        ("[measurement_hours]\nlunch = 1", "unknown key lunch"),
        ("[measurement_hours]\nsensors = 0", "sensors = 0 is not .* Give sensors in hours"),
        ("measurement_hours = 3", "must be a table"),
    ],
)
def test_hours_that_cannot_be_are_refused(tmp_path: Path, hours: str, fault: str) -> None:
    with pytest.raises(BadInput, match=fault):
        load_bridge(written(tmp_path, hours))
