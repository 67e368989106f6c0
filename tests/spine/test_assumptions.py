"""One table of physical assumptions: complete, read by the rooms, overridden by the owner."""

from __future__ import annotations

import ast
import json
import math
import pickle
from collections.abc import Callable, Iterator
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest

from shm.assumptions import DEFAULTS, Assumption, Assumptions, number_text
from shm.bridge import Bridge, load_bridge
from shm.documents import dump
from shm.errors import BadInput
from shm.gap.hypotheses.noise import nodes
from shm.gap.hypotheses.observations import observed
from shm.inference.problem.field import FieldLikelihood
from shm.inference.problem.priors import SPRINGS, Ends, TensionPrior, reading_of
from shm.inference.problem.systematic_errors import errors_of_sensors
from shm.models import described
from shm.models.bar_fit import seen_in
from shm.models.effects import EFFECTS, Variant
from shm.pipeline.lineage import redescribed
from shm.report.assumed import assumptions_line, assumptions_table, with_assumptions
from shm.store import BaselineGlance
from shm.values import NAN, FloatArray, Hanger, ModalTest, Mode, Scatter
from shm.watch import WatchOptions
from shm.watch.engine.causes import mounted_kg
from shm.watch.sensors.stream_watch import condition_sd
from tests.helpers.hangers import HANGER_3

ROOT = Path(__file__).resolve().parents[2]
STRAND = replace(HANGER_3, plate=None, kind="strand")
BRIDGE = """
[bridge]
name = "B"

[assumptions]
section_sd = 0.02
ROW

[[hanger]]
id = 3
diameter_m = 0.130
length_m = 12.0
elastic_modulus_pa = 200e9
density_kg_m3 = 7800
nominal_tension_n = 711e3
OWN
"""
UNSTATED = ModalTest("t", (Mode("transverse", 1, 6.0, NAN), Mode("transverse", 2, 14.0, NAN)), 3)
READ = replace(UNSTATED, tension_read_n=7e5)


def load(folder: Path, row: str = "", own: str = "") -> Bridge:
    path = folder / "bridge.toml"
    path.write_text(BRIDGE.replace("ROW", row).replace("OWN", own), encoding="utf-8")
    return load_bridge(path)


def attributes() -> Iterator[tuple[str, str]]:
    """Yield each attribute that product code reads, with the name of what it is read from."""
    for package in ("shm", "cli/shm_cli", "daemon/shm_daemon"):
        for path in (ROOT / package).rglob("*.py"):
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                if isinstance(node, ast.Attribute):
                    owner = node.value
                    named = getattr(owner, "id", getattr(owner, "attr", ""))
                    yield named, node.attr


# ---------------------------------------------------------------- the table


@pytest.mark.parametrize("row", DEFAULTS.values(), ids=lambda row: row.name)
def test_row_is_complete(row: Assumption) -> None:
    assert row.has_value or row.has_range
    assert not row.has_sd or row.has_value
    assert row.unit
    assert row.source
    assert row.origin == "default"
    assert row.reason.endswith(".")
    assert not row.has_sd or row.least_sd <= row.sd <= row.most_sd
    numbers = [row.value, row.lower, row.upper]
    assert all(row.least <= each <= row.most for each in numbers if not math.isnan(each))
    assert not row.has_range or row.lower < row.upper


def test_rooms_read_every_row_and_no_other() -> None:
    read = set(attributes())
    assert set(DEFAULTS) <= {name for _, name in read}
    tables = {"assumptions", "assumed", "_assumed", "DEFAULTS"}
    rows = {name for owner, name in read if owner in tables}
    methods = {name for name in dir(Assumptions) if not name.startswith("__")} | {"overridden"}
    assert rows - methods <= set(DEFAULTS)


def test_assumptions_by_name_and_attribute() -> None:
    assert DEFAULTS["end_restraint"] is DEFAULTS.end_restraint
    assert DEFAULTS.end_restraint.decades == pytest.approx(math.log10(1000 / 0.03))
    with pytest.raises(AttributeError):
        _ = DEFAULTS.mass_of_the_moon
    with pytest.raises(KeyError):
        DEFAULTS.with_numbers(mass_of_the_moon=1.0)


def test_assumptions_are_frozen_and_travel() -> None:
    own = DEFAULTS.with_numbers(accelerometer_mass_kg=0.2, end_restraint=(3.0, 100.0))
    assert number_text(own.accelerometer_mass_kg) == "0.2 ± 0.05"
    assert own.end_restraint.bounds == (3.0, 100.0)
    assert DEFAULTS.accelerometer_mass_kg.value == 0.05
    assert repr(pickle.loads(pickle.dumps(own))) == repr(own)
    assert [row.name for row in own.overridden] == ["end_restraint", "accelerometer_mass_kg"]


def test_scatter_defaults_are_rows() -> None:
    assert Scatter.of(DEFAULTS) == replace(
        Scatter(), bending_factor=Scatter.of(DEFAULTS).bending_factor
    )
    own = DEFAULTS.with_numbers(modulus_sd=0.03)
    assert Scatter.of(own).modulus == 0.03


# ---------------------------------------------------------------- what an owner states


def test_overrides_of_bridge_and_hanger(tmp_path: Path) -> None:
    weighed = 'accelerometer_mass_kg = {value = 0.2, sd = 0.02, reason = "weighed"}'
    own = "[hanger.assumptions]\nend_restraint = [3, 1000]\nsection_sd = 0.005"
    found = load(tmp_path, weighed, own)
    hanger = found.hanger(3)
    sensor = hanger.assumptions.accelerometer_mass_kg
    assert (sensor.value, sensor.sd, sensor.reason) == (0.2, 0.02, "weighed")
    assert sensor.origin == "bridge.toml"
    assert hanger.assumptions.end_restraint.lower == 3
    assert hanger.assumptions.end_restraint.origin == "bridge.toml, hanger 3"
    assert (found.assumptions.section_sd.value, hanger.scatter.section) == (0.02, 0.005)
    assert found.assumptions.end_restraint == DEFAULTS.end_restraint


def test_scatter_of_a_hanger_goes_before(tmp_path: Path) -> None:
    hanger = load(tmp_path, "density_sd = 0.01", "[hanger.scatter]\nsection = 0.004").hanger(3)
    assert (hanger.scatter.section, hanger.scatter.density) == (0.004, 0.01)


def test_without_overrides_a_hanger_has_the_defaults(tmp_path: Path) -> None:
    path = tmp_path / "bridge.toml"
    path.write_text(BRIDGE.replace("section_sd = 0.02\nROW", "").replace("OWN", ""))
    assert load_bridge(path).hanger(3).assumptions == DEFAULTS


@pytest.mark.parametrize(
    ("row", "problem"),
    [
        ("acelerometer_mass = 0.1", "Did you mean accelerometer_mass_kg"),
        ("something_else = 0.1", "`shm settings --assumptions` lists all"),
        ("accelerometer_mass_kg = -0.1", "a number of -0.1 kg is not from 0 to 50"),
        ('accelerometer_mass_kg = "heavy"', "'heavy' is not a number"),
        ("accelerometer_mass_kg = true", "True is not a number"),
        ("accelerometer_mass_kg = nan", "nan is not a number"),
        ("accelerometer_mass_kg = [0.1, 0.2]", "has no low end"),
        ("accelerometer_mass_kg = {sd = -1}", "a standard deviation of -1 is not 0 or more"),
        ("socket_fixity = 0.99", "unchanged standard deviation of 0.141 beside a value of 0.99"),
        ("socket_fixity = 0.99", r"too, such as socket_fixity = {value = 0.99, sd = 0.011}"),
        ("socket_fixity = {value = 0.9, sd = 0.5}", "a value of 0.9 is not from 0.001 to 0.173"),
        ("socket_fixity = {value = 0.9, sd = 0.0}", "a standard deviation of 0 beside a value"),
        ("socket_stiffness_log = {value = 2, sd = 0}", "deviation of 0 is not 0.001 or more"),
        ("accelerometer_mass_kg = {valu = 1}", "unknown key valu"),
        ('accelerometer_mass_kg = {reason = "x"}', "states no number"),
        ("accelerometer_mass_kg = {value = 1, reason = 3}", "reason is not a text"),
        ("end_restraint = 3", r"Write end_restraint = \[0.03, 1000\], in k L/EI"),
        ("end_restraint = [3]", "is not two numbers"),
        ("end_restraint = [1000, 3]", "does not rise"),
        ("density_sd = {value = 0.01, sd = 0.1}", "has no standard deviation"),
    ],
)
def test_impossible_rows_are_refused_with_their_line(
    tmp_path: Path, row: str, problem: str
) -> None:
    with pytest.raises(BadInput, match=problem) as refused:
        load(tmp_path, row)
    assert (Path(refused.value.file).name, refused.value.line) == ("bridge.toml", 7)


@pytest.mark.parametrize("value", [0.01, 0.5, 0.99])
def test_widest_fixity_that_is_admitted_is_a_prior(tmp_path: Path, value: float) -> None:
    widest = replace(DEFAULTS.socket_fixity, value=value).most_sd
    row = f"socket_fixity = {{value = {value}, sd = {0.9999 * widest}}}"
    hanger = replace(load(tmp_path, row).hanger(3), ends="socket")
    assert np.isfinite(Ends(hanger, SPRINGS, ()).scores(
        {name: np.array([7.0]) for name in SPRINGS}, np.array([5.0]), 1
    )).all()  # fmt: skip


def test_impossible_row_of_a_hanger_names_its_line(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="Did you mean section_sd") as refused:
        load(tmp_path, own="[hanger.assumptions]\nsectoin_sd = 0.1")
    assert refused.value.line == 17


def test_assumptions_that_are_no_table_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "bridge.toml"
    path.write_text('assumptions = "usual"\n')
    with pytest.raises(BadInput, match="assumptions must be a table"):
        load_bridge(path)


# ---------------------------------------------------------------- overrides reach computations


def felt(x_m: FloatArray) -> FloatArray:
    return -np.ones((2, len(x_m)))


def unstated_sd(hanger: Hanger) -> float:
    return float(FieldLikelihood([UNSTATED], described("beam2", hanger)).identification_error[0])


def reading_sd(hanger: Hanger) -> float:
    reading = reading_of([READ], hanger.assumptions)
    assert reading is not None
    return reading.sd


def largest_unstated_sd(hanger: Hanger) -> float:
    found = nodes(observed([UNSTATED], hanger))
    return math.sqrt(max(float(np.diag(node.covariance.frequency).max()) for node in found))


REACHED: dict[str, tuple[Hanger, float | tuple[float, float], Callable[[Hanger], float], float]] = {
    "accelerometer_mass_kg": (
        HANGER_3, 0.1, lambda h: float(errors_of_sensors(h, felt, (3.0,))[0][0]), 2.0,
    ),
    "accelerometers_on_bar": (HANGER_3, 4.0, mounted_kg, 2.0),
    "unstated_frequency_sd": (HANGER_3, 6e-4, unstated_sd, 2.0),
    "tension_reading_sd": (HANGER_3, 0.06, reading_sd, 2.0),
    "tension_ratio": (
        HANGER_3, (0.02, 10.0), lambda h: described("beam2", h, "description").bounds["theta_F"][1],
        2.0,
    ),
    "end_restraint": (
        HANGER_3, (0.03, 2000.0),
        lambda h: 10 ** described("beam2", h, "description").bounds["log10_k1"][1], 2.0,
    ),
    "strand_bending_factor": (
        STRAND, (0.15, 1.0),
        lambda h: described("beam2", h, "description").bounds["bending_factor"][0], 0.5,
    ),
    "thermal_expansion_1_k": (
        HANGER_3, 2.4e-5,
        lambda h: EFFECTS["temperature_tension"].parameters(h, Variant())[0].upper, 2.0,
    ),
    "tension_per_kelvin_sd": (
        HANGER_3, 0.002, lambda h: float(condition_sd(h.assumptions)[0]), 2.0,
    ),
    "mode_scatter": (HANGER_3, 1e-3, lambda h: WatchOptions.of(h.assumptions).mode_scatter, 2.0),
}  # fmt: skip


@pytest.mark.parametrize("name", REACHED)
def test_override_reaches_the_computation(name: str) -> None:
    hanger, number, compute, factor = REACHED[name]
    own = replace(hanger, assumptions=DEFAULTS.with_numbers(**{name: number}))
    assert compute(own) == pytest.approx(factor * compute(hanger))


def test_override_of_the_design_prior() -> None:
    usual, sure = (
        np.ptp(TensionPrior((0.02, 5.0), assumed).value(np.array([-1.0, 1.0])))
        for assumed in (DEFAULTS, DEFAULTS.with_numbers(as_designed_log_sd=0.1))
    )
    assert usual > 2.5 * sure


def test_override_of_an_unstated_error_reaches_every_room() -> None:
    own = replace(HANGER_3, assumptions=DEFAULTS.with_numbers(unstated_frequency_sd=(1e-4, 0.1)))
    assert largest_unstated_sd(own) > 2 * largest_unstated_sd(HANGER_3)
    doubled = replace(HANGER_3, assumptions=DEFAULTS.with_numbers(unstated_frequency_sd=6e-4))
    seen = [seen_in([UNSTATED], hanger).variance.max() for hanger in (HANGER_3, doubled)]
    assert seen[1] == pytest.approx(4 * seen[0])


# ---------------------------------------------------------------- what is said of them


def test_report_names_overridden_rows() -> None:
    own = replace(HANGER_3, assumptions=DEFAULTS.with_numbers(accelerometer_mass_kg=0.2))
    assert "accelerometer_mass_kg = 0.2 ± 0.05 kg" in assumptions_line(own)
    assert "shm settings --assumptions" in assumptions_line(own)
    assert assumptions_table(own).rows[0][:4] == (
        "accelerometer_mass_kg", "0.2 ± 0.05", "0.05 ± 0.05", "kg",
    )  # fmt: skip
    document = with_assumptions({}, own)["assumptions"]
    assert document["accelerometer_mass_kg"]["value"] == 0.2


def test_report_without_overrides() -> None:
    assert "are the defaults" in assumptions_line(HANGER_3)
    assert "shm settings --assumptions" in assumptions_line(HANGER_3)
    assert assumptions_table(HANGER_3).rows == ()
    assert with_assumptions({}, HANGER_3) == {}


def test_baseline_made_under_other_assumptions_is_named() -> None:
    own = replace(HANGER_3, assumptions=DEFAULTS.with_numbers(accelerometer_mass_kg=0.2))
    changed = "assumptions.accelerometer_mass_kg from 0.05 ± 0.05 to 0.2 ± 0.05"
    assert redescribed(own, glance(HANGER_3)) == (changed,)
    assert redescribed(own, glance(own)) == ()
    older = {key: value for key, value in asdict(HANGER_3).items() if key != "assumptions"}
    assert redescribed(HANGER_3, glance(HANGER_3, older)) == ()


def glance(hanger: Hanger, described: dict[str, object] | None = None) -> BaselineGlance:
    """Return a baseline of which only the description counts, as the store has it."""
    stored = json.loads(dump(described or asdict(hanger)))
    found = object.__new__(BaselineGlance)
    object.__setattr__(found, "described", stored)
    return found


PAGE = (ROOT / "docs" / "hangers.md").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("key", "row"),
    [
        ("`section` (area)", "section_sd"),
        ("`density`", "density_sd"),
        ("`length`", "length_sd"),
        ("`modulus`", "modulus_sd"),
        ("`along`", "section_along_sd"),
        ("`sensor_gain`, `sensor_place_m`, `sensor_turn_deg`", "sensor_gain_sd"),
        ("`sensor_gain`, `sensor_place_m`, `sensor_turn_deg`", "sensor_place_sd_m"),
        ("`sensor_gain`, `sensor_place_m`, `sensor_turn_deg`", "sensor_turn_sd_deg"),
        ("`sensor_cross_axis`", "sensor_cross_axis_sd"),
    ],
)
def test_page_of_hangers_has_default(key: str, row: str) -> None:
    (line,) = [each for each in PAGE.splitlines() if each.startswith(f"| {key} |")]
    stated = [word for cell in line.split("|")[2].split(",") for word in cell.split()]
    assert f"{DEFAULTS[row].value:g}" in stated, f"{row} is {DEFAULTS[row].value:g}: {line}"
